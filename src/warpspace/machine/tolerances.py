"""Tolerance sets: the range within which each error parameter of a machine may fall."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from warpspace.machine.parameters import parameter

TOLERANCE_CLASSES = ("translation", "rotation", "squareness")


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Range of one parameter.

    Attributes
    ----------
    centre : float, µm or µrad
    half_width : float, µm or µrad, not negative
    """

    centre: float
    half_width: float


@dataclass(frozen=True, slots=True)
class ToleranceSet:
    """Tolerances of a machine's parameters.

    Attributes
    ----------
    default : mapping of str to float
        Half width about zero per class: translation [µm], rotation and squareness [µrad].
    own : mapping of str to Tolerance
        Parameters with a tolerance of their own.
    """

    default: Mapping[str, float] = field(default_factory=dict[str, float])
    own: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance])

    def __bool__(self) -> bool:
        """Whether any tolerance is given."""
        return bool(self.default or self.own)

    def get(self, key: str) -> Tolerance | None:
        """Give the tolerance of a parameter; None where neither it nor its class has one."""
        if key in self.own:
            return self.own[key]
        half_width = self.default.get(parameter(key).tolerance_class)
        return None if half_width is None else Tolerance(0.0, half_width)

    def missing(self, keys: Sequence[str]) -> tuple[str, ...]:
        """List the parameters that have no tolerance."""
        return tuple(key for key in keys if self.get(key) is None)

    def with_half_widths(self, half_widths: Mapping[str, float]) -> "ToleranceSet":
        """Give parameters other half widths, µm or µrad; centres stay where they are."""
        own = dict(self.own)
        for key, half_width in half_widths.items():
            present = self.get(key)
            own[key] = Tolerance(0.0 if present is None else present.centre, half_width)
        return replace(self, own=own)
