"""Command `export`: the deformed scene or its field, for other programs and for a browser."""

from typing import TYPE_CHECKING

import click

from warpspace.cli.options import COMPONENTS, loop_option, scene_argument
from warpspace.cli.targets import exaggeration_option, force_option, parse_exaggeration

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.picture.scene_picture import ScenePicture

ENDINGS = (".glb", ".vts", ".csv", ".html")


@click.command()
@scene_argument()
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(),
    help="File to write: .glb (3-D viewers, CAD), .vts (ParaView), .csv (the field), .html (the"
    " interactive scene in one file that needs no network).",
)
@exaggeration_option
@click.option(
    "--grid", type=int, default=21, show_default=True, help="Nodes per axis of the working volume."
)
@click.option(
    "--component",
    type=click.Choice(COMPONENTS),
    default="norm",
    show_default=True,
    help="What the colours show: |E| or one component.",
)
@loop_option
@force_option
def export(
    scene: str,
    output: str,
    exaggeration: str | None,
    grid: int,
    component: str,
    loop: str,
    *,
    force: bool,
) -> None:
    """Write SCENE for other programs; the ending of FILE chooses the format.

    Every format carries the scene, the settings, the display factor and the program's version.
    `warpspace view FILE.vts` shows a stored field again.
    """
    from warpspace.outputs.files import check_target
    from warpspace.picture.scene_picture import evaluate_picture
    from warpspace.scene.library import load_scene

    target = check_target(output, ENDINGS, overwrite=force)
    picture = evaluate_picture(
        load_scene(scene),
        exaggeration=parse_exaggeration(exaggeration),
        grid=grid,
        loop=loop,
        component=component,
    )
    write_export(picture, target, overwrite=force)
    click.echo(
        f"{output}: {picture.scene.title}, displacement drawn ×{picture.exaggeration:g},"
        f" {target.stat().st_size / 1e6:.2f} MB"
    )


def write_export(picture: "ScenePicture", target: "Path", *, overwrite: bool) -> None:
    """Write the format that the ending names."""
    match target.suffix.lower():
        case ".glb":
            from warpspace.outputs.exports import write_glb

            write_glb(picture, target, overwrite=overwrite)
        case ".vts":
            from warpspace.outputs.exports import write_vts

            write_vts(picture, target, overwrite=overwrite)
        case ".csv":
            from warpspace.outputs.exports import write_csv

            write_csv(picture, target, overwrite=overwrite)
        case _:
            from warpspace.app.documents.offline_page import build_offline_html, offline_picture
            from warpspace.outputs.files import write_atomically

            live = offline_picture(
                picture.scene,
                exaggeration=picture.exaggeration,
                nodes=max(picture.grid.shape),
                loop=picture.view.loop,
                component=picture.component,
            )
            page = build_offline_html(live, picture.provenance)
            with write_atomically(target, overwrite=overwrite) as temporary:
                temporary.write_text(page, encoding="utf-8")
