"""The difference of two scenes over one working volume."""

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.scene.pipeline import ScenePicture

SAME_MM = 1e-6


def difference_field(first: ScenePicture, second: ScenePicture) -> ErrorField:
    """Subtract the errors of a scene from those of another, B − A, node by node.

    Raises
    ------
    OptionError
        If the scenes are not evaluated at the same points.
    """
    a, b = first.field, second.field
    if first.grid.shape != second.grid.shape or np.abs(a.nominal_mm - b.nominal_mm).max() > SAME_MM:
        raise OptionError(
            f"{first.scene.name} and {second.scene.name} cannot be compared: their working volumes"
            " differ ([workspace] of both must give the same box)"
        )
    return ErrorField(
        a.nominal_mm, b.error_um - a.error_um, b.orientation_urad - a.orientation_urad
    )
