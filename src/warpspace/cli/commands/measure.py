"""Commands about measurements: standard tests, and measured errors into a scene."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import click

from warpspace.analysis.blocks import Column
from warpspace.cli.analyses import command_of, print_blocks
from warpspace.cli.file_arguments import Commands, InputFile, SceneName, check_files
from warpspace.cli.shared_options import (
    SCENES,
    force_option,
    json_option,
    output_option,
    print_json,
    write_text,
)
from warpspace.cli.tables import echo, print_table, print_text, progress
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_LENGTH_MM
from warpspace.scene.text_files import one_line, parse_number


def _test_names() -> tuple[str, ...]:
    from warpspace.bench.base import bench_names

    return bench_names()


def _build_test(name: str) -> click.Command:
    from warpspace.bench.base import FORMER, find_test

    if name not in _test_names() and name not in FORMER:
        raise KeyError(name)
    test = find_test(name)
    command = command_of(test)
    command.short_help = test.title
    return command


@click.group(name="test", commands=Commands(_test_names, _build_test), invoke_without_command=True)
@click.option("--list", "listing", is_flag=True, help="List the tests: name, standard, what it is.")
@click.pass_context
def test_(context: click.Context, *, listing: bool) -> None:
    """Run a standard test of machine tools on SCENE.

    Each test prints its standard's numbers and draws its customary figure; with --data measured
    readings are evaluated by the same formulas and drawn over the model's. Readings come from the
    exact chain, along the path that the test has on the machine. `warpspace test NAME --help` has
    the options of a test.
    """
    if context.invoked_subcommand is None:
        if not listing:
            raise click.UsageError(
                "Missing argument 'NAME'; `warpspace test --list` has the names."
            )
        _list()


def _list() -> None:
    from warpspace.bench.base import find_test

    columns = (
        Column("name", leads=True),
        Column("standard", wraps=True),
        Column("what", wraps=True),
    )
    tests = [find_test(name) for name in _test_names()]
    print_table(columns, [(test.name, test.standard, test.title) for test in tests], indent=0)


ROBOT = "urdf"
SHOWN = 30  # remarks on a robot that are printed; all of them stand in the file
MOST_ROWS = 100_000  # rows of a table to fill in


@click.command("import")
@click.argument("files", nargs=-1, type=InputFile(path_type=Path))
@output_option("Scene file to write: .toml; for --template .csv.", *SCENES, ".csv", required=False)
@click.option(
    "--machine",
    type=SceneName(),
    metavar="M",
    help="Machine of the errors: a bundled name, or a scene whose other errors stay."
    "  [X, Y and Z with the travels of the data]",
)
@click.option(
    "--format",
    "format_name",
    metavar="F",
    help="Format of the files; --formats lists them.  [recognised]",
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
    help="Published variant of the format; --formats lists them.  [the usual one]",
)
@click.option("--title", help="Title of the scene.  [name of the first file]")
@click.option("--tool", metavar="LINK", help="URDF: link of the tool point.  [by its name]")
@click.option(
    "--workpiece",
    metavar="LINK",
    help="URDF: link of the workpiece.  [by its name, else the link that hangs on nothing]",
)
@click.option(
    "--mesh-root",
    type=InputFile(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="URDF: folder out of which no mesh is read.  [that of the file]",
)
@click.option(
    "--template",
    is_flag=True,
    help="Write a table to fill in with the measured errors of an axis, named instead of FILES.",
)
@click.option(
    "--positions",
    metavar="Q1,Q2,…",
    help="Positions of the rows of --template, in mm or degrees.  [-250 … 250, or a turn]",
)
@click.option(
    "--over",
    metavar="AXIS|AXIS=Q1,Q2,…",
    help="Second axis that the errors of --template depend on, with its positions.",
)
@click.option("--formats", is_flag=True, help="List the formats, and what each holds.")
@force_option
@json_option
def import_(
    files: tuple[Path, ...],
    output: str | None,
    machine: str | None,
    format_name: str | None,
    axes: tuple[str, ...],
    sign: str | None,
    variant: str | None,
    title: str | None,
    tool: str | None,
    workpiece: str | None,
    mesh_root: Path | None,
    positions: str | None,
    over: str | None,
    *,
    template: bool,
    formats: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Read measured errors, or a machine in URDF, into a scene.

    What was recognised, in which units the numbers are, and whatever the files do not say and is
    assumed stands in the output and in the description of the scene. A file that cannot be read
    rightly is refused with its line; nothing is written then.

    The joints of a robot (.urdf) between workpiece and tool become axes, their limits travels,
    their origins offsets and rotations, their shapes one mesh for each axis, written beside the
    scene. What has no place is named, here and at the top of the scene.
    """
    from warpspace.outputs.file_output import check_target

    if formats:
        _list_formats(as_json=as_json)
        return
    if not files:
        raise click.UsageError("Missing argument 'FILES...'.")
    for given, name in ((positions, "--positions"), (over, "--over")):
        if given is not None and not template:
            raise OptionError(f"{name} {given!r} belongs to --template")
    if template:
        if output is not None:
            check_target(output, (".csv",), overwrite=force)
        _write_template(files, output, positions, over, force=force)
        return
    robot = format_name == ROBOT or (format_name is None and files[0].suffix.lower() == ".urdf")
    for given, name in ((tool, "--tool"), (workpiece, "--workpiece"), (mesh_root, "--mesh-root")):
        if given is not None and not robot:
            raise OptionError(f"{name} {str(given)!r} belongs to a URDF file")
    if output is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    check_target(output, SCENES, overwrite=force)
    if robot:
        _import_robot(files, output, tool or "", workpiece or "", mesh_root, force=force)
        return

    from warpspace.analysis.description import to_json
    from warpspace.formats.measured import summarise_errors, summary_table
    from warpspace.formats.registry import ReadOptions, open_files, parse_axis_options, read_errors
    from warpspace.formats.to_scene import base_scene, build_imported_scene
    from warpspace.scene.machine_library import machine_names

    scenes = [machine] if machine and machine not in machine_names() else []
    axis, names = parse_axis_options(axes)
    with progress("reading", silent=as_json):
        base = base_scene(machine) if machine else None
        options = ReadOptions(
            base.machine if base else None, axis, names, sign or "", variant or ""
        )
        reading = read_errors(open_files(files), options, format_name or "")
        what = files[0].name if len(files) == 1 else f"{files[0].name} and {len(files) - 1} more"
        if base is not None and (title or not scenes):
            base = replace(base, title=one_line(title or files[0].stem), name=Path(output).stem)
        made = build_imported_scene(reading, base, title or files[0].stem, what)
    kind = reading.format
    how = "recognised" if reading.recognised else "as told"
    echo(f"warpspace: {kind.name}, {kind.title} ({how})", err=True)
    write_text(output, made.text, force=force)
    notes = [*reading.imported.notes, *made.notes]
    if as_json:
        print_json(
            {
                "format": kind.name,
                "recognised": reading.recognised,
                "machine": made.scene.machine.name,
                "chain": str(made.scene.machine.chain),
                "units": list(reading.imported.units),
                "errors": to_json(summarise_errors(reading.imported)),
                "assumed": list(reading.imported.assumed),
                "notes": notes,
                "output": str(output),
            }
        )
        return
    print_text(f"{output}: {kind.title}, {made.scene.machine.chain}")
    print_text(f"  units: {', '.join(reading.imported.units)}")
    print_blocks([summary_table(reading.imported)])
    for text in reading.imported.assumed:
        print_text(f"  assumed: {text}")
    for text in notes:
        print_text(f"  {text}")


def _import_robot(
    files: tuple[Path, ...],
    output: str,
    tool: str,
    workpiece: str,
    mesh_root: Path | None,
    *,
    force: bool,
) -> None:
    from warpspace.bodies.own_meshes import frame_meshes
    from warpspace.outputs.file_output import mesh_files, write_with_meshes
    from warpspace.scene.library import parse_scene
    from warpspace.scene.urdf import imported_text, left_out, place_robot, read_robot

    target, robot = Path(output), files[0]
    if len(files) > 1:
        raise OptionError(f"{files[1]}: expected one URDF file, found {len(files)}")
    loaded, others = read_robot(robot)
    found = place_robot(loaded, str(robot), tool, workpiece)
    meshes, unread, read = frame_meshes(loaded, found.frame_of, robot.parent, mesh_root)
    written = mesh_files(target, meshes, overwrite=force, inputs=read)
    check_files(click.get_current_context(), written.values())
    notes = [*found.notes, *unread, *left_out(loaded, others, found.frame_of)]
    names = {frame: file.name for frame, file in written.items()}
    text = imported_text(found.machine, robot.name, notes, names)
    scene = parse_scene(text, target.stem, output)
    write_with_meshes(target, text.encode(), written, meshes, overwrite=force)
    axes = len(scene.machine.axes)
    print_text(f"{output}: {scene.machine.chain}, {axes} {'axis' if axes == 1 else 'axes'}")
    if written:
        print_text(f"  meshes: {', '.join(file.name for file in written.values())}")
    for note in notes[:SHOWN]:
        print_text(f"  {note}")
    if len(notes) > SHOWN:
        print_text(f"  and {len(notes) - SHOWN} more remarks, at the top of {output}")


def _write_template(
    files: tuple[Path, ...],
    output: str | None,
    positions: str | None,
    over: str | None,
    *,
    force: bool,
) -> None:
    from warpspace.formats.kinds.csv_own import default_positions, surface_template
    from warpspace.formats.kinds.csv_own import template as spelled
    from warpspace.machine.axes import is_axis_name

    axis = str(files[0])
    name = axis.strip().upper()
    if len(files) > 1 or not is_axis_name(name):
        raise OptionError(
            f"axis {' '.join(map(str, files))!r}; expected one name such as X, C or C2"
        )
    places = _positions(positions, "--positions")
    if over is None:
        text = spelled(name, places)
    else:
        second, equals, given = over.partition("=")
        other = second.strip().upper()
        if not is_axis_name(other) or other == name:
            raise OptionError(
                f"--over {over!r}; expected another axis than {name}, such as Z=0,100"
            )
        beside = _positions(given if equals else None, "--over")
        at = (places or default_positions(name), beside or default_positions(other))
        if len(at[0]) * len(at[1]) > MOST_ROWS:
            found = f"{len(at[0])} × {len(at[1])} points"
            raise OptionError(f"{found}; expected at most {MOST_ROWS:,} rows")
        text = surface_template((name, other), at)
    if output is None:
        click.echo(text, nl=False)
        return
    write_text(output, text, force=force)
    echo(f"wrote {output}")


def _positions(text: str | None, option: str) -> tuple[float, ...]:
    if text is None:
        return ()
    try:
        found = tuple(parse_number(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not 2 <= len(found) <= 1000 or not all(abs(q) <= 1e5 for q in found):
        raise OptionError(f"{option} {text!r}; expected 2 to 1000 numbers with commas between")
    if any(high <= low for low, high in pairwise(found)):
        raise OptionError(f"{option} {text!r}; expected ascending positions")
    return found


def _list_formats(*, as_json: bool) -> None:
    from warpspace.formats.registry import formats as all_formats

    found = all_formats()
    if as_json:
        said = (
            "holds", "units", "grid", "limits", "points", "most_points", "orientation", "variants",
            "endings", "source",
        )  # fmt: skip
        listed = [
            {
                "name": one.name,
                "title": one.title,
                "reads": True,
                "writes": one.can_write,
                "controller": one.tables is not None,
                **{name: getattr(one, name) for name in said},
            }
            for one in found
        ]
        print_json({"formats": listed})
        return
    rows: list[tuple[str, str, str]] = []
    for one in found:
        rows.append((one.name, "read, write" if one.can_write else "read", one.title))
        rows += [
            ("", "", f"{word}: {text}")
            for word, text in (
                ("holds", one.holds),
                ("units", one.units),
                ("grid", one.grid),
                ("limits", one.limits),
                ("variants", ", ".join(one.variants)),
                ("published", one.source),
            )
            if text
        ]
    print_table((Column(leads=True), Column(), Column(wraps=True)), rows, indent=0)


@click.command("test-piece")
@click.argument("name", type=click.Choice(("contour", "cone", "plate", "cube")))
@output_option(
    "File to write: mesh .stl, program .ngc, or features .toml.", ".stl", ".ngc", ".toml"
)
@click.option(
    "--size",
    type=click.FloatRange(1.0, MAX_LENGTH_MM),
    help="Its length or diameter across, mm.  [100 to 240, by piece]",
)
@force_option
def test_piece(name: str, output: str, size: float | None, *, force: bool) -> None:
    """Write a piece to start with: mesh, program or features.

    contour is a circle on a diamond on a square (after ISO 10791-7), cone a frustum (after NAS
    979), plate one of nine holes. The frame of all files has its zero in the middle of the lower
    side: --place of the mesh, and work offset of the program.
    """
    from warpspace.parts.sample_pieces import build_piece

    write_text(output, build_piece(name, size)[Path(output).suffix.lower()], force=force)
    echo(f"wrote {output}")
