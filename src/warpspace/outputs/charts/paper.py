"""The sheet charts are drawn on, and writing them."""

from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpspace.outputs.drawing.style import FIGURE_ENDINGS, FONT, LIGHT, SAVE_RC, Theme
from warpspace.outputs.encoding import encode_figure
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
    """Start a figure with a title and a line below it.

    Parameters
    ----------
    width, height : float, inches
    title, subtitle : str
    top_in : float, optional
        Height kept for both, inches.

    Returns
    -------
    figure : Figure
    top : float
        Upper end of the room for axes, share of the height.
    """
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
    """Write a chart; the ending chooses the format, the same chart gives the same bytes.

    Parameters
    ----------
    figure : Figure
    path : str or Path
        Ending .png, .svg or .pdf.
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    target = check_target(path, CHART_ENDINGS, overwrite=overwrite)
    content = encode_figure(figure, target.suffix.lower().lstrip("."))
    with write_atomically(target, overwrite=overwrite) as temporary:
        temporary.write_bytes(content)
    return target
