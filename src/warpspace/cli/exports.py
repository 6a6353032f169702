"""The export format that the app writes, its offline page; outputs know nothing of the app."""

from typing import TYPE_CHECKING

from warpspace.outputs.exports.formats import (
    ExportFormat,
    export_formats,
    register_format,
    write_export,
)

__all__ = ["embed_view", "export_formats", "write_export", "write_page"]

BYTES_PER_RESPONSE = 48
"""Position and orientation error of one node to one parameter: six numbers."""

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.picture.model import ScenePicture
    from warpspace.scene.model import Scene


def write_page(picture: "ScenePicture", target: "Path", *, overwrite: bool) -> None:
    """Write the interactive scene as one page that needs no network."""
    from warpspace.app.documents.offline_page import build_offline_html, offline_picture
    from warpspace.outputs.files import write_atomically

    _check_size(picture)
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


def _check_size(picture: "ScenePicture") -> None:
    from warpspace.exceptions import OptionError
    from warpspace.machine.limits import MAX_PAGE_BYTES

    nodes, keys = picture.values.size, len(picture.scene.parameter_keys)
    needed = nodes * keys * BYTES_PER_RESPONSE
    if needed > MAX_PAGE_BYTES:
        per_axis = max(picture.grid.shape)
        fits = int(per_axis * (MAX_PAGE_BYTES / needed) ** (1.0 / 3.0))
        raise OptionError(
            f"grid {per_axis}: the page needs about {needed / 1e9:.1f} GB of memory for"
            f" {keys} parameters at {nodes:,} nodes; expected at most {MAX_PAGE_BYTES / 1e9:.1f} GB"
            f" (--grid {fits}, or a .vts or .csv file, which hold any grid)"
        )


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
