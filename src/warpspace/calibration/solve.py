"""Weighted least squares of errors and unknown set-ups to readings, and what data can tell."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.calibration.kinds import BLIND, Prediction
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import find_kind
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import PARAMETERS, Parameter, direction_index, is_linear, parameter
from warpspace.machine.errors import Constant, ErrorSet, Ramp
from warpspace.scene.model import Scene
from warpspace.units import Array

SHARE = 1e-3  # of a combination, below which a parameter is not named as part of it


@dataclass(frozen=True, slots=True)
class Rank:
    """What can be told apart."""

    rank: int  # independent combinations of the parameters that the readings show
    kept: tuple[str, ...]  # parameters that are determined once those left out are held
    unseen: tuple[str, ...]  # parameters without any effect on the readings, whatever the set-up
    # by each parameter that looks like others (and what the set-up leaves unknown; it alone where
    # there are none): how much of each of these looks like a unit of it
    alike: Mapping[str, Mapping[str, float]]

    @property
    def confounded(self) -> tuple[tuple[str, ...], ...]:
        """Groups whose first parameter looks like a combination of the others."""
        return tuple((key, *others) for key, others in self.alike.items())

    def is_identifiable(self, key: str) -> bool:
        return key in self.kept and not any(key in group for group in self.confounded)

    @property
    def null_space(self) -> list[dict[str, float]]:
        """Sums of parameters that do not show in the readings."""
        alike = [
            {first: 1.0, **{key: -share for key, share in row.items()}}
            for first, row in self.alike.items()
        ]
        return [*({key: 1.0} for key in self.unseen), *alike]

    def confounded_with(self, key: str) -> dict[str, float]:
        """Give the sum of parameters that the readings tell where they tell one of them in part."""
        others = {first: row[key] for first, row in self.alike.items() if key in row}
        return {key: 1.0, **others}


def find_rank(
    keys: Sequence[str], by_parameter: Array, by_unknown: Array, blind: float = BLIND
) -> Rank:
    """Go through the parameters in order and see which adds something new.

    The likelier come first: where two look alike the later one is left out. Readings are weighted;
    their changes are per unit of each parameter, [N, K], and of each unknown, [N, m].
    """
    set_up = orthonormal(by_unknown)
    norms = np.linalg.norm(by_parameter, axis=0)
    largest = norms.max(initial=0.0)
    units = without(by_parameter / np.where(norms > 0.0, norms, 1.0), set_up)
    kept: list[int] = []
    basis: list[Array] = []
    unseen: list[str] = []
    alike: dict[str, Mapping[str, float]] = {}
    for at, key in enumerate(keys):
        if norms[at] <= BLIND * largest or not norms[at]:
            unseen.append(key)
            continue
        rest = units[:, at]
        for _ in range(2):  # twice: the second pass takes what rounding left
            for direction in basis:
                rest = rest - direction * (direction @ rest)
        if np.linalg.norm(rest) > blind:
            kept.append(at)
            basis.append(rest / np.linalg.norm(rest))
            continue
        alike[key] = {}
        if kept and np.linalg.norm(units[:, at]) > blind:
            shares, *_ = np.linalg.lstsq(units[:, kept], units[:, at], rcond=None)
            alike[key] = {
                keys[one]: float(share * norms[at] / norms[one])
                for one, share in zip(kept, shares, strict=True)
                if abs(share) > SHARE
            }
    return Rank(len(kept), tuple(keys[at] for at in kept), tuple(unseen), alike)


def orthonormal(columns: Array) -> Array:
    """Give an orthonormal basis of columns, [N, r]."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, values > 1e-12 * values[0]]


def without(columns: Array, basis: Array) -> Array:
    """Take what lies in a basis out of columns; twice, for rounding."""
    once = columns - basis @ (basis.T @ columns)
    return once - basis @ (basis.T @ once)


def spell_rank(rank: Rank, slopes: Collection[str] = ()) -> tuple[str, ...]:
    def name(key: str) -> str:
        return f"the slope of {key}" if key in slopes else key

    words: list[str] = []
    if rank.unseen:
        words.append(f"{', '.join(rank.unseen)}: no effect on these readings")
    alone = [name(group[0]) for group in rank.confounded if len(group) == 1]
    if alone:
        words.append(
            f"{', '.join(alone)}: cannot be told apart from the unknown place of the set-up"
        )
    for group in (group for group in rank.confounded if len(group) > 1):
        first, *others = map(name, group)
        joined = ", ".join(others[:-1]) + " and " + others[-1] if others[1:] else others[0]
        if others[1:]:
            words.append(f"{first} looks in these readings like a combination of {joined}")
        else:
            words.append(f"{first} and {joined} cannot be told apart by these readings")
    return tuple(words)


AUTO = "auto"
CURVES = ("constant", "ramp")


@dataclass(frozen=True, slots=True)
class FitParameters:
    """Parameters to be found, and the errors that their amplitudes give."""

    keys: tuple[str, ...]  # (K,)
    errors: ErrorSet  # the scene's errors, with a curve for each parameter
    start: Array  # [K], µm or µrad; amplitudes of the scene

    def errors_with(self, amplitudes: Array) -> ErrorSet:
        functions = dict(self.errors.functions)
        for key, value in zip(self.keys, amplitudes, strict=True):
            functions[key] = functions[key].with_amplitude(float(value))
        return ErrorSet(functions)

    def only(self, keys: Sequence[str]) -> "FitParameters":
        start = np.array([self.start[self.keys.index(key)] for key in keys], dtype=float)
        return replace(self, keys=tuple(keys), start=start)

    @property
    def slopes(self) -> frozenset[str]:
        ramps = (key for key in self.keys if isinstance(self.errors.functions[key], Ramp))
        return frozenset(ramps)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(parameter(key) for key in self.keys)


def build_terms(scene: Scene, keys: Sequence[str]) -> FitParameters:
    """Give each parameter a curve: the scene's own, else what its kind suggests."""
    functions = dict(scene.errors.functions)
    names: list[str] = []
    for text in keys:
        key, _, curve = text.partition(":")
        row = parameter(key)
        if row.axis not in scene.machine.axes:
            raise UnknownNameError("error parameter", key, scene.machine.allowed_keys)
        if key in names:
            raise OptionError(f"{{fit}} {key} is given twice; expected each parameter once")
        if curve and curve not in CURVES:
            raise OptionError(f"{{fit}} {text!r}; expected {key} with :constant or :ramp behind it")
        names.append(key)
        linear = scene.machine.axes[row.axis].is_linear
        if curve or key not in functions:
            ramp = curve == "ramp" or (not curve and linear and not row.is_constant)
            kind = Ramp if ramp and not row.is_constant else Constant
            functions[key] = kind(scene.axis_span(row.axis))
    errors = ErrorSet(functions)
    return FitParameters(
        tuple(names), errors, np.array([errors.amplitude(key) for key in names], float)
    )


def read_keys(text: str, _scene: Scene) -> tuple[str, ...] | None:
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if [part.lower() for part in parts] == [AUTO]:
        return None
    if not parts or any(part.lower() == AUTO for part in parts):
        raise ValueError("expected auto, or keys such as EX0B,EZ0B")
    known = {key.lower(): key for key in PARAMETERS}
    spelled: list[str] = []
    for part in parts:
        key, colon, curve = part.partition(":")
        spelled.append(known.get(key.strip().lower(), key.strip()) + colon + curve.strip().lower())
    return tuple(spelled)


def automatic(scene: Scene, together: Sequence[Readings]) -> tuple[str, ...]:
    """List the parameters that ``--fit auto`` looks for in several sets of readings."""
    keys: dict[str, None] = {}
    for readings in together:
        for key in find_kind(readings.kind).automatic_keys(readings, scene):
            row = parameter(key)
            rotary = not scene.machine.axes[row.axis].is_linear
            whole = readings.kind in {"points", "tracker", "positions", "lengths"}
            if whole and rotary and not row.is_constant and key not in scene.errors:
                continue  # a constant there is a location error by another name
            keys[key] = None
    return tuple(sorted(keys, key=lambda key: key not in scene.errors and is_straightness(key)))


def is_straightness(key: str) -> bool:
    """Tell whether a parameter is a straightness error; its slope looks like a squareness."""
    row = parameter(key)
    return (
        not row.is_constant
        and not row.is_rotation
        and is_linear(row.axis)
        and row.direction != direction_index(row.axis)
    )


Watch = Callable[[], object]


def unwatched() -> None:
    """Let the work go on."""


@dataclass(frozen=True, slots=True)
class MeasurementModel:
    """Readings of one or more files."""

    scene: Scene
    sets: tuple[Readings, ...]
    # (m,); what the set-ups leave unknown; files that name the same session share it
    unknowns: tuple[str, ...]
    # called before each evaluation of the model; what it raises ends the work
    watch: Watch = unwatched

    @classmethod
    def of(
        cls, scene: Scene, sets: Sequence[Readings], watch: Watch = unwatched
    ) -> "MeasurementModel":
        names = (name for one in sets for name in find_kind(one.kind).unknowns(one))
        return cls(scene, tuple(sets), tuple(dict.fromkeys(names)), watch)

    def start(self) -> Array:
        """Give values of the unknowns to begin with, [m], mm."""
        values: dict[str, float] = {}
        for one in self.sets:
            kind = find_kind(one.kind)
            for name, value in zip(kind.unknowns(one), kind.start(one), strict=True):
                values.setdefault(name, float(value))
        return np.array([values[name] for name in self.unknowns])

    def residuals(self, terms: FitParameters, amplitudes: Array, unknown: Array) -> list[Array]:
        """Give observed − predicted of each set with the exact model, [n, d] each, mm."""
        self.watch()
        guess = Prediction(terms.errors_with(amplitudes), self.unknowns, unknown)
        return [
            one.observed_mm - find_kind(one.kind).observe(self.scene, one, guess)
            for one in self.sets
        ]

    def derivatives(
        self, terms: FitParameters, amplitudes: Array, unknown: Array
    ) -> tuple[Array, Array]:
        """Give the change of all predictions, [N, K] per µm or µrad and [N, m] per mm."""
        self.watch()
        guess = Prediction(terms.errors_with(amplitudes), self.unknowns, unknown)
        by_parameter: list[Array] = []
        by_unknown: list[Array] = []
        for one in self.sets:
            gains, own = find_kind(one.kind).slopes(self.scene, one, guess, terms.keys)
            by_parameter.append(gains.reshape(one.observed_mm.size, len(terms.keys)))
            by_unknown.append(own.reshape(one.observed_mm.size, len(self.unknowns)))
        return np.vstack(by_parameter), np.vstack(by_unknown)

    def weights(self, otherwise_mm: float = 1.0) -> list[Array]:
        """Give the weight of each component of each reading, [n·d], 1/mm."""
        return [
            np.full(one.observed_mm.size, 1.0 / otherwise_mm)
            if one.sigma_mm is None
            else np.repeat(1.0 / one.sigma_mm, one.observed_mm.shape[1])
            for one in self.sets
        ]

    @property
    def positions(self) -> dict[str, Array]:
        """Positions of all axes at all readings, [n], mm or degrees."""
        each = [one.coordinates for one in self.sets]
        return {axis: np.concatenate([at[axis] for at in each]) for axis in each[0]}

    @property
    def blind(self) -> float:
        """Share of its effect below which nothing is told of a parameter."""
        return max(find_kind(one.kind).blind for one in self.sets)

    @property
    def has_uncertainties(self) -> bool:
        return all(one.sigma_mm is not None for one in self.sets)

    @property
    def size(self) -> int:
        return sum(one.observed_mm.size for one in self.sets)


def rms_mm(residuals: Sequence[Array]) -> float:
    """Root mean square of the lengths of residual vectors, mm."""
    lengths = np.concatenate([np.linalg.norm(one, axis=-1) for one in residuals])
    return float(np.sqrt(np.mean(lengths**2)))


def named(unknowns: Sequence[str], values: Array) -> dict[str, float]:
    return {name: float(value) for name, value in zip(unknowns, values, strict=True)}


ROBUST_SCALE = 1.345  # standard deviations at which the soft L1 loss begins to trust a reading less
MAD = 1.4826  # standard deviation of a normal distribution per median absolute deviation
MOST_ROUNDS = 20  # times that a robust fit weighs its readings anew


@dataclass(frozen=True, slots=True)
class Solved:
    """A solution, the weighted derivatives there, and what a component scatters if robust."""

    amplitudes: Array
    unknown: Array
    weighted: Array
    scale: float | None = None
    trust: float = 1.0  # square of what multiplies the rows of `weighted`, beside their weights


def solve(
    stack: MeasurementModel,
    terms: FitParameters,
    prior: tuple[Array, Array] | None = None,
    unknown: Array | None = None,
    *,
    robust: bool = False,
) -> Solved:
    from scipy.optimize import OptimizeResult, least_squares

    weights = np.concatenate(stack.weights())
    count = len(terms.keys)
    start = np.concatenate([terms.start, stack.start() if unknown is None else unknown])
    if not len(start):
        return Solved(start, start, np.zeros((stack.size, 0)))

    def missed(values: Array) -> Array:
        rows = stack.residuals(terms, values[:count], values[count:])
        return np.concatenate([row.ravel() for row in rows]) * weights

    def slopes(values: Array) -> Array:
        both = stack.derivatives(terms, values[:count], values[count:])
        return -weights[:, None] * np.hstack(both)

    trust, unit = np.ones(stack.size), None
    freedom = max(stack.size - len(start) + (0 if prior is None else count), 1)

    def function(values: Array) -> Array:
        rows = np.sqrt(trust) * missed(values)
        return rows if prior is None else np.append(rows, (values[:count] - prior[0]) / prior[1])

    def jacobian(values: Array) -> Array:
        rows = np.sqrt(trust)[:, None] * slopes(values)
        if prior is None:
            return rows
        own = np.hstack([np.diag(1.0 / prior[1]), np.zeros((count, len(values) - count))])
        return np.vstack([rows, own])

    for _ in range(MOST_ROUNDS if robust else 1):
        scale = np.linalg.norm(jacobian(start), axis=0)
        found: OptimizeResult = least_squares(
            function,
            start,
            jac=jacobian,  # pyright: ignore[reportArgumentType]
            x_scale=1.0 / np.where(scale > 0.0, scale, 1.0),
            xtol=1e-10,
            ftol=1e-13,
            gtol=1e-13,
            max_nfev=200,
        )
        if not found.success:
            raise OptionError(
                f"the fit does not converge ({found.message}); expected readings near to the model."
                " Leave out outliers ({robust}), or look for fewer parameters ({fit} KEYS)"
            )
        moved = float(np.abs((found.x - start) * scale).max(initial=0.0))
        start = found.x
        if not robust:
            break
        rows = missed(start)
        middle = float(np.median(np.abs(rows)))
        unit = max(MAD * middle * np.sqrt(stack.size / freedom), 1e-12)
        trust = 1.0 / np.sqrt(1.0 + (rows / (ROBUST_SCALE * unit)) ** 2)
        if moved < 1e-9 * unit:
            break
    if unit is not None:
        variance = unit**2 * _robust_variance(missed(start) / unit, freedom)
        trust = np.full(stack.size, 1.0 / max(variance, float(stack.has_uncertainties)))
    return Solved(start[:count], start[count:], jacobian(start), unit, float(trust[0]))


def _robust_variance(rows: Array, freedom: int) -> float:
    """Give what takes the place of the residual variance where rows count by the soft L1 loss.

    κ²·Σψ²/(n − p)/(mean of ψ′)², Huber and Ronchetti, Robust Statistics (2nd edition), 7.6.
    """
    falls = 1.0 + (rows / ROBUST_SCALE) ** 2
    slope = falls**-1.5
    mean, share = float(slope.mean()), 1.0 - freedom / len(rows)
    correction = 1.0 + share * float(slope.var()) / mean**2
    return correction**2 * float(np.sum(rows**2 / falls)) / freedom / mean**2


def covariance_of(solved: Solved, count: int) -> Array:
    """Give the covariance of the parameters, [K, K]: for a weight of one, unless robust."""
    scale = np.linalg.norm(solved.weighted, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    triangle = np.linalg.qr(solved.weighted / scale, mode="r")
    inverse = np.linalg.pinv(triangle) / scale[:, None]
    return (inverse @ inverse.T)[:count, :count]
