"""Any matplotlib figure to the bytes of a PNG, SVG or PDF file, the same bytes every time."""

import io
from collections.abc import Mapping
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpspace.outputs.drawing.style import SAVE_RC

_UNDATED: Final[dict[str, dict[str, str | None]]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""What matplotlib would write of its own accord: dates and versions, which differ between runs."""


def encode_figure(figure: Figure, form: str, facts: Mapping[str, str] | None = None) -> bytes:
    """Write a figure into memory.

    Parameters
    ----------
    figure : Figure
    form : str
        "png", "svg" or "pdf".
    facts : mapping of str to str, optional
        What the file says of itself, by the names that the format has for it: any for PNG, for
        the others those that matplotlib's ``savefig`` knows.

    Returns
    -------
    bytes
        The same for the same figure: no dates, no random names.
    """
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
