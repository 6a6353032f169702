"""Exports for the commands and the app: outputs write files, the app writes its offline page."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.picture.scene_picture import ScenePicture
    from warpspace.scene.model import Scene


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


def embed_view(
    scene: "Scene", *, exaggeration: float, nodes: int, loop: str, largest: float
) -> str:
    """Build the page with the interactive scene; outputs know nothing of the app."""
    from warpspace.app.documents.offline_page import build_offline_html, offline_picture
    from warpspace.kinematics.model import Loop

    live = offline_picture(
        scene, exaggeration=exaggeration, nodes=nodes, loop=Loop(loop), largest=largest
    )
    return build_offline_html(live)
