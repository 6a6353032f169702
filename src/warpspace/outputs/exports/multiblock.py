"""A scene as PyVista blocks, for a plotter, a filter or a file of the user's own."""

from collections.abc import Mapping

import numpy as np
import pyvista as pv

from warpspace.bodies.placed import place_bodies, scene_motions
from warpspace.field.grid import DEFAULT_NODES
from warpspace.geometry.surfaces import is_thin, outer_surface
from warpspace.kinematics.model import Loop
from warpspace.picture.model import Exaggeration, ScenePicture, evaluate_picture
from warpspace.picture.traces import TraceLine, trace_lines
from warpspace.scene.model import Scene, grid_basis
from warpspace.units import Array


def to_pyvista(
    scene: Scene,
    *,
    grid: int = DEFAULT_NODES,
    loop: Loop | str = Loop.TOOL,
    exaggeration: Exaggeration = "auto",
    parts: bool = False,
) -> pv.MultiBlock:
    """Give an evaluated scene as PyVista meshes.

    Parameters
    ----------
    scene : Scene
    grid : int, optional
        Nodes per axis.
    loop : Loop or str, optional
        "tool", "workpiece" or "relative".
    exaggeration : float, "auto" or None, optional
        Display factor of what is drawn displaced: a number, "auto" for a round one that suits the
        scene, None for what the scene says.
    parts : bool, optional
        Whether the part of each parameter in the error is wanted too.

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
    picture = evaluate_picture(scene, exaggeration=exaggeration, grid=grid, loop=loop)
    arrays = node_arrays(picture)
    if parts:
        arrays |= _parts(picture)
    blocks = pv.MultiBlock()
    for name, points in (
        ("deformed", picture.drawn_mm),
        ("nominal", picture.grid.nominal_mm),
    ):
        blocks.append(structured_grid(points, arrays), name)
    blocks.append(_surface(picture, arrays), "surface")
    blocks.append(_traces(trace_lines(picture.traces)), "traces")
    blocks.append(_bodies(picture), "bodies")
    blocks.field_data["exaggeration"] = np.array([picture.exaggeration])
    blocks.field_data["scene"] = [scene.name]
    blocks.field_data["program"] = [picture.provenance["program"]]
    return blocks


def structured_grid(points_mm: Array, arrays: Mapping[str, Array]) -> pv.StructuredGrid:
    """Build a structured grid from nodes and what is known at them."""
    mesh = pv.StructuredGrid()
    mesh.points = _in_order_of_vtk(points_mm)
    mesh.dimensions = points_mm.shape[:3]
    for name, values in arrays.items():
        mesh.point_data[name] = _in_order_of_vtk(values)
    mesh.point_data.active_scalars_name = "norm_um"
    return mesh


def _in_order_of_vtk(values: Array) -> Array:
    """Order node values as VTK does, the first axis fastest: [n] or [n, 3]."""
    tail = values.shape[3:]
    return np.ascontiguousarray(np.swapaxes(values, 0, 2)).reshape(-1, *tail)


def node_arrays(picture: ScenePicture) -> dict[str, Array]:
    """Collect the errors at the nodes, [nx, ny, nz] and [nx, ny, nz, 3]."""
    field = picture.field
    return {
        "error_um": field.error_um,
        "norm_um": field.norm_um,
        "orientation_urad": field.orientation_urad,
        "tilt_urad": np.linalg.norm(field.orientation_urad, axis=-1),
    }


def _parts(picture: ScenePicture) -> dict[str, Array]:
    """Split the position error into the parameters that are not zero, [nx, ny, nz, 3]."""
    scene = picture.scene
    basis = grid_basis(scene, picture.grid, picture.view)
    amplitudes = {key: scene.errors.amplitude(key) for key in basis.keys}
    return {
        f"part_{key}_um": amplitudes[key] * response
        for key, response in zip(basis.keys, basis.position, strict=True)
        if amplitudes[key] != 0.0
    }


def _surface(picture: ScenePicture, arrays: Mapping[str, Array]) -> pv.PolyData:
    surface = outer_surface(picture.grid.shape)
    drawn = picture.drawn_mm.reshape(-1, 3)
    if is_thin(picture.shape):
        nodes = np.arange(len(drawn))
        # PyVista makes one vertex of a single point
        mesh = pv.PolyData(drawn) if len(nodes) == 1 else pv.MultipleLines(drawn)
    else:
        nodes = surface.nodes
        mesh = pv.PolyData.from_regular_faces(drawn[nodes], surface.triangles)
    for name, values in arrays.items():
        mesh.point_data[name] = values.reshape(-1, *values.shape[3:])[nodes]
    mesh.point_data.active_scalars_name = "norm_um"
    return mesh


def _traces(traces: tuple[TraceLine, ...]) -> pv.MultiBlock:
    blocks = pv.MultiBlock()
    for drawn in traces:
        point = ", ".join(f"{value:g}" for value in drawn.trace.point_mm)
        label = f"({point}) {drawn.trace.label}"
        blocks.append(pv.MultipleLines(drawn.nominal_mm), f"nominal {label}")
        actual = pv.MultipleLines(drawn.actual_mm)
        actual.point_data["error_um"] = drawn.error_um
        actual.point_data["norm_um"] = np.linalg.norm(drawn.error_um, axis=-1)
        blocks.append(actual, f"actual {label}")
    return blocks


def _bodies(picture: ScenePicture) -> pv.MultiBlock:
    blocks = pv.MultiBlock()
    motions = scene_motions(picture.scene, picture.view)
    for part in place_bodies(picture.scene, motions, picture.exaggeration):
        mesh = pv.PolyData.from_regular_faces(part.vertices_mm, part.body.triangles)
        count = len(part.body.triangles)
        mesh.cell_data["colour"] = np.tile(np.array(part.body.colour, dtype=np.uint8), (count, 1))
        blocks.append(mesh, part.body.name)
    return blocks
