"""Command `new-machine`: a scene to start from, for any chain of axes."""

from pathlib import Path

import click

from warpspace.cli.options import SCENES, force_option, output_option
from warpspace.cli.tables import print_text


@click.command("new-machine")
@click.argument("chain")
@output_option("Scene file to write: .toml.", *SCENES)
@click.option("--title", default="", help="Of the machine and the scene.  [the chain]")
@force_option
def new_machine(chain: str, output: str, title: str, *, force: bool) -> None:
    """Write a scene for a machine with the axes of CHAIN.

    CHAIN runs from the workpiece w over the frame F to the tool t, for instance wBCFXYZt: B and C
    carry the workpiece, X Y Z the tool. Axes are letters of X Y Z U V W A B C with an optional
    digit, up to eight. Offsets, travels, working volume, tolerances and a few example errors are
    chosen so that the scene opens at once, with a remark on each line.
    """
    from warpspace.outputs.files import write_atomically
    from warpspace.scene.library import parse_scene
    from warpspace.scene.starter import starter_text

    text = starter_text(chain, title)
    scene = parse_scene(text, Path(output).stem, output)
    with write_atomically(output, overwrite=force) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_text(
        f"{output}: {scene.machine.chain}, {len(scene.parameter_keys)} errors;"
        f" warpspace view {output} opens it"
    )
