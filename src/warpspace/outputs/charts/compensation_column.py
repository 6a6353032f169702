"""The maps of a compensation for the app: three rows of small slices, or the sheet for a report."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpspace.formats.compensation.compensate import Compensation
from warpspace.outputs.charts.compensation import (
    chart_fields,
    chart_planes,
    compensation_chart,
    draw_slice,
)
from warpspace.outputs.charts.paper import DPI, ground, on_ground, style
from warpspace.outputs.drawing.style import DARK, LIGHT
from warpspace.outputs.encoding import encode_figure

WIDTH_IN, HEIGHT_IN = 4.3, 5.0
WORDS = 9.0


def compensation_column(found: Compensation) -> Figure:
    """Draw |E| before, after on the same colours, and what is left on its own, a row each.

    Parameters
    ----------
    found : Compensation

    Returns
    -------
    Figure
        The slices pass through the point where most is left; a colour bar stands beside each row.
    """
    planes = chart_planes(found)
    with style():
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI, facecolor=ground().paper)
        axes = np.atleast_2d(figure.subplots(3, max(len(planes), 1), squeeze=False))
        figure.subplots_adjust(
            left=0.095, right=0.85, top=0.93, bottom=0.085, wspace=0.42, hspace=0.66
        )
        for row, (words, field, largest) in zip(axes, chart_fields(found), strict=True):
            place = row[0].get_position()
            figure.text(place.x0, place.y1 + 0.022, words, size=WORDS, color=ground().ink)
            if not planes:
                row[0].set_axis_off()
                continue
            meshes = [
                draw_slice(column, found, field, plane, largest)
                for column, plane in zip(row, planes, strict=True)
            ]
            for column in row:
                _narrow(column)
            beside = figure.add_axes((0.875, place.y0, 0.024, place.height))
            bar = figure.colorbar(meshes[0], cax=beside)
            bar.ax.tick_params(labelsize=WORDS - 2.0)
            bar.ax.set_title("|E| [µm]", fontsize=WORDS - 1.5, pad=6.0)
        return figure


def _narrow(axes: Axes) -> None:
    """Name both axes of a map below it, where there is no room beside it."""
    across, up = axes.get_xlabel(), axes.get_ylabel()
    axes.set_xlabel(f"{up.replace(' [', ' over ' + across.partition(' [')[0] + ' [')}")
    axes.xaxis.label.set_fontsize(WORDS - 1.0)
    axes.set_ylabel("")
    axes.tick_params(labelsize=WORDS - 2.0)
    axes.locator_params(nbins=3)


def draw_maps(found: Compensation, *, dark: bool, narrow: bool) -> bytes:
    """Draw the maps of a compensation as a PNG: the column, or the sheet of the command."""
    with on_ground(DARK if dark else LIGHT):
        if narrow:
            return encode_figure(compensation_column(found), "png")
        scene = found.controller.scene
        where = f"{found.format.title} · loop {found.loop} · {found.points_words}"
        return encode_figure(
            compensation_chart(found, f"Compensation · {scene.title}", where), "png"
        )
