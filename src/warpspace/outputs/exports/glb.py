"""The deformed scene as binary glTF: for viewers, slide decks and CAD systems."""

from pathlib import Path

import numpy as np

from warpspace.geometry.deform import deform
from warpspace.geometry.surfaces import (
    box_edges,
    grid_lines,
    line_spacing,
    outer_surface,
    segments,
)
from warpspace.outputs.exports.gltf import GltfBuilder, srgb_to_linear, to_gltf
from warpspace.outputs.files import write_atomically
from warpspace.picture.bodies import place_bodies, scene_motions
from warpspace.picture.scene_picture import ScenePicture
from warpspace.picture.traces import TraceLine, trace_lines
from warpspace.units import MM_PER_UM, Array

INK, GHOST, NOMINAL = (30, 36, 48), (140, 147, 160), (150, 158, 172)
TRACE = (200, 60, 70)
BODY_OPACITY = 0.3
_ATTRIBUTES = {
    "_ERROR_UM": "position error x, y, z in the machine frame (Z up), µm",
    "_ORIENTATION_URAD": "orientation error of the tool axis in the machine frame (Z up), µrad",
}


def write_glb(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    """Write the deformed scene as binary glTF.

    Parameters
    ----------
    picture : ScenePicture
    path : str or Path
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    data = build_glb(picture)
    with write_atomically(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)


def build_glb(picture: ScenePicture) -> bytes:
    """Build the deformed scene as binary glTF.

    Parameters
    ----------
    picture : ScenePicture

    Returns
    -------
    bytes
        Metres, Y up. Nodes: deformed surface, deformed grid lines and edges, ghost of the nominal
        box, nominal and actual traces, bodies of the machine. Colours are unlit, so that a viewer
        shows those of the colour scale. Every displaced node has a morph target "nominal" that
        takes it back to where it nominally is. Display factor, scene, settings and program are in
        the extras of the asset, the factor also in the name of the root.
    """
    builder = GltfBuilder()
    nodes = [
        *_surface(builder, picture),
        *_lines(builder, picture),
        *_traces(builder, trace_lines(picture.traces), picture.exaggeration),
        *_bodies(builder, picture),
    ]
    root = builder.add_node(
        f"warpspace {picture.scene.name} ×{picture.exaggeration:g}", children=nodes
    )
    extras = {**picture.provenance, "attributes": _ATTRIBUTES, "colours": _colours(picture)}
    return builder.to_bytes(root, picture.provenance["program"], extras)


def _colours(picture: ScenePicture) -> dict[str, object]:
    """Say what the colours mean."""
    scale = picture.scale
    return {
        "map": scale.name,
        "low": scale.low,
        "high": scale.high,
        "label": scale.label,
        "unit": scale.unit,
    }


def _placed(
    nominal_mm: Array, error_um: Array, exaggeration: float
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Positions where they are drawn, and the morph target that takes them back."""
    position = to_gltf(deform(nominal_mm, error_um, exaggeration))
    back = to_gltf(error_um * (-exaggeration * MM_PER_UM))
    return {"POSITION": position}, {"nominal": back}


def _surface(builder: GltfBuilder, picture: ScenePicture) -> list[int]:
    """Add the outside of the deformed grid, with its errors as attributes."""
    grid, field = picture.grid, picture.field
    surface = outer_surface(grid.shape)
    if not len(surface.triangles):
        return []
    at = surface.nodes
    error = field.error_um.reshape(-1, 3)[at]
    position, back = _placed(grid.nominal_mm.reshape(-1, 3)[at], error, picture.exaggeration)
    attributes = {
        **position,
        "COLOR_0": srgb_to_linear(picture.scale.colours(picture.values.reshape(-1)[at])),
        "_ERROR_UM": error,
        "_ORIENTATION_URAD": field.orientation_urad.reshape(-1, 3)[at],
    }
    material = builder.add_material("error")
    mesh = builder.add_mesh(
        "deformed_surface", attributes, surface.triangles, material, targets=back
    )
    return [builder.add_node("deformed_surface", mesh=mesh)]


def _lines(builder: GltfBuilder, picture: ScenePicture) -> list[int]:
    """Add grid lines and edges of the deformed box, and the ghost of the nominal one."""
    grid = picture.grid
    nominal = grid.nominal_mm.reshape(-1, 3)
    error = picture.field.error_um.reshape(-1, 3)
    x, y, z = (line_spacing(count) for count in grid.shape)
    edges = segments(box_edges(grid.shape))
    ink, ghost = builder.add_material("line", INK), builder.add_material("ghost", GHOST)
    found: list[int] = []
    for name, pairs, material, displaced in (
        ("deformed_grid", segments(grid_lines(grid.shape, (x, y, z))), ink, error),
        ("deformed_edges", edges, ink, error),
        ("ghost", edges, ghost, None),
    ):
        if not len(pairs):
            continue
        used, numbered = np.unique(pairs, return_inverse=True)
        shift = np.zeros((len(used), 3)) if displaced is None else displaced[used]
        position, back = _placed(nominal[used], shift, picture.exaggeration)
        mesh = builder.add_mesh(
            name,
            position,
            numbered.reshape(-1, 2),
            material,
            targets=None if displaced is None else back,
        )
        found.append(builder.add_node(name, mesh=mesh))
    return found


def _traces(builder: GltfBuilder, traces: tuple[TraceLine, ...], exaggeration: float) -> list[int]:
    """Add the nominal and the actual traces of the rotary axes."""
    if not traces:
        return []
    nominal = builder.add_material("trace nominal", NOMINAL)
    actual = builder.add_material("trace actual", TRACE)
    children: list[int] = []
    for drawn in traces:
        point = ", ".join(f"{value:g}" for value in drawn.trace.point_mm)
        label = f"({point}) {drawn.trace.label}"
        count = len(drawn.nominal_mm)
        pairs = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
        still = {"POSITION": to_gltf(drawn.nominal_mm)}
        moved, back = _placed(drawn.nominal_mm, drawn.error_um, exaggeration)
        for kind, position, material, targets in (
            ("nominal", still, nominal, None),
            ("actual", moved, actual, back),
        ):
            mesh = builder.add_mesh(
                f"trace {kind} {label}", position, pairs, material, targets=targets
            )
            children.append(builder.add_node(f"trace {kind} {label}", mesh=mesh))
    return [builder.add_node("traces", children=children)]


def _bodies(builder: GltfBuilder, picture: ScenePicture) -> list[int]:
    """Add the bodies of the machine where there are any, bent by the same factor."""
    children: list[int] = []
    motions = scene_motions(picture.scene, picture.view)
    for part in place_bodies(picture.scene, motions, picture.exaggeration):
        body, drawn_mm, nominal_mm = part.body, part.vertices_mm, part.nominal_mm
        material = builder.add_material(f"body {body.name}", body.colour, opacity=BODY_OPACITY)
        mesh = builder.add_mesh(
            body.name,
            {"POSITION": to_gltf(drawn_mm)},
            body.triangles,
            material,
            targets={"nominal": to_gltf(nominal_mm - drawn_mm)},
        )
        children.append(builder.add_node(body.name, mesh=mesh))
    return [builder.add_node("bodies", children=children)] if children else []
