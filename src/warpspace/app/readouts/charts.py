"""Small charts beside the numbers, drawn by viser's uPlot."""

from collections.abc import Sequence

from viser import GuiApi, GuiUplotHandle, uplot

from warpspace.units import Array

FONT = "11px sans-serif"
WHOLE = "whole"
"""Scale of lines that are given in heights of the chart, 0 to 1, beside the one of the values."""


def add_chart(
    gui: GuiApi,
    data: tuple[Array, ...],
    lines: Sequence[uplot.Series],
    height: int,
    *,
    axes: tuple[uplot.Axis, ...] | None = None,
    visible: bool = True,
) -> GuiUplotHandle:
    """Add a chart without a legend, whose `data` may be assigned anew.

    Parameters
    ----------
    gui : viser.GuiApi
    data : tuple of ndarray, [n]
        What is along the axis, ascending, then one array a line.
    lines : sequence of viser.uplot.Series
    height : int
        CSS pixels.
    axes : tuple of viser.uplot.Axis, (2,), optional
        Horizontal and vertical.
    visible : bool, optional

    Returns
    -------
    viser.GuiUplotHandle
    """
    return gui.add_uplot(
        data,
        (uplot.Series(label="along"), *lines),
        scales=chart_scales(None),
        axes=axes,
        legend=uplot.Legend(show=False),
        height=height,
        padding=(8, 14, 0, 0),
        visible=visible,
    )


def chart_scales(span: tuple[float, float] | None) -> dict[str, uplot.Scale]:
    """Describe the scales of a chart.

    Parameters
    ----------
    span : tuple of float, (2,), or None
        Lower and upper end of the values; None where the chart is to find them itself, which it
        cannot do where a value is NaN.
    """
    scales = {"x": uplot.Scale(time=False), WHOLE: uplot.Scale(range=(0.0, 1.0))}
    return scales if span is None else {**scales, "y": uplot.Scale(range=span)}


def chart_axis(label: str, size: int) -> uplot.Axis:
    """Describe an axis of a chart; its colours are the page's, light or dark.

    Parameters
    ----------
    label : str
        With the unit.
    size : int
        Room across the axis, CSS pixels.
    """
    return uplot.Axis(
        label=label, size=size, labelSize=16, font=FONT, space=18 if size > 40 else 40
    )
