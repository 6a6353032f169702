"""Error fields, and the first-order basis that gives one for any amplitudes."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from warpspace.units import Array


@dataclass(frozen=True)
class ErrorField:
    """Errors over a batch of points.

    Attributes
    ----------
    nominal_mm : ndarray, [..., 3], mm
        Nominal points in R.
    error_um : ndarray, [..., 3], µm
        Position error, actual − nominal.
    orientation_urad : ndarray, [..., 3], µrad
        Orientation error of the tool axis: the small rotation vector that turns it, right-hand
        rule. It has no part about the tool axis itself; its norm is the tilt. Not a number where it
        was not asked for.
    """

    nominal_mm: Array
    error_um: Array
    orientation_urad: Array

    @cached_property
    def norm_um(self) -> Array:
        """Length of the position error, [...], µm."""
        x, y, z = (self.error_um[..., axis] for axis in range(3))
        squared = x * x
        squared += y * y  # in place: a volume of points is larger than what a processor keeps near
        squared += z * z
        return np.sqrt(squared)


@dataclass(frozen=True, slots=True)
class ErrorBasis:
    """First-order response of a batch of points to every parameter.

    Attributes
    ----------
    keys : tuple of str, (K,)
        Parameter keys.
    nominal_mm : ndarray, [..., 3], mm
        Nominal points in R.
    position : ndarray, [K, ..., 3], µm per µm or µrad of amplitude
        The curve of each parameter along its axis is folded in.
    orientation : ndarray, [K, ..., 3], µrad per µm or µrad of amplitude
    """

    keys: tuple[str, ...]
    nominal_mm: Array
    position: Array
    orientation: Array

    def evaluate(self, amplitudes: Array, *, orientation: bool = True) -> ErrorField:
        """Add up the response to a vector of amplitudes.

        Parameters
        ----------
        amplitudes : ndarray, [K], µm or µrad
        orientation : bool, optional
            Whether the orientation error is wanted too, at twice the work.

        Returns
        -------
        ErrorField
        """
        return ErrorField(
            self.nominal_mm,
            self._combine(amplitudes, self.position),
            self._combine(amplitudes, self.orientation)
            if orientation
            else _unknown(self.nominal_mm.shape),
        )

    def _combine(self, amplitudes: Array, response: Array) -> Array:
        """One matrix-vector product, [..., 3], without the rows of parameters that are zero.

        The product waits for the memory, and most machines have most parameters at zero.
        """
        flat = response.reshape(len(self.keys), self.nominal_mm.size)
        used = np.flatnonzero(amplitudes)
        if 2 * len(used) > len(self.keys):
            return (amplitudes @ flat).reshape(self.nominal_mm.shape)
        if not len(used):
            return np.zeros(self.nominal_mm.shape)
        total = flat[used[0]] * amplitudes[used[0]]
        part = np.empty_like(total)
        for index in used[1:]:
            np.multiply(flat[index], amplitudes[index], out=part)
            total += part
        return total.reshape(self.nominal_mm.shape)

    def contributions(self, amplitudes: Array, index: tuple[int, ...] = ()) -> Array:
        """Split the position error at one node into the parameters, [K, 3], µm."""
        chosen = self.position[(slice(None), *index)]
        return amplitudes[:, None] * chosen.reshape(len(self.keys), 3)


@lru_cache(maxsize=64)
def _unknown(shape: tuple[int, ...]) -> Array:
    """Give an array of a shape that is not a number anywhere, without the memory for it."""
    return np.broadcast_to(np.nan, shape)
