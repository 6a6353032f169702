"""Charts as figures of the catalogue: gains, Monte Carlo, circular test, rotary axes."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from matplotlib.figure import Figure

from warpspace.analysis.blocks import Lines
from warpspace.analysis.commands.gains import Gains
from warpspace.analysis.commands.montecarlo import MonteCarlo, sampled_histogram
from warpspace.analysis.description import ignore_progress
from warpspace.analysis.sampling.cases import SamplingPlan
from warpspace.analysis.sampling.machine_sampling import montecarlo
from warpspace.bench.base import run_test
from warpspace.bench.kinds.circular import Circular
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import placed_words
from warpspace.kinematics.model import Loop
from warpspace.outputs.charts.block_charts import (
    bars_chart,
    charts_sheet,
    histogram_chart,
    on_ground,
)
from warpspace.outputs.charts.result_charts import bench_chart
from warpspace.outputs.drawing.settings import FONT, FigureSettings
from warpspace.outputs.drawing.sheet import LOOP_WORDS, Drawing, metadata
from warpspace.picture import traces
from warpspace.resources import __version__
from warpspace.scene.model import Scene, choose_view
from warpspace.units import spell_count


def draw_gains(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    bars = Gains(loop=Loop(settings.loop), over_travel=True).run(scene, ignore_progress).bars()
    title = f"Error gains: {scene.machine.title}"
    subtitle = f"{_loop(scene, settings)} · largest absolute gains over the travel"
    chart = replace(bars, title=title, subtitle=subtitle)
    return _draw("gains", title, scene, settings, bars_chart, chart)


def draw_montecarlo(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    sampled = montecarlo(MonteCarlo(loop=Loop(settings.loop)).case(scene, SamplingPlan()))
    title = f"Machines within tolerance: {scene.title}"
    loop = " · ".join((_loop(scene, settings), *placed_words(sampled.case.view)))
    subtitle = (
        f"{loop} · {spell_count(sampled.case.plan.samples)} machines, one random point each ·"
        f" {sampled.case.draws.distribution} over the tolerances · seed {sampled.case.plan.seed}"
    )
    histogram = sampled_histogram(sampled, title, subtitle)
    return _draw("montecarlo", title, scene, settings, histogram_chart, histogram)


def draw_ballbar(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    test = run_test(scene, Circular(plane="XY", radius_mm=150.0))
    title = f"Circular test: {scene.title}"
    return _draw("ballbar", title, scene, settings, bench_chart, test, title)


def draw_rotary(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    lines = first_lines(scene)
    if not lines:
        raise OptionError(
            f"figure 'rotary': {scene.name} has no traces; expected a machine with a rotary axis"
            " and points in [points_mm] traces"
        )
    title = f"Error motions of the rotary axes: {scene.title}"
    subtitle = (
        "ISO 230-7 · over the position of the axis, at the height of the point and in its"
        " direction, which turns with it"
    )
    charts: list[Lines] = []
    for line in lines:
        name, motion = traces.name_trace(line.trace), traces.evaluate_axis_motion(scene, line)
        if motion is None:
            subtitle += f" · {name}: the point lies on the axis"
        else:
            charts += [traces.motion_lines(name, motion, part) for part in motion.motions]
    return _draw("rotary", title, scene, settings, charts_sheet, charts, title, subtitle, 3)


def first_lines(scene: Scene) -> list[traces.TraceLine]:
    positions = scene.workspace.positions
    lines: dict[str, traces.TraceLine] = {}
    for line in traces.trace_lines(traces.evaluate_traces(scene, 1.0)):
        if all(positions.get(axis, 0.0) == at for axis, at in line.trace.at.items()):
            lines.setdefault(line.trace.axis, line)
    return list(lines.values())


def _loop(scene: Scene, settings: FigureSettings) -> str:
    return LOOP_WORDS[choose_view(scene, settings.loop).loop]


def _draw(
    name: str,
    title: str,
    scene: Scene,
    settings: FigureSettings,
    draw: Callable[..., Figure],
    *arguments: Any,
) -> Drawing:
    with on_ground(settings.theme):
        figure = draw(*arguments)
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
