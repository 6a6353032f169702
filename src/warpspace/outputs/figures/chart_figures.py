"""Charts as figures: errors along each axis, gains, sampled machines, circular test, rotation."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from warpspace.analysis.blocks import Band, Bars, Curve, Lines, Panel, Series, Style
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
from warpspace.machine.axes import axis_order, parameter
from warpspace.machine.definition import Axis
from warpspace.machine.errors import BACKWARD, Tolerance
from warpspace.outputs.charts import block_charts
from warpspace.outputs.charts.result_charts import bench_chart
from warpspace.outputs.drawing.canvas import POINTS_PER_PX
from warpspace.outputs.drawing.settings import FONT, SIZES, FigureSettings
from warpspace.outputs.drawing.sheet import (
    LOOP_WORDS,
    Drawing,
    metadata,
    reference_words,
    start_sheet,
)
from warpspace.picture import traces
from warpspace.resources import __version__
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MICRORADIAN, Array, spell_count


def draw_gains(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    bars = Gains(loop=settings.chosen_loop, over_travel=True).run(scene, ignore_progress).bars()
    title = f"Error gains: {scene.machine.title}"
    subtitle = f"{LOOP_WORDS[Loop(settings.loop)]} · largest absolute gains over the travel"
    chart = replace(bars, title=title, subtitle=subtitle)
    return _draw("gains", title, scene, settings, block_charts.bars_chart, chart)


def draw_montecarlo(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    sampled = montecarlo(MonteCarlo(loop=settings.chosen_loop).case(scene, SamplingPlan()))
    title = f"Machines within tolerance: {scene.title}"
    loop = " · ".join((LOOP_WORDS[sampled.case.view.loop], *placed_words(sampled.case.view)))
    subtitle = (
        f"{loop} · {spell_count(sampled.case.plan.samples)} machines, one random point each ·"
        f" {sampled.case.draws.distribution} over the tolerances · seed {sampled.case.plan.seed}"
    )
    histogram = sampled_histogram(sampled, title, subtitle)
    return _draw("montecarlo", title, scene, settings, block_charts.histogram_chart, histogram)


def draw_ballbar(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    scene = scenes[0]
    test = run_test(scene, Circular())
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
    drawn = [chart for chart in charts if not block_charts.is_empty(chart)]
    if drawn and len(drawn) < len(charts):
        subtitle += f" · {len(charts) - len(drawn)} plots without error are omitted"
    drawn = drawn or [replace(chart, title="All rotary axes") for chart in charts[:1]]
    return _draw(
        "rotary", title, scene, settings, block_charts.charts_sheet, drawn, title, subtitle, 3
    )


def first_lines(scene: Scene) -> list[traces.TraceLine]:
    positions = scene.workspace.positions
    lines: dict[str, traces.TraceLine] = {}
    for line in traces.trace_lines(traces.evaluate_traces(scene, 1.0)):
        if all(positions.get(axis, 0.0) == at for axis, at in line.trace.at.items()):
            lines.setdefault(line.trace.axis, line)
    return list(lines.values())


def _draw(
    name: str,
    title: str,
    scene: Scene,
    settings: FigureSettings,
    draw: Callable[..., Figure],
    *arguments: Any,
) -> Drawing:
    with block_charts.on_ground(settings.theme):
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


SAMPLES = 361
FEW_READINGS = 5000  # largest number of readings drawn, evenly selected
BAND = 5
"""Colour of a tolerance that several errors of a chart share; otherwise that of its error."""
KINDS = (("XYZ", MICROMETRE, "translation"), ("ABC", MICRORADIAN, "rotation"))
Errors = tuple[Axis, str, str, str]
"""An axis, the letters of the errors of one kind, their unit and the kind."""


def draw_curves(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    scene = scenes[0]
    charts = _drawn_errors(scene)
    facts = [
        f"{scene.machine.title}, chain {scene.machine.chain}",
        "component errors over the range of each axis, constant errors at the right",
        "strokes: tolerance of a constant error" if scene.tolerances else "",
        reference_words(scene) if scene.reference else "",
        _left_out_words(scene, charts),
    ]
    title = f"Errors along the axes: {scene.title}"
    sheet = start_sheet(
        "error-curves", settings, title, [fact for fact in facts if fact], scenes, [],
        exact=exact, panel=False,
    )  # fmt: skip
    canvas = sheet.canvas
    x_left, bottom, right, top = sheet.content
    bars = _constants(scene)
    split = x_left + (0.68 if bars else 1.0) * (right - x_left)
    columns = 1 if len(charts) < 3 else 2
    row = (top - bottom) / max(math.ceil(len(charts) / columns), 1)
    column = (split - x_left) / columns
    text = SIZES.text if settings.printed else SIZES.small
    size = canvas.px(text) * POINTS_PER_PX
    width, height = canvas.width, canvas.height
    with block_charts.on_ground(settings.theme), block_charts.style():
        for number, errors in enumerate(charts):
            line, side = divmod(number, columns)
            low = top - (line + 1) * row
            box = ((x_left + side * column) / width, low / height, column / width, row / height)
            block_charts.draw_lines(canvas.figure, _axis_lines(scene, *errors), box, size)
        if bars:
            box = (split / width, bottom / height, (right - split) / width, (top - bottom) / height)
            block_charts.draw_beside(canvas.figure, bars, box, size)
    if not charts:
        message = "All component errors are zero."
        text, small = canvas.fit(message, split - x_left, SIZES.heading)
        canvas.text((x_left + split) / 2.0, (bottom + top) / 2.0, text, size=small, ha="center")
    return sheet.finish(1.0)


def _keys(axis: Axis, letters: str) -> list[str]:
    return [f"E{letter}{axis.name}" for letter in letters]


def _drawn_errors(scene: Scene) -> list[Errors]:
    candidates = [(axis, *kind) for axis in scene.machine.axes.values() for kind in KINDS]
    for is_drawn in (
        lambda key: scene.errors.amplitude(key) != 0.0 or key in scene.measured,
        lambda key: _has_width(scene.tolerances.get(key)),
    ):
        drawn = [errors for errors in candidates if any(map(is_drawn, _keys(*errors[:2])))]
        if drawn:
            return drawn
    return []


def _has_width(tolerance: Tolerance | None) -> bool:
    return tolerance is not None and tolerance.half_width > 0.0


def _left_out_words(scene: Scene, charts: Sequence[Errors]) -> str:
    drawn = {(axis.name, kind) for axis, _, _, kind in charts}
    missing = [
        f"{kind}s of {', '.join(names)}"
        for _, _, kind in KINDS
        if (names := [name for name in scene.machine.axes if (name, kind) not in drawn])
    ]
    return f"zero: {'; '.join(missing)}" if missing and charts else ""


def _axis_lines(scene: Scene, axis: Axis, letters: str, unit: str, kind: str) -> Lines:
    low, high = scene.workspace.ranges.get(axis.name, axis.travel)
    if low == high:
        low, high = axis.travel
    at = np.linspace(low, high, SAMPLES)
    curves: list[Curve] = []
    bands: list[Band] = []
    shared: dict[Tolerance, list[int]] = {}
    for colour, key in enumerate(_keys(axis, letters)):
        curves += _curves(scene, key, at, colour)
        if key in scene.uncertainty:
            middle, half = scene.errors.evaluate(key, at), scene.uncertainty[key].evaluate(at)
            label = f"{key} ± standard uncertainty"
            bands.append(Band(label, at, middle - half, middle + half, colour))
        if (tolerance := scene.tolerances.get(key)) is not None:
            shared.setdefault(tolerance, []).append(colour)
    for tolerance, colours in shared.items():
        ends, half = np.array([low, high]), tolerance.half_width
        lowest, highest = (np.full(2, tolerance.centre + sign * half) for sign in (-1.0, 1.0))
        band_colour = colours[0] if len(colours) == 1 else BAND
        bands.append(Band(f"± {half:g} {unit} tolerance", ends, lowest, highest, band_colour))
    title = f"{kind} of {axis.name}  [{unit}]"
    return Lines("lines", title, f"{axis.name} [{axis.unit}]", "", tuple(curves), tuple(bands))


def _curves(scene: Scene, key: str, at: Array, colour: int) -> list[Curve]:
    function = scene.errors.functions.get(key)
    if function is None or scene.errors.amplitude(key) == 0.0:
        curves = [Curve(f"{key}: zero", at, np.zeros_like(at), colour, "thin")]
    else:
        curves = [Curve(key, at, scene.errors.evaluate(key, at), colour)]
        if len(function.lines) > 1:
            curves = []
            for number, (label, line) in enumerate(function.lines):
                first = label.startswith("forward") or not (number or label.startswith("back"))
                kind: Style = "line" if first else "dashed"
                curves.append(Curve(f"{key} {label}", at, line.evaluate(at), colour, kind))
    if key in scene.measured:
        for travel, points in scene.measured[key].scatter.items():
            step = max(1, -(-len(points) // FEW_READINGS))
            label = f"{key} read {'backward' if travel == BACKWARD else ''}".strip()
            curves.append(Curve(label, points[::step, 0], points[::step, 1], colour, "dots"))
    return curves


def _constants(scene: Scene) -> Bars | None:
    amplitude, tolerances = scene.errors.amplitude, scene.tolerances
    rows = [
        parameter(key)
        for key in scene.parameter_keys
        if amplitude(key) != 0.0 or _has_width(tolerances.get(key))
    ]
    rows = [row for row in rows if row.is_constant]
    rows.sort(key=lambda row: (not row.is_rotation, axis_order(row.axis)))
    if not rows:
        return None
    limits = [tolerances.get(row.key) for row in rows]
    ends = [
        Series([one and one.centre + sign * one.half_width for one in limits], as_mark=True)
        for sign in (-1.0, 1.0)
    ]
    values = Series([amplitude(row.key) for row in rows], role="key")
    title, names = "constant errors", [f"{row.key} [{row.unit}]" for row in rows]
    return Bars(title, "", names, (Panel(title, (values, *ends), "µm or µrad", signed=True),))
