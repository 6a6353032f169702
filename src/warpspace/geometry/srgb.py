"""The transfer curve between sRGB colours and linear light."""

import numpy as np

from warpspace.units import Array


def srgb_to_linear(srgb: Array) -> Array:
    """Undo the sRGB transfer curve, [..., 3] of 0 … 1."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: Array) -> Array:
    """Apply the sRGB transfer curve, [..., 3] of 0 … 1."""
    positive = np.maximum(linear, 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * positive ** (1 / 2.4) - 0.055)
