"""How sure numbers are: the covariance of a machine's errors, carried to points and statistics.

An error of a scene is sure by its standard uncertainty along its axis (``[uncertainty]``, errors
independent of each other, one number for a whole curve), or by the covariance of amplitudes that a
calibration found. To first order a result f moves by its gradient g per unit of the amplitudes, so
that its variance is gᵀ C g (ISO/IEC Guide 98-3, 5.2). U95 = k · u, k being Student's t for 95.45 %:
2 for infinite degrees of freedom (ibid., table G.2; ISO 230-9 takes k = 2).

An error that a scene gives without saying how sure it is, is *unknown*: so is all that it moves.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np

from warpspace.analysis.distribution import loop_axes
from warpspace.analysis.statistics import P95, Summary
from warpspace.field.evaluate import View, build_basis
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene, evaluate_grid
from warpspace.units import Array

NAMES = {"mean_um": "mean", "rms_um": "RMS", "p95_um": "P95", "max_um": "max"}
COVERED = 0.9545  # of a normal distribution, within two standard deviations
NEAR = 0.01  # part of the points that tells how their 95th percentile moves
MOST_DRAWN = 2_000_000  # |E| of machines that are held at a time
S = TypeVar("S", bound=Summary)


@lru_cache(maxsize=256)
def coverage_factor(freedom: float) -> float:
    """Give k of U95 = k · u: 2 for infinite degrees of freedom."""
    if np.isinf(freedom):
        return 2.0
    from scipy.stats import t

    return float(t.ppf(0.5 + COVERED / 2.0, max(freedom, 1.0)))


@dataclass(frozen=True, eq=False)
class Doubt:
    """How sure the errors of a scene are, through one loop."""

    keys: tuple[str, ...]  # (K,); errors that are not sure
    errors: ErrorSet  # their curves; the amplitudes play no part
    covariance: Array  # [K, K], µm and µrad; of their amplitudes
    unknown: tuple[str, ...]  # errors of which nobody says how sure they are
    freedom: float  # degrees of freedom
    untold: tuple[str, ...] = ()  # of the unknown: what a calibration left open
    lack_of_fit: float = 0.0  # that it saw

    @property
    def factor(self) -> float:
        return coverage_factor(self.freedom)

    @property
    def is_known(self) -> bool:
        return not (self.unknown or self.untold)

    @cached_property
    def root(self) -> Array:
        """Independent changes of the amplitudes, [K, M], of one standard uncertainty each."""
        width = np.sqrt(np.diagonal(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(width, width))
        return width[:, None] * vectors * _root(values)

    def u95_of(self, key: str) -> float | None:
        """Give U95 of the amplitude of one error; None where it is not stated."""
        width = dict(zip(self.keys, np.diagonal(self.covariance).tolist(), strict=True))
        return self.factor * width[key] ** 0.5 if key in width else None

    def within(self, value: Array | float, u: Array | float, low: float, high: float) -> Array:
        """Give the probability that numbers lie between two, by their standard uncertainties."""
        from scipy.stats import t

        ends = ((end - value) / np.maximum(u, 1e-12) for end in (low, high))
        below, above = (t.cdf(end, self.freedom) for end in ends)
        return above - below

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draw changes of the amplitudes, [count, K]: normal, or Student's t of its freedom."""
        found = rng.standard_normal((count, len(self.keys))) @ self.root.T
        if np.isinf(self.freedom):
            return found
        return found * np.sqrt(self.freedom / rng.chisquare(self.freedom, (count, 1)))

    def through(self, ask: Callable[[Array], Array]) -> list[float | None]:
        """Give U95 of numbers, [n], that are a function of changes of the amplitudes, [K].

        Notes
        -----
        Half the difference of what one standard uncertainty up and down gives (ISO/IEC Guide 98-3,
        5.1.3, note 2), or where both go the same way, as at the least of a width, their RMS.
        """
        present = ask(np.zeros(len(self.keys)))
        if not self.is_known:
            return [None] * len(present)
        steps = np.array([(ask(way), ask(-way)) for way in self.root.T]) - present
        variance = np.sum(steps**2, axis=(0, 1)) / 2.0 if steps.size else np.zeros(len(present))
        return (self.factor * _root(variance)).tolist()

    def remarks(self) -> Iterator[str]:
        """Say what is not stated, and what the data did not determine."""
        if unstated := [key for key in self.unknown if key not in self.untold]:
            yield (
                f"uncertainty not stated of {', '.join(unstated)}: it is unknown wherever they"
                " act, not zero"
            )
        if self.untold:
            names = ", ".join(self.untold)
            yield f"the readings did not determine {names}: unknown wherever they act"
        if self.lack_of_fit:
            yield (
                f"the calibration missed something: its residuals were {self.lack_of_fit:.1f} times"
                " what its readings scatter; U95 does not contain that"
            )


def find_doubt(scene: Scene, loop: Loop = Loop.TOOL) -> Doubt | None:
    """Collect how sure the errors of a scene are; None where it says nothing of that."""
    joint, alone = scene.covariance, scene.uncertainty
    if joint is None and not alone:
        return None
    together, axes = () if joint is None else joint.keys, loop_axes(scene.model, loop)
    keys = tuple(key for key in (*together, *alone) if parameter(key).axis in axes)
    curves = {key: scene.errors.functions[key] for key in together if key in scene.errors}
    errors = ErrorSet({key: one for key, one in {**curves, **alone}.items() if key in keys})
    covariance = np.diag([alone[key].amplitude ** 2 if key in alone else 0.0 for key in keys])
    if joint is not None:
        own = [key for key in keys if key in together]
        rows, places = [keys.index(key) for key in own], [together.index(key) for key in own]
        covariance[np.ix_(rows, rows)] = joint.matrix[np.ix_(places, places)]
    open_keys = () if joint is None else joint.untold
    untold = tuple(key for key in open_keys if parameter(key).axis in axes)
    acting = (key for key in scene.errors if parameter(key).axis in axes and key not in untold)
    unknown = tuple(k for k in acting if k not in keys and scene.errors.amplitude(k))
    freedom, lack = (np.inf, 0.0) if joint is None else (joint.freedom, joint.lack_of_fit)
    return Doubt(keys, errors, covariance, (*unknown, *untold), freedom, untold, lack)


def _root(variance: Array) -> Array:
    return np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True, eq=False)
class FieldDoubt:
    """How sure the errors of points are; `replace` error_um where only these change."""

    doubt: Doubt
    response: Array  # [K, ..., 3], of the position errors to what is not sure
    covariance_um2: Array  # [..., 3, 3], of the position errors
    error_um: Array  # [..., 3], position errors
    shares: Array | None = None  # of the points in statistics, their sum is 1; None for equal ones
    turning: Array | None = None  # [K, ..., 3], response of the orientation errors

    @cached_property
    def norm_um(self) -> Array:
        return np.linalg.norm(self.error_um, axis=-1)

    @property
    def u_um(self) -> Array:
        """Standard uncertainty of the components of position errors, [..., 3]."""
        return _root(np.diagonal(self.covariance_um2, axis1=-2, axis2=-1))

    @property
    def u_urad(self) -> Array:
        """Standard uncertainty of the components of orientation errors, [..., 3]."""
        turning = np.zeros_like(self.response) if self.turning is None else self.turning
        return _root(np.sum(turning * np.tensordot(self.doubt.covariance, turning, 1), axis=0))

    @cached_property
    def direction(self) -> Array:
        """Unit vectors along the position errors, [..., 3]; zero where there is none."""
        length = self.norm_um[..., None]
        return self.error_um / np.where(length > 0.0, length, 1.0)

    @cached_property
    def u_norm_um(self) -> Array:
        """Standard uncertainty of |E|, [...]; where that is zero, of the vector."""
        way = self.direction
        turned = np.einsum("...ij,...i->...j", self.covariance_um2, way)
        variance = np.einsum("...j,...j->...", turned, way)
        if (none := self.norm_um == 0.0).any():
            traces = np.trace(self.covariance_um2, axis1=-2, axis2=-1)
            variance = np.where(none, traces, variance)
        return _root(variance)

    def u95_at(self, point: int) -> float | None:
        """Give U95 of |E| at a point by its number; None where it is unknown."""
        return self.doubt.factor * self.u_norm_um.item(point) if self.doubt.is_known else None

    def u95(self, gradient: Array) -> float:
        """Give U95 of a number by its growth per unit of each amplitude, [K]."""
        return self.doubt.factor * float(_root(gradient @ self.doubt.covariance @ gradient))

    def statistics(self) -> dict[str, float | None]:
        """Give U95 of mean, RMS, P95 and max of |E| by their keys; None where it is unknown."""
        if not self.doubt.is_known:
            return dict.fromkeys(NAMES)
        return dict(zip(NAMES, map(self.u95, self.gradients), strict=True))

    def said_of(self, numbers: S) -> S:
        """Say U95 beside statistics of the field."""
        u95 = {f"u95_{name}": value for name, value in self.statistics().items()}
        return replace(numbers, sure=u95)

    @cached_property
    def weights(self) -> Array:
        size = self.norm_um.size
        return np.full(size, 1.0 / size) if self.shares is None else self.shares.reshape(-1)

    def seen(self, linear: Callable[[Array], Array]) -> "FieldDoubt":
        """Give the same of what a linear function makes of position errors, [..., n, 3]."""
        return combine(self.doubt, linear(self.response), linear(self.error_um), self.shares)

    @cached_property
    def gradients(self) -> Array:
        """Growth of mean, RMS, P95 and max of |E| per unit of each amplitude, [4, K]."""
        norm, weights = self.norm_um.reshape(-1), self.weights
        order = np.argsort(norm)
        place = np.cumsum(weights[order])
        near, largest = np.zeros((2, norm.size))
        chosen = order[np.abs(place - P95) <= max(NEAR, 1.5 / norm.size)]
        near[chosen] = weights[chosen] / max(weights[chosen].sum(), 1e-300)
        largest[int(np.argmax(norm))] = 1.0
        rms = float(np.sqrt(weights @ norm**2))
        shares = np.stack([weights, weights * norm / (rms or 1.0), near, largest])
        ways = shares[:, :, None] * self.direction.reshape(-1, 3)
        return ways.reshape(4, -1) @ self.response.reshape(len(self.doubt.keys), -1).T

    def falls(self, after: "FieldDoubt", name: str) -> float | None:
        """Give the probability that RMS or max of |E| is smaller with other errors of the points.

        Squares are compared: that of the RMS is linear in what is not sure, however large that is.
        """
        if not self.doubt.is_known:
            return None
        squares, ways = np.zeros(2), list[Array]()
        for index, one in enumerate((self, after)):
            square = one.norm_um.reshape(-1) ** 2
            squares[index] = square.max() if name == "max_um" else self.weights @ square
            ways.append(2.0 * squares[index] ** 0.5 * one.gradients[[*NAMES].index(name)])
        way, fall = ways[1] - ways[0], float(squares[0] - squares[1])
        u = _root(way @ self.doubt.covariance @ way)
        return float(self.doubt.within(fall, u, 0.0, np.inf))

    def machines(self, count: int, seed: int) -> Iterator[Array]:
        """Draw machines from the covariance: |E| of each at every point, [n, N], in pieces."""
        rng, points = np.random.default_rng(seed), self.norm_um.size
        gains = np.moveaxis(self.response.reshape(len(self.doubt.keys), points, 3), -1, 0)
        present = self.error_um.reshape(points, 3).T
        for start in range(0, count, step := max(1, MOST_DRAWN // points)):
            change = self.doubt.draw(rng, min(step, count - start))
            parts = (change @ gain + own for gain, own in zip(gains, present, strict=True))
            yield np.sqrt(sum(part**2 for part in parts))


def field_doubt(
    scene: Scene,
    error_um: Array,
    at: Coordinates,
    view: View,
    point_mm: Array | None = None,
    shares: Array | None = None,
) -> FieldDoubt | None:
    """Say how sure a field of a scene is; None where the scene says nothing of that."""
    if (doubt := find_doubt(scene, view.loop)) is None:
        return None
    basis = build_basis(scene.model, doubt.errors, doubt.keys, at, view, point_mm)
    found = combine(doubt, basis.position, error_um, shares)
    return replace(found, turning=basis.orientation)


def combine(
    doubt: Doubt, response: Array, error_um: Array, shares: Array | None = None
) -> FieldDoubt:
    """Carry how sure errors are to points, by the response of these, [K, ..., 3]."""
    turned = (doubt.covariance @ response.reshape(len(doubt.keys), -1)).reshape(response.shape)
    covariance = np.einsum("k...i,k...j->...ij", response, turned)
    return FieldDoubt(doubt, response, covariance, error_um, shares)


def volume_doubt(scene: Scene, view: View, nodes: int = DEFAULT_NODES) -> FieldDoubt | None:
    """Say how sure the errors over the working volume are; None where a scene does not say."""
    grid = build_grid(scene.model, scene.workspace, min(nodes, DEFAULT_NODES))
    error = evaluate_grid(scene, grid, view).error_um
    return field_doubt(scene, error, grid.coordinates, view, grid.point_mm, grid.weights)


def u95_lines(doubt: Doubt | None, named: Mapping[str, Summary]) -> Iterator[str]:
    """Say U95 of mean, RMS, P95 and max by what they are of, and what is not stated."""
    if doubt is None:
        return
    for of, one in named.items():
        each = (f"{word} {plus_minus(one.sure[f'u95_{name}'])}" for name, word in NAMES.items())
        yield f"  U95{of and f', {of}'} (k = {doubt.factor:.3g}): {', '.join(each)} µm"
    yield from (f"  {words}" for words in doubt.remarks())


def plus_minus(u95: float | None, form: str = ".2f") -> str:
    return f"± {'?' if u95 is None else format(u95, form)}"
