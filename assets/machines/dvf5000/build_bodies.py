"""Build the schematic bodies of the DVF5000: `bodies.glb` and `bodies.npz` beside this file.

Run `python assets/machines/dvf5000/build_bodies.py` after changing a size here or an offset in
`machine.toml`. Sizes are our own reading of a machine of this kind, no drawing of the maker; what
they must agree with is `machine.toml`: the tool ends in the tool point, the table's top is z = 0 of
the workpiece frame, and nothing meets over the travels but tool and table, which the travel of Z
itself allows.

A node is named after the frame it rides on (R, X, Y, Z, S, t, B, C) and what it is: `X_saddle`. All
vertices are mm in that frame. `bodies.glb` (mm, z upwards) is for programs that read meshes;
`bodies.npz` holds the same triangles, the edges worth drawing and quiet colours for those without.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from warpspace.kinematics.bodies import body_motions
from warpspace.kinematics.model import Model
from warpspace.scene.machines import load_machine

HERE = Path(__file__).parent
SIDES = 40
CREASE_RAD = np.deg2rad(30.0)
Points = NDArray[np.float64]
Mesh = trimesh.Trimesh

LIGHT, MIDDLE, DARK, METAL = (206, 210, 216), (178, 184, 192), (104, 112, 124), (150, 157, 167)


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Mesh:
    """Box between two positions along each axis of R, mm."""
    ends = np.array([x, y, z], dtype=float)
    mesh = trimesh.creation.box(extents=np.ptp(ends, axis=1))
    mesh.apply_translation(ends.mean(axis=1))
    return mesh


def cylinder(
    radius: float,
    ends: tuple[float, float],
    at: tuple[float, float] = (0.0, 0.0),
    axis: str = "z",
    inner: float = 0.0,
) -> Mesh:
    """Cylinder, or ring, between two positions along an axis; `at` are its other coordinates."""
    height = ends[1] - ends[0]
    mesh = (
        trimesh.creation.annulus(r_min=inner, r_max=radius, height=height, sections=SIDES)
        if inner
        else trimesh.creation.cylinder(radius=radius, height=height, sections=SIDES)
    )
    middle = (ends[0] + ends[1]) / 2.0
    if axis == "y":
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
        mesh.apply_translation([at[0], middle, at[1]])
    else:
        mesh.apply_translation([at[0], at[1], middle])
    return mesh


def cone(lower: float, upper: float, ends: tuple[float, float]) -> Mesh:
    """Frustum about z between two heights."""
    outline = np.array([(0.0, ends[0]), (lower, ends[0]), (upper, ends[1]), (0.0, ends[1])])
    return trimesh.creation.revolve(outline, sections=SIDES)


# All sizes in R, mm, with every axis at zero: the tool point is then at (0, 0, 429), the spindle
# nose at z = 579, the table's top at z = 0 and the B axis along y at z = 50.


def bed() -> list[Mesh]:
    """Bed on a plinth."""
    return [
        box((-640, 640), (-620, 1250), (-520, -320)),
        box((-600, 600), (-580, 1210), (-545, -520)),
    ]


def column() -> list[Mesh]:
    """Column behind the table, with the rails of X along its top."""
    block = box((-640, 640), (580, 1250), (-320, 385))
    return [block, *(box((-640, 640), (y - 35, y + 35), (385, 423)) for y in (717.5, 1120.0))]


def towers() -> list[Mesh]:
    """Bearings of B before and behind the table."""
    found: list[Mesh] = []
    for near, far in ((-490, -385), (385, 490)):
        found += [
            box((-120, 120), (near, far), (-320, 50)),
            cylinder(120, (near, far), (0, 50), axis="y"),
        ]
    return found


def saddle_x() -> list[Mesh]:
    """Saddle of X on the column, with the rails of Y along its top."""
    block = box((-340, 340), (610, 1235), (423, 575))
    return [block, *(box((x - 30, x + 30), (610, 1235), (575, 607)) for x in (-150, 150))]


def saddle_y() -> list[Mesh]:
    """Beam of Y on the saddle, with the guide of Z at its front."""
    return [
        box((-200, 200), (330, 1250), (607, 960)),
        box((-215, 215), (270, 330), (540, 1160)),
        *(box((x - 28, x + 28), (242, 270), (540, 1160)) for x in (-115, 115)),
    ]


def ram() -> list[Mesh]:
    """Ram of Z."""
    return [box((-135, 135), (-110, 242), (735, 1400))]


def spindle() -> list[Mesh]:
    """Spindle: housing and nose."""
    return [cylinder(100, (650, 735)), cone(48, 72, (579, 650))]


def tool() -> list[Mesh]:
    """Holder and tool, ending in the tool point."""
    return [cylinder(32, (549, 579)), cylinder(21, (499, 549)), cylinder(8, (429, 499))]


def cradle() -> list[Mesh]:
    """Cradle of B: two arms, a floor, and the housing of the C drive."""
    arms = [
        part
        for near, far in ((-380, -320), (320, 380))
        for part in (
            box((-100, 100), (near, far), (-205, 50)),
            cylinder(100, (near, far), (0, 50), axis="y"),
        )
    ]
    return [*arms, box((-190, 190), (-320, 320), (-205, -130)), cylinder(185, (-130, -75))]


def table() -> list[Mesh]:
    """Table of C, 500 mm across, with a bore."""
    return [cylinder(250, (-50, 0), inner=30), cylinder(205, (-75, -50), inner=30)]


def table_marks() -> list[Points]:
    """Slots of the table as pairs of lines a little above its top, one of them marked."""
    above = 0.3
    lines: list[Points] = []
    for number in range(8):
        turn = trimesh.transformations.rotation_matrix(number * np.pi / 4, [0, 0, 1])[:3, :3]
        slot = [np.array([(45.0, y, above), (249.0, y, above)]) for y in (-7.0, 7.0)]
        lines += [line @ turn.T for line in slot]
    lines.append(np.array([(249.0, -7.0, above), (205.0, 0.0, above)]))
    lines.append(np.array([(205.0, 0.0, above), (249.0, 7.0, above)]))
    return lines


BODIES: dict[str, tuple[Callable[[], list[Mesh]], tuple[int, int, int]]] = {
    "R_bed": (bed, MIDDLE),
    "R_column": (column, LIGHT),
    "R_towers": (towers, MIDDLE),
    "X_saddle": (saddle_x, DARK),
    "Y_saddle": (saddle_y, LIGHT),
    "Z_ram": (ram, MIDDLE),
    "S_spindle": (spindle, METAL),
    "t_tool": (tool, DARK),
    "B_cradle": (cradle, DARK),
    "C_table": (table, METAL),
}


def crease_edges(mesh: Mesh) -> Points:
    """Find the edges at which a mesh bends sharply, ends [E, 2, 3]."""
    sharp = mesh.face_adjacency_angles > CREASE_RAD
    return mesh.vertices[mesh.face_adjacency_edges[sharp]]


def build_body(parts: list[Mesh], origin: Points) -> tuple[Mesh, Points]:
    """Join closed parts into one mesh in its own frame, and collect its edges."""
    for part in parts:
        if not part.is_watertight or part.volume <= 0.0:
            raise ValueError(f"a part of volume {part.volume} is open or inside out")
    edges = np.concatenate([crease_edges(part) for part in parts]) - origin
    mesh = trimesh.util.concatenate(parts)
    mesh.apply_translation(-origin)
    return mesh, edges


def main() -> None:
    """Write both files."""
    model = Model(load_machine(HERE.name))
    still = {name: np.asarray(0.0) for name in model.machine.axes}
    frames = body_motions(model, {}, still)
    scene = trimesh.Scene()
    meshes: list[Mesh] = []
    edges: list[Points] = []
    for name, (make, colour) in BODIES.items():
        frame = frames[name.split("_")[0]]
        mesh, lines = build_body(make(), frame.nominal[:3, 3])
        if name == "C_table":
            lines = np.concatenate([lines, np.stack(table_marks())])
        mesh.visual.face_colors = [*colour, 255]
        scene.add_geometry(mesh, node_name=name, geom_name=name)
        meshes.append(mesh)
        edges.append(lines)
    (HERE / "bodies.glb").write_bytes(scene.export(file_type="glb"))
    np.savez(
        HERE / "bodies.npz",
        names=np.array(list(BODIES)),
        colours=np.array([colour for _, colour in BODIES.values()], dtype=np.uint8),
        vertices=np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32),
        triangles=np.concatenate([mesh.faces for mesh in meshes]).astype(np.int32),
        edges=np.concatenate(edges).astype(np.float32),
        vertex_ends=np.cumsum([len(mesh.vertices) for mesh in meshes]),
        triangle_ends=np.cumsum([len(mesh.faces) for mesh in meshes]),
        edge_ends=np.cumsum([len(lines) for lines in edges]),
    )


if __name__ == "__main__":
    main()
