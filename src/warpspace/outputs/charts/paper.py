"""The sheet charts are drawn on, and writing them."""

import io
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpspace.outputs.drawing.style import FIGURE_ENDINGS, FONT, LIGHT, SAVE_RC, Theme
from warpspace.outputs.files import check_target, write_atomically

CHART_ENDINGS = FIGURE_ENDINGS
DPI = 160.0
TITLE, SUBTITLE, TEXT, SMALL = 13.0, 9.5, 9.5, 8.5
LEAST_SHARE = 0.6
"""Of its size, what a title is drawn with at the least."""
_THEME: ContextVar[Theme] = ContextVar("theme of the charts", default=LIGHT)


@contextmanager
def on_ground(theme: Theme) -> Generator[None]:
    """Draw the charts inside on the ground of a theme; they are light elsewhere."""
    token = _THEME.set(theme)
    try:
        yield
    finally:
        _THEME.reset(token)


def ground() -> Theme:
    """Give the theme that charts are drawn on here."""
    return _THEME.get()


def key_colour() -> str:
    """Colour of what matters."""
    return ground().series[0]


def bar_colour() -> str:
    """Colour of the other bars."""
    return "#b4bfcc" if ground() is LIGHT else "#56616f"


def style() -> Any:
    """Give the context that charts are drawn in."""
    theme = ground()
    return mpl.rc_context(
        {
            **SAVE_RC,
            "font.family": [FONT],
            "font.size": TEXT,
            "axes.facecolor": theme.paper,
            "axes.edgecolor": theme.muted,
            "axes.labelcolor": theme.ink,
            "legend.facecolor": theme.paper,
            "legend.edgecolor": theme.faint,
            "text.color": theme.ink,
            "xtick.color": theme.muted,
            "ytick.color": theme.muted,
            "xtick.labelcolor": theme.ink,
            "ytick.labelcolor": theme.ink,
        }
    )


def sheet(
    width: float, height: float, title: str, subtitle: str, top_in: float = 0.85
) -> tuple[Figure, float]:
    """Start a figure with a title and a line below it."""
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor=ground().paper)
    left = 0.3 / width
    for words, size, down, weight, colour in (
        (title, TITLE, 0.2, "bold", ground().ink),
        (subtitle, SUBTITLE, 0.5, "normal", ground().muted),
    ):
        text = figure.text(left, 1.0 - down / height, words, size=size, weight=weight, color=colour)
        text.set(va="top", parse_math=False)  # a $ in what a user calls a scene is a dollar
        wide = text.get_window_extent().width / figure.dpi
        if wide > width - 0.5:  # smaller, so that it does not run off the sheet
            text.set_fontsize(size * max((width - 0.5) / wide, LEAST_SHARE))
    return figure, 1.0 - top_in / height


def quiet(axes: Axes, grid: str = "x") -> None:
    """Leave an axes no more lines than it needs."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(length=3.0, width=0.8)
    axes.grid(visible=True, axis=grid, color=ground().faint, linewidth=0.7)  # pyright: ignore[reportArgumentType]
    axes.set_axisbelow(True)


def write_chart(figure: Figure, path: str | Path, *, overwrite: bool = True) -> Path:
    """Write a chart; the ending chooses the format, the same chart gives the same bytes."""
    target = check_target(path, CHART_ENDINGS, overwrite=overwrite)
    content = encode_figure(figure, target.suffix.lower().lstrip("."))
    with write_atomically(target, overwrite=overwrite) as temporary:
        temporary.write_bytes(content)
    return target


_UNDATED: Final[dict[str, dict[str, str | None]]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""What matplotlib would write of its own accord: dates and versions, which differ between runs."""


def encode_figure(figure: Figure, form: str, facts: Mapping[str, str] | None = None) -> bytes:
    """Write a figure into memory."""
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
