"""Figures by name to bytes and files."""

import gc
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl

from warpspace.outputs.charts.paper import encode_figure
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.drawing.sheet import Drawing
from warpspace.outputs.drawing.style import FIGURE_ENDINGS, SAVE_RC
from warpspace.outputs.figures.catalogue import draw_figure
from warpspace.outputs.files import check_target, write_atomically
from warpspace.scene.model import Scene


def figure_bytes(drawing: Drawing, form: str) -> bytes:
    """Write a drawn figure into memory."""
    facts = drawing.facts
    about = f"{facts['settings']}; scene={facts['scene']}"
    said = {"Title": drawing.title}
    if form == "png":
        said |= {
            "Software": facts["version"],
            "Description": about,
            "Exaggeration": facts["exaggeration"],
            "Scene": facts["scene"],
        }
    elif form == "svg":
        said |= {"Creator": facts["version"], "Description": about}
    else:
        keywords = f"scene={facts['scene']}, exaggeration={facts['exaggeration']}"
        said |= {"Creator": facts["version"], "Subject": about, "Keywords": keywords}
    return encode_figure(drawing.figure, form, said)


def render_figure(
    name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str = "png"
) -> bytes:
    """Draw a figure and give it as a file's bytes; see `draw_figure` and `figure_bytes`."""
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
    """Draw a figure into a file, in this process."""
    form = check_target(path, FIGURE_ENDINGS, overwrite=force).suffix.lower().lstrip(".")
    content = render_figure(name, scenes, settings or FigureSettings(), form)
    with write_atomically(path, overwrite=force) as temporary:
        temporary.write_bytes(content)
    return Path(path)
