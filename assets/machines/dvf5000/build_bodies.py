"""Build the schematic bodies of the DVF5000: `bodies.glb` beside this file.

Run `python assets/machines/dvf5000/build_bodies.py` after changing a size here or an offset in
`machine.toml`. Sizes are our own reading of a machine of this kind, no drawing of the maker; what
they must agree with is `machine.toml`: the tool ends in the tool point, the table's top is z = 0 of
the workpiece frame, and nothing meets over the travels but tool and table, which the travel of Z
itself allows.

All sizes are in R, mm, with every axis at zero: the tool point is then at (0, 0, 429), the spindle
nose at z = 579, the table's top at z = 0 and the B axis along y at z = 50.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from trimesh import util

from warpspace.bodies.gltf import GltfNode, Material, build_gltf
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE, Body, build_body
from warpspace.bodies.schematic import BODY_FILE, LINES, Shape, box, cone, cylinder, frame_of
from warpspace.kinematics.chain import body_motions
from warpspace.kinematics.model import Model
from warpspace.kinematics.transforms import axis_rotation
from warpspace.scene.machine_library import load_machine
from warpspace.units import Array

HERE = Path(__file__).parent
SLOTS = 8
ABOVE_TOP = 0.3
BOSS = 2.0  # of a bearing; the bevel of an edge within the face of its wall would show through it

BED = [
    box((-640, 640), (-620, 1250), (-520, -320)),
    box((-600, 600), (-580, 1210), (-545, -520)),  # plinth
]
COLUMN = [
    box((-640, 640), (580, 1250), (-320, 385)),
    *(box((-640, 640), (y - 35, y + 35), (385, 423)) for y in (717.5, 1120.0)),  # rails of X
]
TOWERS = [  # bearings of B before and behind the table
    shape
    for near, far in ((-490, -385), (385, 490))
    for shape in (
        box((-120, 120), (near, far), (-320, 50)),
        cylinder(120, (near - BOSS, far + BOSS), (0, 50), axis="y"),
    )
]
SADDLE_X = [
    box((-340, 340), (610, 1235), (423, 575)),
    *(box((x - 30, x + 30), (610, 1235), (575, 607)) for x in (-150, 150)),  # rails of Y
]
SADDLE_Y = [
    box((-200, 200), (330, 1250), (607, 960)),
    box((-215, 215), (270, 330), (540, 1160)),
    *(box((x - 28, x + 28), (242, 270), (540, 1160)) for x in (-115, 115)),  # guide of Z
]
RAM = [box((-135, 135), (-110, 242), (735, 1400))]
SPINDLE = [cylinder(100, (650, 735)), cone(48, 72, (579, 650))]
TOOL = [cylinder(32, (549, 579)), cylinder(21, (499, 549)), cylinder(8, (429, 499))]
CRADLE = [
    *(
        shape
        for near, far in ((-380, -320), (320, 380))
        for shape in (
            box((-100, 100), (near, far), (-205, 50)),
            cylinder(100, (near - BOSS, far + BOSS), (0, 50), axis="y"),
        )
    ),
    box((-190, 190), (-320, 320), (-205, -130)),
    cylinder(185, (-130, -75)),  # housing of the C drive
]
TABLE = [cylinder(250, (-50, 0), inner=30), cylinder(205, (-75, -50), inner=30)]

BODIES = {
    "R_bed": (BED, MIDDLE),
    "R_column": (COLUMN, LIGHT),
    "R_towers": (TOWERS, MIDDLE),
    "X_saddle": (SADDLE_X, DARK),
    "Y_saddle": (SADDLE_Y, LIGHT),
    "Z_ram": (RAM, MIDDLE),
    "S_spindle": (SPINDLE, METAL),
    "t_tool": (TOOL, DARK),
    "B_cradle": (CRADLE, DARK),
    "C_table": (TABLE, METAL),
}


def table_slots() -> Array:
    """Slots of the table as pairs of lines a little above its top, one of them marked."""
    slot = np.array([[(45.0, y, ABOVE_TOP), (249.0, y, ABOVE_TOP)] for y in (-7.0, 7.0)])
    tip = (205.0, 0.0, ABOVE_TOP)
    mark = np.array([[(249.0, -7.0, ABOVE_TOP), tip], [tip, (249.0, 7.0, ABOVE_TOP)]])
    angles = np.arange(SLOTS) * 2.0 * np.pi / SLOTS
    return np.concatenate([*(slot @ axis_rotation(2, angle).T for angle in angles), mark])


def join_shapes(
    name: str, colour: tuple[int, int, int], shapes: Sequence[Shape], origin_mm: Array
) -> Body:
    """Join closed shapes to a body in its own frame."""
    for shape in shapes:
        if not shape.is_watertight or shape.volume <= 0.0:
            raise ValueError(f"{name}: a shape of volume {shape.volume} is open or inside out")
    mesh: Any = util.concatenate(list(shapes))
    mesh.apply_translation(-origin_mm)
    return build_body(mesh, name, frame_of(name), colour)


def write_bodies(
    path: Path, bodies: Sequence[Body], lines_mm: Mapping[str, Array] | None = None
) -> None:
    """Write a file of bodies."""
    parts: list[GltfNode] = []
    for body in bodies:
        material = Material(body.name, body.colour)
        parts.append(GltfNode(body.name, body.vertices_mm, body.triangles, material))
        further = (lines_mm or {}).get(body.name)
        if further is not None:
            pairs = np.arange(2 * len(further)).reshape(-1, 2)
            parts.append(GltfNode(body.name + LINES, further.reshape(-1, 3), pairs, material))
    path.write_bytes(build_gltf(parts, root="bodies, mm, Z up"))


def main() -> None:
    """Write the file."""
    model = Model(load_machine(HERE.name))
    frames = body_motions(model, {}, {name: np.asarray(0.0) for name in model.machine.axes})
    bodies = [
        join_shapes(name, colour, shapes, frames[frame_of(name)].nominal[:3, 3])
        for name, (shapes, colour) in BODIES.items()
    ]
    write_bodies(HERE / BODY_FILE, bodies, {"C_table": table_slots()})


if __name__ == "__main__":
    main()
