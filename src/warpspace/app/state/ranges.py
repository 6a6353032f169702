"""Ranges and steps of the controls, and how a wild number is brought into them."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

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

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Both ends and zero, with what is written there."""
        return ((self.low, f"{self.low:g}"), (0.0, "0"), (self.high, f"{self.high:g}"))

    def clamp(self, value: float, fallback: float) -> float:
        """Bring a number that may be anything into the range; what is no number falls back."""
        if math.isnan(value):
            return fallback
        kept = min(max(value, self.low), self.high)
        return 0.0 if 0.0 < abs(kept) < MIN_NUMBER else kept


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


def amplitude_spans(scene: Scene) -> dict[str, Span]:
    """Choose the slider ranges of all parameters of a scene, by key."""
    return {
        key: amplitude_span(key, scene.errors.amplitude(key), scene.tolerances.get(key))
        for key in scene.parameter_keys
    }


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

    excluded: frozenset[str] = frozenset()  # keys that do not take part
    # where there are any, only these take part; an excluded one among them still does not
    only: frozenset[str] = frozenset()

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

    def with_excluded(self, key: str, excluded: bool) -> "Exclusions":
        """Exclude one parameter, or include it again."""
        return replace(self, excluded=_with(self.excluded, key, excluded))

    def with_only(self, key: str, only: bool) -> "Exclusions":
        """Add one parameter to those that alone take part, or take it away."""
        return replace(self, only=_with(self.only, key, only))

    def within(self, keys: Collection[str]) -> "Exclusions":
        """Keep what concerns the parameters of a machine."""
        return Exclusions(self.excluded & frozenset(keys), self.only & frozenset(keys))


def _with(keys: frozenset[str], key: str, on: bool) -> frozenset[str]:
    return keys | {key} if on else keys - {key}
