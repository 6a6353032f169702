"""Colour scales: numbers to colours, the same in the browser and in the figures."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from cmap import Colormap
from numpy.typing import NDArray

from warpspace.exceptions import OptionError
from warpspace.units import MICROMETRE, MICRORADIAN, Array

SEQUENTIAL = "viridis"
DIVERGING = "crameri:vik"
SYMBOLS = {
    "position": ("E", MICROMETRE),
    "orientation": ("φ", MICRORADIAN),
    "uncertainty": ("E", MICROMETRE),
}
"""Symbol and unit of what can be coloured; uncertainties are U95 of position errors."""
COMPONENTS = ("norm", "x", "y", "z")
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_INTERVALS = 10
LEVELS = 256
Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class ColourScale:
    """A colour map over a range of values."""

    low: float  # values at the ends, in `unit`
    high: float
    # whether it has a neutral middle (signed values) rather than a dark end (lengths)
    diverging: bool = False
    label: str = "|E|"  # what the values are
    unit: str = MICROMETRE

    @property
    def name(self) -> str:
        return DIVERGING if self.diverging else SEQUENTIAL

    def colours(self, values: Array) -> Bytes:
        """Map values, [...], to sRGB, [..., 3]; those beyond take the colour of the end."""
        table = colour_table(diverging=self.diverging)
        return table[np.rint(self.fraction(values) * (LEVELS - 1)).astype(np.intp)]

    def fraction(self, values: Array) -> Array:
        """Place values on the scale, 0 at the low and 1 at the high end, clipped."""
        return np.clip((np.asarray(values) - self.low) / (self.high - self.low), 0.0, 1.0)

    @property
    def ticks(self) -> tuple[float, ...]:
        """Round values to label, from the low to the high end."""
        return tuple(_multiples(nice_step(self.high - self.low), self.low, self.high))


@cache
def colour_table(*, diverging: bool = False) -> Bytes:
    """Return the colours of a scale from its low to its high end, [256, 3] of uint8, sRGB."""
    colours = Colormap(DIVERGING if diverging else SEQUENTIAL).lut(LEVELS)
    return (np.asarray(colours)[:, :3] * 255.0 + 0.5).astype(np.uint8)


def nice_step(span: float) -> float:
    """Choose a round step (1, 2, 2.5, 5 × 10ⁿ) that divides a span into at most ten."""
    raw = span / _INTERVALS
    decade = 10.0 ** math.floor(math.log10(raw))
    return next(step * decade for step in _STEPS if step * decade >= raw * (1.0 - 1e-9))


def _multiples(step: float, low: float, high: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(step * number, 12) for number in range(first, last + 1)]


def component_values(error: Array, component: str) -> Array:
    """Pick what a map shows of errors, [..., 3]: "norm", "x", "y" or "z", [...]."""
    if component not in COMPONENTS:
        raise OptionError(f"component {component!r}; expected one of {', '.join(COMPONENTS)}")
    if component == "norm":
        return np.sqrt(np.einsum("...i,...i->...", error, error))
    return error[..., "xyz".index(component)]


def build_scale(
    largest: float,
    component: str,
    *,
    quantity: str = "E",
    unit: str = MICROMETRE,
    end: float | None = None,
    change: bool = False,
) -> ColourScale:
    """Choose a scale with round ends for values up to a magnitude, or a specified end."""
    top = 1.0
    if math.isfinite(largest) and largest > 0.0:
        step = nice_step(largest if component == "norm" else 2.0 * largest)
        top = step * math.ceil(largest / step * (1.0 - 1e-9))
    top = top if end is None else end
    if component == "norm":
        label = f"|{quantity}_B − {quantity}_A|" if change else f"|{quantity}|"
        return ColourScale(0.0, top, label=label, unit=unit)
    label = f"{quantity}_{component}{', B − A' if change else ''}"
    return ColourScale(-top, top, diverging=True, label=label, unit=unit)


def srgb_to_linear(srgb: Array) -> Array:
    """Undo the sRGB transfer curve, [..., 3] of 0 … 1."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: Array) -> Array:
    """Apply the sRGB transfer curve, [..., 3] of 0 … 1."""
    positive = np.maximum(linear, 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * positive ** (1 / 2.4) - 0.055)


NO_SPAN = 1e-12  # A range below this part of its ends is rounding, mm a part of 1 mm


def tick_values(low: float, high: float, max_count: float) -> list[float]:
    span = high - low
    if not span > NO_SPAN * max(1.0, abs(low), abs(high)):
        return [low]
    step = nice_step(span)
    while span / step > max(max_count, 2.0):
        step = nice_step(10.0 * step * 1.01)
    return _multiples(step, low, high)
