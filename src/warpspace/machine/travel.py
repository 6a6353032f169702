"""Direction of travel: which way an axis reaches a position, and what is looked at of both ways."""

from enum import StrEnum


class TravelDirection(StrEnum):
    """What counts of errors that depend on the direction of travel.

    Forward is towards growing positions of the axis, as commanded. Errors that do not depend on the
    direction are the same in the first three and zero in the difference.
    """

    MEAN = "mean"
    FORWARD = "forward"
    BACKWARD = "backward"
    DIFFERENCE = "difference"


DIRECTION_WORDS = {
    TravelDirection.MEAN: "mean of both directions of travel",
    TravelDirection.FORWARD: "travelling forward",
    TravelDirection.BACKWARD: "travelling backward",
    TravelDirection.DIFFERENCE: "reversal: forward − backward",
}
"""How each is called on figures and pages."""
