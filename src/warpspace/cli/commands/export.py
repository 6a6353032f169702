"""Command `export`: the deformed scene or its field, for other programs and for a browser."""

import click

from warpspace.cli.exports import export_formats, write_export
from warpspace.cli.file_options import check_output, force_option, output_option, size_text
from warpspace.cli.options import (
    component_option,
    direction_option,
    exaggeration_option,
    grid_option,
    loop_option,
    parse_exaggeration,
    scene_argument,
)
from warpspace.cli.progress import progress
from warpspace.cli.tables import print_text
from warpspace.cli.terminal import echo


def _formats_help() -> str:
    """Say which endings there are, and what each is for."""
    return ", ".join(f"{form.ending} ({form.about})" for form in export_formats())


@click.command()
@scene_argument()
@output_option(f"File to write: {_formats_help()}.")
@exaggeration_option
@grid_option()
@component_option
@loop_option
@direction_option
@force_option
def export(
    scene: str,
    output: str,
    exaggeration: str | None,
    grid: int,
    component: str,
    loop: str,
    direction: str | None,
    *,
    force: bool,
) -> None:
    """Write SCENE into a file for other programs.

    The ending of FILE chooses the format. Every format carries the scene, the settings, the display
    factor and the program's version. `warpspace view FILE.vts` shows a stored field again.
    """
    from warpspace.picture.scene_picture import evaluate_picture
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import in_direction

    target = check_output(
        output, [form.ending for form in export_formats()], force=force, scenes=[scene]
    )
    with progress("writing"):
        picture = evaluate_picture(
            in_direction(load_scene(scene), direction),
            exaggeration=parse_exaggeration(exaggeration),
            grid=grid,
            loop=loop,
            component=component,
        )
        write_export(picture, target, overwrite=force)
    kind = next(form for form in export_formats() if form.ending == target.suffix.lower())
    if kind.left_out:
        echo(f"{output}: {picture.scene.machine.title}, {size_text(target)}")
        print_text(f"  {kind.left_out}")
        return
    echo(
        f"{output}: {picture.scene.title}, displacement drawn ×{picture.exaggeration:g},"
        f" {size_text(target)}"
    )
