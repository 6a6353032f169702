"""Commands about scenes and machines: list, create, validate, annotate, merge."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from warpspace.analysis.blocks import Block, Column, Table
from warpspace.cli import shared_options
from warpspace.cli.analyses import print_blocks
from warpspace.cli.file_arguments import OutputFile, SceneName
from warpspace.cli.tables import print_table, print_text, progress
from warpspace.exceptions import OptionError
from warpspace.plugins import load_plugins

if TYPE_CHECKING:
    from warpspace.analysis.registry import PrintedNumber
    from warpspace.analysis.statistics import Check, Measured
    from warpspace.scene.model import Scene

NOTES = "warpspace.cli.note_editing"
OWN_TOLERANCES = "own"
CHECKED = ("id", "kind", "stale", "numbers", "now")  # keys of a note in the output of `check`
Kind = Literal["scenes", "machines"]


@click.command("list")
@click.argument("kind", type=click.Choice(("scenes", "machines")), required=False)
@shared_options.json_option
def list_(kind: Kind | None, *, as_json: bool) -> None:
    """List the bundled scenes and machines, or one of both.

    A scene refers to a machine by name, machine = "scara"; the scene machine_NAME shows it.
    """
    load_plugins()  # reports those that cannot be loaded
    kinds: tuple[Kind, ...] = ("scenes", "machines") if kind is None else (kind,)
    listing = {kind_name: _list_kind(kind_name) for kind_name in kinds}
    if as_json:
        shared_options.print_json(listing)
        return
    for kind_name, rows in listing.items():
        if kind is None:
            print_text(kind_name)
        lines = [line for row in rows for line in _lines(row)]
        print_table((Column(leads=True), Column(), Column(wraps=True)), lines, indent=0)


def _list_kind(kind: Kind) -> list[dict[str, str | None]]:
    from warpspace.scene.library import load_scene, scene_names
    from warpspace.scene.machine_library import load_machine, machine_names, machine_picture

    if kind == "scenes":
        return [{"name": name, "title": load_scene(name).title} for name in scene_names()]
    return [
        {
            "name": machine.name,
            "title": machine.title,
            "chain": str(machine.chain),
            "source": machine.source,
            "picture": str(machine_picture(machine.name) or "") or None,
        }
        for machine in map(load_machine, machine_names())
    ]


def _lines(row: dict[str, str | None]) -> list[tuple[str, str, str]]:
    first = (row["name"] or "", row.get("chain") or "", row["title"] or "")
    details = [text for text in (row.get("source"), row.get("picture")) if text]
    return [first, *(("", "", text) for text in details)]


@click.command("new-machine")
@click.argument("chain")
@shared_options.output_option("Scene file to write: .toml.", *shared_options.SCENES)
@click.option("--title", default="", help="Title of the machine and the scene.  [the chain]")
@shared_options.force_option
def new_machine(chain: str, output: str, title: str, *, force: bool) -> None:
    """Write a scene for a machine with the axes of CHAIN.

    CHAIN runs from the workpiece w over the frame F to the tool t, for instance wBCFXYZt: B and C
    carry the workpiece, X Y Z the tool. Axes are letters of X Y Z U V W A B C with an optional
    digit, up to eight. Offsets, travels, working volume, tolerances and a few example errors are
    chosen so that the scene opens at once, with a remark on each line.
    """
    from warpspace.scene.library import parse_scene
    from warpspace.scene.starter import starter_text

    text = starter_text(chain, title)
    scene = parse_scene(text, Path(output).stem, output)
    shared_options.write_text(output, text, force=force)
    print_text(
        f"{output}: {scene.machine.chain}, {len(scene.parameter_keys)} errors;"
        f" warpspace view {output} opens it"
    )


@click.command()
@shared_options.scene_argument("scenes", nargs=-1, required=True)
@click.option(
    "--against",
    type=SceneName(),
    metavar="SCENE|own",
    help="Compare each error with the tolerances of this scene, for instance dvf5000_proposed, or"
    " of SCENE itself (own), and report the predicted map. Allows several SCENES.",
)
@shared_options.loop_option
@shared_options.grid_option(of="of the predicted map, with --against")
@shared_options.json_option
def check(
    scenes: tuple[str, ...], against: str | None, loop: str | None, grid: int, *, as_json: bool
) -> None:
    """Validate SCENE and summarise its content.

    All problems of a file are reported together, each with key, value and expected value.

    With --against, each error is within or outside its tolerance. The published measured error, if
    any, is printed next to the predicted one. The shear of each plane is that of the best affine
    fit to the predicted map.
    """
    from warpspace.analysis.description import to_json
    from warpspace.analysis.statistics import measured
    from warpspace.scene.library import load_scene

    loaded = [load_scene(name) for name in scenes]
    if against is None:
        if len(scenes) > 1:
            raise OptionError(f"{len(scenes)} scenes; expected one, or --against")
        _check(*loaded, as_json=as_json)
        return
    limits = None if against == OWN_TOLERANCES else load_scene(against).tolerances
    pairs = [(one, measured(one, tolerances=limits, loop=loop, grid=grid)) for one in loaded]
    shared_options.warn_first_order(loop, *loaded)
    if as_json:
        shared_options.print_json(
            {
                "machines": [
                    {
                        "scene": scene.name,
                        "checks": [{**asdict(row), "passes": row.passes} for row in result.checks],
                        "predicted": to_json(result.predicted),
                        "statistics_nodes": to_json(result.predicted_nodes),
                        "measured_um": next(
                            (number.value_um for number in _measured_errors(scene)), None
                        ),
                        "shear_urad": result.shear_urad,
                    }
                    for scene, result in pairs
                ]
            }
        )
        return
    for scene, result in pairs:
        print_blocks(_against(scene, result))


def _check(scene: "Scene", *, as_json: bool) -> None:
    from warpspace.analysis.note_tables import notes_table
    from warpspace.bodies.placed import check_bodies
    from warpspace.cli.note_editing import notes_json
    from warpspace.scene.model import second_order

    remarks = (*scene.notes, *check_bodies(scene.model))
    estimate = second_order(scene)
    shared_options.warn_second_order(estimate)
    non_zero = [key for key in scene.errors if scene.errors.amplitude(key) != 0.0]
    if as_json:
        shared_options.print_json(
            {
                "scene": scene.name,
                "title": scene.title,
                "machine": scene.machine.name,
                "chain": str(scene.machine.chain),
                "parameters": len(scene.parameter_keys),
                "non_zero": non_zero,
                "linearisation_error_um": estimate.um,
                "remarks": list(remarks),
                "notes": [{key: one[key] for key in CHECKED} for one in notes_json(scene)],
            }
        )
        return
    facts = [("machine", f"{scene.machine.title}, chain {scene.machine.chain}")]
    for name, (low, high) in scene.workspace.ranges.items():
        span = f"{low:g}" if low == high else f"{low:g} … {high:g}"
        facts.append((name, f"{span} {scene.machine.axes[name].unit}"))
    count = f"{len(non_zero)} of {len(scene.parameter_keys)} parameters not zero"
    facts.append(("errors", count + (f": {', '.join(non_zero)}" if non_zero else "")))
    facts.append(("first order", f"differs from the exact chain by at most {estimate.um:.2g} µm"))
    facts.extend(("remark", remark) for remark in remarks)
    columns = (Column(leads=True), Column(wraps=True))
    review = [notes_table(scene, "notes")] if scene.review else []
    print_blocks((f"{scene.name}: valid. {scene.title}", Table(columns, facts), *review))


@click.command()
@shared_options.scene_argument()
@click.option("--add", "text", metavar="TEXT", help="Add a note with this text.")
@click.option(
    "--at",
    "point",
    metavar="X=..,Y=..",
    help="Position of the new note: axis positions in mm and degrees.  [none]",
)
@shared_options.choice_option(
    "--kind", ("note", "question", "decision"), "Kind of the new note.", "note"
)
@click.option("--author", default="", help="Author of the new note.")
@click.option("--step", default=0, help="Position in the story; 0 for none.", show_default=True)
@shared_options.output_option(
    "File to write: the notes as .csv or .md, or with --add the scene as .toml.  [SCENE]",
    ".csv", ".md", ".toml", required=False,
)  # fmt: skip
@shared_options.loop_option
@shared_options.force_option
@shared_options.json_option
@shared_options.run_by(f"{NOTES}:edit_notes")
def notes() -> None:
    """List the review notes of SCENE, or add one.

    A note whose numbers have changed is marked "changed", with the stored and the present number.
    """


@click.command()
@shared_options.scene_argument("first")
@shared_options.scene_argument("second")
@shared_options.output_option("Scene file to write: .toml.", *shared_options.SCENES)
@shared_options.force_option
@shared_options.run_by(f"{NOTES}:merge_scenes")
def merge() -> None:
    """Merge the review notes of two copies of a scene.

    Notes are matched by id, and replies merged. Of a note edited in both copies, both versions are
    retained. All else is taken from FIRST.
    """


def _measured_errors(scene: "Scene") -> list["PrintedNumber"]:
    from warpspace.analysis.registry import PUBLICATIONS

    printed = (publication.measured_error(scene) for publication in PUBLICATIONS.members())
    return [number for number in printed if number is not None]


def _against(scene: "Scene", result: "Measured") -> Iterator[Block]:
    yield scene.title
    columns = (
        Column("limit"),
        Column("key"),
        Column("value", ".1f"),
        Column("unit"),
        Column("tolerance", _limits),
    )
    verdicts = {True: "within", False: "outside", None: "none"}
    rows = [
        (verdicts[check_row.passes], check_row.key, check_row.value, check_row.unit, check_row)
        for check_row in result.checks
    ]
    yield Table(columns, rows)
    measured = "".join(f"; {number.quotation}" for number in _measured_errors(scene))
    yield (
        f"  predicted |E|: mean {result.predicted.mean_um:.2f}, RMS {result.predicted.rms_um:.2f},"
        f" max {result.predicted.max_um:.2f} µm over the volume;"
        f" mean of 11³ nodes {result.predicted_nodes.mean_um:.2f} µm{measured}"
    )
    shears = ", ".join(f"{plane} {value:+.1f}" for plane, value in result.shear_urad.items())
    yield f"  shear of the volume: {shears} µrad"


def _limits(check: "Check") -> str:
    if check.centre is None or check.half_width is None:
        return "no tolerance"
    return f"{check.centre:g} ± {check.half_width:g}"


@click.command()
@click.option("--markdown", type=OutputFile(".md"), help="Write the comparison to this .md file.")
@shared_options.force_option
@shared_options.json_option
def thesis(markdown: str | None, *, force: bool, as_json: bool) -> None:
    """Recompute every number that the thesis prints.

    That is its tables 4-1 to 4-8 and 5-3 to 5-5; each number comes with its unit.
    A number agrees where it lies within half of the last printed digit. Rows that do not agree say
    why. Nothing is tuned to agree.
    """
    from warpspace.thesis_example.rows import markdown_page, thesis_blocks, thesis_json
    from warpspace.thesis_example.rows import thesis as compare

    with progress("computing", silent=as_json):
        rows = compare()
    if markdown is not None:
        shared_options.write_text(markdown, markdown_page(rows), force=force)
    if as_json:
        shared_options.print_json(thesis_json(rows))
        return
    print_blocks(thesis_blocks(rows))
