"""Bars per parameter: error gains like figures 4-3 to 4-6 of the thesis, and variance shares."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from warpspace.analysis.contributions import Contributions
from warpspace.analysis.gains import Gain
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

WIDTH_IN = 11.0
ROW_IN = 0.235


def gains_chart(
    gains: Sequence[Gain], title: str, subtitle: str, share: float, *, signed: bool = False
) -> Figure:
    """Draw the gain of every parameter: |E| wide, its components beside it.

    Parameters
    ----------
    gains : sequence of Gain
        Largest first.
    title, subtitle : str
    share : float
        Share of the sum of squares that the key errors make up; for the legend.
    signed : bool, optional
        Whether the components have a sign (at a point) or not (over the travel).

    Returns
    -------
    Figure
    """
    with style():
        height = 1.75 + ROW_IN * len(gains)
        figure, top = sheet(WIDTH_IN, height, title, subtitle, top_in=1.15)
        axes = figure.subplots(1, 4, sharey=True, width_ratios=[2.2, 1, 1, 1])
        figure.subplots_adjust(
            left=2.55 / WIDTH_IN, right=0.98, top=top, bottom=0.62 / height, wspace=0.09
        )
        rows = range(len(gains))
        colours = [key_colour() if gain.is_key else bar_colour() for gain in gains]
        columns = (
            ("|E|", [gain.norm for gain in gains]),
            ("x", [gain.x for gain in gains]),
            ("y", [gain.y for gain in gains]),
            ("z", [gain.z for gain in gains]),
        )
        largest = max(gain.norm for gain in gains) or 1.0
        for panel, (name, values) in zip(axes, columns, strict=True):
            panel.barh(rows, values, height=0.7, color=colours)
            _gain_panel(panel, name, largest, signed=signed and name != "|E|")
        for row, gain in enumerate(gains):
            axes[0].text(
                gain.norm + 0.012 * largest, row, f"{gain.norm:.2f}", va="center", size=SMALL
            )
        _name_rows(axes[0], [gain.key for gain in gains])
        axes[0].set_xlim(0.0, 1.12 * largest)
        keys = sum(gain.is_key for gain in gains)
        _legend(figure, top, f"key errors: the largest {keys}, {share:.0%} of the sum of squares")
        return figure


def _legend(figure: Figure, top: float, text: str) -> None:
    """Say what the two colours mean, above the bars."""
    height = float(figure.get_figheight())
    figure.legend(
        handles=[Patch(color=key_colour(), label=text), Patch(color=bar_colour(), label="others")],
        loc="lower left",
        bbox_to_anchor=(2.5 / WIDTH_IN, top + 0.16 / height),
        ncols=2,
        frameon=False,
        fontsize=SMALL,
        borderpad=0.0,
        handlelength=1.0,
        handleheight=0.8,
    )


def _gain_panel(panel: Axes, name: str, largest: float, *, signed: bool) -> None:
    """Set up the axes of one column of bars."""
    quiet(panel)
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)
    panel.axvline(0.0, color=ground().muted, linewidth=0.8)
    panel.set_xlim(-1.05 * largest if signed else 0.0, 1.05 * largest)
    panel.set_title(name, size=TEXT, weight="bold", loc="left" if name == "|E|" else "center")
    panel.set_xlabel("µm per µm or µrad", size=SMALL)
    panel.tick_params(axis="x", labelsize=SMALL)


def _name_rows(panel: Axes, keys: Sequence[str]) -> None:
    """Label the rows with key, symbol and plain name, first row on top."""
    labels = [f"{parameter(key).name}  {parameter(key).symbol}  {key}" for key in keys]
    panel.set_yticks(range(len(keys)), labels, size=SMALL)
    panel.set_ylim(len(keys) - 0.4, -0.6)


def contributions_chart(found: Contributions, title: str, subtitle: str) -> Figure:
    """Draw the variance share of every parameter; Sobol indices beside it where there are any.

    Parameters
    ----------
    found : Contributions
    title, subtitle : str

    Returns
    -------
    Figure
    """
    rows = found.rows
    with style():
        height = 1.75 + ROW_IN * len(rows)
        figure, top = sheet(WIDTH_IN, height, title, subtitle, top_in=1.15)
        sobol = rows[0].sobol_total is not None or any(row.sobol_total for row in rows)
        axes = figure.subplots(1, 2 if sobol else 1, sharey=True, squeeze=False)[0]
        figure.subplots_adjust(
            left=2.55 / WIDTH_IN, right=0.98, top=top, bottom=0.62 / height, wspace=0.06
        )
        places = range(len(rows))
        share = [100.0 * row.share for row in rows]
        axes[0].barh(places, share, height=0.7, color=key_colour(), label="exact")
        sampled = [100.0 * row.sampled_share for row in rows]
        axes[0].plot(
            sampled,
            places,
            "|",
            color=ground().ink,
            markersize=9,
            label="from 20,000 sampled machines",
        )
        for place, (value, drawn) in enumerate(zip(share, sampled, strict=True)):
            axes[0].text(
                max(value, drawn) + 0.015 * max(share),
                place,
                f"{value:.1f}",
                va="center",
                size=SMALL,
            )
        _share_panel(axes[0], "share of the variance of E", "%")
        axes[0].set_xlim(0.0, 1.14 * max(*share, *sampled))
        if sobol:
            total = [row.sobol_total or 0.0 for row in rows]
            spread = [row.sobol_total_confidence or 0.0 for row in rows]
            first = [max(row.sobol_first or 0.0, 0.0) for row in rows]
            axes[1].barh(
                places,
                total,
                xerr=spread,
                height=0.7,
                color=bar_colour(),
                label="total, 95 % interval",
                error_kw={"elinewidth": 0.9, "ecolor": ground().muted},
            )
            axes[1].plot(
                first, places, "o", color=ground().ink, markersize=3.2, label="first order"
            )
            _share_panel(axes[1], "Sobol index of the mean |E| of a machine", "")
            axes[1].set_xlim(left=0.0)
        _name_rows(axes[0], [row.key for row in rows])
        return figure


def _share_panel(panel: Axes, title: str, unit: str) -> None:
    """Set up one column of shares."""
    quiet(panel)
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)
    panel.tick_params(axis="x", labelsize=SMALL)
    panel.set_title(title, size=TEXT, weight="bold", loc="left")
    panel.set_xlabel(unit, size=SMALL)
    panel.legend(loc="lower right", fontsize=SMALL, frameon=False)
