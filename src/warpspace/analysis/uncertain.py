"""What the standard uncertainty of measured errors does to the field, and to |E|.

The uncertainties of different errors are taken as independent; that of one error as one number
for its whole curve, which the errors of a calibration are: a reading that is too large at one
position is so at the next one. At one point without a reference this makes no difference.
"""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numpy as np

from warpspace.analysis.cases import Case
from warpspace.analysis.draws import SIGMAS, Distribution, Draws
from warpspace.analysis.montecarlo import MonteCarlo, Plan, Progress, Take, montecarlo_each
from warpspace.analysis.points import Places
from warpspace.field.evaluate import View, amplitudes_of, build_basis, evaluate_first_order
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Coordinates, Model
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.errors import ErrorSet
from warpspace.units import Array

Uncertainties = Mapping[str, ErrorFunction]
"""Standard uncertainty (k = 1) along its axis, by key of the error."""


@dataclass(frozen=True, slots=True)
class FieldUncertainty:
    """Standard uncertainty (k = 1) of a field.

    Attributes
    ----------
    error_um : ndarray, [..., 3], µm
        Of each component of the position error.
    norm_um : ndarray, [...], µm
        Of its length: along the error, or of the vector as a whole where the error is zero.
    orientation_urad : ndarray, [..., 3], µrad
    """

    error_um: Array
    norm_um: Array
    orientation_urad: Array


def field_uncertainty(
    model: Model,
    errors: ErrorSet,
    uncertainty: Uncertainties,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> FieldUncertainty:
    """Propagate standard uncertainties of errors to a field, to first order.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
        Gives the direction of the error, along which the uncertainty of its length counts.
    uncertainty : mapping of str to ErrorFunction
    coordinates : mapping of str to ndarray, [...], mm or degrees
    view : View, optional
        With a reference, the uncertainty of the difference to it.
    point_mm : ndarray, [..., 3], mm, optional
        Nominal points in R; by default the functional point of the loop.

    Returns
    -------
    FieldUncertainty

    Notes
    -----
    Root of the sum of (gain × standard uncertainty)² over the errors (GUM, 5.1.2).
    """
    nominal = evaluate_first_order(model, errors, coordinates, view, point_mm)
    length = nominal.norm_um[..., None]
    along = np.where(length > 0.0, nominal.error_um / np.where(length > 0.0, length, 1.0), 0.0)
    own = ErrorSet(uncertainty)
    position, tilt = np.zeros(nominal.error_um.shape), np.zeros(nominal.error_um.shape)
    norm = np.zeros(nominal.norm_um.shape)
    for key in uncertainty:
        one = build_basis(model, own, (key,), coordinates, view, point_mm)
        (amplitude,) = amplitudes_of(own, (key,))
        part = amplitude * one.position[0]
        position += part**2
        tilt += (amplitude * one.orientation[0]) ** 2
        norm += np.sum(part * along, axis=-1) ** 2
    whole = np.sum(position, axis=-1)
    norm = np.where(length[..., 0] > 0.0, norm, whole)
    return FieldUncertainty(np.sqrt(position), np.sqrt(norm), np.sqrt(tilt))


@dataclass(frozen=True, slots=True)
class UncertainCase(Case):
    """A measured machine whose errors are off by their standard uncertainties.

    Attributes
    ----------
    errors : ErrorSet
        As measured.
    uncertainty : ErrorSet
        Standard uncertainty along the axis of each error.
    """

    errors: ErrorSet = dataclass_field(default_factory=ErrorSet)
    uncertainty: ErrorSet = dataclass_field(default_factory=ErrorSet)

    def machines(self, rng: np.random.Generator, count: int) -> Array:
        """Draw by how many standard uncertainties each error is off, and one last, [count, K + 1].

        The one is the factor of the errors as measured.
        """
        draws = self.draws
        widths = {Distribution.NORMAL: SIGMAS, Distribution.UNIFORM: np.sqrt(3.0)}
        size = np.full(len(draws.keys), widths[Distribution(draws.distribution)])
        unit = Draws(draws.keys, np.zeros(len(draws.keys)), size, draws.distribution)
        return np.column_stack([unit.draw(rng, count), np.ones(count)])

    def responses(self, places: Places) -> Array:
        """Give responses to a standard uncertainty each, the measured error last, [3, K + 1, N]."""
        keys, model, view = self.draws.keys, self.model, self.view
        at, point = places.coordinates, places.point_mm
        basis = build_basis(model, self.uncertainty, keys, at, view, point)
        factors = amplitudes_of(self.uncertainty, keys)[:, None, None]
        parts = factors * basis.position.reshape(len(keys), -1, 3)
        measured = evaluate_first_order(model, self.errors, at, view, point)
        both = np.concatenate([parts, measured.error_um.reshape(1, -1, 3)])
        return np.ascontiguousarray(np.moveaxis(both, -1, 0))


def uncertain_montecarlo(
    model: Model,
    errors: ErrorSet,
    uncertainty: Uncertainties,
    workspace: Workspace,
    view: View | None = None,
    plan: Plan | None = None,
    distribution: Distribution = Distribution.NORMAL,
    progress: Progress | None = None,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    take: Take | None = None,
) -> MonteCarlo:
    """Sample what the machine may be: its measured errors, each off by its uncertainty.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
        As measured.
    uncertainty : mapping of str to ErrorFunction
        Those of axes that are not in the loop do nothing.
    workspace : Workspace
    view : View, optional
    plan : Plan, optional
    distribution : Distribution, optional
        Normal, or uniform with the same standard uncertainty.
    progress : callable, optional
        Called with the number of machines done since the last call.
    workers, executor, take : optional
        See `warpspace.analysis.montecarlo.montecarlo_each`.

    Returns
    -------
    MonteCarlo
        Its draws have the amplitudes of the errors as centres and three standard uncertainties,
        or √3 of them where uniform, as half widths.
    """
    view, plan = view or View(), plan or Plan()
    own = ErrorSet(uncertainty)
    keys = tuple(own)
    widths = {Distribution.NORMAL: SIGMAS, Distribution.UNIFORM: np.sqrt(3.0)}
    size = np.full(len(keys), widths[distribution]) * np.abs(amplitudes_of(own, keys))
    drawn = Draws(keys, amplitudes_of(errors, keys), size, distribution)
    case = UncertainCase(model, drawn, workspace, view, plan, errors, own)
    (found,) = montecarlo_each(
        [case], workers=workers or plan.workers, executor=executor, progress=progress, take=take
    )
    return found
