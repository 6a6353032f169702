"""Plan and outcome of a test: poses, sensed directions, readings on the model."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warpspace.field.evaluate import View, build_basis, evaluate_exact
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.axes import TravelDirection, parameter
from warpspace.machine.curves.simple import Directional
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, Array

IndexArray = NDArray[np.intp]
NONE = -1  # site of reference of a reading without one
DEPENDENT = 1e-9
"""Independent share of a column of the set-up below which it is omitted."""


@dataclass(frozen=True)
class BenchPlan:
    """Path and sensing of a test on one machine.

    A site is a pose with its functional point. The error of a site is that of the tool relative to
    the workpiece (loop `relative`) at that point; a reading senses it in one direction, by itself
    or relative to another site.
    """

    coordinates: Mapping[str, Array]  # [n], mm or degrees; of all axes at each site, commanded
    point_mm: Array  # [n, 3]; nominal points in R
    travel: Mapping[str, Array]  # [n]; ±1: direction of travel of an axis, 0 if it does not move
    site: IndexArray  # [m]; of each reading
    direction: Array  # [m, 3]; sensed unit vectors in R
    against: IndexArray  # [m]; site whose error is subtracted, or `NONE`
    gain: Array  # [m]; 1 for readings in µm, 1000 / lever in mm for angles in µrad
    # [m]; of a bar whose change is read; infinite for a sensor of fixed direction
    length_mm: Array
    # [m]; labels of readings: targets, angles, runs, directions, channels
    marks: Mapping[str, Array]
    # [m]; readings per unit (µm, or µrad by the name) of an unknown of the set-up: the zero of a
    # scale, the position of a ball. They are no errors of the machine.
    setup: Mapping[str, Array]
    place: str  # description of the position on the machine
    path: tuple[IndexArray, ...] = ()  # sites of each stretch of the path, in order, for drawings
    squareness_key: str = ""  # the constant whose value a squareness is; of diagonals three

    @property
    def readings(self) -> int:
        return len(self.site)


def build_plan(
    coordinates: Mapping[str, Array],
    point_mm: Array,
    direction: Array,
    *,
    place: str,
    marks: Mapping[str, Array] | None = None,
    site: IndexArray | None = None,
    against: IndexArray | None = None,
    gain: Array | float = 1.0,
    length_mm: Array | float = np.inf,
    travel: Mapping[str, Array] | None = None,
    setup: Mapping[str, Array] | None = None,
    path: tuple[IndexArray, ...] | None = None,
    squareness_key: str = "",
) -> BenchPlan:
    """Build a plan; by default each site yields one reading of a fixed direction."""
    sites = len(point_mm)
    rows = np.arange(sites) if site is None else site
    count = len(rows)
    full = {name: np.broadcast_to(values, (sites,)) for name, values in coordinates.items()}
    return BenchPlan(
        full,
        point_mm,
        travel or {},
        rows,
        np.broadcast_to(direction, (count, 3)),
        np.full(count, NONE) if against is None else against,
        np.broadcast_to(np.asarray(gain, dtype=float), (count,)),
        np.broadcast_to(np.asarray(length_mm, dtype=float), (count,)),
        marks or {},
        _independent(setup or {}),
        place,
        (np.arange(sites),) if path is None else path,
        squareness_key,
    )


def _independent(setup: Mapping[str, Array]) -> dict[str, Array]:
    independent: dict[str, Array] = {}
    basis: list[Array] = []
    for name, column in setup.items():
        remainder = column.astype(float)
        for vector in basis:
            remainder = remainder - (vector @ remainder) * vector
        size = float(np.linalg.norm(remainder))
        if size > DEPENDENT * np.sqrt(len(column)):
            independent[name] = column
            basis.append(remainder / size)
    return independent


@dataclass(frozen=True, slots=True)
class BenchQuantity:
    """One quantity of a standard."""

    key: str  # in JSON; ends in its unit
    name: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """Quantities evaluated from readings."""

    quantities: tuple[BenchQuantity, ...]  # the most important first
    # further JSON keys: lists of numbers
    details: Mapping[str, object] = field(default_factory=dict[str, object])

    def __getitem__(self, key: str) -> float:
        return next(quantity.value for quantity in self.quantities if quantity.key == key)


UNITS = {"um": "µm", "urad": "µrad", "m": "µm/m"}


def build_outcome(
    rows: Iterable[tuple[str, str, float]], details: Mapping[str, object] | None = None
) -> Outcome:
    """Build an outcome of quantities: key, which ends in its unit, name and value."""
    quantities = (
        BenchQuantity(key, name, float(value), UNITS[key.rpartition("_")[2]])
        for key, name, value in rows
    )
    return Outcome(tuple(quantities), details or {})


RELATIVE = View(Loop.RELATIVE)


def simulate(scene: Scene, plan: BenchPlan, *, exact: bool = True) -> Array:
    """Compute the readings of a plan on the model of a scene, [m], µm (angles: µrad)."""
    if not exact:
        amplitudes = [scene.errors.amplitude(key) for key in scene.parameter_keys]
        return respond(scene, plan, scene.parameter_keys) @ np.array(amplitudes, dtype=float)
    error_um = np.zeros((len(plan.point_mm), 3))
    model = _mean_of_directions(scene)
    for rows, coordinates, errors in _by_travel(scene.errors, plan):
        field = evaluate_exact(model, errors, coordinates, RELATIVE, plan.point_mm[rows])
        error_um[rows] = field.error_um
    return sense(plan, error_um)


def sense(plan: BenchPlan, error_um: Array) -> Array:
    """Compute the readings of a plan, [m], from the errors of its sites, [n, 3], µm."""
    shift = _differences(plan, error_um)
    along = np.sum(shift * plan.direction, axis=-1)
    bars = np.isfinite(plan.length_mm)
    if bars.any():
        length = plan.length_mm[bars] * UM_PER_MM
        squared = np.sum(shift[bars] ** 2, axis=-1)
        actual = np.sqrt(length**2 + 2.0 * length * along[bars] + squared)
        along[bars] = (2.0 * length * along[bars] + squared) / (actual + length)
    return plan.gain * along


def respond(scene: Scene, plan: BenchPlan, keys: Sequence[str]) -> Array:
    """Compute the readings of a plan per unit of each error, [m, K], µm or µrad.

    The curve of each parameter along its axis is folded in, as in an `ErrorBasis`.
    """
    position = respond_sites(scene, plan, keys)
    along = np.sum(_differences(plan, position) * plan.direction, axis=-1)
    return (along * plan.gain).T


def respond_sites(scene: Scene, plan: BenchPlan, keys: Sequence[str]) -> Array:
    """Compute the errors of all sites per unit of each parameter, [K, n, 3], µm."""
    position = np.zeros((len(keys), len(plan.point_mm), 3))
    model = _mean_of_directions(scene)
    whole = np.array([scene.errors.amplitude(key) for key in keys], dtype=float)
    for rows, coordinates, errors in _by_travel(scene.errors, plan):
        basis = build_basis(model, errors, keys, coordinates, RELATIVE, plan.point_mm[rows])
        active = np.array([errors.amplitude(key) for key in keys], dtype=float)
        share = np.divide(active, whole, out=np.ones(len(keys)), where=whole != 0.0)
        position[:, rows] = basis.position * share[:, None, None]
    return position


def fit_setup(plan: BenchPlan, readings: Array) -> tuple[Array, Array]:
    """Fit the unknowns of the set-up; return them and the residual readings, [m]."""
    if not plan.setup:
        return np.zeros(0), readings
    design = np.stack(list(plan.setup.values()), -1)
    unknowns: Array = np.asarray(np.linalg.lstsq(design, readings, rcond=None)[0], dtype=float)
    return unknowns, readings - design @ unknowns


def _differences(plan: BenchPlan, values: Array) -> Array:
    shift = values[..., plan.site, :].copy()
    is_relative = plan.against != NONE
    shift[..., is_relative, :] -= values[..., plan.against[is_relative], :]
    return shift


def _by_travel(
    errors: ErrorSet, plan: BenchPlan
) -> Iterator[tuple[IndexArray, dict[str, Array], ErrorSet]]:
    """Split a path by direction of travel: sites, their axis positions, and the errors there."""
    directional = {
        key: function
        for key, function in errors.functions.items()
        if isinstance(function, Directional)
    }
    moving = {parameter(key).axis for key in directional}
    axes = [axis for axis in plan.travel if axis in moving]
    signs = [np.sign(plan.travel[axis]) for axis in axes] or [np.zeros(len(plan.point_mm))]
    combinations, number = np.unique(np.stack(signs, axis=-1), axis=0, return_inverse=True)
    for index, combination in enumerate(combinations):
        sites = np.flatnonzero(number.reshape(-1) == index)
        travel = dict(zip(axes, combination, strict=False))
        functions = dict(errors.functions)
        for key, function in directional.items():
            sign = travel.get(parameter(key).axis, 0.0)
            if sign:
                functions[key] = function.forward if sign > 0.0 else function.backward
        yield sites, {n: v[sites] for n, v in plan.coordinates.items()}, ErrorSet(functions)


def _mean_of_directions(scene: Scene) -> Model:
    return replace(scene.model, direction=TravelDirection.MEAN)
