"""The export format that the app writes, its offline page; outputs know nothing of the app."""

from typing import TYPE_CHECKING

from warpspace.outputs.exports.formats import (
    ExportFormat,
    export_formats,
    register_format,
    write_export,
)

__all__ = ["embed_view", "export_formats", "write_export", "write_page"]

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.picture.scene_picture import ScenePicture
    from warpspace.scene.model import Scene


def write_page(picture: "ScenePicture", target: "Path", *, overwrite: bool) -> None:
    """Write the interactive scene as one page that needs no network."""
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


register_format(
    ExportFormat(
        ".html", "the interactive scene, one file that needs no network", write_page, in_app=False
    )
)


def embed_view(
    scene: "Scene", *, exaggeration: float, nodes: int, loop: str, largest: float
) -> str:
    """Build the page with the interactive scene."""
    from warpspace.app.documents.offline_page import build_offline_html, offline_picture
    from warpspace.kinematics.model import Loop

    live = offline_picture(
        scene, exaggeration=exaggeration, nodes=nodes, loop=Loop(loop), largest=largest
    )
    return build_offline_html(live)
