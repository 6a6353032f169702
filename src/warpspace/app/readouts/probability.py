"""What a tolerance set is likely to give: the probability in words, its histogram, the shares."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from warpspace.app.readouts.html import render, thousands
from warpspace.app.state.specification import MAX
from warpspace.machine.axes import Parameter
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.analysis.allocate import AllocateResult
    from warpspace.app.evaluation.probability import Estimate

FIXED = "fixed"
MARGIN = 1.02  # length of the chart's axis by the largest value on it


def spell_probability(estimated: "Estimate") -> str:
    """Spell the probability and the limit: what stays at the top of the panel."""
    return render(
        "probability",
        probability=percent(estimated.probability.probability),
        limit_um=estimated.probability.spec_um,
        everywhere=estimated.over == MAX,
    )


def spell_scatter(estimated: "Estimate") -> str:
    """Spell the histogram's key, mean, P95 and largest error, and the confidence interval."""
    found = estimated.probability
    return render(
        "scatter",
        limit_um=found.spec_um,
        numbers={"mean": estimated.mean_um, "P95": estimated.p95_um, "largest": estimated.max_um},
        low=percent(found.low),
        high=percent(found.high),
        machines=thousands(estimated.samples),
    )


def spell_tolerance(
    row: Parameter, share: float, longest: float, *, fixed: bool, button: Callable[[str], Markup]
) -> str:
    """Draw the share of one error's tolerance as a bar, and its box "fixed"."""
    return render(
        "tolerance",
        row=row,
        share=share,
        length=share / longest if longest > 0.0 else 0.0,
        fixed=fixed,
        word=f"{FIXED} {row.key}",
        button=button,
    )


def spell_allocation(found: "AllocateResult") -> str:
    """Say what an allocation has reached."""
    return render(
        "allocation",
        limit_um=found.asked.limit_um,
        before=percent(found.before.probability),
        after=percent(found.after.probability),
        low=percent(found.after.low),
        high=percent(found.after.high),
        machines=thousands(found.samples),
        cost_before=found.cost_before,
        cost_after=found.cost_after,
        count=len(found.tolerances),
        at_widest=found.at_widest,
        widest=found.widest,
        exact=found.exact.words().capitalize(),
    )


def percent(share: float) -> str:
    """Spell a share in per cent; only what is certain reads 0 or 100."""
    value = f"{100.0 * share:.1f}"
    if value == "100.0" and share < 1.0:
        return "99.9"
    return "0.1" if value == "0.0" and share > 0.0 else value


def histogram_lines(estimated: "Estimate") -> tuple[Array, Array, Array, Array]:
    """Outline the bars of the histogram of the error, those outside the limit by themselves."""
    edges, counts = estimated.histogram.edges_um, estimated.histogram.counts.astype(float)
    limit_um = estimated.probability.spec_um
    heights = np.append(np.repeat(counts, 2), [0.0, 0.0])
    is_within = np.append(np.repeat((edges[:-1] + edges[1:]) / 2.0 <= limit_um, 2), [True, True])
    error_um = np.append(edges.repeat(2)[1:], max(float(edges[-1]), limit_um) * MARGIN)
    within, outside = np.where(is_within, heights, 0.0), np.where(is_within, 0.0, heights)
    # two points at the limit, for a line of their own; the bar it stands in goes on as it is
    at = int(np.searchsorted(error_um, limit_um, side="right"))
    error_um = np.insert(error_um, at, [limit_um] * 2)
    limit = np.full(error_um.shape, np.nan)
    limit[at : at + 2] = 0.0, 1.0
    within, outside = (np.insert(line, at, [line[at - 1]] * 2) for line in (within, outside))
    return error_um, within, outside, limit
