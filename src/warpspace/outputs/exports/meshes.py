"""The deformed scene as meshes: binary glTF for viewers and CAD systems, PyVista blocks."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpspace.bodies.gltf import GltfNode, Material, build_gltf, to_gltf
from warpspace.bodies.placed import place_bodies
from warpspace.field.grid import DEFAULT_NODES
from warpspace.geometry import surfaces
from warpspace.geometry.colour import srgb_to_linear
from warpspace.kinematics.model import Loop
from warpspace.outputs.exports.fields import field_arrays, structured_grid
from warpspace.outputs.file_output import write_content
from warpspace.picture.map_mesh import thick_nodes
from warpspace.picture.model import Exaggeration, ScenePicture, evaluate_picture
from warpspace.picture.traces import TraceLine, trace_lines
from warpspace.scene.model import Scene, grid_basis
from warpspace.units import MM_PER_UM, Array

if TYPE_CHECKING:
    import pyvista as pv

INK, GHOST, NOMINAL = (30, 36, 48), (140, 147, 160), (150, 158, 172)
TRACE = (200, 60, 70)
BODY_OPACITY = 0.3
_ATTRIBUTES = {
    "_ERROR_UM": "position error x, y, z in the machine frame (Z up), µm",
    "_ORIENTATION_URAD": "orientation error of the tool axis in the machine frame (Z up), µrad",
}


def write_glb(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    write_content(build_glb(picture), path, overwrite=overwrite)


def build_glb(picture: ScenePicture) -> bytes:
    names = ("low", "high", "label", "unit")
    colours = {"map": picture.scale.name, **{name: getattr(picture.scale, name) for name in names}}
    return build_gltf(
        [_surface(picture), *_lines(picture), *_traces(picture), *_bodies(picture)],
        root=f"warpspace {picture.scene.name} ×{picture.exaggeration:g}",
        generator=picture.provenance["program"],
        extras={**picture.provenance, "attributes": _ATTRIBUTES, "colours": colours},
    )


def _bent(
    picture: ScenePicture,
    name: str,
    nominal_mm: Array,
    error_um: Array,
    indices: surfaces.Index,
    material: Material,
    **options: Any,
) -> GltfNode:
    """Build a displaced node; its morph target leads back to the nominal points."""
    drawn_mm = surfaces.deform(nominal_mm, error_um, picture.exaggeration)
    to_nominal = to_gltf(error_um * (-picture.exaggeration * MM_PER_UM))
    return GltfNode(
        name, to_gltf(drawn_mm), indices, material, targets={"nominal": to_nominal}, **options
    )


def _surface(picture: ScenePicture) -> GltfNode:
    nominal = thick_nodes(picture, picture.grid.nominal_mm)
    surface = surfaces.outer_surface(nominal.shape[:3])
    at = surfaces.spread_nodes(picture.shape)[surface.nodes]
    colours = picture.scale.colours(picture.values.reshape(-1)[at])
    error, tilts = (
        vectors.reshape(-1, 3)[at]
        for vectors in (picture.field.error_um, picture.field.orientation_urad)
    )
    return _bent(
        picture,
        "deformed_surface",
        nominal.reshape(-1, 3)[surface.nodes],
        error,
        surface.triangles,
        Material("error"),
        colours=srgb_to_linear(colours / 255.0),
        attributes={"_ERROR_UM": error, "_ORIENTATION_URAD": tilts},
    )


def _lines(picture: ScenePicture) -> Iterator[GltfNode]:
    shape, ink = picture.shape, Material("line", INK)
    nominal = picture.grid.nominal_mm.reshape(-1, 3)
    error = picture.field.error_um.reshape(-1, 3)
    grid, edges = (
        surfaces.grid_lines(shape, surfaces.line_spacing(shape)),
        surfaces.box_edges(shape),
    )
    for name, lines in (("deformed_grid", grid), ("deformed_edges", edges)):
        at, pairs = np.unique(surfaces.segments(lines), return_inverse=True)
        yield _bent(picture, name, nominal[at], error[at], pairs.reshape(-1, 2), ink)
    yield GltfNode("ghost", to_gltf(nominal[at]), pairs.reshape(-1, 2), Material("ghost", GHOST))


def _named_traces(picture: ScenePicture) -> Iterator[tuple[str, TraceLine]]:
    for drawn in trace_lines(picture.traces):
        point = ", ".join(f"{value:g}" for value in drawn.trace.point_mm)
        yield f"({point}) {drawn.trace.label}", drawn


def _traces(picture: ScenePicture) -> Iterator[GltfNode]:
    nominal, actual = Material("trace nominal", NOMINAL), Material("trace actual", TRACE)
    for label, drawn in _named_traces(picture):
        points_mm, name = drawn.nominal_mm, f"trace nominal {label}"
        pairs = surfaces.segments([np.arange(len(points_mm))])
        yield GltfNode(name, to_gltf(points_mm), pairs, nominal, group="traces")
        name = f"trace actual {label}"
        yield _bent(picture, name, points_mm, drawn.error_um, pairs, actual, group="traces")


def _bodies(picture: ScenePicture) -> list[GltfNode]:
    return [
        GltfNode(
            part.body.name,
            to_gltf(part.vertices_mm),
            part.body.triangles,
            Material(f"body {part.body.name}", part.body.colour, BODY_OPACITY),
            targets={"nominal": to_gltf(part.nominal_mm - part.vertices_mm)},
            group="bodies",
        )
        for part in place_bodies(picture.scene, picture.view, picture.exaggeration)
    ]


def to_pyvista(
    scene: Scene,
    *,
    grid: int = DEFAULT_NODES,
    loop: Loop | str | None = None,
    exaggeration: Exaggeration = "auto",
    parts: bool = False,
) -> "pv.MultiBlock":
    """Build PyVista meshes of an evaluated scene.

    Parameters
    ----------
    scene : Scene
    grid : int, optional
        Nodes per axis.
    loop : Loop or str, optional
        "tool", "workpiece" or "relative".
    exaggeration : float, "auto" or None, optional
        Display factor of displacements: a number, "auto" for a round one that suits the scene, None
        for the scene's own.
    parts : bool, optional
        Whether the contribution of each parameter to the error is added.

    Returns
    -------
    pyvista.MultiBlock
        All points in the machine frame R, mm. Blocks:

        ``deformed``, ``nominal``
            StructuredGrid of the working volume, with the point arrays ``error_um`` [n, 3],
            ``norm_um`` [n], ``orientation_urad`` [n, 3] and ``tilt_urad`` [n]; with `parts` also
            one array [n, 3] for each parameter that is not zero, for instance ``part_EAX_um``,
            which add up to ``error_um``.
        ``surface``
            PolyData: the outside of the deformed volume, with the same arrays; a line or a vertex
            where no more than one linear axis moves.
        ``traces``
            MultiBlock of polylines, two for each trace of a rotary axis, named
            ``nominal (275, 0, 0) over C`` and ``actual (275, 0, 0) over C``; the actual ones carry
            ``error_um`` and ``norm_um``.
        ``bodies``
            MultiBlock of PolyData, one for each schematic body of the machine, drawn displaced
            like the volume; the cell array ``colour`` holds its sRGB colour, 0 to 255.

        Errors are never exaggerated, only points are. The field data say so: ``exaggeration``,
        ``scene``, ``program``.

    Raises
    ------
    OptionError
        If one of the choices does not exist or is out of range.
    """
    import pyvista as pv

    picture = evaluate_picture(scene, exaggeration=exaggeration, grid=grid, loop=loop)
    arrays = field_arrays(picture.field)
    arrays["tilt_urad"] = np.linalg.norm(picture.field.orientation_urad, axis=-1)
    if parts:
        basis = grid_basis(scene, picture.grid, picture.view)
        for key, response in zip(basis.keys, basis.position, strict=True):
            if scene.errors.amplitude(key):
                arrays[f"part_{key}_um"] = scene.errors.amplitude(key) * response
    traces, bodies = pv.MultiBlock(), pv.MultiBlock()
    for label, drawn in _named_traces(picture):
        actual = pv.MultipleLines(drawn.actual_mm)
        actual.point_data["error_um"] = drawn.error_um
        actual.point_data["norm_um"] = np.linalg.norm(drawn.error_um, axis=-1)
        traces.append(pv.MultipleLines(drawn.nominal_mm), f"nominal {label}")
        traces.append(actual, f"actual {label}")
    for part in place_bodies(picture.scene, picture.view, picture.exaggeration):
        mesh = pv.PolyData.from_regular_faces(part.vertices_mm, part.body.triangles)
        colour = np.array(part.body.colour, dtype=np.uint8)
        mesh.cell_data["colour"] = np.tile(colour, (len(part.body.triangles), 1))
        bodies.append(mesh, part.body.name)
    blocks = pv.MultiBlock(
        {
            "deformed": structured_grid(picture.drawn_mm, arrays),
            "nominal": structured_grid(picture.grid.nominal_mm, arrays),
            "surface": _surface_block(picture, arrays),
            "traces": traces,
            "bodies": bodies,
        }
    )
    blocks.field_data["exaggeration"] = np.array([picture.exaggeration])
    blocks.field_data["scene"] = [scene.name]
    blocks.field_data["program"] = [picture.provenance["program"]]
    return blocks


def _surface_block(picture: ScenePicture, arrays: Mapping[str, Array]) -> "pv.PolyData":
    import pyvista as pv

    drawn = picture.drawn_mm.reshape(-1, 3)
    nodes = np.arange(len(drawn))
    if surfaces.is_thin(picture.shape):
        # PyVista makes one vertex of a single point
        mesh = pv.PolyData(drawn) if len(nodes) == 1 else pv.MultipleLines(drawn)
    else:
        surface = surfaces.outer_surface(picture.grid.shape)
        nodes = surface.nodes
        mesh = pv.PolyData.from_regular_faces(drawn[nodes], surface.triangles)
    for name, values in arrays.items():
        mesh.point_data[name] = values.reshape(-1, *values.shape[3:])[nodes]
    mesh.point_data.active_scalars_name = "norm_um"
    return mesh
