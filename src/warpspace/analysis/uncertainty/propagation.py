"""Uncertainty of results: the covariance of errors, propagated to points and statistics.

An error of a scene is sure by its standard uncertainty at points of its axis (``[uncertainty]``,
errors independent of each other), or by the covariance of amplitudes that a calibration found. To
first order a result f moves by its gradient g per unit of the amplitudes, so that its variance is
gᵀ C g (ISO/IEC Guide 98-3, 5.2). U95 = k · u, k being Student's t for 95.45 %: 2 for infinite
degrees of freedom (ibid., table G.2; ISO 230-9 takes k = 2).

An error that a scene gives without saying how sure it is, is *unknown*: so is all that it moves.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeAlias, TypeVar

import numpy as np

from warpspace.analysis.description import ExpandedUncertainty, UncertaintySource
from warpspace.analysis.loop_parameters import loop_axes
from warpspace.analysis.statistics import P95, Summary
from warpspace.field.evaluate import ErrorBasis, ErrorField, View, build_basis
from warpspace.field.grid import DEFAULT_NODES, build_grid, cut, pieces
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Covariance, ErrorFunction, ErrorSet, TableCurve
from warpspace.scene.model import Scene, evaluate_grid
from warpspace.units import Array, Integers

NAMES = {"mean_um": "mean", "rms_um": "RMS", "p95_um": "P95", "max_um": "max"}
COVERAGE = 0.9545  # of a normal distribution, within two standard deviations
NEAR = 0.01  # part of the points that tells how their 95th percentile moves
MOST_DRAWN = 2_000_000  # |E| of machines that are held at a time
SAMPLES = 17  # points that a mode along an axis is drawn through
NOT_STATED = "the scene states no uncertainty of its errors; expected [uncertainty]"
S = TypeVar("S", bound=Summary)
Layer: TypeAlias = tuple[ErrorSet, tuple[str, ...]]


@lru_cache(maxsize=256)
def coverage_factor(dof: float) -> float:
    """Compute the coverage factor k of U95 = k · u: 2 for infinite degrees of freedom."""
    if np.isinf(dof):
        return 2.0
    return float(t_quantile(0.5 + COVERAGE / 2.0, max(dof, 1.0)))


def t_quantile(probability: float, dof: Array | float) -> Array:
    """Compute the quantile of Student's t at a probability, for each number of degrees, [...]."""
    from scipy.stats import t

    return np.asarray(t.ppf(probability, dof), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class ErrorUncertainty:
    """Uncertainty of the errors of a scene that act in one loop."""

    layers: tuple[Layer, ...]  # curves that are not sure; their amplitudes play no part
    covariance: Array  # [K, K], µm and µrad; of the amplitudes, one layer behind the other
    dofs: Array  # [K], degrees of freedom
    unknown: tuple[str, ...]  # errors of which nobody says how sure they are
    undetermined: tuple[str, ...] = ()  # of the unknown: what a calibration left open
    lack_of_fit: float = 0.0  # that it saw

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Keys of the amplitudes, (K,); one may come twice."""
        return tuple(key for _, keys in self.layers for key in keys)

    def respond(
        self, model: Model, at: Coordinates, view: View, point_mm: Array | None = None
    ) -> ErrorBasis:
        """Compute the response of errors of points to the amplitudes."""
        bases = [build_basis(model, *layer, at, view, point_mm) for layer in self.layers]
        responses = zip(*((basis.position, basis.orientation) for basis in bases), strict=True)
        return ErrorBasis(self.keys, bases[0].nominal_mm, *map(np.concatenate, responses))

    @cached_property
    def dof(self) -> float:
        """Common degrees of freedom, else infinite; `expanded` uses those of each amplitude."""
        return float(self.dofs[0]) if len({*self.dofs.tolist()}) == 1 else np.inf

    @property
    def factor(self) -> float:
        return coverage_factor(self.dof)

    @cached_property
    def factors(self) -> Array:
        """U95 / u by the degrees of freedom of each, [K]."""
        return np.array([coverage_factor(dof) for dof in self.dofs.tolist()])

    @cached_property
    def expanded(self) -> Array:
        """Covariance times the factors: U95 of a number of gradient g is √(g · this · g)."""
        return self.covariance * np.outer(self.factors, self.factors)

    @property
    def is_known(self) -> bool:
        return not (self.unknown or self.undetermined)

    @cached_property
    def root(self) -> Array:
        """Independent changes of the amplitudes, [K, M], of one standard uncertainty each."""
        width = np.sqrt(np.diagonal(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(width, width))
        return width[:, None] * vectors * _root(values)

    def u95_of(self, key: str) -> float | None:
        """Return U95 of the amplitude of one error; None where it is not stated."""
        at = self.keys.index(key) if key in self.keys else None
        return None if at is None else float(self.expanded[at, at]) ** 0.5

    def probability_within(
        self, value: Array | float, u95: Array | float, low: float, high: float
    ) -> Array:
        """Compute the probability that quantities lie between limits, by their U95."""
        from scipy.stats import t

        unit = np.maximum(u95, 1e-12) / self.factor
        below, above = (t.cdf((end - value) / unit, self.dof) for end in (low, high))
        return above - below

    def draw(self, rng: "np.random.Generator", count: int) -> Array:
        """Draw changes of the amplitudes, [count, K]: normal, or Student's t of their dof."""
        changes = rng.standard_normal((count, len(self.keys))) @ self.root.T
        for dof in {*self.dofs.tolist()} - {np.inf}:
            changes[:, self.dofs == dof] *= np.sqrt(dof / rng.chisquare(dof, (count, 1)))
        return changes

    def propagate(self, function: Callable[[Array], Array]) -> list[float | None]:
        """Compute U95 of numbers, [n], that are a function of changes of the amplitudes, [K].

        Notes
        -----
        Half the difference of what one standard uncertainty up and down gives (ISO/IEC Guide 98-3,
        5.1.3, note 2), or where both go the same way, as at the least of a width, their RMS.
        """
        present = function(np.zeros(len(self.keys)))
        if not self.is_known:
            return [None] * len(present)
        steps = [
            (function(step), function(-step)) for step in (self.root * self.factors[:, None]).T
        ]
        variance = np.sum((np.array(steps).reshape(-1, len(present)) - present) ** 2, axis=0) / 2.0
        return _root(variance).tolist()

    def remarks(self) -> Iterator[str]:
        """List the errors whose uncertainty is unknown, and a lack of fit."""
        unstated = [key for key in self.unknown if key not in self.undetermined]
        if unstated:
            yield (
                f"uncertainty of {', '.join(unstated)} is unknown; results that depend on it show"
                " “± ?”"
            )
        if self.undetermined:
            names = ", ".join(self.undetermined)
            yield f"not estimable from the readings: {names}; what depends on them shows “± ?”"
        if self.lack_of_fit:
            yield (
                f"lack of fit: residuals of the calibration are {self.lack_of_fit:.1f} times the"
                " scatter of its readings; U95 does not include that"
            )


def scene_uncertainty(scene: Scene, loop: Loop = Loop.TOOL) -> ErrorUncertainty | None:
    """Collect the uncertainty of the errors of a scene; None where it states none."""
    covariance, curves = scene.covariance or Covariance((), ()), scene.uncertainty
    if scene.covariance is None and not curves:
        return None
    axes, joint = loop_axes(scene.model, loop), covariance.keys
    first = {key: scene.errors.functions[key] for key in joint if key in scene.errors}
    second: dict[str, ErrorFunction] = {}
    for key, curve in curves.items():
        modes = _modes(key, curve)
        first[key] = modes[0]
        second |= dict.fromkeys((key,), *modes[1:]) if modes[1:] else {}
    keys = tuple(key for key in (*joint, *curves) if parameter(key).axis in axes)
    second_keys = tuple(key for key in second if key in keys)
    layers = (ErrorSet(first), keys), (ErrorSet(second), second_keys)
    widths = [first[key].amplitude if key in curves else 0.0 for key in keys]
    widths += [second[key].amplitude for key in second_keys]
    matrix = np.diag(np.square(widths))
    dofs = np.full(len(matrix), np.inf)
    if joint:
        rows = [index for index, key in enumerate(keys) if key in joint]
        places = [joint.index(keys[index]) for index in rows]
        matrix[np.ix_(rows, rows)] = covariance.matrix[np.ix_(places, places)]
        dofs[rows] = covariance.dof
    undetermined = tuple(key for key in covariance.undetermined if parameter(key).axis in axes)
    unstated = tuple(
        key
        for key in scene.errors
        if parameter(key).axis in axes
        and key not in (*undetermined, *keys)
        and scene.errors.amplitude(key)
    )
    unknown = (*unstated, *undetermined)
    return ErrorUncertainty(layers, matrix, dofs, unknown, undetermined, covariance.lack_of_fit)


def _modes(key: str, curve: ErrorFunction) -> tuple[ErrorFunction, ...]:
    """Return the modes of an error whose standard uncertainty along its axis is a curve.

    u · cos φ and u · sin φ, φ from 0 at one end to 90° at the other: near points vary together, the
    ends by themselves, so that widths and differences along the axis are not sure either.
    """
    low, high = curve.span
    if parameter(key).is_constant or low == high:
        return (curve,)
    at = np.unique([*curve.kinks, *np.linspace(low, high, SAMPLES)])
    phase = 0.5 * np.pi * np.clip((at - low) / (high - low), 0.0, 1.0)
    parts = (curve.evaluate(at) * weights for weights in (np.cos(phase), np.sin(phase)))
    return tuple(
        TableCurve(curve.span, tuple(zip(at.tolist(), u.tolist(), strict=True))) for u in parts
    )


def _root(variance: Array) -> Array:
    return np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True, eq=False)
class FieldUncertainty:
    """Uncertainty of the errors of points; `replace` error_um where only these change."""

    errors: ErrorUncertainty
    response: Array  # [K, ..., 3], of the position errors to what is not sure
    expanded_um2: Array  # [..., 3, 3]: U95 along a unit vector v is the root of v · this · v
    error_um: Array  # [..., 3], position errors
    shares: Array | None = None  # of the points in statistics, their sum is 1; None for equal ones
    turning: Array | None = None  # [K, ..., 3], response of the orientation errors

    @cached_property
    def norm_um(self) -> Array:
        return np.linalg.norm(self.error_um, axis=-1)

    @cached_property
    def covariance_um2(self) -> Array:
        """Covariance of the position errors, [..., 3, 3]."""
        if len({*self.errors.factors.tolist()}) == 1:  # no second product on each slider move
            return self.expanded_um2 / self.errors.factor**2
        return _carry(self.errors.covariance, self.response)

    @property
    def u_norm_um(self) -> Array:
        """Standard uncertainty of |E|, [...]."""
        return self._along(self.covariance_um2)

    @property
    def u95_um(self) -> Array:
        """U95 of the components of position errors, [..., 3]."""
        return _root(np.diagonal(self.expanded_um2, axis1=-2, axis2=-1))

    @cached_property
    def u95_norm_um(self) -> Array:
        """U95 of |E|, [...]; where that is zero, of the vector."""
        return self._along(self.expanded_um2)

    @property
    def columns(self) -> dict[str, Array]:
        """U95 of position errors, of their length and of orientation errors, by name."""
        turning = np.zeros_like(self.response) if self.turning is None else self.turning
        square = np.sum(turning * np.tensordot(self.errors.expanded, turning, 1), axis=0)
        return {
            "u95_um": self.u95_um,
            "u95_norm_um": self.u95_norm_um,
            "u95_orientation_urad": _root(square),
        }

    @cached_property
    def direction(self) -> Array:
        """Unit vectors along the position errors, [..., 3]; zero where there is none."""
        length = self.norm_um[..., None]
        return self.error_um / np.where(length > 0.0, length, 1.0)

    def _along(self, square: Array) -> Array:
        direction = self.direction
        turned = np.einsum("...ij,...i->...j", square, direction)
        variance = np.einsum("...j,...j->...", turned, direction)
        none = self.norm_um == 0.0
        if none.any():
            variance = np.where(none, np.trace(square, axis1=-2, axis2=-1), variance)
        return _root(variance)

    def u95_along(self, point: int, direction: Array) -> float | None:
        """Compute U95 of the error of a point by its index, along a unit vector, [3]."""
        square = self.expanded_um2.reshape(-1, 3, 3)[point]
        return float(_root(direction @ square @ direction)) if self.errors.is_known else None

    def u95_at(self, point: int) -> float | None:
        """Return U95 of |E| at a point by its index; None where unknown."""
        return self.u95_norm_um.item(point) if self.errors.is_known else None

    def u95(self, gradient: Array) -> float:
        """Compute U95 of a number from its gradient in the amplitudes, [K]."""
        return float(_root(gradient @ self.errors.expanded @ gradient))

    def propagate(self, function: Callable[[Array], Array]) -> list[float | None]:
        """Compute U95 of numbers, [n], that are a function of the position errors, [..., 3]."""
        return self.errors.propagate(
            lambda change: function(self.error_um + np.tensordot(change, self.response, 1))
        )

    def variance_shares(self, gradient: Array) -> dict[str, float]:
        """Split the variance of a number into shares of errors, the largest first.

        They add up to one; a share is below zero where a correlation makes the variance smaller.
        """
        parts = gradient * (self.errors.covariance @ gradient)
        shares = dict.fromkeys(self.errors.keys, 0.0)
        for key, part in zip(
            self.errors.keys, (parts / (parts.sum() or 1.0)).tolist(), strict=True
        ):
            shares[key] += part
        return dict(sorted(shares.items(), key=lambda item: -abs(item[1])))

    def conformance_probability(self, limit_um: float) -> Array:
        """Compute the probability that |E| is within a limit at each point, [...].

        |E|² is a quadratic form; a gamma distribution of its mean and variance stands for it.
        """
        from scipy.special import gammainc

        square = self.norm_um**2
        spread = np.trace(self.covariance_um2, axis1=-2, axis2=-1)
        pairs = np.sum(self.covariance_um2**2, axis=(-2, -1))
        mean, variance = square + spread, 2.0 * pairs + 4.0 * square * self.u_norm_um**2
        per = mean / np.maximum(variance, 1e-300)
        sharp = (self.norm_um <= limit_um).astype(float)
        return np.where(variance > 1e-12 * mean**2, gammainc(mean * per, limit_um**2 * per), sharp)

    def statistics(self) -> dict[str, float | None]:
        """Compute U95 of mean, RMS, P95 and max of |E| by key; None where unknown.

        Points without an error count by U95 of their vector.
        """
        if not self.errors.is_known:
            return dict.fromkeys(NAMES)
        u95 = [self.u95(gradient) for gradient in self.gradients]
        none = self.norm_um.reshape(-1) == 0.0
        if none.any():
            increase = self.counts[:, none] @ self.u95_norm_um.reshape(-1)[none]
            u95 = np.add(u95, increase).tolist()
        return dict(zip(NAMES, u95, strict=True))

    def with_expanded_uncertainty(self, numbers: S) -> S:
        """Return statistics of the field with their expanded uncertainties."""
        u95 = ExpandedUncertainty(
            (f"u95_{name}", value) for name, value in self.statistics().items()
        )
        return replace(numbers, expanded_uncertainty=u95)

    @cached_property
    def weights(self) -> Array:
        size = self.norm_um.size
        return np.full(size, 1.0 / size) if self.shares is None else self.shares.reshape(-1)

    def transform(self, linear: Callable[[Array], Array]) -> "FieldUncertainty":
        """Propagate through a linear function of the position errors, [..., n, 3]."""
        return combine(self.errors, linear(self.response), linear(self.error_um), self.shares)

    @cached_property
    def counts(self) -> Array:
        """Weight of |E| of each point in mean, RMS, P95 and max, [4, N]."""
        norm, weights = self.norm_um.reshape(-1), self.weights
        order = np.argsort(norm)
        place = np.cumsum(weights[order]) - weights[order] / 2.0
        near, largest = np.zeros((2, norm.size))
        away = np.abs(place - P95)
        chosen = order[away <= max(NEAR, 1.5 / norm.size, away.min())]
        # errors that grow by 1 % make P95 grow by 1 %, however few points are near
        p95, mean = np.interp(P95, place, norm[order]), weights[chosen] @ norm[chosen]
        scale = p95 / mean if mean else 1.0 / max(weights[chosen].sum(), 1e-300)
        near[chosen] = weights[chosen] * scale
        largest[np.argmax(norm if norm.any() else self.u95_norm_um)] = 1.0
        rms = float(np.sqrt(weights @ norm**2))
        return np.stack([weights, weights * norm / rms if rms else weights, near, largest])

    @cached_property
    def gradients(self) -> Array:
        """Gradients of mean, RMS, P95 and max of |E| in the amplitudes, [4, K]."""
        response, gradients = self.response.reshape(-1, self.norm_um.size, 3), list[Array]()
        direction = self.direction.reshape(-1, 3)
        for count in self.counts:
            points = np.flatnonzero(count) if not count.all() else slice(None)  # tell P95 and max
            weighted = (count[points, None] * direction[points]).reshape(-1)
            gradients.append(response[:, points].reshape(len(response), weighted.size) @ weighted)
        return np.stack(gradients)

    def probability_of_improvement(self, after: "FieldUncertainty", name: str) -> float | None:
        """Compute the probability that RMS or max of |E| is smaller after a change of the errors.

        Squares are compared: that of the RMS is linear in what is not sure, however large that is.
        """
        if not self.errors.is_known:
            return None
        squares, gradients = np.zeros(2), list[Array]()
        for index, field in enumerate((self, after)):
            square = field.norm_um.reshape(-1) ** 2
            squares[index] = square.max() if name == "max_um" else self.weights @ square
            gradients.append(2.0 * squares[index] ** 0.5 * field.gradients[[*NAMES].index(name)])
        gradient, fall = gradients[1] - gradients[0], float(squares[0] - squares[1])
        return float(self.errors.probability_within(fall, self.u95(gradient), 0.0, np.inf))

    def machines(
        self, count: int, seed: int, nodes: Integers | slice = slice(None)
    ) -> Iterator[Array]:
        """Draw machines from the covariance; yield |E| at some points, [n, N], in pieces."""
        rng, shape = np.random.default_rng(seed), (-1, self.norm_um.size, 3)
        layers = (self.response.reshape(shape), self.error_um.reshape(shape))
        gains = np.moveaxis(np.concatenate(layers)[:, nodes], -1, 0).copy()
        step = max(1, MOST_DRAWN // gains.shape[-1])
        for start in range(0, count, step):
            change = self.errors.draw(rng, min(step, count - start))
            parts = np.column_stack([change, np.ones(len(change))]) @ gains
            yield np.sqrt(np.sum(np.square(parts, out=parts), axis=0))


def field_uncertainty(
    scene: Scene,
    error_um: Array,
    at: Coordinates,
    view: View,
    point_mm: Array | None = None,
    shares: Array | None = None,
) -> FieldUncertainty | None:
    """Propagate the uncertainty of a scene to a field; None where the scene states none."""
    uncertainty = scene_uncertainty(scene, view.loop)
    return uncertainty and _propagate_to_field(
        uncertainty, scene.model, error_um, at, view, point_mm, shares
    )


def _propagate_to_field(
    errors: ErrorUncertainty, model: Model, error_um: Array, at: Coordinates, view: View,
    point_mm: Array | None, shares: Array | None = None,
) -> FieldUncertainty:  # fmt: skip
    basis = errors.respond(model, at, view, point_mm)
    return replace(combine(errors, basis.position, error_um, shares), turning=basis.orientation)


def u95_columns(
    scene: Scene, field: ErrorField, at: Coordinates, view: View, point_mm: Array | None = None
) -> ExpandedUncertainty[Array]:
    """Compute `FieldUncertainty.columns` of points, [...], in pieces; none where unknown."""
    shape, columns = field.norm_um.shape, ExpandedUncertainty[Array]()
    errors = scene_uncertainty(scene, view.loop)
    if errors is None or not errors.is_known:
        return columns
    point_mm = None if point_mm is None else np.broadcast_to(point_mm, (*shape, 3))
    for piece in pieces(shape):
        axes = {name: cut(np.asarray(values), piece) for name, values in at.items()}
        point = None if point_mm is None else point_mm[piece]
        part = _propagate_to_field(errors, scene.model, field.error_um[piece], axes, view, point)
        for name, values in part.columns.items():
            column = columns.setdefault(name, np.empty(shape + values.shape[len(shape) :]))
            column[piece] = values
    return columns


def combine(
    errors: ErrorUncertainty, response: Array, error_um: Array, shares: Array | None = None
) -> FieldUncertainty:
    """Propagate the uncertainty of errors to points by their response, [K, ..., 3]."""
    return FieldUncertainty(errors, response, _carry(errors.expanded, response), error_um, shares)


def _carry(covariance: Array, response: Array) -> Array:
    turned = np.tensordot(covariance, response, 1)
    return np.einsum("k...i,k...j->...ij", response, turned)


def volume_uncertainty(
    scene: Scene, view: View, nodes: int = DEFAULT_NODES
) -> FieldUncertainty | None:
    """Propagate the uncertainty of a scene to its working volume; None where it states none."""
    grid = build_grid(scene.model, scene.workspace, min(nodes, DEFAULT_NODES))
    error = evaluate_grid(scene, grid, view).error_um
    return field_uncertainty(scene, error, grid.coordinates, view, grid.point_mm, grid.weights)


def u95_lines(uncertainty: UncertaintySource | None, named: Mapping[str, Summary]) -> Iterator[str]:
    """Format U95 of mean, RMS, P95 and max of named statistics, and the remarks."""
    if uncertainty is None:
        return
    for of, summary in named.items():
        each = (
            f"{word} {plus_minus(summary.expanded_uncertainty[f'u95_{name}'])}"
            for name, word in NAMES.items()
        )
        yield f"  U95{of and f', {of}'} (k = {uncertainty.factor:.3g}): {', '.join(each)} µm"
    yield from (f"  {remark}" for remark in uncertainty.remarks())


def plus_minus(u95: float | None, form: str = "") -> str:
    """Format U95: one decimal, below 0.95 two digits; unknown (None): ``± ?``."""
    form = form or (".2g" if u95 and u95 < 0.95 else ".1f")
    return f"± {'?' if u95 is None else format(u95, form)}"
