"""Histogram of sampled machines like figures 4-8 and 4-9 of the thesis."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from warpspace.analysis.distribution import Probability
from warpspace.analysis.montecarlo import MonteCarlo
from warpspace.outputs.charts.paper import SMALL, TEXT, ground, key_colour, quiet, sheet, style
from warpspace.outputs.drawing.style import LIGHT

WIDTH_IN, HEIGHT_IN = 9.0, 5.4
ROWS = 4
"""Rows of labels above the bars, at most."""


def montecarlo_chart(
    result: MonteCarlo, title: str, subtitle: str, printed_um: float | None = None
) -> Figure:
    """Draw the distribution of |E| with its mean, mode, P95 and specification.

    Parameters
    ----------
    result : MonteCarlo
    title, subtitle : str
    printed_um : float, optional
        Value printed in the thesis, µm, drawn beside ours.

    Returns
    -------
    Figure
    """
    with style():
        figure, top = sheet(WIDTH_IN, HEIGHT_IN, title, subtitle, top_in=1.5)
        axes = figure.add_axes((0.085, 0.115, 0.885, top - 0.115))
        edges, counts = result.histogram.edges_um, result.histogram.counts
        percent = 100.0 * counts / result.plan.samples
        spec = result.plan.spec_um
        for low, high, value in zip(edges[:-1], edges[1:], percent, strict=True):
            beyond = spec is not None and low >= spec
            axes.bar(
                low,
                value,
                high - low,
                align="edge",
                color=_bin_colour(beyond=beyond),
                edgecolor=ground().paper,
                linewidth=0.5,
            )
        quiet(axes, "y")
        axes.set_xlabel("volumetric error |E|, µm")
        axes.set_ylabel(f"machines per {edges[1] - edges[0]:g} µm, %")
        last = float(edges[1:][np.cumsum(counts) >= 0.9995 * result.plan.samples][0])
        axes.set_xlim(0.0, max(last, 1.05 * (spec or 0.0), 1.05 * (printed_um or 0.0)))
        axes.set_ylim(0.0, 1.06 * float(percent.max()))
        marks = [
            ("mode", result.mode_um, ground().ink, "-"),
            ("mean", result.mean_um, key_colour(), "-"),
            ("P95", result.p95_um, ground().muted, "-"),
        ]
        if printed_um is not None:
            marks.append(("thesis", printed_um, ground().series[4], "--"))
        if spec is not None:
            marks.append(("spec", spec, ground().accent, "-"))
        _mark(axes, marks)
        if result.probability is not None:
            _tell(axes, result.probability)
        return figure


def _mark(axes: Axes, marks: Sequence[tuple[str, float, str, str]]) -> None:
    """Draw vertical lines; labels start at their line, on as many rows above as they need."""
    low, high = axes.get_xlim()
    gap = 0.006 * (high - low)
    renderer = FigureCanvasAgg(cast("Figure", axes.figure)).get_renderer()
    taken: list[Bbox] = []
    for name, value, colour, dash in sorted(marks, key=lambda mark: mark[1]):
        label = axes.text(
            value + gap,
            0.0,
            f"{name} {value:.1f} µm",
            color=colour,
            size=TEXT,
            weight="bold",
            va="bottom",
            transform=axes.get_xaxis_transform(),
            zorder=5,
            bbox=_paper(0.4),
        )
        box = label.get_window_extent(renderer).transformed(axes.transData.inverted())
        width = box.width + 2.0 * gap
        if (name == "mode" and value - width >= low) or value + width > high:
            label.set(x=value - gap, ha="right")
        for row in range(ROWS):
            label.set_y(1.02 + 0.058 * row)
            # with the gap to its own line, and as much on the other side
            box = label.get_window_extent(renderer).padded(0.006 * axes.bbox.width, 1.0)
            if not box.count_overlaps(taken):
                break
        taken.append(box)
        axes.plot(
            [value, value],
            [0.0, label.get_position()[1] + 0.04],
            color=colour,
            linestyle=dash,
            linewidth=1.4,
            transform=axes.get_xaxis_transform(),
            clip_on=False,
            zorder=4,
        )


def _tell(axes: Axes, probability: Probability) -> None:
    """Say how likely the specification is kept."""
    axes.text(
        0.985,
        0.95,
        f"{100.0 * probability.probability:.2f} % of the machines\nstay within"
        f" {probability.spec_um:g} µm",
        transform=axes.transAxes,
        ha="right",
        va="top",
        size=TEXT + 2.0,
        weight="bold",
        bbox=_paper(),
    )
    axes.text(
        0.985,
        0.83,
        f"95 % interval {100.0 * probability.low:.2f} … {100.0 * probability.high:.2f} %",
        transform=axes.transAxes,
        ha="right",
        va="top",
        size=SMALL,
        color=ground().muted,
        bbox=_paper(),
    )


def _bin_colour(*, beyond: bool) -> str:
    """Colour of a bin within or beyond the specification."""
    if ground() is LIGHT:
        return "#e3c3c6" if beyond else "#a9c4de"
    return "#7a4a52" if beyond else "#3f6a92"


def _paper(pad: float = 1.5) -> dict[str, Any]:
    """Give the ground behind a label."""
    return {"facecolor": ground().paper, "edgecolor": "none", "pad": pad}
