"""Charts as figures of the catalogue: gains, Monte Carlo, circular test."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from warpspace import __version__
from warpspace.analysis.gains import DEFAULT_SHARE
from warpspace.bench.ballbar import ballbar
from warpspace.outputs.charts import ballbar_chart, gains_chart, montecarlo_chart
from warpspace.outputs.charts.paper import on_ground
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.drawing.sheet import LOOP_WORDS, metadata
from warpspace.outputs.drawing.style import FONT
from warpspace.scene import verbs
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import choose_view

RADIUS_MM = 150.0
PLANE = "XY"


def draw_gains(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    """Draw the largest error gains over the travel of a scene's machine."""
    scene = scenes[0]
    found = verbs.gains(scene, loop=settings.loop, over_travel=True)
    title = f"Error gains: {scene.machine.title}"
    where = f"{_loop(scene, settings)} · largest absolute gains over the travel"
    with on_ground(settings.theme):
        figure = gains_chart(found, title, where, DEFAULT_SHARE)
    return finish_chart(figure, title, scene, settings, "gains")


def draw_montecarlo(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    """Draw the volumetric error of machines drawn from a scene's tolerances."""
    scene = scenes[0]
    result = verbs.montecarlo(scene, loop=settings.loop)
    title = f"Machines within tolerance: {scene.title}"
    what = (
        f"{_loop(scene, settings)} · {result.plan.samples:,} machines, one random point each ·"
        f" {result.draws.distribution} over the tolerances · seed {result.plan.seed}"
    ).replace(",", " ", 1)
    with on_ground(settings.theme):
        figure = montecarlo_chart(result, title, what)
    return finish_chart(figure, title, scene, settings, "montecarlo")


def draw_ballbar(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    """Draw the circular test of ISO 230-4 on a scene."""
    scene = scenes[0]
    result = ballbar(scene, plane=PLANE, radius_mm=RADIUS_MM)
    middle = ", ".join(f"{name} {value:g}" for name, value in result.centre.items())
    title = f"Circular test: {scene.title}"
    where = f"{PLANE} plane · radius {RADIUS_MM:g} mm · centre {middle}"
    with on_ground(settings.theme):
        figure = ballbar_chart(result, title, where)
    return finish_chart(figure, title, scene, settings, "ballbar")


def _loop(scene: Scene, settings: FigureSettings) -> str:
    """Name the loop."""
    return LOOP_WORDS[choose_view(scene, settings.loop).loop]


def finish_chart(
    figure: Figure, title: str, scene: Scene, settings: FigureSettings, name: str
) -> Drawing:
    """Give a chart the width asked for (its height follows) and say where it comes from.

    Parameters
    ----------
    figure : Figure
    title : str
    scene : Scene
    settings : FigureSettings
    name : str
        Of the figure.

    Returns
    -------
    Drawing
    """
    width, height = figure.get_size_inches()
    dpi = settings.size[0] / width
    figure.set_size_inches(round(width * dpi) / dpi, round(height * dpi) / dpi)
    figure.set_dpi(dpi)
    figure.text(
        1.0 - 0.12 / width, 0.08 / height, f"warpspace {__version__} · scene {scene.name}",
        size=6.5, color=settings.theme.muted, ha="right", va="bottom", family=[FONT],
        parse_math=False,
    )  # fmt: skip
    return Drawing(figure, title, metadata(title, [scene], settings, 1.0, name))
