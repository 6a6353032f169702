"""Verdicts on limits and tolerances (ISO 14253-1)."""

from enum import StrEnum

VERDICT_PROBABILITY = 0.95  # that a stated verdict is correct, at least


class Verdict(StrEnum):
    """A verdict on a limit or a tolerance."""

    PASS = "pass"  # noqa: S105 - no password
    FAIL = "fail"
    UNDECIDED = "undecided"

    @classmethod
    def from_probability(cls, probability: float | None) -> "Verdict":
        """Return the verdict for a probability of conformance; None: the probability is unknown."""
        if probability is None or 1.0 - VERDICT_PROBABILITY < probability < VERDICT_PROBABILITY:
            return cls.UNDECIDED
        return cls.PASS if probability >= VERDICT_PROBABILITY else cls.FAIL
