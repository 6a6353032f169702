"""Measured machines: errors against tolerances, what they predict, how far that is certain."""

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numpy as np

from warpspace.analysis.cases import Case, Places, Plan
from warpspace.analysis.distribution import SIGMAS, Distribution, Draws
from warpspace.analysis.doubt import Doubt, find_doubt
from warpspace.analysis.statistics import Statistics, statistics, volume_statistics
from warpspace.exceptions import SceneError
from warpspace.field.evaluate import ErrorField, amplitudes_of, evaluate_first_order
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.machine.errors import ErrorSet, ToleranceSet
from warpspace.scene.model import Scene, choose_view, evaluate_grid
from warpspace.units import Array

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
    """A measured machine."""

    checks: tuple[Check, ...]  # one per error of the set
    predicted: Statistics  # |E| of the loop over the working volume
    # the same over the nodes of the grid, each counted once, as the thesis has it
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
    loop: Loop | str = Loop.TOOL,
    grid: int | Sequence[int] = PREDICTED_NODES,
) -> Measured:
    """Judge the errors of a scene against tolerances and predict its volumetric error.

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


SIGMAS_OF = {Distribution.NORMAL: SIGMAS, Distribution.UNIFORM: 3.0**0.5}
"""Half width in standard uncertainties."""


@dataclass(frozen=True, eq=False)
class UncertainCase(Case):
    """A measured machine whose errors are off by their standard uncertainties."""

    doubt: Doubt = dataclass_field(kw_only=True)
    errors: ErrorSet = dataclass_field(kw_only=True)  # as measured

    def machines(self, rng: np.random.Generator, count: int) -> Array:
        """Draw by how much the errors are off, and one last, [count, K + 1]."""
        keys, law = self.doubt.keys, Distribution(self.draws.distribution)
        unit = Draws(keys, np.zeros(len(keys)), np.full(len(keys), SIGMAS_OF[law]), law)
        found = self.doubt.draw(rng, count, unit.draw(rng, count))
        return np.column_stack([found, np.ones(count)])

    def responses(self, places: Places) -> Array:
        """Give responses to what is off, the measured error last, [3, K + 1, N]."""
        model, view, doubt = self.model, self.view, self.doubt
        at, point = places.coordinates, places.point_mm
        parts = doubt.respond(model, at, view, point).position
        measured = evaluate_first_order(model, self.errors, at, view, point).error_um
        both = np.concatenate([parts, measured[None]]).reshape(len(doubt.keys) + 1, -1, 3)
        return np.ascontiguousarray(np.moveaxis(both, -1, 0))


def uncertain_case(
    scene: Scene,
    plan: Plan,
    loop: Loop = Loop.TOOL,
    distribution: Distribution = Distribution.NORMAL,
) -> UncertainCase:
    """Give what a measured machine may be: its errors, off as their uncertainties say."""
    if (doubt := find_doubt(scene, loop)) is None:
        problem = "has no uncertainties; expected an [uncertainty] section, for instance EXX = 0.4"
        raise SceneError(scene.name, [problem])
    size = SIGMAS_OF[distribution] * np.diagonal(doubt.covariance) ** 0.5
    drawn = Draws(doubt.keys, amplitudes_of(scene.errors, doubt.keys), size, distribution)
    view = scene.view(loop)
    return UncertainCase(
        scene.model, drawn, scene.workspace, view, plan, doubt=doubt, errors=scene.errors
    )
