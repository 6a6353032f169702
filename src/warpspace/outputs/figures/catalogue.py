"""The figures there are: one entry here, and one module that draws it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.plugins import load_plugins

if TYPE_CHECKING:
    from warpspace.outputs.drawing.content import Drawing
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.scene.model import Scene

Draw = Callable[..., "Drawing"]
"""Takes scenes, settings and the keyword `exact`; gives the drawing."""


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A kind of figure.

    Attributes
    ----------
    name : str
        As it is asked for.
    caption : str
        What it shows, one sentence: help of the command line, list of the app, report.
    draw : str or callable
        ``"module:function"``, imported when it is drawn, or the function itself.
    scenes : int
        How many scenes it is drawn from ...
    most_scenes : int or None
        ... or at most, where that may differ.
    command : str
        The command that draws it where `snapshot` does not.
    evidence : bool
        Whether a report shows it after the error map of a scene.
    """

    name: str
    caption: str
    draw: str | Draw
    scenes: int = 1
    evidence: bool = False
    most_scenes: int | None = None
    command: str = ""

    def load(self) -> Draw:
        """Give the function that draws it."""
        return resolve_name(self.draw) if isinstance(self.draw, str) else self.draw


_HERE = "warpspace.outputs.figures"
_KINDS: dict[str, FigureKind] = {}


def register_figure(kind: FigureKind) -> None:
    """Add a kind of figure; it then appears on the command line, in the app and in reports."""
    if kind.name in _KINDS:
        raise OptionError(f"figure {kind.name!r} is there already")
    _KINDS[kind.name] = kind


def unregister_figure(name: str) -> None:
    """Take a kind of figure away again."""
    del _KINDS[name]


def figure_kinds() -> tuple[FigureKind, ...]:
    """List the kinds of figures."""
    load_plugins()
    return tuple(_KINDS.values())


def figure_command(name: str) -> str:
    """Give the command that draws a figure of several scenes; empty for any other name."""
    load_plugins()
    return _KINDS[name].command if name in _KINDS else ""


def figure_names(scenes: int = 1) -> tuple[str, ...]:
    """List the names of the figures that are drawn from so many scenes."""
    return tuple(kind.name for kind in figure_kinds() if kind.scenes == scenes)


for _kind in (
    FigureKind(
        "error-map", "The deformed working volume, coloured.", f"{_HERE}.error_map:draw_error_map"
    ),
    FigureKind(
        "slices",
        "Three slices through the working volume.",
        f"{_HERE}.slices:draw_slices",
        evidence=True,
    ),
    FigureKind(
        "orientation-map",
        "Orientation error of the tool axis.",
        f"{_HERE}.orientation:draw_orientation",
        evidence=True,
    ),
    FigureKind(
        "error-curves",
        "Errors along each axis, with their tolerance bands.",
        f"{_HERE}.curves:draw_curves",
        evidence=True,
    ),
    FigureKind(
        "traces",
        "Traces of the rotary table, nominal and actual.",
        f"{_HERE}.traces:draw_traces",
        evidence=True,
    ),
    FigureKind(
        "rotary",
        "Error motions of the rotary axes, ISO 230-7.",
        f"{_HERE}.rotary:draw_rotary",
    ),
    FigureKind(
        "machine",
        "The machine with its deformed bodies.",
        f"{_HERE}.machine:draw_machine",
        evidence=True,
    ),
    FigureKind("gains", "Largest error gains over the travel.", f"{_HERE}.charts:draw_gains"),
    FigureKind(
        "montecarlo",
        "Volumetric error of machines within tolerance.",
        f"{_HERE}.charts:draw_montecarlo",
    ),
    FigureKind(
        "repair",
        "Before and after the best repair, and what each error does to the whole volume.",
        f"{_HERE}.repair:draw_repair",
    ),
    FigureKind("ballbar", "Circular test, ISO 230-4.", f"{_HERE}.charts:draw_ballbar"),
    FigureKind(
        "comparison",
        "Two scenes and their difference.",
        f"{_HERE}.comparison:draw_comparison",
        scenes=2,
        command="compare A B -o FILE",
    ),
    FigureKind(
        "concepts",
        "Machines side by side within the same tolerances.",
        f"{_HERE}.concepts:draw_concepts",
        scenes=2,
        most_scenes=MOST_CONCEPTS,
        command="concepts SCENE… --plot FILE",
    ),
):
    register_figure(_kind)


def draw_figure(
    name: str,
    scenes: "Sequence[Scene]",
    settings: "FigureSettings | None" = None,
    *,
    exact: bool = True,
) -> "Drawing":
    """Draw a figure by its name.

    Parameters
    ----------
    name : str
        One of `figure_kinds`.
    scenes : sequence of Scene
        One; two for a comparison.
    settings : FigureSettings, optional
    exact : bool, optional
        Whether the figure becomes pixels of its own size (PNG), or is to be scaled (SVG, PDF).

    Returns
    -------
    Drawing

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such figure, or it needs another number of scenes.
    """
    from warpspace.outputs.drawing.settings import FigureSettings

    load_plugins()
    kind = _KINDS.get(name)
    if kind is None:
        raise UnknownNameError("figure", name, tuple(_KINDS))
    most = kind.most_scenes or kind.scenes
    if not kind.scenes <= len(scenes) <= most:
        words = "one scene" if kind.scenes == 1 else "two scenes"
        words = words if most == kind.scenes else f"{kind.scenes} to {most} scenes"
        raise OptionError(f"figure {name!r} is drawn from {words}; given {len(scenes)}")
    return kind.load()(scenes, settings or FigureSettings(), exact=exact)
