"""Colours of the lines of a picture, on a light ground and on a dark one."""

from dataclasses import dataclass

from warpspace.app.evaluation.live_picture import LivePicture

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Palette:
    """Quiet colours around the map, sRGB; only the trace that is looked at stands out."""

    edge: Rgb
    grid: Rgb
    ghost: Rgb
    trace_nominal: Rgb
    trace_actual: Rgb
    trace_elsewhere: Rgb
    axis: Rgb


LIGHT = Palette(
    edge=(24, 32, 46),
    grid=(24, 32, 46),
    ghost=(140, 150, 165),
    trace_nominal=(130, 139, 153),
    trace_actual=(206, 84, 8),
    trace_elsewhere=(196, 202, 211),
    axis=(110, 120, 135),
)
DARK = Palette(
    edge=(215, 220, 228),
    grid=(20, 24, 32),
    ghost=(130, 138, 150),
    trace_nominal=(150, 158, 170),
    trace_actual=(224, 142, 62),
    trace_elsewhere=(84, 92, 104),
    axis=(150, 158, 170),
)


def palette(picture: LivePicture) -> Palette:
    """Choose the colours for the ground a picture is drawn on."""
    return DARK if picture.state.shown.dark else LIGHT
