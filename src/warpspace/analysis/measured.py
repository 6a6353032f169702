"""Measured machines: each error against its tolerance, and what the model predicts from them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.statistics import Statistics, statistics, volume_statistics
from warpspace.field.basis import ErrorField
from warpspace.field.evaluate import View, evaluate_first_order
from warpspace.field.grid import Workspace, build_grid
from warpspace.kinematics.model import Model
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import PARAMETERS, parameter
from warpspace.machine.tolerances import ToleranceSet

DEFAULT_NODES = 11
SHEARS = {"XY": (0, 1, "EC0Y", -1.0), "XZ": (0, 2, "EB0Z", 1.0), "YZ": (1, 2, "EA0Z", -1.0)}


@dataclass(frozen=True, slots=True)
class Check:
    """One measured error against its tolerance.

    Attributes
    ----------
    key : str
    value : float, µm or µrad
    centre, half_width : float or None, µm or µrad
        The tolerance; None where there is none.
    """

    key: str
    value: float
    centre: float | None
    half_width: float | None

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return parameter(self.key).unit

    @property
    def passes(self) -> bool | None:
        """Whether the value lies within the tolerance, limits included; None without one."""
        if self.centre is None or self.half_width is None:
            return None
        return bool(abs(self.value - self.centre) <= self.half_width * (1.0 + 1e-12))

    @property
    def mark(self) -> str:
        """O, X or a dash, as the thesis marks them in table 5-5."""
        return "–" if self.passes is None else "O" if self.passes else "X"


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured machine.

    Attributes
    ----------
    checks : tuple of Check
        One per error of the set.
    predicted : Statistics
        |E| of the loop over the working volume.
    predicted_nodes : Statistics
        The same over the nodes of the grid, each counted once, as the thesis has it.
    shear_urad : dict of str to float, µrad
        Angle by which the volume is out of square per plane, in the sign of the squareness
        parameter; out of a least-squares affine fit to the whole map.
    """

    checks: tuple[Check, ...]
    predicted: Statistics
    predicted_nodes: Statistics
    shear_urad: dict[str, float]


def check_errors(errors: ErrorSet, tolerances: ToleranceSet) -> tuple[Check, ...]:
    """Compare the amplitude of every error that is given with its tolerance.

    Parameters
    ----------
    errors : ErrorSet
    tolerances : ToleranceSet

    Returns
    -------
    tuple of Check
        In the order of the parameter table.
    """
    rows: list[Check] = []
    for key in (key for key in PARAMETERS if key in errors.functions):
        tolerance = tolerances.get(key)
        limits = (None, None) if tolerance is None else (tolerance.centre, tolerance.half_width)
        rows.append(Check(key, errors.amplitude(key), *limits))
    return tuple(rows)


def measured(
    model: Model,
    errors: ErrorSet,
    tolerances: ToleranceSet,
    workspace: Workspace,
    view: View | None = None,
    nodes: int | Sequence[int] = DEFAULT_NODES,
) -> Measured:
    """Judge a measured machine.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
        As measured.
    tolerances : ToleranceSet
        What it is to keep.
    workspace : Workspace
    view : View, optional
        The tool loop, absolute, by default.
    nodes : int or sequence of int, (3,), optional
        Nodes per axis of the predicted map.

    Returns
    -------
    Measured
    """
    grid = build_grid(model, workspace, nodes)
    view = view or View()
    field = evaluate_first_order(model, errors, grid.coordinates, view, grid.nominal_mm)
    return Measured(
        check_errors(errors, tolerances),
        volume_statistics(field, grid),
        statistics(field, grid.coordinates),
        shear(field),
    )


def shear(field: ErrorField) -> dict[str, float]:
    """Fit an affine map to an error field and give its shear per plane.

    Parameters
    ----------
    field : ErrorField
        Over a volume.

    Returns
    -------
    dict of str to float, µrad
        "XY", "XZ", "YZ": change of the right angle, in the sign of EC0Y, EB0Z and EA0Z.
    """
    point = field.nominal_mm.reshape(-1, 3)
    design = np.column_stack([np.ones(len(point)), point - point.mean(axis=0)])
    error = field.error_um.reshape(-1, 3)
    gradient = 1e3 * np.linalg.lstsq(design, error, rcond=None)[0][1:].T
    return {
        plane: float(sign * (gradient[first, second] + gradient[second, first]))
        for plane, (first, second, _, sign) in SHEARS.items()
    }
