"""What a test runs through and comes to: poses, what is sensed there, readings on the model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warpspace.field.evaluate import View, build_basis, evaluate_exact
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.axes import TravelDirection, parameter
from warpspace.machine.curves.simple import Directional
from warpspace.machine.errors import ErrorFunction, ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, Array

Whole = NDArray[np.intp]
NONE = -1  # in place of the site that a reading is taken against: none
DEPENDENT = 1e-9
"""Share of a column of the set-up that others do not give, below which it is left out."""


@dataclass(frozen=True)
class BenchPlan:
    """Path and sensing of a test on one machine.

    A site is a pose and a point that counts there. The error of a site is that of the tool against
    the workpiece (loop `relative`) at that point; a reading senses it in one direction, as it is or
    against that of another site.
    """

    coordinates: Mapping[str, Array]  # [n], mm or degrees; of all axes at each site, commanded
    point_mm: Array  # [n, 3]; nominal points in R
    travel: Mapping[str, Array]  # [n]; ±1: direction in which an axis has come, 0 where it stands
    site: Whole  # [m]; of each reading
    direction: Array  # [m, 3]; unit vectors in R that are sensed along
    against: Whole  # [m]; site whose error is subtracted, or `NONE`
    gain: Array  # [m]; 1 for readings in µm, 1000 / lever in mm for angles in µrad
    # [m]; of a bar whose change is read; infinite where a sensor looks in a fixed direction
    length_mm: Array
    # [m]; what tells readings apart: targets, angles, runs, directions, channels
    marks: Mapping[str, Array]
    # [m]; readings that one unit (µm, or µrad where the name says so) of an unknown of the set-up
    # gives: the zero of a scale, the place of a ball. They are no errors of the machine.
    setup: Mapping[str, Array]
    place: str  # where it stands, in words
    path: tuple[Whole, ...] = ()  # sites of each stretch of the path, in order, for drawings

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
    site: Whole | None = None,
    against: Whole | None = None,
    gain: Array | float = 1.0,
    length_mm: Array | float = np.inf,
    travel: Mapping[str, Array] | None = None,
    setup: Mapping[str, Array] | None = None,
    path: tuple[Whole, ...] | None = None,
) -> BenchPlan:
    """Put a plan together; by default each site gives one reading of a fixed direction."""
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
    )


def _independent(setup: Mapping[str, Array]) -> dict[str, Array]:
    kept: dict[str, Array] = {}
    basis: list[Array] = []
    for name, column in setup.items():
        rest = column.astype(float)
        for vector in basis:
            rest = rest - (vector @ rest) * vector
        size = float(np.linalg.norm(rest))
        if size > DEPENDENT * np.sqrt(len(column)):
            kept[name] = column
            basis.append(rest / size)
    return kept


@dataclass(frozen=True, slots=True)
class BenchQuantity:
    """One number of a standard."""

    key: str  # in JSON; ends in its unit
    name: str  # in words
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """What readings come to."""

    quantities: tuple[BenchQuantity, ...]  # the most important first
    # what else JSON has: lists of numbers, ready to be spelled
    details: Mapping[str, object] = field(default_factory=dict[str, object])

    def __getitem__(self, key: str) -> float:
        return next(quantity.value for quantity in self.quantities if quantity.key == key)


RELATIVE = View(Loop.RELATIVE)


def simulate(scene: Scene, plan: BenchPlan, *, exact: bool = True) -> Array:
    """Take the readings of a plan on the model of a scene, [m], µm (angles: µrad)."""
    if not exact:
        amplitudes = [scene.errors.amplitude(key) for key in scene.parameter_keys]
        return respond(scene, plan, scene.parameter_keys) @ np.array(amplitudes, dtype=float)
    found = np.zeros((len(plan.point_mm), 3))
    model = _both_ways(scene)
    for rows, errors in _by_travel(scene.errors, plan):
        coordinates = {name: values[rows] for name, values in plan.coordinates.items()}
        field = evaluate_exact(model, errors, coordinates, RELATIVE, plan.point_mm[rows])
        found[rows] = field.error_um
    return sense(plan, found)


def sense(plan: BenchPlan, error_um: Array) -> Array:
    """Give what the sensors of a plan read, [m], of the errors of its sites, [n, 3], µm."""
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
    """Give the readings of a plan as a linear function of errors, [m, K], µm or µrad per unit.

    The curve of each parameter along its axis is folded in, as in an `ErrorBasis`.
    """
    position = respond_sites(scene, plan, keys)
    along = np.sum(_differences(plan, position) * plan.direction, axis=-1)
    return (along * plan.gain).T


def respond_sites(scene: Scene, plan: BenchPlan, keys: Sequence[str]) -> Array:
    """Give the errors of all sites as a linear function of errors, [K, n, 3], µm per unit."""
    position = np.zeros((len(keys), len(plan.point_mm), 3))
    model = _both_ways(scene)
    for rows, errors in _by_travel(scene.errors, plan):
        coordinates = {name: values[rows] for name, values in plan.coordinates.items()}
        basis = build_basis(model, errors, keys, coordinates, RELATIVE, plan.point_mm[rows])
        share = np.array([_share(scene.errors, errors, key) for key in keys])
        position[:, rows] = basis.position * share[:, None, None]
    return position


def fit_setup(plan: BenchPlan, readings: Array) -> tuple[Array, Array]:
    """Fit the unknowns of the set-up; give them and what is left of the readings, [m]."""
    if not plan.setup:
        return np.zeros(0), readings
    design = np.stack(list(plan.setup.values()), -1)
    found: Array = np.asarray(np.linalg.lstsq(design, readings, rcond=None)[0], dtype=float)
    return found, readings - design @ found


def _differences(plan: BenchPlan, values: Array) -> Array:
    shift = values[..., plan.site, :].copy()
    held = plan.against != NONE
    shift[..., held, :] -= values[..., plan.against[held], :]
    return shift


def _by_travel(errors: ErrorSet, plan: BenchPlan) -> Iterator[tuple[Whole, ErrorSet]]:
    every = np.arange(len(plan.point_mm))
    functions = errors.functions.items()
    directional = {parameter(key).axis for key, one in functions if isinstance(one, Directional)}
    axes = [axis for axis in plan.travel if axis in directional]
    if not axes:
        yield every, errors
        return
    ways = np.stack([np.sign(plan.travel[axis]) for axis in axes], axis=-1)
    found, number = np.unique(ways, axis=0, return_inverse=True)
    for index, way in enumerate(found):
        yield (
            every[number.reshape(-1) == index],
            _travelling(errors, dict(zip(axes, way, strict=True))),
        )


def _both_ways(scene: Scene) -> Model:
    return replace(scene.model, direction=TravelDirection.MEAN)


def _travelling(errors: ErrorSet, way: Mapping[str, float]) -> ErrorSet:
    def chosen(key: str, function: ErrorFunction) -> ErrorFunction:
        sign = way.get(parameter(key).axis, 0.0)
        if not sign or not isinstance(function, Directional):
            return function
        return function.forward if sign > 0.0 else function.backward

    return ErrorSet({key: chosen(key, function) for key, function in errors.functions.items()})


def _share(errors: ErrorSet, acting: ErrorSet, key: str) -> float:
    whole, part = errors.functions.get(key), acting.functions.get(key)
    if whole is None or part is None or whole is part:
        return 1.0
    amplitude = whole.amplitude
    return part.amplitude / amplitude if amplitude else 1.0
