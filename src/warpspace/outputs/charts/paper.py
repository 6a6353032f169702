"""The sheet charts are drawn on, and writing them so that the same chart is the same file."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpspace.outputs.files import check_target, write_atomically
from warpspace.outputs.style import FONT, LIGHT

CHART_ENDINGS = (".png", ".svg", ".pdf")
DPI = 160.0
TITLE, SUBTITLE, TEXT, SMALL = 13.0, 9.5, 9.5, 8.5
KEY_COLOUR, BAR_COLOUR = LIGHT.series[0], "#b4bfcc"
# Dates and versions would make every run a new file.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_RC: Any = {
    "font.family": [FONT],
    "font.size": TEXT,
    "svg.hashsalt": "warpspace",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "axes.edgecolor": LIGHT.muted,
    "axes.labelcolor": LIGHT.ink,
    "text.color": LIGHT.ink,
    "xtick.color": LIGHT.muted,
    "ytick.color": LIGHT.muted,
    "xtick.labelcolor": LIGHT.ink,
    "ytick.labelcolor": LIGHT.ink,
}


def style() -> Any:
    """Give the context that charts are drawn and written in."""
    return mpl.rc_context(_RC)


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
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor=LIGHT.paper)
    left = 0.3 / width
    figure.text(left, 1.0 - 0.2 / height, title, size=TITLE, weight="bold", va="top")
    figure.text(left, 1.0 - 0.5 / height, subtitle, size=SUBTITLE, color=LIGHT.muted, va="top")
    return figure, 1.0 - top_in / height


def quiet(axes: Axes, grid: str = "x") -> None:
    """Leave an axes no more lines than it needs."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(length=3.0, width=0.8)
    axes.grid(visible=True, axis=grid, color=LIGHT.faint, linewidth=0.7)  # pyright: ignore[reportArgumentType]
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
    with style(), write_atomically(target, overwrite=overwrite) as temporary:
        ending = target.suffix.lower()
        figure.savefig(temporary, format=ending[1:], metadata=_METADATA[ending])
    return target
