"""Weighted least squares of errors and set-ups to readings, and the rank of the data."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.calibration.kinds import RANK_TOLERANCE, Prediction
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import find_kind
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import PARAMETERS, Parameter, direction_index, is_linear, parameter
from warpspace.machine.errors import Constant, ErrorSet, Ramp
from warpspace.scene.model import Scene
from warpspace.units import Array

MIN_SHARE = 1e-3  # coefficient below which a parameter is not named as part of a combination


@dataclass(frozen=True, slots=True)
class Rank:
    """Estimable and confounded parameters of a set of readings."""

    rank: int  # independent combinations of the parameters that affect the readings
    independent: tuple[str, ...]  # parameters that are determined if the others are fixed
    without_effect: tuple[str, ...]  # parameters without effect on the readings
    # by confounded parameter: the equal change of independent parameters, per unit of it; empty
    # where it is confounded with the unknowns of the set-up alone
    dependent: Mapping[str, Mapping[str, float]]

    @property
    def confounded(self) -> tuple[tuple[str, ...], ...]:
        """Groups whose first parameter is confounded with a combination of the others."""
        return tuple((key, *factors) for key, factors in self.dependent.items())

    def is_identifiable(self, key: str) -> bool:
        return key in self.independent and not any(key in group for group in self.confounded)

    @property
    def null_space(self) -> list[dict[str, float]]:
        """Sums of parameters without effect on the readings."""
        sums = [
            {key: 1.0, **{other: -factor for other, factor in factors.items()}}
            for key, factors in self.dependent.items()
        ]
        return [*({key: 1.0} for key in self.without_effect), *sums]

    def confounded_with(self, key: str) -> dict[str, float]:
        """Return the sum of parameters that is estimable where one of them is confounded."""
        factors = {other: row[key] for other, row in self.dependent.items() if key in row}
        return {key: 1.0, **factors}


def find_rank(
    keys: Sequence[str],
    by_parameter: Array,
    by_unknown: Array,
    rank_tolerance: float = RANK_TOLERANCE,
) -> Rank:
    """Find the parameters that are independent, in the order of the keys.

    Of two confounded parameters the later one is dependent. Readings are weighted; their changes
    are per unit of each parameter, [N, K], and of each unknown, [N, m].
    """
    set_up = orthonormal_basis(by_unknown)
    norms = np.linalg.norm(by_parameter, axis=0)
    largest = norms.max(initial=0.0)
    units = project_out(by_parameter / np.where(norms > 0.0, norms, 1.0), set_up)
    independent: list[int] = []
    basis = np.zeros((len(units), 0))
    without_effect: list[str] = []
    dependent: dict[str, Mapping[str, float]] = {}
    for at, key in enumerate(keys):
        if norms[at] <= RANK_TOLERANCE * largest or not norms[at]:
            without_effect.append(key)
            continue
        remainder = project_out(units[:, at], basis)
        if np.linalg.norm(remainder) > rank_tolerance:
            independent.append(at)
            basis = np.column_stack([basis, remainder / np.linalg.norm(remainder)])
            continue
        dependent[key] = {}
        if independent and np.linalg.norm(units[:, at]) > rank_tolerance:
            shares, *_ = np.linalg.lstsq(units[:, independent], units[:, at], rcond=None)
            dependent[key] = {
                keys[column]: float(share * norms[at] / norms[column])
                for column, share in zip(independent, shares, strict=True)
                if abs(share) > MIN_SHARE
            }
    names = tuple(keys[at] for at in independent)
    return Rank(len(names), names, tuple(without_effect), dependent)


def orthonormal_basis(columns: Array) -> Array:
    """Compute an orthonormal basis of columns, [N, r]."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    vectors, singular_values, _ = np.linalg.svd(columns, full_matrices=False)
    return vectors[:, singular_values > 1e-12 * singular_values[0]]


def project_out(columns: Array, basis: Array) -> Array:
    """Remove from columns their part in an orthonormal basis; twice, for rounding."""
    projected = columns - basis @ (basis.T @ columns)
    return projected - basis @ (basis.T @ projected)


def describe_rank(rank: Rank, slopes: Collection[str] = ()) -> tuple[str, ...]:
    def name(key: str) -> str:
        return f"the slope of {key}" if key in slopes else key

    lines: list[str] = []
    if rank.without_effect:
        lines.append(f"{', '.join(rank.without_effect)}: no effect on these readings")
    with_set_up = [name(group[0]) for group in rank.confounded if len(group) == 1]
    if with_set_up:
        lines.append(
            f"{', '.join(with_set_up)}: confounded with the unknown position of the set-up"
        )
    for group in rank.confounded:
        if len(group) == 2:
            lines.append(f"{name(group[0])} and {name(group[1])} are confounded in these readings")
        elif len(group) > 2:
            key, *keys, last = map(name, group)
            combination = f"{', '.join(keys)} and {last}"
            lines.append(f"{key} is confounded with a combination of {combination}")
    return tuple(lines)


AUTO = "auto"
CURVES = ("constant", "ramp")


@dataclass(frozen=True, slots=True)
class FitParameters:
    """Parameters to be fitted, and the error set of their amplitudes."""

    keys: tuple[str, ...]  # (K,)
    errors: ErrorSet  # errors of the scene, with a curve for each parameter
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


def build_fit_parameters(scene: Scene, keys: Sequence[str]) -> FitParameters:
    """Build the curve of each parameter: that of the scene, else a constant or a ramp."""
    functions = dict(scene.errors.functions)
    names: list[str] = []
    for text in keys:
        key, _, curve = text.partition(":")
        row = parameter(key)
        if row.axis not in scene.machine.axes:
            raise UnknownNameError("error parameter", key, scene.machine.allowed_keys)
        if key in names:
            raise OptionError(f"{{fit}} {key} occurs twice; expected each parameter once")
        if curve and curve not in CURVES:
            raise OptionError(f"{{fit}} {text!r}; expected {key}:constant or {key}:ramp")
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
    spellings = {key.lower(): key for key in PARAMETERS}
    keys: list[str] = []
    for part in parts:
        key, colon, curve = part.partition(":")
        key = spellings.get(key.strip().lower(), key.strip())
        keys.append(key + colon + curve.strip().lower())
    return tuple(keys)


def automatic_parameters(scene: Scene, sets: Sequence[Readings]) -> tuple[str, ...]:
    """List the parameters that ``--fit auto`` fits to several sets of readings."""
    keys: dict[str, None] = {}
    for readings in sets:
        for key in find_kind(readings.kind).automatic_keys(readings, scene):
            row = parameter(key)
            rotary = not scene.machine.axes[row.axis].is_linear
            is_volumetric = readings.kind in {"points", "tracker", "positions", "lengths"}
            if is_volumetric and rotary and not row.is_constant and key not in scene.errors:
                continue  # its constant is confounded with a location error
            keys[key] = None
    return tuple(sorted(keys, key=lambda key: key not in scene.errors and is_straightness(key)))


def is_straightness(key: str) -> bool:
    """Check for a straightness error, whose slope is confounded with a squareness."""
    row = parameter(key)
    is_translation = not row.is_constant and not row.is_rotation and is_linear(row.axis)
    return is_translation and row.direction != direction_index(row.axis)


CheckCancelled = Callable[[], object]


def never_cancelled() -> None:
    """Continue: the default of `check_cancelled`."""


@dataclass(frozen=True, slots=True)
class MeasurementModel:
    """Readings of one or more files."""

    scene: Scene
    sets: tuple[Readings, ...]
    # (m,); unknowns of the set-ups; files with the same session share them
    unknowns: tuple[str, ...]
    # called before each evaluation of the model; an exception that it raises ends the fit
    check_cancelled: CheckCancelled = never_cancelled

    @classmethod
    def of(
        cls,
        scene: Scene,
        sets: Sequence[Readings],
        check_cancelled: CheckCancelled = never_cancelled,
    ) -> "MeasurementModel":
        names = (name for readings in sets for name in find_kind(readings.kind).unknowns(readings))
        return cls(scene, tuple(sets), tuple(dict.fromkeys(names)), check_cancelled)

    def start(self) -> Array:
        """Return start values of the unknowns, [m], mm."""
        values: dict[str, float] = {}
        for readings in self.sets:
            kind = find_kind(readings.kind)
            for name, value in zip(kind.unknowns(readings), kind.start(readings), strict=True):
                values.setdefault(name, float(value))
        return np.array([values[name] for name in self.unknowns])

    def residuals(
        self, parameters: FitParameters, amplitudes: Array, unknown: Array
    ) -> list[Array]:
        """Compute observed − predicted of each set with the exact model, [n, d] each, mm."""
        self.check_cancelled()
        prediction = Prediction(parameters.errors_with(amplitudes), self.unknowns, unknown)
        return [
            readings.observed_mm
            - find_kind(readings.kind).observe(self.scene, readings, prediction)
            for readings in self.sets
        ]

    def derivatives(
        self, parameters: FitParameters, amplitudes: Array, unknown: Array
    ) -> tuple[Array, Array]:
        """Compute the change of all predictions, [N, K] per µm or µrad and [N, m] per mm."""
        self.check_cancelled()
        prediction = Prediction(parameters.errors_with(amplitudes), self.unknowns, unknown)
        by_parameter: list[Array] = []
        by_unknown: list[Array] = []
        for readings in self.sets:
            kind, size = find_kind(readings.kind), readings.observed_mm.size
            gains, set_up = kind.slopes(self.scene, readings, prediction, parameters.keys)
            by_parameter.append(gains.reshape(size, len(parameters.keys)))
            by_unknown.append(set_up.reshape(size, len(self.unknowns)))
        return np.vstack(by_parameter), np.vstack(by_unknown)

    def weighted(self, components: Sequence[Array], otherwise_mm: float = 1.0) -> list[Array]:
        """Multiply the components of readings, [n, d] each, by their weights, 1/mm."""
        sigmas = (np.array(otherwise_mm) if r.sigma_mm is None else r.sigma_mm for r in self.sets)
        return [
            row * (1.0 / sigma)[..., None] for row, sigma in zip(components, sigmas, strict=True)
        ]

    def weights(self, otherwise_mm: float = 1.0) -> Array:
        """Return the weight of each component of each reading, [N], 1/mm."""
        ones = [np.ones_like(readings.observed_mm) for readings in self.sets]
        return np.concatenate([row.ravel() for row in self.weighted(ones, otherwise_mm)])

    @property
    def positions(self) -> dict[str, Array]:
        """Positions of all axes at all readings, [n], mm or degrees."""
        axes = self.sets[0].coordinates
        return {
            axis: np.concatenate([readings.coordinates[axis] for readings in self.sets])
            for axis in axes
        }

    @property
    def rank_tolerance(self) -> float:
        """Share of its effect below which a parameter counts as dependent."""
        return max(find_kind(readings.kind).rank_tolerance for readings in self.sets)

    @property
    def has_uncertainties(self) -> bool:
        return all(readings.sigma_mm is not None for readings in self.sets)

    @property
    def size(self) -> int:
        return sum(readings.observed_mm.size for readings in self.sets)


def rms_mm(residuals: Sequence[Array]) -> float:
    """Compute the root mean square of the lengths of residual vectors, mm."""
    lengths = np.concatenate([np.linalg.norm(row, axis=-1) for row in residuals])
    return float(np.sqrt(np.mean(lengths**2)))


ROBUST_SCALE = 1.345  # standard deviations at which the soft L1 loss starts to reduce the weight
MAD = 1.4826  # standard deviation of a normal distribution per median absolute deviation
MAX_ROUNDS = 20  # times that a robust fit updates its weights


@dataclass(frozen=True, slots=True)
class Solved:
    """Solution of a fit, its weighted Jacobian, and the robust scale of a component."""

    amplitudes: Array
    unknown: Array
    weighted: Array
    scale: float | None = None
    trust: float = 1.0  # squared factor of the rows of `weighted`, in addition to their weights


def solve(
    model: MeasurementModel,
    parameters: FitParameters,
    prior: tuple[Array, Array] | None = None,
    unknown: Array | None = None,
    *,
    robust: bool = False,
) -> Solved:
    from scipy.optimize import OptimizeResult, least_squares

    weights = model.weights()
    count = len(parameters.keys)
    start = np.concatenate([parameters.start, model.start() if unknown is None else unknown])
    if not len(start):
        return Solved(start, start, np.zeros((model.size, 0)))

    def deviations(values: Array) -> Array:
        rows = model.residuals(parameters, values[:count], values[count:])
        return np.concatenate([row.ravel() for row in rows]) * weights

    trust, unit = np.ones(model.size), None
    dof = max(model.size - len(start) + (0 if prior is None else count), 1)

    def function(values: Array) -> Array:
        rows = np.sqrt(trust) * deviations(values)
        return rows if prior is None else np.append(rows, (values[:count] - prior[0]) / prior[1])

    def jacobian(values: Array) -> Array:
        columns = model.derivatives(parameters, values[:count], values[count:])
        rows = np.sqrt(trust)[:, None] * (-weights[:, None] * np.hstack(columns))
        if prior is None:
            return rows
        set_ups = np.zeros((count, len(values) - count))
        return np.vstack([rows, np.hstack([np.diag(1.0 / prior[1]), set_ups])])

    for _ in range(MAX_ROUNDS if robust else 1):
        scale = np.linalg.norm(jacobian(start), axis=0)
        optimum: OptimizeResult = least_squares(
            function,
            start,
            jac=jacobian,  # pyright: ignore[reportArgumentType]
            x_scale=1.0 / np.where(scale > 0.0, scale, 1.0),
            xtol=1e-10,
            ftol=1e-13,
            gtol=1e-13,
            max_nfev=200,
        )
        if not optimum.success:
            raise OptionError(
                f"the fit does not converge ({optimum.message}); expected readings close to the"
                " model. Reduce the weight of outliers ({robust}), or fit fewer parameters"
                " ({fit} KEYS)"
            )
        moved = float(np.abs((optimum.x - start) * scale).max(initial=0.0))
        start = optimum.x
        if not robust:
            break
        rows = deviations(start)
        unit = robust_scale(rows, dof)
        trust = 1.0 / np.sqrt(1.0 + (rows / (ROBUST_SCALE * unit)) ** 2)
        if moved < 1e-9 * unit:
            break
    if unit is not None:
        variance = unit**2 * _robust_variance(deviations(start) / unit, dof)
        trust = np.full(model.size, 1.0 / max(variance, float(model.has_uncertainties)))
    return Solved(start[:count], start[count:], jacobian(start), unit, float(trust[0]))


def robust_scale(rows: Array, dof: int) -> float:
    """Compute the standard deviation of weighted residuals from their median magnitude."""
    middle = float(np.median(np.abs(rows)))
    return max(MAD * middle * np.sqrt(len(rows) / max(dof, 1)), 1e-12)


def _robust_variance(rows: Array, dof: int) -> float:
    """Compute the equivalent of the residual variance for the soft L1 loss.

    κ²·Σψ²/(n − p)/(mean of ψ′)², Huber and Ronchetti, Robust Statistics (2nd edition), 7.6.
    """
    falls = 1.0 + (rows / ROBUST_SCALE) ** 2
    slope = falls**-1.5
    mean, share = float(slope.mean()), 1.0 - dof / len(rows)
    correction = 1.0 + share * float(slope.var()) / mean**2
    return correction**2 * float(np.sum(rows**2 / falls)) / dof / mean**2


def covariance_of(solved: Solved) -> Array:
    """Compute the covariance of the solution, for a weight of one unless the fit is robust."""
    scale = np.linalg.norm(solved.weighted, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    triangle = np.linalg.qr(solved.weighted / scale, mode="r")
    inverse = np.linalg.pinv(triangle) / scale[:, None]
    return inverse @ inverse.T
