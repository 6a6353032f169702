"""The drawing of a page as a figure: its pixels with heading, colour bar, scale bars and labels."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.colour import ColourScale
from warpspace.outputs.drawing.canvas import (
    LEADER_FROM,
    Canvas,
    Occupancy,
    write_label,
)
from warpspace.outputs.drawing.settings import DARK, LIGHT, FigureSettings, factor
from warpspace.outputs.drawing.sheet import Row, Sheet, draw_heading
from warpspace.outputs.figure_files import encode_figure
from warpspace.resources import __version__
from warpspace.units import Array

HEAD, PANEL = 190.0, 330.0  # space above and beside the pixels, px of a 1600 × 1200 figure


def draw_view(
    pixels: NDArray[np.uint8],  # [height, width, 3 or 4]
    title: str,
    facts: Sequence[str],
    scale: ColourScale,
    marks: Mapping[str, float],
    rows: Sequence[Row],
    bars: tuple[float, float] | None,  # px of a millimetre, display factor; None for no scale bars
    labels: Sequence[tuple[str, Array]],  # text and point, [2], px from the left bottom
    dark: bool,
) -> bytes:
    """Draw the figure as a PNG."""
    height, width = pixels.shape[:2]
    unit = factor(width, height)
    canvas = Canvas(
        width + round(PANEL * unit), height + round(HEAD * unit), DARK if dark else LIGHT
    )
    drawn = (0.0, 0.0, float(width), float(height))
    canvas.image(pixels, drawn)
    draw_heading(canvas, title, facts)
    column = (width + 0.3 * canvas.margin, 0.6 * canvas.margin, canvas.width - 0.6 * canvas.margin,
              float(height))  # fmt: skip
    sheet = Sheet("view", canvas, title, drawn, column, (), FigureSettings(dark=dark))
    sheet.draw_panel(scale, f"{scale.label} [{scale.unit}]", list(marks.items()), rows, bars)
    occupancy = Occupancy(canvas.width, canvas.height, 2.0 * canvas.factor)
    if pixels.shape[2] == 4:
        occupancy.add_mask(pixels[..., 3] > 127, drawn)
    for text, point_px in labels:
        placed = write_label(canvas, text, [point_px], drawn, occupancy)
        if placed is not None and placed.distance > canvas.px(LEADER_FROM):
            placed.draw_leader(canvas, canvas.theme.ink)
    program, description = f"warpspace {__version__}", "; ".join(facts)
    tags = {"Title": title, "Software": program, "Description": description}
    return encode_figure(canvas.figure, "png", tags)
