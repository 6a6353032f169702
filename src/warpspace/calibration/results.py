"""What is asked of a calibration, and what it gives."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpspace.calibration.rank import Rank
from warpspace.calibration.readings import Readings
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of a calibration.

    Attributes
    ----------
    keys : tuple of str or None
        Parameters to find, each with ``:constant`` or ``:ramp`` behind it on request; None for
        those that the kinds of readings suggest and the data determine.
    robust : bool
        Whether readings far off count less (soft L1 loss).
    priors : bool
        Whether the tolerances of the scene count as knowledge: a uniform distribution each.
    """

    keys: tuple[str, ...] | None = None
    robust: bool = False
    priors: bool = False


@dataclass(frozen=True, slots=True)
class Found:
    """One parameter after a calibration.

    Attributes
    ----------
    key : str
    before, value : float, µm or µrad
    standard_uncertainty : float or None, µm or µrad
        None where the readings do not determine it.
    interval : tuple of float, (2,), or None
        95 % interval.
    identifiable : bool
        Whether the readings determine it without holding another parameter.
    """

    key: str
    before: float
    value: float
    standard_uncertainty: float | None
    interval: tuple[float, float] | None
    identifiable: bool


@dataclass(frozen=True, slots=True)
class Residuals:
    """What one file of readings leaves.

    Attributes
    ----------
    readings : Readings
    before_mm, after_mm : ndarray, [n, d], mm
        Observed − predicted: with the errors of the scene, and with those found.
    outliers : tuple of int
        Rows that lie further off than the others let expect.
    """

    readings: Readings
    before_mm: Array
    after_mm: Array
    outliers: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Calibration:
    """A calibrated machine.

    Attributes
    ----------
    scene : Scene
        With the errors found.
    parameters : tuple of Found
    rank : Rank
    slopes : frozenset of str
        Parameters of which a slope was looked for.
    keys : tuple of str, (k,)
        Parameters of `correlation`.
    correlation : ndarray, [k, k]
    covariance : ndarray, [k, k], µm and µrad
    unknowns : mapping of str to float, mm
        What the set-up left unknown, as found.
    fitted, predicted : tuple of Residuals
    rms_before_mm, rms_after_mm : float, mm
        Of the residual vectors that were fitted.
    rms_predicted_before_mm, rms_predicted_after_mm : float or None, mm
    sigma_mm : float, mm
        Standard deviation of one component, from the residuals; of a weight of one where
        uncertainties are given.
    freedom : int
        Components less what was fitted.
    notes : tuple of str
    """

    scene: Scene
    parameters: tuple[Found, ...]
    rank: Rank
    slopes: frozenset[str]
    keys: tuple[str, ...]
    correlation: Array
    covariance: Array
    unknowns: Mapping[str, float]
    fitted: tuple[Residuals, ...]
    predicted: tuple[Residuals, ...]
    rms_before_mm: float
    rms_after_mm: float
    rms_predicted_before_mm: float | None
    rms_predicted_after_mm: float | None
    sigma_mm: float
    freedom: int
    notes: tuple[str, ...] = field(default=())
