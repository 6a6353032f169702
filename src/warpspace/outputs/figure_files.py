"""Figures and charts to bytes and files; the same figure gives the same bytes."""

import gc
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpspace.outputs.drawing.settings import FIGURE_ENDINGS, SAVE_RC, FigureSettings
from warpspace.outputs.drawing.sheet import Drawing
from warpspace.outputs.figures.registry import draw_figure
from warpspace.outputs.file_output import check_target, write_content
from warpspace.scene.model import Scene


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
    gc.collect()  # a figure refers to itself: 100 MB of those before would wait for the collector
    with mpl.rc_context(SAVE_RC):
        drawing = draw_figure(name, scenes, settings, exact=form == "png")
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
            Image.fromarray(pixels).save(
                buffer, format="png", pnginfo=text, dpi=(figure.dpi, figure.dpi)
            )
        else:
            figure.savefig(
                buffer, format=form, dpi="figure", metadata={**_UNDATED[form], **(facts or {})},
                facecolor=figure.get_facecolor(),
            )  # fmt: skip
    return buffer.getvalue()
