"""Command `compensate`: tables for a controller, and the error that is left after them."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import check_targets, force_option, output_option, plot_option
from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.statistics import Statistics
    from warpspace.formats.compensation.compensate import Compensation, Plan
    from warpspace.formats.compensation.sweep import Step
    from warpspace.scene.model import Scene

EXPECTED_SWEEP = "expected numbers of points with commas between, for instance 3,5,9,17"


@click.command()
@scene_argument()
@click.option(
    "--format",
    "kinds",
    multiple=True,
    metavar="F",
    help="Format of the table, see `warpspace formats`; with --sweep repeatable.",
)
@output_option("File to write; tables of several files stand beside it.", required=False)
@click.option(
    "--grid",
    metavar="N|X=N,…",
    help="Points of the table along each axis.  [what suits the format]",
)
@click.option(
    "--resolution",
    type=float,
    default=0.0,
    metavar="MM",
    help="Smallest step of a value, mm or degrees; of fanuc-3d the detection unit."
    "  [that of the format]",
)
@click.option(
    "--sign",
    type=click.Choice(("error", "correction")),
    help="What the numbers of the table are: the error, which the controller takes back, or what it"
    " adds.  [what the manual says]",
)
@click.option(
    "--loop",
    type=click.Choice(("tool", "relative")),
    help="Structural loop that is corrected.  [relative where a linear axis, or with --orientation"
    " all rotary axes, carry the workpiece]",
)
@click.option(
    "--orientation",
    is_flag=True,
    help="Correct the tool axis too, with the rotary axes, where the format has a place for it.",
)
@click.option(
    "--sweep",
    metavar="N,N,…",
    help="Instead of one table, compare tables with so many points per axis.",
)
@plot_option("maps before and after, or what is left by the size of the table,")
@force_option
@json_option
def compensate(
    scene: str,
    kinds: tuple[str, ...],
    output: str | None,
    grid: str | None,
    resolution: float,
    sign: str | None,
    loop: str | None,
    sweep: str | None,
    plot: str | None,
    *,
    orientation: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Write a table of compensation, and say what it leaves.

    The program reads its own file back and does with it what the controller does: it interpolates,
    rounds and clips, and adds the result to the commanded positions. What is left is evaluated with
    the exact chain over the working volume, between the points of the table.

    --sweep 3,5,9,17 compares kinds of table by their size instead.
    """
    from warpspace.formats.compensation.compensate import Plan, read_points
    from warpspace.formats.registry import find_format
    from warpspace.scene.library import load_scene

    check_targets(scene, force=force, plot=plot)
    for kind in kinds:
        find_format(kind)
    if sweep is None and (len(kinds) != 1 or output is None):
        raise OptionError("expected --format F and -o FILE; --sweep compares several tables")
    if sweep is not None and (output or grid or orientation):
        raise OptionError("--sweep writes no table: expected it without -o, --grid, --orientation")
    loaded = load_scene(scene)
    stem = Path(output).stem if output else "compensation"
    plan = Plan(
        kinds[0] if kinds else "",
        None if grid is None else read_points(grid),
        resolution,
        sign or "",
        loop or "",
        orientation,
        stem,
    )
    if sweep is not None:
        _run_sweep(loaded, plan, kinds, _counts(sweep), plot, force=force, as_json=as_json)
        return
    _run(scene, loaded, plan, output or "", plot, force=force, as_json=as_json)


def _run(
    name: str,
    scene: "Scene",
    plan: "Plan",
    output: str,
    plot: str | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Write one table."""
    from warpspace.cli.file_options import check_output
    from warpspace.formats.compensation.compensate import compensate as run
    from warpspace.outputs.files import write_atomically

    main = check_output(output, (), force=force, scenes=[name])
    with progress("compensating", silent=as_json):
        found = run(scene, plan)
    targets = {
        add: main
        if not add
        else check_output(str(main.with_name(f"{main.stem}{add}")), (), force=force, scenes=[name])
        for add in found.files
    }
    if len(set(targets.values())) < len(targets):
        raise OptionError(f"{output}: expected another ending, a table beside it has the same name")
    if plot is not None:
        from warpspace.outputs.charts import write_chart
        from warpspace.outputs.charts.compensation import compensation_chart

        where = f"{found.format.title} · loop {found.loop} · {found.points_words}"
        title = f"Compensation · {scene.title}"
        write_chart(compensation_chart(found, title, where), plot, overwrite=force)
    for add, target in targets.items():
        with write_atomically(target, overwrite=force) as temporary:
            temporary.write_text(found.files[add], encoding="utf-8", newline="")
    if as_json:
        print_json(_json(found, [str(target) for target in targets.values()]))
        return
    print_text(f"{scene.title} · {found.format.title} · loop {found.loop}")
    columns = (
        Column("", leads=True),
        *number_columns(("mean", "RMS", "P95", "max"), "µm"),
        *number_columns(("mean tilt", "max tilt"), "µrad"),
    )
    shown = {"": found, **found.directions}
    rows = [
        (f"{word} {way}".rstrip(), *_four(numbers), *(f"{v:.2f}" for v in one.tilt_urad(field)))
        for way, one in shown.items()
        for word, numbers, field in (
            ("before", one.before_statistics, one.before),
            ("after", one.after_statistics, one.after),
        )
    ]
    print_table(columns, rows)
    print_text(f"  {found.size} numbers; corrected: {', '.join(found.axes)}; {found.points_words}")
    for text in found.assumed:
        print_text(f"  assumed: {text}")
    for text in found.notes:
        print_text(f"  {text}")
    for path in filter(None, (*map(str, targets.values()), plot)):
        echo(f"wrote {path}")


def _run_sweep(
    scene: "Scene",
    plan: "Plan",
    kinds: tuple[str, ...],
    counts: tuple[int, ...],
    plot: str | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Compare tables."""
    from warpspace.formats.compensation.sweep import sweep as run

    with progress("compensating", silent=as_json):
        before, steps, left_out = run(scene, plan, kinds, counts)
    if plot is not None:
        from warpspace.outputs.charts import write_chart
        from warpspace.outputs.charts.compensation import sweep_chart

        title = f"Which table is worth it? · {scene.title}"
        write_chart(sweep_chart(before, steps, title), plot, overwrite=force)
    if as_json:
        print_json(
            {
                "before": _statistics(before),
                "sweep": [
                    {
                        "format": one.format,
                        "points": one.points,
                        "pitch": one.pitch,
                        "numbers": one.numbers,
                        "bytes": one.bytes,
                        "after": _statistics(one.after),
                        "worst_after_um": one.after.max_um,
                    }
                    for one in steps
                ],
                "left_out": left_out,
            }
        )
        return
    print_text(f"{scene.title} · before: {_words(before)}")
    _print_sweep(steps)
    for text in left_out:
        print_text(f"  left out: {text}")
    if plot:
        echo(f"wrote {plot}")


def _print_sweep(steps: list["Step"]) -> None:
    """Print what each table leaves."""
    columns = (
        Column("format", leads=True),
        Column("points", is_number=True),
        Column("pitch", is_number=True),
        Column("numbers", is_number=True),
        *number_columns(("mean", "RMS", "P95", "max"), "µm"),
    )
    rows = [
        (
            one.format,
            str(one.points) if one.points else "",
            f"{one.pitch:.4g}" if one.pitch else "",
            str(one.numbers),
            *_four(one.after),
        )
        for one in steps
    ]
    print_table(columns, rows)


def _counts(text: str) -> tuple[int, ...]:
    """Read the numbers of points of a sweep."""
    try:
        found = tuple(dict.fromkeys(int(part) for part in text.split(",")))
    except ValueError:
        found = ()
    if not found or not all(2 <= count <= 1000 for count in found):
        raise OptionError(f"--sweep {text!r}; {EXPECTED_SWEEP}")
    return found


def _statistics(found: "Statistics") -> dict[str, object]:
    """Spell statistics as other commands do."""
    return asdict(found)


def _json(found: "Compensation", files: list[str]) -> dict[str, object]:
    """Spell a compensation for a program."""
    after = found.after_statistics
    return {
        "format": found.format.name,
        "loop": found.loop,
        "corrected": list(found.axes),
        "points": dict(found.points) if not found.format.grid.startswith("none") else {},
        "numbers": found.size,
        "files": files,
        "before": _statistics(found.before_statistics),
        "after": _statistics(after),
        "worst_after_um": after.max_um,
        "orientation": {
            word: dict(zip(("mean_urad", "max_urad"), found.tilt_urad(field), strict=True))
            for word, field in (("before", found.before), ("after", found.after))
        },
        "directions": {
            way: {
                "before": _statistics(one.before_statistics),
                "after": _statistics(one.after_statistics),
            }
            for way, one in found.directions.items()
        },
        "assumed": list(found.assumed),
        "notes": list(found.notes),
    }


def _four(found: "Statistics") -> tuple[str, ...]:
    """Spell mean, RMS, P95 and max."""
    numbers = (found.mean_um, found.rms_um, found.p95_um, found.max_um)
    return tuple(f"{number:.3f}" for number in numbers)


def _words(found: "Statistics") -> str:
    """Spell statistics in a sentence."""
    mean, rms, p95, largest = _four(found)
    return f"mean {mean}, RMS {rms}, P95 {p95}, max {largest} µm"
