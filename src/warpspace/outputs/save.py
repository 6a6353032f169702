"""Figures to bytes: PNG, SVG and PDF, the same every time."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.drawing.style import FIGURE_ENDINGS, SAVE_RC
from warpspace.outputs.figures.catalogue import draw_figure
from warpspace.outputs.files import check_target, write_atomically
from warpspace.scene.model import Scene


def figure_bytes(drawing: Drawing, form: str) -> bytes:
    """Write a drawn figure into memory.

    Parameters
    ----------
    drawing : Drawing
    form : str
        One of `FORMATS`.

    Returns
    -------
    bytes
        The same for the same figure: no dates, no random names.
    """
    facts = drawing.facts
    about = f"{facts['settings']}; scene={facts['scene']}"
    metadata: dict[str, str | None]
    if form == "png":
        return _png_bytes(
            drawing,
            {
                "Title": drawing.title,
                "Software": facts["version"],
                "Description": about,
                "Exaggeration": facts["exaggeration"],
                "Scene": facts["scene"],
            },
        )
    if form == "svg":
        metadata = {
            "Title": drawing.title,
            "Creator": facts["version"],
            "Description": about,
            "Date": None,
        }
    else:
        metadata = {
            "Title": drawing.title,
            "Creator": facts["version"],
            "Subject": about,
            "Keywords": f"scene={facts['scene']}, exaggeration={facts['exaggeration']}",
            "CreationDate": None,
        }
    buffer = io.BytesIO()
    with mpl.rc_context(SAVE_RC):
        drawing.figure.savefig(
            buffer, format=form, dpi="figure", metadata=metadata,
            facecolor=drawing.figure.get_facecolor(),
        )  # fmt: skip
    return buffer.getvalue()


def _png_bytes(drawing: Drawing, facts: Mapping[str, str]) -> bytes:
    """Draw the pixels and pack them without transparency."""
    text = PngInfo()
    for key, value in facts.items():
        text.add_itxt(key, value)
    with mpl.rc_context(SAVE_RC):
        canvas = FigureCanvasAgg(drawing.figure)
        canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(
        buffer, format="png", pnginfo=text, compress_level=6
    )
    return buffer.getvalue()


def render_figure(
    name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str = "png"
) -> bytes:
    """Draw a figure and give it as a file's bytes; see `draw_figure` and `figure_bytes`."""
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
    """Draw a figure into a file, in this process.

    Parameters
    ----------
    path : str or Path
        Ends in .png, .svg or .pdf.
    name : str
        Name of the figure, see `warpspace.outputs.figures.catalogue`.
    scenes : sequence of Scene
    settings : FigureSettings, optional
    force : bool, optional
        Whether an existing file is replaced.

    Returns
    -------
    Path
        The file.
    """
    form = check_target(path, FIGURE_ENDINGS, overwrite=force).suffix.lower().lstrip(".")
    content = render_figure(name, scenes, settings or FigureSettings(), form)
    with write_atomically(path, overwrite=force) as temporary:
        temporary.write_bytes(content)
    return Path(path)
