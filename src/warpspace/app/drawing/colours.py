"""Colours of the drawing, corrected for the tone mapping of viser's client.

The client applies the ACES filmic tone map (three.js). For unlit materials it can be inverted:
vertices get the colour that the tone map turns into the target colour. Some components are below 0
or above 1, so they are sent as floats.
"""

from collections.abc import Mapping
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.geometry import colour as scales
from warpspace.units import Array

Floats = NDArray[np.float32]
Rgb = tuple[int, int, int]

# three.js, tonemapping_pars_fragment: sRGB to the ACES working space, and back.
_IN = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
_OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
_EXPOSURE = 1.0 / 0.6
_A, _B = 0.0245786, 0.000090537
_C, _D, _E = 0.983729, 0.4329510, 0.238081


def inverse_tone_map(srgb: NDArray[np.uint8]) -> Floats:
    """Compute the linear colours that the client maps to sRGB colours."""
    target = scales.srgb_to_linear(srgb.astype(float) / 255.0) @ np.linalg.inv(_OUT).T
    # target = (v² + A·v − B) / (C·v² + D·v + E), solved for the positive v
    a, b, c = 1.0 - _C * target, _A - _D * target, -(_B + _E * target)
    v = (-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    return ((v / _EXPOSURE) @ np.linalg.inv(_IN).T).astype(np.float32)


@cache
def level_colours(*, diverging: bool) -> Floats:
    """Return the vertex colours of all levels of a scale, [LEVELS, 3]."""
    return inverse_tone_map(scales.colour_table(diverging=diverging))


def colour_levels(scale: scales.ColourScale, values: Array) -> NDArray[np.uint8]:
    return np.rint(scale.fraction(values) * (scales.LEVELS - 1)).astype(np.uint8)


@lru_cache(maxsize=64)
def line_colour(rgb: Rgb) -> NDArray[np.uint8]:
    """Return the bytes of a line that appears in a colour, [3]; nearly exact below 230."""
    linear = np.clip(inverse_tone_map(np.array(rgb, dtype=np.uint8)), 0.0, 1.0)
    rgb_bytes = np.rint(scales.linear_to_srgb(linear.astype(float)) * 255.0).astype(np.uint8)
    rgb_bytes.flags.writeable = False  # the same array each time
    return rgb_bytes


# --- Colours of lines, on a light and on a dark background ----------------------------------------


COLOURS: Mapping[str, tuple[Rgb, Rgb]] = {
    "edge": ((24, 32, 46), (215, 220, 228)),
    "grid": ((24, 32, 46), (20, 24, 32)),
    "ghost": ((140, 150, 165), (130, 138, 150)),
    "trace_nominal": ((130, 139, 153), (150, 158, 170)),
    "trace_actual": ((206, 84, 8), (224, 142, 62)),  # the only accent
    "trace_elsewhere": ((196, 202, 211), (84, 92, 104)),
    "axis": ((110, 120, 135), (150, 158, 170)),
}


def colour(picture: LivePicture, name: str) -> Rgb:
    return COLOURS[name][picture.state.shown.dark]
