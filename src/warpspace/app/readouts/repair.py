"""What repairs the volume, as HTML: the best sets with their buttons, and every error alone."""

from collections.abc import Callable

from markupsafe import Markup

from warpspace.analysis.adjusting import Objective
from warpspace.analysis.options import ALL
from warpspace.analysis.repair import AdjustedSet, RepairResult
from warpspace.analysis.statistics import Summary
from warpspace.app.readouts.html import message, render
from warpspace.machine.axes import parameter
from warpspace.units import spell, spell_short

SEEN = "seen"  # word that the page sends once a reader sees where the answer will be
NOTHING = message("No point is off in this loop: there is nothing to repair.", "repair none")
NO_GAIN_UM = 0.01  # A repair that gains less is not offered, µm
COLUMNS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}
Button = Callable[[str], Markup]


def looking_html(button: Button) -> str:
    """Say that repairs are looked for; the page tells with the word `SEEN` when that is seen."""
    return render("repair_looking", attributes=button(SEEN))


def repair_html(found: RepairResult, button: Button) -> str:
    """Spell what repairs a machine."""
    if not found.before.max_um:
        return NOTHING
    return render(
        "repair",
        columns=COLUMNS,
        before=found.before,
        sets=[(len(one.adjust), one, _words(found, one)) for one in offered(found)],
        effects=found.errors,
        nothing=_why_none(found),
        largest=found.objective is Objective.MAX,
        limit=spell_short(found.asked.limit_of(ALL)),
        tried=found.adjustable,
        proven=all(one.proven for one in found.repairs),
        cells=lambda outcome: _cells(found.before, outcome),
        spell=spell,
        button=button,
    )


def offered(found: RepairResult) -> tuple[AdjustedSet, ...]:
    """Pick the sets that gain something over the smaller ones."""
    name = f"{found.objective}_um"
    least: float = getattr(found.before, name)
    kept: list[AdjustedSet] = []
    for one in found.repairs:
        value: float = getattr(one, name)
        if least - value >= NO_GAIN_UM:
            kept.append(one)
            least = value
    return tuple(kept)


def _why_none(found: RepairResult) -> str:
    if not found.adjustable:
        return "No squareness or alignment error acts in this loop. Choose any error above."
    return f"{', '.join(found.adjustable)}: at their best values already."


def _words(found: RepairResult, one: AdjustedSet) -> str:
    return ", ".join(
        f"{key} {spell_short(found.present[key])} → {spell(value)} {parameter(key).unit}"
        for key, value in one.adjust.items()
    )


def _cells(before: Summary, outcome: Summary) -> list[dict[str, object]]:
    cells: list[dict[str, object]] = []
    for name, field in COLUMNS.items():
        value, was = (float(getattr(one, field)) for one in (outcome, before))
        change = value - was
        better, worse = change <= -NO_GAIN_UM, change >= NO_GAIN_UM
        cells.append({"name": name, "text": f"{value:.2f}", "better": better, "worse": worse})
    return cells
