"""Error curves along each axis with tolerance bands, and the constant errors beside them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from warpspace.machine.axes import axis_order
from warpspace.machine.description import Axis
from warpspace.machine.parameters import parameter
from warpspace.machine.tolerances import Tolerance
from warpspace.outputs.drawing.canvas import POINTS_PER_PX, Canvas
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.projection import Rect
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.drawing.sheet import (
    LegendEntry,
    metadata,
    reference_words,
    start_sheet,
)
from warpspace.outputs.drawing.style import FONT, SIZES, Theme
from warpspace.outputs.figures.curve_lines import draw_error, line_legend
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MICRORADIAN

SAMPLES = 361
WIDTHS = (4.4, 2.8, 1.5)
"""Of the three curves of a panel: those drawn later are thinner, so that none hides another."""
DOT = 5.0
"""Size of a reading."""
KINDS = (("XYZ", MICROMETRE, "translation"), ("ABC", MICRORADIAN, "rotation"))


def draw_curves(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw every error of a scene along its axis, tolerances behind.

    Parameters
    ----------
    scenes : sequence of Scene, (1,)
    settings : FigureSettings
        Size and theme are used.
    exact : bool
        Whether the figure becomes pixels of its own size.

    Returns
    -------
    Drawing
    """
    scene = scenes[0]
    title = f"Errors along the axes: {scene.title}"
    panels = _panels(scene)
    facts = [
        f"{scene.machine.title}, chain {scene.machine.chain}",
        "component errors over the range of each axis, constant errors at the right",
        reference_words(scene) if scene.reference else "",
        _left_out_words(scene, panels),
    ]
    legend = [*_legend(banded=bool(scene.tolerances)), *line_legend(scene)]
    sheet = start_sheet(
        settings, title, [fact for fact in facts if fact], scenes, legend, exact=exact, panel=False
    )
    canvas = sheet.canvas
    left, bottom, right, top = sheet.content
    constants = _constant_keys(scene)
    split = left + (0.72 if constants else 1.0) * (right - left)
    columns = 1 if len(panels) < 3 else 2
    row = (top - bottom) / max(math.ceil(len(panels) / columns), 1)
    column = (split - left) / columns
    for number, (axis, letters, unit, kind) in enumerate(panels):
        line, side = divmod(number, columns)
        box = (
            left + side * column + canvas.px(74.0),
            top - (line + 1) * row + canvas.px(50.0),
            left + (side + 1) * column - canvas.px(12.0),
            top - line * row - canvas.px(30.0),
        )
        _draw_curves(canvas, scene, axis, letters, unit, kind, box)
    if not panels:
        words = "No component error: every one is zero along its axis."
        text, size = canvas.fit(words, split - left, SIZES.heading)
        canvas.text((left + split) / 2.0, (bottom + top) / 2.0, text, size=size, ha="center")
    if constants:
        box = (split + canvas.px(90.0), bottom + canvas.px(50.0), right, top - canvas.px(30.0))
        _draw_constants(canvas, scene, constants, box)
    about = metadata(title, scenes, settings, 1.0, "error-curves")
    return Drawing(canvas.figure, title, about, (), tuple(canvas.rects))


Panel = tuple[Axis, str, str, str]
"""An axis, the letters of the errors of one kind, their unit and the kind."""


def _panels(scene: Scene) -> list[Panel]:
    """List what there is to draw: kinds of errors of an axis with one that is not zero.

    Of a scene without any, those with a tolerance.
    """
    every = [(axis, *kind) for axis in scene.machine.axes.values() for kind in KINDS]

    def keys(panel: Panel) -> list[str]:
        return [f"E{letter}{panel[0].name}" for letter in panel[1]]

    given = [
        panel
        for panel in every
        if any(
            (key in scene.errors and scene.errors.amplitude(key) != 0.0) or key in scene.measured
            for key in keys(panel)
        )
    ]
    return given or [
        panel
        for panel in every
        if any(_has_width(scene.tolerances.get(key)) for key in keys(panel))
    ]


def _has_width(tolerance: Tolerance | None) -> bool:
    """Tell whether there is a tolerance that an error may fall in."""
    return tolerance is not None and tolerance.half_width > 0.0


def _left_out_words(scene: Scene, panels: Sequence[Panel]) -> str:
    """Say which panels are left out since all their errors are zero; empty where none is."""
    drawn = {(axis.name, kind) for axis, _, _, kind in panels}
    missing = [
        f"{kind}s of {', '.join(names)}"
        for _, _, kind in KINDS
        if (names := [name for name in scene.machine.axes if (name, kind) not in drawn])
    ]
    return f"zero: {'; '.join(missing)}" if missing and panels else ""


def _axes(canvas: Canvas, box: Rect) -> Any:
    """Lay matplotlib axes of the house style into a box of the figure, px."""
    left, bottom, right, top = box
    width, height = max(right - left, canvas.px(20.0)), max(top - bottom, canvas.px(12.0))
    axes: Any = canvas.figure.add_axes(
        (left / canvas.width, bottom / canvas.height, width / canvas.width, height / canvas.height)
    )
    theme = canvas.theme
    axes.set_facecolor("none")
    for name, spine in axes.spines.items():
        spine.set_visible(name in ("left", "bottom"))
        spine.set_color(theme.muted)
        spine.set_linewidth(canvas.px(SIZES.hair) * POINTS_PER_PX)
    axes.tick_params(
        colors=theme.muted, labelsize=canvas.px(SIZES.small - 1.0) * POINTS_PER_PX,
        width=canvas.px(SIZES.hair) * POINTS_PER_PX, length=canvas.px(4.0) * POINTS_PER_PX,
        pad=canvas.px(4.0) * POINTS_PER_PX, labelfontfamily=FONT,
    )  # fmt: skip
    axes.grid(visible=True, color=theme.faint, linewidth=canvas.px(0.8) * POINTS_PER_PX)
    axes.set_axisbelow(True)
    return axes


def _draw_curves(
    canvas: Canvas, scene: Scene, axis: Axis, letters: str, unit: str, kind: str, box: Rect
) -> None:
    """Draw the three translations or rotations of an axis over its range."""
    axes = _axes(canvas, box)
    theme = canvas.theme
    low, high = scene.workspace.ranges.get(axis.name, axis.travel)
    if low == high:
        low, high = axis.travel
    at = np.linspace(low, high, SAMPLES)
    keys = [f"E{letter}{axis.name}" for letter in letters]
    reach = _draw_bands(axes, scene, keys, theme, (low, high))
    names: list[tuple[str, str]] = []
    for number, key in enumerate(keys):
        colour = theme.series[number]
        values = scene.errors.evaluate(key, at) if key in scene.errors else np.zeros_like(at)
        reach = max(reach, float(np.abs(values).max()))
        zero = not values.any()
        width = 1.0 if zero else WIDTHS[number]
        axes.plot(
            at, values, color=colour, linewidth=canvas.px(width) * POINTS_PER_PX,
            alpha=0.55 if zero else 1.0, zorder=2.0 if zero else 3.0,
        )  # fmt: skip
        reach = max(
            reach,
            draw_error(
                axes, scene, key, at, colour, canvas.px(WIDTHS[number]) * POINTS_PER_PX,
                canvas.px(DOT) * POINTS_PER_PX,
            ),
        )  # fmt: skip
        names.append((key, colour))
    reach = 1.12 * reach or 1.0
    axes.set_xlim(low, high)
    axes.set_ylim(-reach, reach)
    axes.locator_params(axis="y", nbins=5)
    x = box[0]
    for key, colour in names:
        rect = canvas.text(
            x, box[3] + canvas.px(7.0), key, size=SIZES.small, colour=colour, weight="bold"
        )
        x = rect[2] + canvas.px(12.0)
    text, size = canvas.fit(f"{kind} of {axis.name}  [{unit}]", box[2] - x, SIZES.small)
    canvas.text(x, box[3] + canvas.px(7.0), text, size=size, colour=theme.muted)
    canvas.text(
        (box[0] + box[2]) / 2.0, box[1] - canvas.px(38.0), f"{axis.name}  [{axis.unit}]",
        size=SIZES.small, colour=theme.muted, ha="center",
    )  # fmt: skip


def _draw_bands(
    axes: Any, scene: Scene, keys: Sequence[str], theme: Theme, ends: tuple[float, float]
) -> float:
    """Draw tolerance bands, in the colour of a curve where it alone has one; their reach."""
    shared: dict[Tolerance, list[int]] = {}
    for number, key in enumerate(keys):
        tolerance = scene.tolerances.get(key)
        if tolerance is not None:
            shared.setdefault(tolerance, []).append(number)
    reach = 0.0
    for tolerance, numbers in shared.items():
        low, high = tolerance.centre - tolerance.half_width, tolerance.centre + tolerance.half_width
        alone = len(numbers) == 1
        axes.fill_between(
            ends, (low, low), (high, high), linewidth=0.0, zorder=0.6 if alone else 0.5,
            color=theme.series[numbers[0]] if alone else theme.band, alpha=0.22 if alone else 0.8,
        )  # fmt: skip
        reach = max(reach, abs(low), abs(high))
    return reach


def _constant_keys(scene: Scene) -> list[str]:
    """List the constant errors of a scene that are not zero or have a tolerance, angles first."""
    keys = [
        key
        for key in scene.parameter_keys
        if parameter(key).is_constant
        and (scene.errors.amplitude(key) != 0.0 or _has_width(scene.tolerances.get(key)))
    ]
    return sorted(
        keys, key=lambda key: (not parameter(key).is_rotation, axis_order(parameter(key).axis))
    )


def _draw_constants(canvas: Canvas, scene: Scene, keys: Sequence[str], box: Rect) -> None:
    """Draw the constant errors as points within their tolerances."""
    axes = _axes(canvas, box)
    theme = canvas.theme
    width = canvas.px(1.0) * POINTS_PER_PX
    reach = 1.0
    for row, key in enumerate(keys):
        tolerance = scene.tolerances.get(key)
        if tolerance is not None:
            left = tolerance.centre - tolerance.half_width
            own = key in scene.tolerances.own
            axes.barh(
                row, 2.0 * tolerance.half_width, left=left, height=0.62, linewidth=0.0,
                color=theme.series[0] if own else theme.band, alpha=0.25 if own else 0.8,
            )  # fmt: skip
            reach = max(reach, abs(tolerance.centre) + tolerance.half_width)
        value = scene.errors.amplitude(key) if key in scene.errors else 0.0
        reach = max(reach, abs(value))
        axes.plot([0.0, value], [row, row], color=theme.series[0], linewidth=2.0 * width)
        axes.plot(
            [value], [row], marker="o", markersize=8.0 * width, color=theme.series[0],
            fillstyle="full" if value else "none", markeredgewidth=1.4 * width,
        )  # fmt: skip
    axes.axvline(0.0, color=theme.muted, linewidth=width)
    axes.set_ylim(len(keys) - 0.4, -0.6)
    axes.set_xlim(-1.1 * reach, 1.1 * reach)
    axes.set_yticks(range(len(keys)), [f"{key} [{parameter(key).unit}]" for key in keys])
    title = "squareness, orientation and location"
    text, size = canvas.fit(title, box[2] - box[0], SIZES.small)
    canvas.text(box[0], box[3] + canvas.px(7.0), text, size=size, colour=theme.muted)
    for label in axes.get_yticklabels():
        label.set_color(theme.ink)


def _legend(*, banded: bool) -> list[LegendEntry]:
    """Build the legend."""
    entries = [
        LegendEntry(
            lambda c, x, y, w: c.line([(x, y), (x + w, y)], width=1.0, colour=c.theme.series[0]),
            "thin: zero",
        )
    ]
    if banded:
        entries.append(
            LegendEntry(_band_symbol, "tolerance, in the colour of a curve if it has its own")
        )
    return entries


def _band_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a tolerance band."""
    height = canvas.px(14.0)
    canvas.rectangle(
        x, y - height / 2, width, height, facecolor=canvas.theme.band, edgecolor="none"
    )
