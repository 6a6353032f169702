"""The widest tolerances that still keep a limit of the volumetric error, and what stands behind."""

from warpspace.analysis.allocation.allocate import Progress, allocate
from warpspace.analysis.allocation.ensemble import Ensemble, build_ensemble
from warpspace.analysis.allocation.scaling import largest_scale, scales_within
from warpspace.analysis.allocation.wish import Allocation, Wish

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
