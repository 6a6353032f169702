"""What a tolerance set is likely to give: the probability in words, its histogram, the shares."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from warpspace.app.readouts.html import render
from warpspace.app.readouts.numbers import thousands
from warpspace.app.state.specification import MAX
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.app.evaluation.probability import Chance

SHOWN_SHARES = 6
MARGIN = 1.02
"""Length of the chart's axis by the largest value on it."""


def spell_probability(chance: "Chance") -> str:
    """Spell the probability with its confidence interval, and the key to the histogram.

    Parameters
    ----------
    chance : Chance

    Returns
    -------
    str
        HTML.
    """
    found = chance.probability
    return render(
        "chance",
        probability=percent(found.probability),
        low=percent(found.low),
        high=percent(found.high),
        limit_um=found.spec_um,
        everywhere=chance.over == MAX,
        machines=thousands(chance.samples),
    )


def spell_scatter(chance: "Chance", shares: Mapping[str, float]) -> str:
    """Spell mean, P95 and the largest error, and which tolerances the scatter comes from.

    Parameters
    ----------
    chance : Chance
    shares : mapping of str to float
        Share of the scatter by parameter.

    Returns
    -------
    str
        HTML.
    """
    ranked = sorted(shares.items(), key=lambda item: -item[1])[:SHOWN_SHARES]
    return render(
        "scatter",
        numbers={"mean": chance.mean_um, "P95": chance.p95_um, "largest": chance.max_um},
        shares={key: share for key, share in ranked if share > 0.0},
        longest=ranked[0][1] if ranked else 1.0,
    )


def percent(share: float) -> str:
    """Spell a share in per cent; only what is certain reads 0 or 100."""
    value = f"{100.0 * share:.1f}"
    if value == "100.0" and share < 1.0:
        return "99.9"
    return "0.1" if value == "0.0" and share > 0.0 else value


def histogram_lines(chance: "Chance") -> tuple[Array, Array, Array, Array]:
    """Outline the bars of the histogram of the error, those beyond the limit by themselves.

    Parameters
    ----------
    chance : Chance

    Returns
    -------
    error_um : ndarray, [n], µm
        Ascending; each edge of a bar stands here twice, so that the lines go straight up and down.
    within, beyond : ndarray, [n]
        Machines per bar, zero where the bar is of the other kind. A bar is within the limit where
        its middle is.
    limit : ndarray, [n]
        From 0 to 1 at the limit, for an axis of its own; NaN elsewhere, where nothing is drawn.
    """
    edges, counts = chance.histogram.edges_um, chance.histogram.counts.astype(float)
    limit_um = chance.probability.spec_um
    heights = np.append(np.repeat(counts, 2), [0.0, 0.0])
    is_within = np.append(np.repeat((edges[:-1] + edges[1:]) / 2.0 <= limit_um, 2), [True, True])
    error_um = np.append(edges.repeat(2)[1:], max(float(edges[-1]), limit_um) * MARGIN)
    within, beyond = np.where(is_within, heights, 0.0), np.where(is_within, 0.0, heights)
    # two points at the limit, for a line of their own; the bar it stands in goes on as it is
    at = int(np.searchsorted(error_um, limit_um, side="right"))
    error_um = np.insert(error_um, at, [limit_um] * 2)
    limit = np.full(error_um.shape, np.nan)
    limit[at : at + 2] = 0.0, 1.0
    within, beyond = (np.insert(line, at, [line[at - 1]] * 2) for line in (within, beyond))
    return error_um, within, beyond, limit
