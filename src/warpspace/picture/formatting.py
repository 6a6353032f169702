"""Formatting of numbers, positions, factors and conventions for pictures, pages and files."""

from collections.abc import Mapping, Sequence
from typing import SupportsFloat

from warpspace.analysis.loop_parameters import loop_axes
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, plus_minus
from warpspace.kinematics.model import Convention, Loop, Model
from warpspace.machine.axes import (
    DIRECTION_WORDS,
    TravelDirection,
    is_linear,
    is_rotary,
    parameter,
)
from warpspace.machine.errors import ToleranceSet
from warpspace.scene.model import Scene
from warpspace.units import MINUS, THIN_SPACE, Array, spell_short

IN_R = "in R"  # prefix of a point in the machine frame
SEPARATOR = " · "
_DIGITS = 6  # decimals of a position in a command: a nanometre
MOSTLY = 0.5  # share of an error above which its largest contribution is most of it


def spell_cause(key: str, share: float) -> str:
    """Spell the largest contribution to an error: ``mostly because Z is not square to Y``."""
    return f"{'mostly' if share > MOSTLY else 'partly'} because {parameter(key).cause}"


def spell_coordinate(value: SupportsFloat) -> str:
    """Spell a coordinate to a tenth, with a true minus; zero has no sign."""
    return f"{round(float(value), 1) + 0.0:g}".replace("-", MINUS)


def list_axes(at: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes: ``X 275 Y −225 Z −480 B 0°``, mm and degrees."""
    units = {name: "" if is_linear(name) else "°" for name in at}
    return " ".join(f"{name} {spell_coordinate(q)}{units[name]}" for name, q in at.items())


def point_axes(scene: Scene, at: Mapping[str, float]) -> dict[str, float]:
    """Select the axes that identify a point: linear ones, and others off their scene position."""
    placed = scene.workspace.positions
    return {
        name: value
        for name, value in at.items()
        if is_linear(name) or abs(value - placed.get(name, 0.0)) > 1e-9
    }


def spell_axes(axes: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes: ``axes X 275 Y −225 Z −480 B −30°``."""
    linear = {name: at for name, at in axes.items() if is_linear(name)}
    rotary = {name: float(at) for name, at in axes.items() if not is_linear(name)}
    turned = {name: at for name, at in rotary.items() if round(at, 1) != 0.0 or not linear}
    return f"axes {list_axes({**linear, **turned})}"


def spell_in_r(point_mm: Array | Sequence[float]) -> str:
    """Spell a point of the machine frame, mm: ``in R x 275 y −225 z −51``."""
    pairs = zip("xyz", point_mm, strict=True)
    return " ".join((IN_R, *(f"{name} {spell_coordinate(value)}" for name, value in pairs)))


def spell_point(axes: Mapping[str, SupportsFloat], point_mm: Array | Sequence[float]) -> str:
    """Spell a point in both coordinates, to a tenth of a millimetre or degree."""
    return SEPARATOR.join((*([spell_axes(axes)] if axes else ()), spell_in_r(point_mm)))


def spell_at(axes: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes as the option ``--at`` of a command takes them."""
    positions = {
        name: round(float(axes[name]), _DIGITS) + 0.0 for name in sorted(axes, key=is_rotary)
    }
    plain = {name: f"{at:.{_DIGITS}f}".rstrip("0").rstrip(".") for name, at in positions.items()}
    return ",".join(f"{name}={text}" for name, text in plain.items())


def u95_behind(u95: float | None) -> str:
    """Format U95 to follow a number, `` ± 1.2``; unknown (None): `` ± ?``."""
    return f" {plus_minus(u95)}"


def length_words(uncertainty: FieldUncertainty | None, point: int = 0) -> str:
    """Format U95 of |E| at a point of a field, by its flat index; empty where none is stated."""
    return u95_behind(uncertainty.u95_at(point)) if uncertainty else ""


def beyond_words(scene: Scene, loop: Loop) -> str:
    """List positions of a loop's axes outside the measured range of a scene: ``Z below −300``."""
    measured_range = scene.covariance.measured_range if scene.covariance else {}
    axes = loop_axes(scene.model, loop)
    ranges: list[str] = []
    for axis, (low, high) in measured_range.items():
        first, last = scene.workspace.ranges[axis]
        if axis in axes and first == last and not low <= first <= high:
            ranges.append(f"{axis} at {spell_coordinate(first)}")
        elif axis in axes:
            ranges += [f"{axis} below {spell_coordinate(low)}"] if first < low else []
            ranges += [f"{axis} above {spell_coordinate(high)}"] if last > high else []
    return f"outside the measured range: {', '.join(ranges)}" if ranges else ""


TIMES = "\N{MULTIPLICATION SIGN}"
LOOP_WORDS = {
    Loop.TOOL: "tool loop",
    Loop.WORKPIECE: "workpiece loop",
    Loop.RELATIVE: "tool relative to workpiece",
}

TOLERANCE_UNITS = {"translation": "µm", "rotation": "µrad", "squareness": "µrad"}


def tolerance_words(tolerances: ToleranceSet) -> str:
    return ", ".join(
        f"{name} ±{spell_short(value)} {TOLERANCE_UNITS[name]}"
        for name, value in tolerances.default.items()
    )


def spell_factor(value: float) -> str:
    """Spell an exaggeration: ``×1000``, ``×20 000``, at most four digits of it."""
    if value == 1.0:
        return f"{TIMES}1, true scale"
    rounded = float(f"{value:.4g}")
    if rounded >= 10_000.0:
        return TIMES + f"{rounded:,.10g}".replace(",", THIN_SPACE)
    return f"{TIMES}{rounded:.10g}"


def spell_vector(point: Sequence[float] | Array) -> str:
    """Spell a point in whole millimetres, tenths below ten: ``(275, −225, −51)``."""
    parts = [f"{v:.0f}" if abs(v) >= 10.0 else f"{round(v, 1) + 0.0:g}" for v in point]
    return "(" + ", ".join(part.replace("-", MINUS) for part in parts) + ")"


def reference_words(scene: Scene) -> str:
    if scene.reference is None:
        return "absolute errors"
    return f"reference point {list_axes(scene.reference)}"


def range_words(low: float, high: float, unit: str) -> str:
    """Format a colour range set by the user: ``range fixed 0–50 µm``."""
    between = "–" if low >= 0.0 else " to "
    return f"range fixed {spell_short(low)}{between}{spell_short(high)} {unit}"


def convention_groups(model: Model) -> tuple[tuple[Convention, tuple[str, ...]], ...]:
    """Group the axes of a machine by their convention."""
    groups: dict[str, list[str]] = {}
    for axis in model.machine.axes:
        groups.setdefault(model.convention(axis).name, []).append(axis)
    return tuple((model.convention(axes[0]), tuple(axes)) for axes in groups.values())


def convention_words(scene: Scene) -> str:
    groups = convention_groups(scene.model)
    parts = [f"{convention.place} of {' '.join(axes)}" for convention, axes in groups]
    return f"component errors {groups[0][0].place if len(groups) == 1 else ', '.join(parts)}"


def direction_words(scene: Scene) -> tuple[str, ...]:
    """Format the direction of travel of the errors; empty where no error depends on it."""
    if not scene.errors.has_directions and scene.model.direction == TravelDirection.MEAN:
        return ()
    return (DIRECTION_WORDS[TravelDirection(scene.model.direction)],)


def convention_sentences(scene: Scene) -> tuple[str, ...]:
    """Describe the conventions of a scene, one sentence each."""
    groups = convention_groups(scene.model)
    if len(groups) == 1:
        return (groups[0][0].sentence,)
    return tuple(
        f"Component errors of {', '.join(axes)} {convention.meaning} ({convention.place})."
        for convention, axes in groups
    )


def quantity_words(component: str, unit: str = "µm") -> str:
    return f"|E|  [{unit}]" if component == "norm" else f"{component} component of E  [{unit}]"
