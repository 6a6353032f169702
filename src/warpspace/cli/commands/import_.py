"""Command `import`: measured errors and tables of controllers into a scene."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import force_option, output_option
from warpspace.cli.options import json_option, print_json
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.cli.terminal import echo

if TYPE_CHECKING:
    from warpspace.formats.importing import Reading


@click.command("import")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@output_option("Scene file to write: .toml.")
@click.option(
    "--machine",
    metavar="M",
    help="Machine of the errors: a bundled name, or a scene whose other errors stay."
    "  [X, Y and Z with the travels of the data]",
)
@click.option(
    "--format",
    "format_name",
    metavar="F",
    help="Format of the files; see `warpspace formats`.  [recognised]",
)
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="AXIS|NAME=AXIS",
    help="Axis of files that name none (X), or what a name in them means (AX1=X). Repeatable.",
)
@click.option(
    "--sign",
    type=click.Choice(("error", "correction")),
    help="What the numbers of a controller's table are: the error, which it takes back, or what it"
    " adds.  [what the manual says]",
)
@click.option(
    "--variant",
    metavar="V",
    help="Published variant of the format; see `warpspace formats`.  [the usual one]",
)
@click.option("--title", help="Title of the scene.  [name of the first file]")
@force_option
@json_option
def import_(
    files: tuple[Path, ...],
    output: str,
    machine: str | None,
    format_name: str | None,
    axes: tuple[str, ...],
    sign: str | None,
    variant: str | None,
    title: str | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Read measured errors from FILES into a scene.

    What was recognised, in which units the numbers are, and whatever the files do not say and is
    assumed stands in the output and in the description of the scene. A file that cannot be read
    rightly is refused with its line; nothing is written then.
    """
    from warpspace.cli.inputs import input_files
    from warpspace.formats.importing import open_files, read_errors
    from warpspace.formats.kind import ReadOptions, parse_axis_options
    from warpspace.formats.to_scene import base_scene, into_scene
    from warpspace.outputs.files import check_target, write_atomically
    from warpspace.scene.machines import machine_names

    scenes = [machine] if machine and machine not in machine_names() else []
    inputs = [*files, *input_files(*scenes)]
    target = check_target(output, (".toml",), overwrite=force, inputs=inputs)
    axis, names = parse_axis_options(axes)
    with progress("reading", silent=as_json):
        base = base_scene(machine) if machine else None
        options = ReadOptions(
            base.machine if base else None, axis, names, sign or "", variant or ""
        )
        reading = read_errors(open_files(files), options, format_name or "")
        what = files[0].name if len(files) == 1 else f"{files[0].name} and {len(files) - 1} more"
        if base is not None and (title or not scenes):
            base = replace(base, title=title or files[0].stem, name=target.stem)
        made = into_scene(reading, base, title or files[0].stem, what)
    kind = reading.format
    how = "recognised" if reading.recognised else "as told"
    echo(f"warpspace: {kind.name}, {kind.title} ({how})", err=True)
    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(made.text, encoding="utf-8")
    notes = [*reading.found.notes, *made.notes]
    if as_json:
        print_json(
            {
                "format": kind.name,
                "recognised": reading.recognised,
                "machine": made.scene.machine.name,
                "chain": str(made.scene.machine.chain),
                "units": list(reading.found.units),
                "errors": _errors(reading),
                "assumed": list(reading.found.assumed),
                "notes": notes,
                "output": str(output),
            }
        )
        return
    print_text(f"{output}: {kind.title}, {made.scene.machine.chain}")
    print_text(f"  units: {', '.join(reading.found.units)}")
    _print(reading)
    for text in reading.found.assumed:
        print_text(f"  assumed: {text}")
    for text in notes:
        print_text(f"  {text}")


def _errors(reading: "Reading") -> list[dict[str, object]]:
    """Summarise each error for a program."""
    from warpspace.formats.summary import summaries

    return [
        {
            "key": one.key,
            "unit": one.unit,
            "kind": one.kind,
            "points": one.points,
            "runs": one.runs,
            "directions": one.directions,
            "range": list(one.span) if one.span else None,
            "smallest": one.smallest,
            "largest": one.largest,
            "mean_reversal": one.mean_reversal,
            "repeatability": one.repeatability,
            "uncertainty": one.uncertainty,
        }
        for one in summaries(reading.found)
    ]


def _print(reading: "Reading") -> None:
    """Print a table of the errors."""
    from warpspace.formats.summary import summaries

    rows = [
        (
            one.key,
            one.kind,
            str(one.points),
            str(one.runs) if one.runs else "",
            one.directions,
            f"{one.span[0]:g} … {one.span[1]:g}" if one.span else "",
            f"{one.smallest:.3f}",
            f"{one.largest:.3f}",
            one.unit,
            "" if one.mean_reversal is None else f"{one.mean_reversal:.3f}",
            "" if one.uncertainty is None else f"{one.uncertainty:.3f}",
        )
        for one in summaries(reading.found)
    ]
    columns = (
        Column("error", leads=True),
        Column("as"),
        Column("points", is_number=True),
        Column("runs", is_number=True),
        Column("direction"),
        Column("from … to"),
        *number_columns(("smallest", "largest")),
        Column("unit"),
        Column("reversal", is_number=True),
        Column("u", is_number=True),
    )
    print_table(columns, rows)
