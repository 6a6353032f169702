"""Bars of a repair: each error left out, each at its best value, and the best sets."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke

from warpspace.analysis.repair import Outcome, Repair, Repairs
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
from warpspace.picture.words import spell, spell_short

WIDTH_IN = 11.0
ROW_IN = 0.36
MOST_ERRORS, MOST_VALUES = 14, 3
COLUMNS = (("mean |E|", "mean_um"), ("RMS |E|", "rms_um"), ("max |E|", "max_um"))
_BAR = 0.36


def repair_chart(found: Repairs, title: str, subtitle: str) -> Figure:
    """Draw what leaving out and adjusting errors gives for mean, RMS and max of the volume.

    Parameters
    ----------
    found : Repairs
    title, subtitle : str

    Returns
    -------
    Figure
    """
    with style():
        height = 1.95 + ROW_IN * max(min(len(found.effects), MOST_ERRORS) + len(found.repairs), 2)
        figure, top = sheet(WIDTH_IN, height, title, subtitle, top_in=1.25)
        axes = figure.subplots(1, len(COLUMNS), sharey=True)
        figure.subplots_adjust(
            left=3.1 / WIDTH_IN, right=0.98, top=top, bottom=0.62 / height, wspace=0.08
        )
        draw_repair_bars(axes, found)
        figure.legend(
            handles=repair_key(),
            loc="lower left",
            bbox_to_anchor=(0.25 / WIDTH_IN, top + 0.24 / height),
            ncols=4,
            frameon=False,
            fontsize=SMALL,
            borderpad=0.0,
            handlelength=1.2,
            handleheight=0.8,
        )
        return figure


def _set_colour() -> str:
    """Colour of the best sets."""
    return ground().series[2]


def repair_key() -> list[Patch | Line2D]:
    """Say what the bars mean."""
    return [
        Line2D([], [], color=ground().ink, linestyle=(0, (4, 3)), label="before"),
        Patch(color=bar_colour(), label="this error left out"),
        Patch(color=key_colour(), label="this error at its best value"),
        Patch(color=_set_colour(), label="best set of adjustments"),
    ]


def draw_repair_bars(axes: Sequence[Axes], found: Repairs, size: float = SMALL) -> None:
    """Draw the bars into axes side by side that share their rows.

    Parameters
    ----------
    axes : sequence of matplotlib Axes, (3,)
        For mean, RMS and max.
    found : Repairs
    size : float, optional
        Of the text, points.
    """
    effects = found.effects[:MOST_ERRORS]
    sets = found.repairs
    places = range(len(effects) + len(sets))
    for panel, (title, name) in zip(axes, COLUMNS, strict=True):

        def values(outcomes: Sequence[Outcome], name: str = name) -> list[float]:
            return [float(getattr(outcome, name)) for outcome in outcomes]

        out = values([effect.left_out for effect in effects])
        best = values([effect.best for effect in effects])
        together = values([one.outcome for one in sets])
        before = float(getattr(found.before, name))
        upper = [place - _BAR / 2 for place in places[: len(effects)]]
        lower = [place + _BAR / 2 for place in places[: len(effects)]]
        below = list(places[len(effects) :])
        panel.barh(upper, out, height=_BAR, color=bar_colour())
        panel.barh(lower, best, height=_BAR, color=key_colour())
        panel.barh(below, together, height=2 * _BAR, color=_set_colour())
        panel.axvline(before, color=ground().ink, linewidth=1.0, linestyle=(0, (4, 3)))
        largest = max((before, *out, *best, *together)) or 1.0
        rows = ((upper, out), (lower, best), (below, together))
        for spots, numbers in rows:
            for spot, number in zip(spots, numbers, strict=True):
                text = panel.text(
                    number + 0.015 * largest, spot, f"{number:.1f}", va="center", size=0.85 * size
                )
                text.set_path_effects([Stroke(linewidth=2.5, foreground=ground().paper), Normal()])
        _set_up(panel, title, before, 1.16 * largest, size)
    labels = [
        *(
            f"{effect.parameter.name}  {effect.key}  {spell_short(effect.present)} →"
            f" {spell(effect.best_value)} {effect.parameter.unit}"
            for effect in effects
        ),
        *(_set_words(one) for one in sets),
    ]
    axes[0].set_yticks(list(places), labels, size=size)
    axes[0].set_ylim(max(len(places), 1) - 0.45, -0.55)


def _set_words(repair: Repair) -> str:
    """Name a set in one line; the values of a large one stand elsewhere."""
    if len(repair.adjust) > MOST_VALUES:
        return f"{len(repair.adjust)} adjusted: " + ", ".join(repair.adjust)
    return ", ".join(f"{key} → {spell(value)}" for key, value in repair.adjust.items())


def _set_up(panel: Axes, title: str, before: float, end: float, size: float) -> None:
    """Set up the axes of one column."""
    quiet(panel)
    panel.spines["left"].set_visible(False)
    panel.tick_params(axis="y", length=0)
    panel.tick_params(axis="x", labelsize=size)
    panel.set_xlim(0.0, end)
    panel.set_title(
        f"{title}, before {before:.1f} µm", size=TEXT * size / SMALL, weight="bold", loc="left"
    )
    panel.set_xlabel("µm", size=size)
