"""Commands about measurements: standard tests, import of errors, sample workpieces."""

from pathlib import Path

import click

from warpspace.analysis.blocks import Column
from warpspace.cli.analyses import command_of
from warpspace.cli.file_arguments import Commands, InputFile, SceneName
from warpspace.cli.shared_options import (
    SCENES,
    force_option,
    json_option,
    output_option,
    run_by,
    write_text,
)
from warpspace.cli.tables import echo, print_table
from warpspace.machine.limits import MAX_LENGTH_MM


def _test_names() -> tuple[str, ...]:
    from warpspace.bench.base import bench_names

    return bench_names()


def _build_test(name: str) -> click.Command:
    from warpspace.bench.base import find_test

    if name not in _test_names():
        raise KeyError(name)
    test_kind = find_test(name)
    command = command_of(test_kind)
    command.short_help = test_kind.title
    return command


@click.group(name="test", commands=Commands(_test_names, _build_test), invoke_without_command=True)
@click.option("--list", "listing", is_flag=True, help="List the tests: name, standard, title.")
@click.pass_context
def test(context: click.Context, *, listing: bool) -> None:
    """Run a standard test of machine tools on SCENE.

    Each test prints the quantities of its standard and draws its customary figure; with --data,
    measured readings are evaluated by the same formulas and drawn over those of the model. The
    model uses the exact chain along the path of the test on the machine. `warpspace test NAME
    --help` lists the options of a test.
    """
    if context.invoked_subcommand is None:
        if not listing:
            raise click.UsageError(
                "Missing argument 'NAME'; `warpspace test --list` lists the tests."
            )
        _list()


def _list() -> None:
    from warpspace.bench.base import find_test

    columns = (
        Column("name", leads=True),
        Column("standard", wraps=True),
        Column("title", wraps=True),
    )
    tests = [find_test(name) for name in _test_names()]
    print_table(columns, [(test.name, test.standard, test.title) for test in tests], indent=0)


@click.command("import")
@click.argument("files", nargs=-1, type=InputFile(path_type=Path))
@output_option("Scene file to write: .toml; for --template .csv.", *SCENES, ".csv", required=False)
@click.option(
    "--machine",
    type=SceneName(),
    metavar="M",
    help="Machine of the errors: a bundled name, or a scene whose other errors are retained."
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
    help="Axis of files that name none (X), or the axis of a name in them (AX1=X). Repeatable.",
)
@click.option(
    "--sign",
    type=click.Choice(("error", "correction")),
    help="Meaning of the numbers of a controller's table: the error, or the correction that is"
    " added.  [as in the manual]",
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
    help="URDF: link of the workpiece.  [by its name, else the root link]",
)
@click.option(
    "--mesh-root",
    type=InputFile(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="URDF: only meshes in this folder are read.  [that of the file]",
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
    "second_axis",
    metavar="AXIS|AXIS=Q1,Q2,…",
    help="Second axis that the errors of --template depend on, with its positions.",
)
@click.option("--formats", is_flag=True, help="List the formats and their content.")
@force_option
@json_option
@run_by("warpspace.cli.measurement_import:import_files")
def import_() -> None:
    """Read measured errors, or a machine in URDF, into a scene.

    The output and the description of the scene state the recognised format, the units, and every
    assumption. A file that cannot be read correctly is refused with its line, and nothing is
    written.

    The joints of a robot (.urdf) between workpiece and tool become axes, their limits travels,
    their origins offsets and rotations, their shapes one mesh per axis, written next to the scene.
    Content that cannot be represented is listed, here and at the top of the scene.
    """


@click.command("test-piece")
@click.argument("name", type=click.Choice(("contour", "cone", "plate", "cube")))
@output_option(
    "File to write: mesh .stl, program .ngc, or features .toml.", ".stl", ".ngc", ".toml"
)
@click.option(
    "--size",
    type=click.FloatRange(1.0, MAX_LENGTH_MM),
    help="Length or diameter, mm.  [100 to 240, by workpiece]",
)
@force_option
def test_piece(name: str, output: str, size: float | None, *, force: bool) -> None:
    """Write a sample workpiece: mesh, program or features.

    contour is a circle on a diamond on a square (after ISO 10791-7), cone a frustum (after NAS
    979), plate has nine holes. The origin of all files is the middle of the lower side: --place of
    the mesh, and work offset of the program.
    """
    from warpspace.parts.sample_pieces import build_piece

    write_text(output, build_piece(name, size)[Path(output).suffix.lower()], force=force)
    echo(f"wrote {output}")
