"""Figures, charts and drawings of a page as bytes and files, the same for the same content."""

import gc
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final
from weakref import WeakSet

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpspace.geometry.colour import ColourScale
from warpspace.outputs.drawing.canvas import LEADER_FROM, Canvas, Occupancy, write_label
from warpspace.outputs.drawing.settings import (
    DARK,
    FIGURE_ENDINGS,
    LIGHT,
    SAVE_RC,
    FigureSettings,
    factor,
)
from warpspace.outputs.drawing.sheet import Drawing, Row, Sheet, draw_heading
from warpspace.outputs.figures.registry import draw_figure
from warpspace.outputs.file_output import check_target, write_content
from warpspace.resources import __version__
from warpspace.scene.model import Scene
from warpspace.units import Array

_figures: WeakSet[Figure] = WeakSet()


def figure_bytes(drawing: Drawing, form: str) -> bytes:
    facts = drawing.facts
    about = f"{facts['settings']}; scene={facts['scene']}"
    numbers = {name.title(): facts[name] for name in ("exaggeration", "scene")}
    keywords = f"scene={facts['scene']}, exaggeration={facts['exaggeration']}"
    tags = {
        "png": {"Software": facts["version"], "Description": about, **numbers},
        "svg": {"Creator": facts["version"], "Description": about},
        "pdf": {"Creator": facts["version"], "Subject": about, "Keywords": keywords},
    }[form]
    return encode_figure(drawing.figure, form, {"Title": drawing.title, **tags})


def render_figure(
    name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str = "png"
) -> bytes:
    if _figures:  # a figure refers to itself: 100 MB of those before would wait for the collector
        gc.collect()
    with mpl.rc_context(SAVE_RC):
        drawing = draw_figure(name, scenes, settings, exact=form == "png")
    _figures.add(drawing.figure)
    return figure_bytes(drawing, form)


def write_figure(
    path: str | Path,
    name: str,
    scenes: Sequence[Scene],
    settings: FigureSettings | None = None,
    *,
    force: bool = True,
) -> Path:
    form = check_target(path, FIGURE_ENDINGS, overwrite=force).suffix.lower().lstrip(".")
    content = render_figure(name, scenes, settings or FigureSettings(), form)
    write_content(content, path, overwrite=force)
    return Path(path)


def write_chart(figure: Figure, path: str | Path, *, overwrite: bool = True) -> Path:
    """Write a chart; the ending chooses the format, the same chart gives the same bytes."""
    target = check_target(path, FIGURE_ENDINGS, overwrite=overwrite)
    content = encode_figure(figure, target.suffix.lower().lstrip("."))
    write_content(content, target, overwrite=overwrite)
    return target


_UNDATED: Final[dict[str, dict[str, str | None]]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""Metadata that matplotlib would add by default: dates and versions, which differ between runs."""


def encode_figure(figure: Figure, form: str, facts: Mapping[str, str] | None = None) -> bytes:
    buffer = io.BytesIO()
    with mpl.rc_context(SAVE_RC):
        if form == "png":
            text = PngInfo()
            for key, value in (facts or {}).items():
                text.add_itxt(key, value)
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            # the paper is opaque: without the transparency files are a quarter smaller
            pixels = np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])
            Image.fromarray(pixels).save(buffer, "png", pnginfo=text, dpi=(figure.dpi, figure.dpi))
        else:
            figure.savefig(
                buffer, format=form, dpi="figure", metadata={**_UNDATED[form], **(facts or {})},
                facecolor=figure.get_facecolor(),
            )  # fmt: skip
    return buffer.getvalue()


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
    """Draw the pixels of a page as a PNG with heading, colour bar, scale bars and labels."""
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
