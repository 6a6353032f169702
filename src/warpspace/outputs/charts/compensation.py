"""Charts of a compensation: maps before and after, and what is left by the size of the table."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patheffects import withStroke

from warpspace.analysis.statistics import Statistics
from warpspace.field.basis import ErrorField
from warpspace.formats.compensation.compensate import Compensation
from warpspace.formats.compensation.sweep import Step
from warpspace.outputs.charts.paper import SMALL, TEXT, ground, quiet, sheet, style
from warpspace.units import Array

WIDTH_IN, ROW_IN = 11.0, 3.2
LEAST_UM = 1e-3
"""Upper end of a colour scale where nothing is left."""
PLANES = ((0, 1), (0, 2), (1, 2))
"""Axes across and up of each slice."""


def compensation_chart(found: Compensation, title: str, subtitle: str) -> Figure:
    """Draw |E| before, after on the same colours, and what is left on its own, in slices.

    Parameters
    ----------
    found : Compensation
    title, subtitle : str

    Returns
    -------
    Figure
        The slices pass through the point where most is left.
    """
    planes = chart_planes(found)
    columns = chart_fields(found)
    with style():
        height = 1.3 + ROW_IN * max(len(planes), 1)
        figure, top = sheet(WIDTH_IN, height, title, subtitle, top_in=1.0)
        axes = np.atleast_2d(figure.subplots(max(len(planes), 1), len(columns), squeeze=False))
        figure.subplots_adjust(
            left=0.075,
            right=0.93,
            top=top - 0.25 / height,
            bottom=0.6 / height,
            wspace=0.42,
            hspace=0.34,
        )
        for row, plane in zip(axes, planes, strict=False):
            for column, (words, field, largest) in zip(row, columns, strict=True):
                mesh = draw_slice(column, found, field, plane, largest)
                bar = figure.colorbar(mesh, ax=column, fraction=0.05, pad=0.03)
                bar.ax.tick_params(labelsize=SMALL - 1.5)
                bar.set_label("|E| [µm]", fontsize=SMALL - 1.0)
                if plane is planes[0]:
                    column.set_title(words, fontsize=SMALL, color=ground().ink, loc="left")
        return figure


def chart_planes(found: Compensation) -> list[tuple[int, int]]:
    """List the slices there are, axes across and up of each; none of a machine with one axis."""
    shape = found.grid.shape
    return [plane for plane in PLANES if all(shape[i] > 1 for i in plane)]


def chart_fields(found: Compensation) -> tuple[tuple[str, ErrorField, float], ...]:
    """List the maps: their words, the field, and the upper end of their colours, µm."""
    before = max(float(found.before.norm_um.max()), LEAST_UM)
    after = max(float(found.after.norm_um.max()), LEAST_UM)
    return (
        (f"before: {_words(found.before_statistics)}", found.before, before),
        (f"after, same colours: {_words(found.after_statistics)}", found.after, before),
        ("what is left, colours of its own", found.after, after),
    )


def _words(found: Statistics) -> str:
    """Spell mean and largest."""
    return f"mean {found.mean_um:.2f}, max {found.max_um:.2f} µm"


def draw_slice(
    axes: Axes,
    found: Compensation,
    field: ErrorField,
    plane: tuple[int, int],
    largest: float,
) -> AxesImage:
    """Draw one slice, through the point where most is left, as a map."""
    worst = np.unravel_index(int(np.argmax(found.after.norm_um)), found.grid.shape)
    across, up = plane
    rest = 3 - across - up
    values = np.take(field.norm_um, worst[rest], axis=rest)
    grid = found.grid
    names = grid.axes
    at = [_along(found, index) for index in (across, up)]
    ends = [(line[0], line[-1], (line[-1] - line[0]) / (len(line) - 1) / 2.0) for line in at]
    (left, right, half), (low, high, tall) = ends
    mesh = axes.imshow(
        values.T,
        origin="lower",
        extent=(left - half, right + half, low - tall, high + tall),
        aspect="auto",
        interpolation="bilinear",
        cmap="viridis",
        vmin=0.0,
        vmax=largest,
    )
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_xlabel(f"{names[across]} [{_unit(names[across])}]", fontsize=SMALL)
    axes.set_ylabel(f"{names[up]} [{_unit(names[up])}]", fontsize=SMALL)
    still = f"{names[rest]} {_along(found, rest)[worst[rest]]:.4g}" if names[rest] else ""
    still = still.replace("-", "−")
    axes.text(
        0.02,
        0.97,
        still,
        transform=axes.transAxes,
        va="top",
        fontsize=SMALL - 1.0,
        color="white",
        path_effects=[withStroke(linewidth=1.8, foreground="#222222")],
    )
    axes.tick_params(labelsize=SMALL - 1.0)
    return mesh


def _unit(axis: str) -> str:
    """Give the unit of the position of an axis."""
    return "mm" if axis[:1] in "XYZUVW" else "°"


def _along(found: Compensation, index: int) -> Array:
    """Give the positions of the nodes along one direction of the grid."""
    name = found.grid.axes[index]
    return np.ravel(found.grid.coordinates[name]) if name else np.zeros(1)


def sweep_chart(before: Statistics, steps: Sequence[Step], title: str) -> Figure:
    """Draw what each table leaves by how many numbers it has.

    Parameters
    ----------
    before : Statistics
    steps : sequence of Step
    title : str

    Returns
    -------
    Figure
    """
    with style():
        subtitle = "left over the working volume, by the numbers that the controller holds"
        figure, top = sheet(9.5, 5.6, title, subtitle)
        axes = figure.add_axes((0.09, 0.12, 0.63, top - 0.15))
        colours = ground().series
        kinds = list(dict.fromkeys(step.format for step in steps))
        for number, kind in enumerate(kinds):
            own = [step for step in steps if step.format == kind]
            sizes = [max(step.numbers, 1) for step in own]
            colour = colours[number % len(colours)]
            marker = "o" if number < len(colours) else "s"
            axes.plot(
                sizes,
                [max(step.after.max_um, LEAST_UM) for step in own],
                color=colour,
                marker=marker,
                markersize=4.5,
                linewidth=1.6,
                label=kind,
            )
            axes.plot(
                sizes,
                [max(step.after.mean_um, LEAST_UM) for step in own],
                color=colour,
                marker=marker,
                markersize=3.0,
                linewidth=1.0,
                linestyle=(0, (2, 2)),
            )
        axes.axhline(before.max_um, color=ground().ink, linewidth=1.0)
        axes.axhline(before.mean_um, color=ground().ink, linewidth=0.8, linestyle=(0, (2, 2)))
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("numbers in the controller", fontsize=TEXT)
        axes.set_ylabel("left: |E| [µm]", fontsize=TEXT)
        quiet(axes, "both")
        figure.legend(loc="upper left", bbox_to_anchor=(0.74, top), frameon=False, fontsize=TEXT)
        notes = (
            "solid: largest",
            "dashed: mean over the volume",
            "black: before",
            f"  max {before.max_um:.2f} µm",
            f"  mean {before.mean_um:.2f} µm",
        )
        for index, text in enumerate(notes):
            figure.text(0.75, 0.3 - 0.038 * index, text, size=SMALL, color=ground().muted)
        return figure
