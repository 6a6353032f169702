"""What a compensation does in each direction of travel, for errors that depend on it."""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.field.basis import ErrorField
from warpspace.field.grid import Grid
from warpspace.formats.compensation.controller import Controller, toward
from warpspace.machine.errors import ErrorSet
from warpspace.machine.travel import DIRECTION_WORDS, TravelDirection

HELD = 0.05
"""Share of the reversal that may be left where a format holds it: the steps of its table."""
LEAST_UM = 0.01
"""A reversal below it is none."""


@dataclass(frozen=True)
class BeforeAfter:
    """The errors over the working volume before and after a compensation.

    Attributes
    ----------
    before, after : ErrorField
    grid : Grid
    """

    before: ErrorField
    after: ErrorField
    grid: Grid

    @property
    def before_statistics(self) -> Statistics:
        """Of the scene as it is."""
        return volume_statistics(self.before, self.grid)

    @property
    def after_statistics(self) -> Statistics:
        """Of what is left."""
        return volume_statistics(self.after, self.grid)

    def tilt_urad(self, field: ErrorField) -> tuple[float, float]:
        """Give mean, by volume, and largest tilt of the tool axis in one of the fields, µrad."""
        tilt = np.linalg.norm(field.orientation_urad, axis=-1)
        return float(np.sum(self.grid.weights * tilt)), float(tilt.max())


def evaluated(controller: Controller, grid: Grid, direction: str) -> BeforeAfter:
    """Evaluate a machine before and after a compensation.

    Parameters
    ----------
    controller : Controller
    grid : Grid
    direction : str
        Of travel.
    """
    at, nominal, scene = grid.coordinates, grid.nominal_mm, toward(controller.scene, direction)
    before = controller.without().field(at, nominal, scene)
    return BeforeAfter(before, controller.field(at, nominal, scene), grid)


def reversal_notes(
    there: BeforeAfter, back: BeforeAfter, errors: ErrorSet, direction: str
) -> tuple[str, ...]:
    """Say what of the reversal a format has no place for.

    Parameters
    ----------
    there, back : BeforeAfter
        Forward and backward.
    errors : ErrorSet
        Of the scene.
    direction : str
        What the scene looks at.

    Returns
    -------
    tuple of str
        Nothing where hardly any of it is left.
    """
    before, after = (
        float(np.linalg.norm(one.error_um - other.error_um, axis=-1).max())
        for one, other in ((there.before, back.before), (there.after, back.after))
    )
    if after <= max(LEAST_UM, HELD * before):
        return ()
    keys = ", ".join(key for key, curve in errors.functions.items() if curve.has_directions)
    words = DIRECTION_WORDS[TravelDirection(direction)]
    said = (
        f"direction of travel is not held here, or not all of it: by {keys} forward and backward"
        f" differ by up to {before:.3g} µm before and {after:.3g} µm after (where one value stands"
        f" for both: {words})"
    )
    return (said,)
