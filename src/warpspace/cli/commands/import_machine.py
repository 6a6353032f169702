"""Command `import-machine`: a machine or robot from a URDF file."""

from pathlib import Path

import click

from warpspace.cli.file_options import check_output, force_option, output_option
from warpspace.cli.tables import print_text

SHOWN = 30
"""Remarks that are printed; all of them stand in the file."""


@click.command("import-machine")
@click.argument("robot", type=click.Path(path_type=Path))
@output_option("Scene file to write: .toml. Meshes are written beside it.")
@click.option("--tool", default="", metavar="LINK", help="Link of the tool point.  [by its name]")
@click.option(
    "--workpiece",
    default="",
    metavar="LINK",
    help="Link of the workpiece.  [by its name, else the link that hangs on nothing]",
)
@force_option
def import_machine(robot: Path, output: str, tool: str, workpiece: str, *, force: bool) -> None:
    """Read a machine from the URDF file ROBOT into a scene.

    The joints between workpiece and tool become axes, their limits travels, their origins offsets
    and rotations, their shapes one mesh for each axis. What has no place is named, here and at the
    top of the scene. `warpspace export SCENE -o FILE.urdf` is the way back.
    """
    from warpspace.bodies.urdf_meshes import frame_meshes
    from warpspace.outputs.files import write_atomically
    from warpspace.outputs.mesh_files import mesh_files, write_meshes
    from warpspace.scene.build import SECTIONS
    from warpspace.scene.library import parse_scene
    from warpspace.scene.urdf.left_out import left_out
    from warpspace.scene.urdf.placing import place_robot
    from warpspace.scene.urdf.reading import read_robot
    from warpspace.scene.urdf.text import imported_text

    target = check_output(output, [".toml"], force=force)
    loaded, others = read_robot(robot)
    found = place_robot(loaded, str(robot), tool, workpiece)
    meshes, unread, read = frame_meshes(loaded, found.frame_of, robot.parent)
    files = mesh_files(target, meshes, overwrite=force, inputs=read)
    notes = [*found.notes, *unread, *left_out(loaded, others, found.frame_of)]
    sections: frozenset[str] = frozenset(SECTIONS)
    names = {frame: file.name for frame, file in files.items() if "bodies" in sections}
    text = imported_text(found.machine, robot.name, notes, names)
    scene = parse_scene(text, target.stem, output)
    write_meshes(files, meshes, overwrite=force)
    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(text, encoding="utf-8")
    axes = len(scene.machine.axes)
    print_text(f"{output}: {scene.machine.chain}, {axes} {'axis' if axes == 1 else 'axes'}")
    if files:
        print_text(f"  meshes: {', '.join(file.name for file in files.values())}")
    for note in notes[:SHOWN]:
        print_text(f"  {note}")
    if len(notes) > SHOWN:
        print_text(f"  and {len(notes) - SHOWN} more remarks, at the top of {output}")
