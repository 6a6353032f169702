"""Measured machines: errors against tolerances, and the predicted volumetric error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.statistics import Statistics, statistics, volume_statistics
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.machine.errors import ErrorSet, ToleranceSet
from warpspace.scene.model import Scene, choose_view, evaluate_grid

PREDICTED_NODES = 11  # per axis
SHEARS = {"XY": (0, 1, -1.0), "XZ": (0, 2, 1.0), "YZ": (1, 2, -1.0)}


@dataclass(frozen=True, slots=True)
class Check:
    """One measured error against its tolerance."""

    key: str
    value: float  # µm or µrad
    centre: float | None  # µm or µrad; the tolerance; None where there is none
    half_width: float | None

    @property
    def unit(self) -> str:
        return parameter(self.key).unit

    @property
    def passes(self) -> bool | None:
        """Verdict: within the tolerance, limits included; None without one."""
        if self.centre is None or self.half_width is None:
            return None
        return bool(abs(self.value - self.centre) <= self.half_width * (1.0 + 1e-12))


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured machine."""

    checks: tuple[Check, ...]  # one per error of the set
    predicted: Statistics  # |E| of the loop over the working volume
    # the same over the nodes of the grid, each with the same weight
    predicted_nodes: Statistics
    # angle by which the volume is out of square per plane, in the sign of the squareness parameter;
    # out of a least-squares affine fit to the whole map
    shear_urad: dict[str, float]


def check_errors(errors: ErrorSet, tolerances: ToleranceSet) -> tuple[Check, ...]:
    rows: list[Check] = []
    for key in (key for key in PARAMETERS if key in errors.functions):
        tolerance = tolerances.get(key)
        limits = (None, None) if tolerance is None else (tolerance.centre, tolerance.half_width)
        rows.append(Check(key, errors.amplitude(key), *limits))
    return tuple(rows)


def measured(
    scene: Scene,
    *,
    tolerances: ToleranceSet | None = None,
    loop: Loop | str | None = None,
    grid: int | Sequence[int] = PREDICTED_NODES,
) -> Measured:
    """Check the errors of a scene against tolerances and predict its volumetric error.

    Parameters
    ----------
    scene : Scene
    tolerances : ToleranceSet, optional
        The scene's own by default.
    loop : Loop or str, optional
    grid : int or sequence of int, (3,), optional
        Nodes per axis of the predicted map.

    Returns
    -------
    Measured
    """
    nodes = build_grid(scene.model, scene.workspace, grid)
    field = evaluate_grid(scene, nodes, choose_view(scene, loop))
    return Measured(
        check_errors(scene.errors, scene.tolerances if tolerances is None else tolerances),
        volume_statistics(field, nodes),
        statistics(field, nodes.coordinates),
        shear(field),
    )


def shear(field: ErrorField) -> dict[str, float]:
    point = field.nominal_mm.reshape(-1, 3)
    design = np.column_stack([np.ones(len(point)), point - point.mean(axis=0)])
    error = field.error_um.reshape(-1, 3)
    gradient = 1e3 * np.linalg.lstsq(design, error, rcond=None)[0][1:].T
    return {
        plane: float(sign * (gradient[first, second] + gradient[second, first]))
        for plane, (first, second, sign) in SHEARS.items()
    }
