"""The widest tolerances that still keep a limit of the volumetric error, and what stands behind."""

from warpspace.analysis.allocation.allocate import Allocation, Progress, Wish, allocate
from warpspace.analysis.allocation.ensemble import Ensemble, build_ensemble
from warpspace.analysis.allocation.scaling import largest_scale, scales_within

__all__ = [
    "Allocation",
    "Ensemble",
    "Progress",
    "Wish",
    "allocate",
    "build_ensemble",
    "largest_scale",
    "scales_within",
]
