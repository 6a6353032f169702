"""What a design is held against: a limit, where it holds, how tolerances are filled."""

from dataclasses import dataclass, replace

from warpspace.app.state.ranges import Span

LIMIT_UM = Span(1.0, 300.0, 0.5)
START_UM = 50.0
SAMPLED, MAX = "sampled", "max"
"""One random point of each machine (as in the thesis), or its worst point."""
UNIFORM, NORMAL = "uniform", "normal"


@dataclass(frozen=True, slots=True)
class Specification:
    """The specification of a review.

    Attributes
    ----------
    limit_um : float, µm
        Largest |E| allowed.
    over : str
        "sampled" or "max".
    distribution : str
        "uniform", or "normal" with 3σ at the limits.
    """

    limit_um: float = START_UM
    over: str = SAMPLED
    distribution: str = UNIFORM

    def with_limit(self, value: float) -> "Specification":
        """Set the limit, µm, within its range; what is no number changes nothing."""
        return replace(self, limit_um=LIMIT_UM.clamp(value, self.limit_um))

    def with_over(self, over: str) -> "Specification":
        """Choose where it holds; an unknown word changes nothing."""
        return replace(self, over=over) if over in (SAMPLED, MAX) else self

    def with_distribution(self, distribution: str) -> "Specification":
        """Choose how parameters fall into tolerance; an unknown word changes nothing."""
        known = distribution in (UNIFORM, NORMAL)
        return replace(self, distribution=distribution) if known else self
