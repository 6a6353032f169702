"""The deformed scene as binary glTF: for viewers, slide decks and CAD systems."""

from pathlib import Path

import numpy as np

from warpspace.bodies.gltf import Material, Part, build_gltf, to_gltf
from warpspace.bodies.placed import place_bodies, scene_motions
from warpspace.geometry.colour import srgb_to_linear
from warpspace.geometry.surfaces import (
    box_edges,
    deform,
    grid_lines,
    is_thin,
    line_spacing,
    outer_surface,
    segments,
    spread_nodes,
)
from warpspace.outputs.files import write_atomically
from warpspace.picture.mesh import thick_nodes
from warpspace.picture.model import ScenePicture
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
    """Write the deformed scene as binary glTF."""
    data = build_glb(picture)
    with write_atomically(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)


def build_glb(picture: ScenePicture) -> bytes:
    """Build the deformed scene as binary glTF."""
    parts = [
        *_surface(picture),
        *_lines(picture),
        *_traces(trace_lines(picture.traces), picture.exaggeration),
        *_bodies(picture),
    ]
    return build_gltf(
        parts,
        root=f"warpspace {picture.scene.name} ×{picture.exaggeration:g}",
        generator=picture.provenance["program"],
        extras={**picture.provenance, "attributes": _ATTRIBUTES, "colours": _colours(picture)},
    )


def _colours(picture: ScenePicture) -> dict[str, object]:
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
) -> tuple[Array, dict[str, Array]]:
    position = to_gltf(deform(nominal_mm, error_um, exaggeration))
    return position, {"nominal": to_gltf(error_um * (-exaggeration * MM_PER_UM))}


def _surface(picture: ScenePicture) -> list[Part]:
    """Build the outside of the deformed grid, with its errors as attributes.

    A line or a point of a grid is given a thickness, so that viewers show it.
    """
    field = picture.field
    nominal = thick_nodes(picture, picture.grid.nominal_mm)
    surface = outer_surface(nominal.shape[:3])
    thin = is_thin(picture.shape)
    at = spread_nodes(picture.shape)[surface.nodes] if thin else surface.nodes
    error = field.error_um.reshape(-1, 3)[at]
    position, back = _placed(nominal.reshape(-1, 3)[surface.nodes], error, picture.exaggeration)
    colours = picture.scale.colours(picture.values.reshape(-1)[at])
    return [
        Part(
            "deformed_surface",
            position,
            surface.triangles,
            Material("error"),
            colours=srgb_to_linear(colours / 255.0),
            attributes={
                "_ERROR_UM": error,
                "_ORIENTATION_URAD": field.orientation_urad.reshape(-1, 3)[at],
            },
            targets=back,
        )
    ]


def _lines(picture: ScenePicture) -> list[Part]:
    grid = picture.grid
    nominal = grid.nominal_mm.reshape(-1, 3)
    error = picture.field.error_um.reshape(-1, 3)
    x, y, z = (line_spacing(count) for count in grid.shape)
    edges = segments(box_edges(grid.shape))
    ink, ghost = Material("line", INK), Material("ghost", GHOST)
    found: list[Part] = []
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
        targets = {} if displaced is None else back
        found.append(Part(name, position, numbered.reshape(-1, 2), material, targets=targets))
    return found


def _traces(traces: tuple[TraceLine, ...], exaggeration: float) -> list[Part]:
    nominal, actual = Material("trace nominal", NOMINAL), Material("trace actual", TRACE)
    found: list[Part] = []
    for drawn in traces:
        point = ", ".join(f"{value:g}" for value in drawn.trace.point_mm)
        label = f"({point}) {drawn.trace.label}"
        count = len(drawn.nominal_mm)
        pairs = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
        still = to_gltf(drawn.nominal_mm)
        moved, back = _placed(drawn.nominal_mm, drawn.error_um, exaggeration)
        found += [
            Part(f"trace nominal {label}", still, pairs, nominal, group="traces"),
            Part(f"trace actual {label}", moved, pairs, actual, targets=back, group="traces"),
        ]
    return found


def _bodies(picture: ScenePicture) -> list[Part]:
    motions = scene_motions(picture.scene, picture.view)
    return [
        Part(
            part.body.name,
            to_gltf(part.vertices_mm),
            part.body.triangles,
            Material(f"body {part.body.name}", part.body.colour, BODY_OPACITY),
            targets={"nominal": to_gltf(part.nominal_mm - part.vertices_mm)},
            group="bodies",
        )
        for part in place_bodies(picture.scene, motions, picture.exaggeration)
    ]
