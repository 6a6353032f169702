"""Units of the product and the factors between them.

Lengths are millimetres, errors micrometres, small angles microradians. Rotary positions are degrees
in files and on screen and radians inside. A millimetre times a microradian is a nanometre.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Array of doubles; the shape is given in each docstring."""

UM_PER_MM = 1e3
MM_PER_UM = 1e-3
RAD_PER_URAD = 1e-6
URAD_PER_RAD = 1e6
UM_PER_MM_URAD = 1e-3
"""Displacement in µm of a lever of 1 mm turned by 1 µrad."""

MICROMETRE = "µm"
MICRORADIAN = "µrad"
