"""Error curves along each axis with tolerance bands, and the constant errors beside them."""

import math
from collections.abc import Sequence

import numpy as np

from warpspace.analysis.blocks import Band, Bars, Curve, Lines, Panel, Series, Style
from warpspace.machine.axes import axis_order, parameter
from warpspace.machine.definition import Axis
from warpspace.machine.errors import BACKWARD, Tolerance
from warpspace.outputs.charts.block_charts import draw_beside, draw_lines, on_ground, style
from warpspace.outputs.drawing.canvas import POINTS_PER_PX
from warpspace.outputs.drawing.settings import SIZES, FigureSettings
from warpspace.outputs.drawing.sheet import Drawing, reference_words, start_sheet
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MICRORADIAN, Array

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
    with on_ground(settings.theme), style():
        for number, errors in enumerate(charts):
            line, side = divmod(number, columns)
            low = top - (line + 1) * row
            box = ((x_left + side * column) / width, low / height, column / width, row / height)
            draw_lines(canvas.figure, _chart(scene, *errors), box, size)
        if bars:
            box = (split / width, bottom / height, (right - split) / width, (top - bottom) / height)
            draw_beside(canvas.figure, bars, box, size)
    if not charts:
        message = "All component errors are zero."
        text, small = canvas.fit(message, split - x_left, SIZES.heading)
        canvas.text((x_left + split) / 2.0, (bottom + top) / 2.0, text, size=small, ha="center")
    return sheet.finish(1.0)


def _keys(axis: Axis, letters: str) -> list[str]:
    return [f"E{letter}{axis.name}" for letter in letters]


def _drawn_errors(scene: Scene) -> list[Errors]:
    candidates = [(axis, *kind) for axis in scene.machine.axes.values() for kind in KINDS]

    def is_given(key: str) -> bool:
        is_set = key in scene.errors and scene.errors.amplitude(key) != 0.0
        return is_set or key in scene.measured

    nonzero = [one for one in candidates if any(map(is_given, _keys(*one[:2])))]
    return nonzero or [
        one
        for one in candidates
        if any(_has_width(scene.tolerances.get(key)) for key in _keys(*one[:2]))
    ]


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


def _chart(scene: Scene, axis: Axis, letters: str, unit: str, kind: str) -> Lines:
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
        ends = np.array([low, high])
        lowest, highest = (
            np.full(2, tolerance.centre + sign * tolerance.half_width) for sign in (-1.0, 1.0)
        )
        band_colour = colours[0] if len(colours) == 1 else BAND
        bands.append(
            Band(f"± {tolerance.half_width:g} {unit} tolerance", ends, lowest, highest, band_colour)
        )
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
    keys = [
        key
        for key in scene.parameter_keys
        if parameter(key).is_constant
        and (scene.errors.amplitude(key) != 0.0 or _has_width(scene.tolerances.get(key)))
    ]
    keys.sort(key=lambda key: (not parameter(key).is_rotation, axis_order(parameter(key).axis)))
    if not keys:
        return None
    limits = [scene.tolerances.get(key) for key in keys]
    ends = [
        Series([one and one.centre + sign * one.half_width for one in limits], as_mark=True)
        for sign in (-1.0, 1.0)
    ]
    values = Series([scene.errors.amplitude(key) for key in keys], role="key")
    title = "constant errors"
    return Bars(
        title, "", [f"{key} [{parameter(key).unit}]" for key in keys],
        (Panel(title, (values, *ends), "µm or µrad", signed=True),),
    )  # fmt: skip
