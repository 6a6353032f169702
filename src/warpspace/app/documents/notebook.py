"""The interactive scene inside a notebook: the offline page in an iframe, without a server."""

from dataclasses import dataclass

from markupsafe import Markup

from warpspace.app.browser.html import tag
from warpspace.app.documents.offline_page import build_offline_html, offline_picture
from warpspace.exceptions import OptionError
from warpspace.field.grid import DEFAULT_NODES
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import LIVE_NODES
from warpspace.picture.model import Exaggeration
from warpspace.scene.model import Scene, choose_view
from warpspace.units import MICROMETRE, spell

HEIGHT_PX = 640


@dataclass(frozen=True, slots=True, repr=False)
class SceneView:
    """An interactive scene that a notebook displays; elsewhere one line of text."""

    title: str
    summary: str  # the largest error
    page: str  # HTML, complete
    height_px: int

    def __repr__(self) -> str:
        return f"<warpspace scene: {self.title}, {self.summary}>"

    def _repr_html_(self) -> Markup:
        style = f"width: 100%; height: {self.height_px}px; border: 0"
        return tag("iframe", "", title=self.title, srcdoc=self.page, style=style)


def show(
    scene: Scene,
    *,
    loop: Loop | str | None = None,
    grid: int = DEFAULT_NODES,
    exaggeration: Exaggeration = None,
    component: str = "norm",
    height: int = HEIGHT_PX,
) -> SceneView:
    """Build the interactive scene for a notebook, which displays it inline.

    Jupyter displays the returned object where it is the last expression of a cell, or the argument
    of ``IPython.display.display``. The page is the one that ``warpspace export SCENE -o FILE.html``
    writes: it needs neither a server nor a network, and is stored with the outputs of the notebook
    (about 1 MB).

    Parameters
    ----------
    scene : Scene
        The scene to evaluate, for instance from `load_scene`.
    loop : Loop or str, optional
        "tool", "workpiece" or "relative": whose error deforms the working volume.
    grid : int, optional
        Nodes per axis of the working volume, 3 to 31.
    exaggeration : float, "auto" or None, optional
        Display factor of displacements: a number, "auto" for a round one that suits the errors,
        None for the scene's own.
    component : str, optional
        What is coloured: "norm" for |E|, or "x", "y" or "z".
    height : int, optional
        Height of the view, px.

    Returns
    -------
    SceneView
        Displayed by Jupyter as an iframe; printed elsewhere (a terminal, a script) as one line
        with the title of the scene and its largest error.

    Raises
    ------
    OptionError
        If one of the choices does not exist or is out of range.

    Examples
    --------
    >>> import warpspace
    >>> warpspace.show(warpspace.load_scene("dvf5000_first"), grid=5)
    <warpspace scene: DVF5000, first machine measured, max |E| 51.7 µm>
    """
    low, high = LIVE_NODES
    if not low <= grid <= high:
        raise OptionError(f"grid {grid}; expected {low} to {high} nodes per axis")
    picture = offline_picture(
        scene,
        nodes=grid,
        loop=choose_view(scene, loop).loop,
        exaggeration=scene.exaggeration if exaggeration is None else exaggeration,
        component=component,
    )
    largest = f"max |E| {spell(picture.statistics.max_um)} {MICROMETRE}"
    return SceneView(picture.title, largest, build_offline_html(picture), height)
