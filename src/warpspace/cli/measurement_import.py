"""Run the command `import`: measured errors, robots in URDF, tables to fill in, formats."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import click

from warpspace.analysis.blocks import Column
from warpspace.analysis.description import to_json
from warpspace.cli.analyses import print_blocks
from warpspace.cli.file_arguments import check_files
from warpspace.cli.shared_options import SCENES, print_json, write_text
from warpspace.cli.tables import echo, print_table, print_text, progress
from warpspace.exceptions import OptionError
from warpspace.formats import registry
from warpspace.formats.kinds import csv_own
from warpspace.formats.measured import summarise_errors, summary_table
from warpspace.formats.registry import formats as all_formats
from warpspace.formats.to_scene import base_scene, build_imported_scene
from warpspace.machine.axes import is_axis_name
from warpspace.outputs.file_output import check_target, mesh_files, write_with_meshes
from warpspace.scene.library import parse_scene
from warpspace.scene.machine_library import machine_names
from warpspace.scene.text_files import one_line, parse_number

ROBOT = "urdf"
MAX_REMARKS = 30  # printed remarks on a robot; the file has all
MAX_ROWS = 100_000  # rows of a table to fill in


def import_files(
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
    second_axis: str | None,
    *,
    template: bool,
    formats: bool,
    force: bool,
    as_json: bool,
) -> None:
    if formats:
        _list_formats(as_json=as_json)
        return
    if not files:
        raise click.UsageError("Missing argument 'FILES...'.")
    for argument, name in ((positions, "--positions"), (second_axis, "--over")):
        if argument is not None and not template:
            raise OptionError(f"{name} {argument!r} belongs to --template")
    if template:
        if output is not None:
            check_target(output, (".csv",), overwrite=force)
        _write_template(files, output, positions, second_axis, force=force)
        return
    robot = format_name == ROBOT or (format_name is None and files[0].suffix.lower() == ".urdf")
    for argument, name in (
        (tool, "--tool"),
        (workpiece, "--workpiece"),
        (mesh_root, "--mesh-root"),
    ):
        if argument is not None and not robot:
            raise OptionError(f"{name} {str(argument)!r} belongs to a URDF file")
    if output is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    check_target(output, SCENES, overwrite=force)
    if robot:
        _import_robot(files, output, tool or "", workpiece or "", mesh_root, force=force)
        return

    scenes = [machine] if machine and machine not in machine_names() else []
    axis, names = registry.parse_axis_options(axes)
    with progress("reading", silent=as_json):
        base = base_scene(machine) if machine else None
        options = registry.ReadOptions(
            base.machine if base else None, axis, names, sign or "", variant or ""
        )
        reading = registry.read_errors(registry.open_files(files), options, format_name or "")
        source = files[0].name if len(files) == 1 else f"{files[0].name} and {len(files) - 1} more"
        if base is not None and (title or not scenes):
            base = replace(base, title=one_line(title or files[0].stem), name=Path(output).stem)
        made = build_imported_scene(reading, base, title or files[0].stem, source)
    kind = reading.format
    recognition = "recognised" if reading.recognised else "by --format"
    echo(f"warpspace: {kind.name}, {kind.title} ({recognition})", err=True)
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
    from warpspace.bodies.mesh_files import frame_meshes
    from warpspace.scene.urdf import imported_text, omitted_notes, place_robot, read_robot

    target, robot = Path(output), files[0]
    if len(files) > 1:
        raise OptionError(f"{files[1]}: expected one URDF file, found {len(files)}")
    loaded, other_files = read_robot(robot)
    placed = place_robot(loaded, str(robot), tool, workpiece)
    meshes, unread, read = frame_meshes(loaded, placed.frame_of, robot.parent, mesh_root)
    mesh_paths = mesh_files(target, meshes, overwrite=force, inputs=read)
    check_files(click.get_current_context(), mesh_paths.values())
    notes = [*placed.notes, *unread, *omitted_notes(loaded, other_files, placed.frame_of)]
    names = {frame: file.name for frame, file in mesh_paths.items()}
    text = imported_text(placed.machine, robot.name, notes, names)
    scene = parse_scene(text, target.stem, output)
    write_with_meshes(target, text.encode(), mesh_paths, meshes, overwrite=force)
    axes = len(scene.machine.axes)
    print_text(f"{output}: {scene.machine.chain}, {axes} {'axis' if axes == 1 else 'axes'}")
    if mesh_paths:
        print_text(f"  meshes: {', '.join(file.name for file in mesh_paths.values())}")
    for note in notes[:MAX_REMARKS]:
        print_text(f"  {note}")
    if len(notes) > MAX_REMARKS:
        print_text(f"  and {len(notes) - MAX_REMARKS} more remarks, at the top of {output}")


def _write_template(
    files: tuple[Path, ...],
    output: str | None,
    positions: str | None,
    second_axis: str | None,
    *,
    force: bool,
) -> None:
    axis = str(files[0])
    name = axis.strip().upper()
    if len(files) > 1 or not is_axis_name(name):
        raise OptionError(
            f"axis {' '.join(map(str, files))!r}; expected one axis such as X, C or C2"
        )
    places = _positions(positions, "--positions")
    if second_axis is None:
        text = csv_own.template(name, places)
    else:
        second, equals, values_text = second_axis.partition("=")
        other = second.strip().upper()
        if not is_axis_name(other) or other == name:
            raise OptionError(
                f"--over {second_axis!r}; expected another axis than {name}, such as Z=0,100"
            )
        second_positions = _positions(values_text if equals else None, "--over")
        at = (
            places or csv_own.default_positions(name),
            second_positions or csv_own.default_positions(other),
        )
        if len(at[0]) * len(at[1]) > MAX_ROWS:
            raise OptionError(
                f"{len(at[0])} × {len(at[1])} points; expected at most {MAX_ROWS:,} rows"
            )
        text = csv_own.surface_template((name, other), at)
    if output is None:
        click.echo(text, nl=False)
        return
    write_text(output, text, force=force)
    echo(f"wrote {output}")


def _positions(text: str | None, option: str) -> tuple[float, ...]:
    if text is None:
        return ()
    try:
        numbers = tuple(parse_number(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if not 2 <= len(numbers) <= 1000 or not all(abs(q) <= 1e5 for q in numbers):
        raise OptionError(f"{option} {text!r}; expected 2 to 1000 numbers with commas between")
    if any(high <= low for low, high in pairwise(numbers)):
        raise OptionError(f"{option} {text!r}; expected ascending positions")
    return numbers


def _list_formats(*, as_json: bool) -> None:
    known_formats = all_formats()
    if as_json:
        keys = (
            "holds", "units", "grid", "limits", "points", "most_points", "orientation", "variants",
            "endings", "source",
        )  # fmt: skip
        listed = [
            {
                "name": format_.name,
                "title": format_.title,
                "reads": True,
                "writes": format_.can_write,
                "controller": format_.tables is not None,
                **{name: getattr(format_, name) for name in keys},
            }
            for format_ in known_formats
        ]
        print_json({"formats": listed})
        return
    rows: list[tuple[str, str, str]] = []
    for format_ in known_formats:
        rows.append((format_.name, "read, write" if format_.can_write else "read", format_.title))
        rows += [
            ("", "", f"{word}: {text}")
            for word, text in (
                ("holds", format_.holds),
                ("units", format_.units),
                ("grid", format_.grid),
                ("limits", format_.limits),
                ("variants", ", ".join(format_.variants)),
                ("published", format_.source),
            )
            if text
        ]
    print_table((Column(leads=True), Column(), Column(wraps=True)), rows, indent=0)
