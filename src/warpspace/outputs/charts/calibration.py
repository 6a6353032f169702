"""What a calibration leaves: residuals before and after, as vectors, and the errors found."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from warpspace.calibration.results import Calibration, Found, Residuals
from warpspace.machine.parameters import parameter
from warpspace.outputs.charts.paper import (
    SMALL,
    TEXT,
    bar_colour,
    ground,
    key_colour,
    quiet,
    sheet,
    style,
)
from warpspace.units import MICROMETRE, MICRORADIAN, UM_PER_MM

WIDTH_IN, HEIGHT_IN = 12.0, 8.2
MOST_ROWS = 22
"""Parameters of one unit that are drawn; the largest by their uncertainty."""
MOST_LABELS = 30


def calibration_chart(found: Calibration, title: str) -> Figure:
    """Draw residuals against the readings, their vectors, and the parameters with intervals.

    Parameters
    ----------
    found : Calibration
    title : str

    Returns
    -------
    Figure
    """
    subtitle = (
        f"RMS of the residual vectors {UM_PER_MM * found.rms_before_mm:.1f} µm before,"
        f" {UM_PER_MM * found.rms_after_mm:.1f} µm after"
    )
    if found.rms_predicted_before_mm is not None and found.rms_predicted_after_mm is not None:
        subtitle += (
            f" · predicted, not fitted: {UM_PER_MM * found.rms_predicted_before_mm:.1f} µm before,"
            f" {UM_PER_MM * found.rms_predicted_after_mm:.1f} µm after"
        )
    with style():
        figure, top = sheet(WIDTH_IN, HEIGHT_IN, title, subtitle, top_in=1.0)
        outer = figure.add_gridspec(
            2, 2, left=0.085, right=0.98, top=top - 0.02, bottom=0.09, hspace=0.42, wspace=0.24
        )
        _draw_lengths(figure.add_subplot(outer[0, :]), found)
        vectors = outer[1, 0].subgridspec(1, 2, wspace=0.45)
        groups = (*found.fitted, *found.predicted)
        wide = [group for group in groups if group.after_mm.shape[1] == 3]
        for at, plane in enumerate(((0, 1), (0, 2))):
            axes = figure.add_subplot(vectors[0, at])
            _draw_vectors(axes, wide, plane)
        values = outer[1, 1].subgridspec(1, 2, wspace=0.55)
        for at, unit in enumerate((MICROMETRE, MICRORADIAN)):
            _draw_values(figure.add_subplot(values[0, at]), found, unit)
        return figure


def _draw_lengths(axes: Axes, found: Calibration) -> None:
    """Draw the length of each residual before and after, in the order of the readings."""
    start, names = 0, list[str]()
    for predicted, groups in ((False, found.fitted), (True, found.predicted)):
        for group in groups:
            before, after = (
                UM_PER_MM * np.linalg.norm(rows, axis=-1)
                for rows in (group.before_mm, group.after_mm)
            )
            at = np.arange(start, start + len(before))
            if predicted:
                axes.axvspan(start - 0.5, at[-1] + 0.5, color=ground().band, zorder=0)
            axes.vlines(at, after, before, color=ground().faint, linewidth=1.5, zorder=1)
            axes.plot(at, before, "o", color=bar_colour(), markersize=5)
            axes.plot(at, after, "o", color=key_colour(), markersize=5)
            for row in group.outliers:
                axes.plot(at[row], after[row], "o", mfc="none", mec=ground().accent, ms=11)
            names += _poses(group)
            start += len(before)
    axes.set_ylabel("length of the residual [µm]")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(-0.7, start - 0.3)
    if start <= MOST_LABELS:
        axes.set_xticks(range(start), names, size=SMALL - 1.0)
    else:
        axes.set_xlabel("reading")
    quiet(axes, "y")
    handles = [
        Line2D([], [], marker="o", linestyle="", color=bar_colour(), label="before"),
        Line2D([], [], marker="o", linestyle="", color=key_colour(), label="after"),
    ]
    if found.predicted:
        handles.append(Line2D([], [], color=ground().band, linewidth=8, label="not fitted"))
    if any(group.outliers for group in (*found.fitted, *found.predicted)):
        ring = {"marker": "o", "linestyle": "", "markersize": 9, "markerfacecolor": "none"}
        handles.append(Line2D([], [], color=ground().accent, label="far off", **ring))  # pyright: ignore[reportArgumentType]
    axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=4,
        frameon=False,
        fontsize=SMALL,
    )
    axes.set_title(
        "Residuals, observed − predicted, by reading", loc="left", size=TEXT, weight="bold"
    )


def _poses(group: Residuals) -> list[str]:
    """Name each reading by the axes that move, one a line; no more than two axes."""
    coordinates = group.readings.coordinates
    machine_order = [name for name, values in coordinates.items() if np.ptp(values) > 1e-9]
    rotary = [name for name in machine_order if name[0] in "ABC"]
    shown = (rotary or machine_order)[:2]
    return [
        "\n".join(f"{name} {coordinates[name][at]:g}" for name in shown)
        for at in range(len(group.readings))
    ]


def _draw_vectors(axes: Axes, groups: Sequence[Residuals], plane: tuple[int, int]) -> None:
    """Draw the ends of the residual vectors in a plane, before and after."""
    first, second = plane
    for group in groups:
        before, after = (UM_PER_MM * rows for rows in (group.before_mm, group.after_mm))
        for start, end in zip(before, after, strict=True):
            axes.plot(
                [start[first], end[first]],
                [start[second], end[second]],
                color=ground().faint,
                linewidth=0.8,
                zorder=1,
            )
        axes.plot(before[:, first], before[:, second], "o", color=bar_colour(), markersize=4)
        axes.plot(after[:, first], after[:, second], "o", color=key_colour(), markersize=4)
    quiet(axes, "both")
    axes.axhline(0.0, color=ground().muted, linewidth=0.8)
    axes.axvline(0.0, color=ground().muted, linewidth=0.8)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{'xyz'[first]} [µm]")
    axes.set_ylabel(f"{'xyz'[second]} [µm]", labelpad=1.0)
    if first == 0 and second == 1:
        axes.set_title("Residual vectors", loc="left", size=TEXT, weight="bold")


def _draw_values(axes: Axes, found: Calibration, unit: str) -> None:
    """Draw the parameters of one unit with their 95 % intervals."""
    rows = [one for one in found.parameters if parameter(one.key).unit == unit]
    told = [one for one in rows if one.interval is not None]
    told = sorted(told, key=_weight, reverse=True)[:MOST_ROWS]
    kept = [one for one in rows if one in told]
    at = np.arange(len(kept))[::-1]
    for place, one in zip(at, kept, strict=True):
        assert one.interval is not None  # noqa: S101 - chosen above
        colour = key_colour() if one.identifiable else ground().series[4]
        axes.plot(one.interval, [place, place], color=colour, linewidth=2.0)
        axes.plot([one.value], [place], "o", color=colour, markersize=5)
        axes.plot([one.before], [place], "|", color=ground().muted, markersize=9)
    axes.set_yticks(at, [one.key for one in kept], size=SMALL)
    axes.set_ylim(-0.7, max(len(kept), 1) - 0.3)
    axes.axvline(0.0, color=ground().muted, linewidth=0.8)
    quiet(axes)
    axes.set_xlabel(f"value, 95 % interval [{unit}]")
    if unit == MICROMETRE:
        axes.set_title("Errors found", loc="left", size=TEXT, weight="bold")
    if unit == MICRORADIAN and any(
        one.interval and not one.identifiable for one in found.parameters
    ):
        axes.text(
            1.0,
            -0.24,
            "orange: told in part, with those like it held",
            transform=axes.transAxes,
            ha="right",
            va="top",
            size=SMALL - 1.0,
            color=ground().muted,
        )


def _weight(one: Found) -> float:
    """Give how far a value stands out of its uncertainty."""
    return abs(one.value - one.before) / max(one.standard_uncertainty or 1.0, 1e-12)
