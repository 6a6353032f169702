"""Command `repair`: which errors to adjust, and to what, so that the volume gets better."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import (
    check_output,
    check_targets,
    force_option,
    output_option,
    plot_option,
)
from warpspace.cli.options import (
    grid_option,
    json_option,
    loop_option,
    print_json,
    scene_argument,
)
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.analysis.repair import Outcome, Repair, RepairPlan, Repairs
    from warpspace.scene.model import Scene

ALL = "all"
ENDINGS = (".toml",)
EXPECTED_LIMIT = "expected KEY=VALUE or one VALUE for all errors, in µm or µrad and above 0"


@click.command()
@scene_argument()
@click.option(
    "--objective",
    type=click.Choice(("rms", "max")),
    default="rms",
    show_default=True,
    help="What is made as small as possible over the volume: RMS or largest |E|.",
)
@click.option(
    "--count",
    type=int,
    default=3,
    show_default=True,
    help="The best sets of one up to this many adjustments.",
)
@click.option(
    "--adjustable",
    multiple=True,
    metavar="KEY,…|all",
    help="Errors that may be adjusted; of a curve its amplitude is (compensation). Repeatable."
    "  [squareness and alignment: the constant errors]",
)
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="KEY=±VALUE|±VALUE",
    help="By how much one error, or each, may be changed, in µm or µrad. Repeatable.  [±200]",
)
@loop_option
@grid_option()
@output_option("Write the scene with the last set listed applied: .toml.", required=False)
@plot_option("chart")
@force_option
@json_option
def repair(
    scene: str,
    objective: str,
    count: int,
    adjustable: tuple[str, ...],
    limits: tuple[str, ...],
    loop: str,
    grid: int,
    output: str | None,
    plot: str | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Find which errors of SCENE to adjust, and to what.

    For each error stands what leaving it out, and what its best value, gives for the whole volume
    with all other errors as they are. Then follow the best sets of one, two, three … adjustments.
    RMS is made smallest by weighted least squares, max as a convex problem, to within 0.0001 µm.
    Model: first order. Each node of the grid weighs its share of the volume.
    """
    from warpspace.scene import repairs as scene_repairs
    from warpspace.scene.library import load_scene

    target = check_output(output, ENDINGS, force=force, scenes=[scene]) if output else None
    check_targets(scene, force=force, plot=plot)
    loaded = load_scene(scene)
    plan = _plan(objective, count, adjustable, limits)
    with progress("searching", silent=as_json):
        found = scene_repairs.repair(loaded, plan, loop=loop, grid=grid)
    if target is not None:
        _write(target, loaded, found, force=force)
    if plot is not None:
        from warpspace.outputs.charts import repair_chart, write_chart

        where = f"{loaded.machine.title} · {loop} loop · {grid} nodes per axis"
        write_chart(repair_chart(found, f"Repair · {loaded.title}", where), plot, overwrite=force)
    if as_json:
        print_json(_json(found))
        return
    print_text(f"{loaded.title} · {loop} loop · smallest {_word(found)}")
    _print(found)
    for path in filter(None, (output, plot)):
        echo(f"wrote {path}")


def _plan(
    objective: str, count: int, adjustable: Sequence[str], limits: Sequence[str]
) -> "RepairPlan":
    """Read what is asked for.

    Raises
    ------
    OptionError
        If an option cannot be read.
    """
    from warpspace.analysis.repair import DEFAULT_LIMIT, Objective, RepairPlan

    wide, own = DEFAULT_LIMIT, dict[str, float]()
    for part in (part.strip() for text in limits for part in text.split(",")):
        name, equals, number = part.rpartition("=")
        value = _limit(part, number)
        if equals:
            own[name.strip().upper()] = value
        else:
            wide = value
    keys = _keys(adjustable)
    every = keys is not None and ALL in keys
    plan = RepairPlan(Objective(objective), count, None if every else keys, every, wide, own)
    plan.check()
    return plan


def _limit(given: str, number: str) -> float:
    """Read one limit, with or without its ±."""
    try:
        value = float(number.strip().lstrip("±"))
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise OptionError(f"--limit {given!r}; {EXPECTED_LIMIT}")
    return value


def _keys(adjustable: Sequence[str]) -> tuple[str, ...] | None:
    """Read which errors may be adjusted, `ALL` for any; None for the default."""
    from warpspace.machine.parameters import PARAMETERS, parameter

    if not adjustable:
        return None
    given = [part.strip() for text in adjustable for part in text.split(",")]
    known = {ALL: ALL, **{key.lower(): key for key in PARAMETERS}}
    keys = tuple(known.get(part.lower(), part) for part in given if part)
    if not keys:
        raise OptionError(f"--adjustable {','.join(adjustable)!r}; expected keys such as EA0Z,EC0Y")
    for key in keys:
        if key != ALL:
            parameter(key)
    return keys


def _write(target: "Path", scene: "Scene", found: "Repairs", *, force: bool) -> None:
    """Write the repaired scene."""
    from warpspace.outputs.files import write_atomically
    from warpspace.scene import repairs as scene_repairs
    from warpspace.scene.save import scene_to_toml

    if not found.repairs:
        raise OptionError(f"-o {target}: there is nothing to adjust in this loop, so no scene")
    text = scene_to_toml(scene_repairs.repaired(scene, found.repairs[-1].adjust))
    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _json(found: "Repairs") -> dict[str, object]:
    """Spell all of it as the JSON output has it."""
    from dataclasses import asdict

    return {
        "objective": str(found.plan.objective),
        "before": asdict(found.before),
        "errors": [
            {
                "key": effect.key,
                "unit": effect.parameter.unit,
                "present": effect.present,
                "left_out": asdict(effect.left_out),
                "best": {"value": effect.best_value, **asdict(effect.best)},
            }
            for effect in found.effects
        ],
        "adjustable": {key: found.plan.limit_of(key) for key in found.adjustable},
        "repairs": [
            {"adjust": dict(repair.adjust), **asdict(repair.outcome)} for repair in found.repairs
        ],
        "all_sets_compared": [repair.proven for repair in found.repairs],
    }


def _word(found: "Repairs") -> str:
    """Name the objective."""
    return "largest |E|" if found.plan.objective == "max" else "RMS |E|"


def _four(outcome: "Outcome") -> tuple[str, ...]:
    """Spell mean, RMS, P95 and max."""
    numbers = (outcome.mean_um, outcome.rms_um, outcome.p95_um, outcome.max_um)
    return tuple(f"{number:.2f}" for number in numbers)


def _three(outcome: "Outcome") -> tuple[str, ...]:
    """Spell mean, RMS and max."""
    mean, rms, _, largest = _four(outcome)
    return mean, rms, largest


def _print(found: "Repairs") -> None:
    """Print the table of errors and that of the best sets."""
    mean, rms, p95, largest = _four(found.before)
    print_text(f"  before: mean {mean}, RMS {rms}, P95 {p95}, max {largest} µm")
    print_text("Each error alone, all others as they are:")
    columns = (
        Column("key", leads=True),
        Column("now", is_number=True),
        Column("unit"),
        *number_columns(("left out: mean", "RMS", "max"), "µm"),
        Column("best value", is_number=True),
        *number_columns(("then: mean", "RMS", "max"), "µm"),
    )
    rows = [
        (
            *(effect.key, f"{effect.present:.4g}", effect.parameter.unit),
            *_three(effect.left_out),
            f"{effect.best_value:.1f}",
            *_three(effect.best),
        )
        for effect in found.effects
    ]
    if rows:
        print_table(columns, rows)
    else:
        print_text("  all errors that act in this loop are zero")
    _print_sets(found)


def _print_sets(found: "Repairs") -> None:
    """Print the best sets, and what they were looked for among."""
    if not found.before.max_um:
        print_text("No point is off in this loop: there is nothing to repair.")
        return
    if not found.repairs:
        print_text("No squareness or alignment acts in this loop; --adjustable names other errors.")
        return
    print_text("Best sets of adjustments:")
    columns = (
        Column("set", is_number=True, leads=True),
        *number_columns(("mean", "RMS", "P95", "max"), "µm"),
        Column("adjust", wraps=True),
    )
    rows = [
        (str(len(repair.adjust)), *_four(repair.outcome), _adjustments(found, repair))
        for repair in found.repairs
    ]
    print_table(columns, rows)
    limits = dict.fromkeys(found.plan.limit_of(key) for key in found.adjustable)
    if len(limits) == 1:
        said = f"each by at most ±{next(iter(limits)):g} µm or µrad"
    else:
        said = "by at most " + ", ".join(
            f"{key} ±{found.plan.limit_of(key):g}" for key in found.adjustable
        )
    print_text(f"  adjusted: {', '.join(found.adjustable)}; {said}")
    sizes = [str(len(repair.adjust)) for repair in found.repairs if not repair.proven]
    print_text(
        "  all sets compared"
        if not sizes
        else f"  sets of {', '.join(sizes)}: too many to compare all; built up one by one, with"
        " members swapped as long as that helped"
    )


def _adjustments(found: "Repairs", repair: "Repair") -> str:
    """Spell the adjustments of a set."""
    from warpspace.machine.parameters import parameter

    return ", ".join(
        f"{key} {found.present[key]:.4g} → {value:.4g} {parameter(key).unit}"
        for key, value in repair.adjust.items()
    )
