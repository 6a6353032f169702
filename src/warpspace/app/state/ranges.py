"""Ranges and steps of the controls, and how a wild number is brought into them."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from warpspace.app.state.leaf import described, error_names
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Tolerance
from warpspace.machine.limits import MAX_ERROR, MIN_HALF_WIDTH, MIN_NUMBER
from warpspace.scene.model import Scene

LEAST_TRANSLATION_UM = 20.0
LEAST_ROTATION_URAD = 50.0
FINE_STEP = 0.1
_FINE_BELOW = 500.0
_FINE_ABOVE = 5.0
_ROUND = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class Span:
    """Range of a control."""

    low: float  # ends, in the unit of the control
    high: float
    step: float  # distance between two positions of a slider

    def clamp(self, value: float, fallback: float) -> float:
        """Bring a number that may be anything into the range; what is no number falls back."""
        if math.isnan(value):
            return fallback
        kept = min(max(value, self.low), self.high)
        return 0.0 if 0.0 < abs(kept) < MIN_NUMBER else kept

    def clamped_words(self, value: float, kept: float, what: str, unit: str) -> str:
        """Say that a number was brought into the range."""
        given = f"{value:g}" if math.isfinite(value) else str(value)
        allowed = f"{self.low:g} to {self.high:g} {unit}".rstrip()
        shown = f"{kept:g} {unit}".rstrip()
        return f"{what} = {given} is outside {allowed}; clamped to {shown}"


def round_up(value: float) -> float:
    """Give the smallest 1, 2 or 5 × 10ⁿ that is not below a positive value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return next(step * decade for step in _ROUND if step * decade >= value * (1.0 - 1e-9))


def _step(high: float) -> float:
    if _FINE_ABOVE <= high <= _FINE_BELOW:
        return FINE_STEP
    return 10.0 ** (math.ceil(math.log10(high)) - 3)


def amplitude_span(key: str, value: float, tolerance: Tolerance | None) -> Span:
    """Choose the slider range of a parameter."""
    least = LEAST_ROTATION_URAD if parameter(key).is_rotation else LEAST_TRANSLATION_UM
    if tolerance is not None:
        reach = abs(tolerance.centre) + tolerance.half_width
        least = reach if reach >= MIN_HALF_WIDTH else least
    high = min(round_up(max(least, 2.0 * abs(value))), MAX_ERROR)
    return Span(-high, high, _step(high))


def position_spans(scene: Scene) -> dict[str, Span]:
    """Give the ranges of the rotary axes that the volume is drawn at, degrees, by axis.

    They are the travels, widened where the scene itself stands beyond. Rotary axes that span the
    volume are not among them.
    """
    at, spanning = scene.workspace.positions, scene.workspace.volume_axes
    return {
        axis.name: Span(
            min(axis.travel[0], at.get(axis.name, axis.travel[0])),
            max(axis.travel[1], at.get(axis.name, axis.travel[1])),
            1.0,
        )
        for axis in scene.machine.axes.values()
        if not axis.is_linear and axis.name not in spanning
    }


# --- Which errors take part: those that were excluded do not, or only the chosen ones do ----------


@dataclass(frozen=True, slots=True)
class Exclusions:
    """Parameters that do not take part, and those that alone do."""

    excluded: frozenset[str] = described(
        frozenset[str](),
        "Excluded errors",
        one="Exclusion of {}",
        choices=error_names,
        linked="excluded",
        hint="Errors that are left out.",
    )
    only: frozenset[str] = described(
        frozenset[str](),
        "Errors drawn alone",
        one="Only {}",
        choices=error_names,
        linked="only",
        hint="Where there are any, all others are left out, and so are excluded ones among them.",
    )

    def __bool__(self) -> bool:
        """Whether anything is left out."""
        return bool(self.excluded or self.only)

    def active(self, key: str) -> bool:
        """Tell whether a parameter takes part."""
        return key not in self.excluded and (not self.only or key in self.only)

    def effective(self, amplitudes: Mapping[str, float]) -> Mapping[str, float]:
        """Give the amplitudes that count, µm or µrad: zero for what does not take part."""
        if not self:
            return amplitudes
        return {key: value if self.active(key) else 0.0 for key, value in amplitudes.items()}

    def within(self, keys: Collection[str]) -> "Exclusions":
        """Keep what concerns the parameters of a machine."""
        return Exclusions(self.excluded & frozenset(keys), self.only & frozenset(keys))
