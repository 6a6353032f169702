"""Command `export`: the deformed scene or its field, for other programs and for a browser."""

from pathlib import Path

import click

from warpspace.cli.exports import export_formats, write_export
from warpspace.cli.options import (
    component_option,
    direction_option,
    exaggeration_option,
    force_option,
    grid_option,
    loop_option,
    output_option,
    parse_exaggeration,
    say_first_order,
    scene_argument,
    size_text,
)
from warpspace.cli.tables import echo, print_text, progress


def _formats_help() -> str:
    return ", ".join(f"{form.ending} ({form.about})" for form in export_formats())


@click.command()
@scene_argument()
@output_option(
    f"File to write: {_formats_help()}.",
    added=lambda: [form.ending for form in export_formats()],
)
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
    factor and the program's version.
    """
    from warpspace.picture.model import evaluate_picture
    from warpspace.scene.library import load_scene
    from warpspace.scene.model import in_direction

    with progress("writing"):
        picture = evaluate_picture(
            in_direction(load_scene(scene), direction),
            exaggeration=parse_exaggeration(exaggeration),
            grid=grid,
            loop=loop,
            component=component,
        )
        write_export(picture, Path(output), overwrite=force)
    kind = next(form for form in export_formats() if form.ending == Path(output).suffix.lower())
    if kind.left_out:
        echo(f"{output}: {picture.scene.machine.title}, {size_text(output)}")
        print_text(f"  {kind.left_out}")
        return
    say_first_order(loop, picture.scene)
    echo(
        f"{output}: {picture.scene.title}, displacement drawn ×{picture.exaggeration:g},"
        f" {size_text(output)}"
    )
