"""Bodies of machines: generated from a description, stored, and placed in the bent machine."""

from itertools import product
from runpy import run_path

import numpy as np
import pytest
from scipy.optimize import linprog
from trimesh import Trimesh

import warpspace
from products import first
from warpspace.bodies.arm import is_arm
from warpspace.bodies.frame import generate_bodies
from warpspace.bodies.mesh import DARK, METAL, Body
from warpspace.bodies.placed import load_bodies, place_bodies, place_points, scene_motions
from warpspace.bodies.schematic import BODY_FILE, box, build_layout, cylinder, read_bodies
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, build_basis
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.kinematics.transforms import apply
from warpspace.machine.definition import build_machine, parse_chain
from warpspace.resources import assets_dir
from warpspace.scene.library import load_scene
from warpspace.scene.machine_library import load_machine, machine_names
from warpspace.scene.starter import starter_scene


def components(body: Body, vertices_mm: np.ndarray | None = None) -> list[Trimesh]:
    """Return the shapes of a body, in its frame or with other vertices, all of them closed."""
    vertices = body.vertices_mm if vertices_mm is None else vertices_mm
    shapes = list(Trimesh(vertices, body.triangles, process=False).split(only_watertight=False))
    assert sum(len(shape.faces) for shape in shapes) == len(body.triangles), body.name
    assert all(shape.is_watertight and shape.volume > 0.0 for shape in shapes), body.name
    return shapes


def assert_clear(machine, body: Body, vertices_mm: np.ndarray, nodes_mm: np.ndarray) -> None:
    """Check that no point lies in the convex hull of a shape, unless it belongs to the head."""
    for shape in components(body, vertices_mm):
        low, high = shape.bounds
        near = nodes_mm[((nodes_mm > low) & (nodes_mm < high)).all(axis=1)]
        normals = shape.face_normals
        behind = np.einsum("fi,fi->f", normals, shape.triangles[:, 0])
        is_inside = ((near @ normals.T) < behind - 1e-6).all(axis=1)
        assert of_head(machine, body) or not is_inside.any(), (str(machine.chain), body.name)


def of_head(machine, body: Body) -> bool:
    """Whether a body belongs to what carries the tool beyond the last linear axis, or is a neck."""
    names = machine.chain.tool
    linear = [place for place, name in enumerate(names) if machine.axes[name].is_linear]
    behind = names[linear[-1] + 1 :] if linear else names
    what = body.name.partition("_")[2]
    return body.frame in ("S", "t", *behind) or what in ("fork", "wedge", "neck")


OWN = {"dvf5000": "dvf5000_general", "ur10": "ur10"}
SCENES = [OWN.get(name, f"machine_{name}") for name in machine_names()]
MAX_TRIANGLES = 20_000


def random_machine(seed):
    rng = np.random.default_rng(seed)
    names: list[str] = []
    for letter in rng.choice(list("XYZUVWABC"), rng.integers(1, 9)):
        same = sum(name.startswith(letter) for name in names)
        names.append(f"{letter}{same}" if same else str(letter))
    cut = rng.integers(0, len(names) + 1)
    offset_mm, rotation_deg = {}, {}
    if seed % 2:
        offset_mm = {f: tuple(map(float, rng.normal(0.0, 200.0, 3))) for f in [*names, "S", "w"]}
        offset_mm["t"] = (0.0, 0.0, -150.0)
    if seed % 3 == 0:
        rotation_deg = {names[0]: tuple(map(float, rng.choice([0.0, 45.0, 90.0], 3)))}
    chain = f"w{''.join(names[:cut])}F{''.join(names[cut:])}t"
    return build_machine(chain, offset_mm=offset_mm, rotation_deg=rotation_deg)


@pytest.mark.parametrize("part", first(*range(3)))
def test_bodies_of_any_chain_are_closed_small_and_clear_of_the_volume(part):
    for seed in range(20 * part, 20 * part + 20):
        machine = random_machine(seed)
        bodies, layout = generate_bodies(machine), build_layout(machine)
        assert {body.frame for body in bodies} >= {"R", "S", "t", *machine.axes}
        assert sum(len(body.triangles) for body in bodies) < MAX_TRIANGLES
        sides = [np.linspace(a, b, 6) for a, b in zip(layout.low_mm, layout.high_mm, strict=True)]
        nodes = np.stack(np.meshgrid(*sides), -1).reshape(-1, 3)
        for body in bodies:
            assert_clear(machine, body, apply(layout.poses[body.frame], body.vertices_mm), nodes)


@pytest.mark.parametrize("name", SCENES)
def test_bodies_of_a_bundled_machine_are_closed_small_grey_and_clear_of_its_volume(name):
    scene = load_scene(name)
    placed = place_bodies(scene, scene.view(), 0.0)
    nodes = build_grid(scene.model, scene.workspace, 7).nominal_mm.reshape(-1, 3)
    assert sum(len(part.body.triangles) for part in placed) < MAX_TRIANGLES
    for part in placed:
        assert_clear(scene.machine, part.body, part.nominal_mm, nodes)
        assert np.ptp(part.body.colour) <= 24, "bodies are grey: colour means error"
        assert len(part.body.edges_mm) > 0


def flush_faces(shapes: list[Trimesh]) -> list[tuple[int, int]]:
    """List the pairs of shapes with an overlap, over 0.5 mm, of faces in one plane and direction.

    Two triangles overlap if no direction across an edge of either parts them.
    """
    chosen = [shape.area_faces > 1.0 for shape in shapes]
    owner = np.concatenate([np.full(some.sum(), at) for at, some in enumerate(chosen)])
    zipped = [*zip(shapes, chosen, strict=True)]
    corners = np.concatenate([shape.triangles[some] for shape, some in zipped])  # [n, 3, 3]
    normals = np.concatenate([shape.face_normals[some] for shape, some in zipped])
    offsets = np.einsum("ni,ni->n", normals, corners[:, 0])
    i, j = np.triu_indices(len(owner), 1)
    near = (owner[i] != owner[j]) & (np.abs(offsets[i] - offsets[j]) < 0.05)
    i, j = i[near], j[near]
    alike = np.einsum("ni,ni->n", normals[i], normals[j]) > 1.0 - 1e-6
    i, j = i[alike], j[alike]
    depth = np.full(len(i), np.inf)
    for triangles in (corners[i], corners[j]):
        for edge in range(3):
            across = np.cross(normals[i], triangles[:, edge - 1] - triangles[:, edge])
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            a, b = (np.einsum("nki,ni->nk", corners[k], across) for k in (i, j))
            both = np.minimum(a.max(1), b.max(1)) - np.maximum(a.min(1), b.min(1))
            depth = np.minimum(depth, both)
    return sorted({*zip(owner[i[depth > 0.5]], owner[j[depth > 0.5]], strict=True)})


@pytest.mark.parametrize("scene", ["dvf5000_first", "wCAYFXZt", "wYFXZBCt"])
def test_no_end_of_a_cylinder_is_flush_with_a_face(scene):
    """Shading of both differs: the drawing would flicker between them."""
    loaded = starter_scene(scene) if "F" in scene else load_scene(scene)
    placed = place_bodies(loaded, loaded.view(), 0.0)
    shapes = [(part, shape) for part in placed for shape in components(part.body, part.nominal_mm)]
    pairs = flush_faces([shape for _, shape in shapes])
    is_round = [len(np.unique(shape.face_normals.round(3), axis=0)) > 8 for _, shape in shapes]
    found = [(a, b) for a, b in pairs if is_round[a] or is_round[b]]
    assert not [(shapes[a][0].body.name, shapes[b][0].body.name) for a, b in found]


@pytest.mark.parametrize("chain", ["wXYZFt", "wZFXYt", "wBYFXZt", "wXYFZt", "wCAZYXFt"])
def test_nothing_reaches_below_the_bed(chain):
    machine = starter_scene(chain).machine
    layout = build_layout(machine)
    lowest = {
        body.name: apply(layout.poses[body.frame], body.vertices_mm)[:, 2].min()
        for body in generate_bodies(machine)
    }
    assert min(lowest.values()) == pytest.approx(lowest["R_bed"])


def slant_lathe(degrees):
    tilt = {45.0: (90.0, -45.0, 90.0), 90.0: (90.0, 0.0, 90.0)}[degrees]
    return build_machine(
        "wC1FZXt",
        offset_mm={"Z": (300.0, 160.0, 160.0)},
        rotation_deg={"C1": (180.0, -90.0, 0.0), "Z": tilt, "t": (0.0, 90.0, 0.0)},
        travel={"X": (0.0, 250.0), "Z": (0.0, 500.0)},
    )


def test_bodies_of_a_slant_bed_follow_its_slides_and_stand_on_a_level_floor():
    machine = slant_lathe(45.0)
    bodies = {body.name: body for body in generate_bodies(machine)}
    for name in ("X_ram", "Z_column"):  # built of boxes: along their slides, not along R
        for shape in components(bodies[name]):
            np.testing.assert_allclose(np.abs(shape.face_normals).max(axis=1), 1.0, atol=1e-9)
    slab, *_, wedge = components(bodies["R_bed"])
    floor = wedge.face_normals[:, 2] < -0.999
    assert wedge.area_faces[floor].sum() > 100.0**2
    assert wedge.bounds[0, 2] == pytest.approx(bodies["R_bed"].vertices_mm[:, 2].min())
    # the bed itself slopes by 45 degrees
    up = slab.face_normals @ np.array([0.0, -1.0, 1.0]) / np.sqrt(2.0)
    assert up.max() == pytest.approx(1.0)
    assert all(map(components, bodies.values()))


def test_only_slides_that_are_square_and_leave_tables_level_make_a_slant():
    skew = build_machine("wFXYZt", rotation_deg={"Y": (0.0, 0.0, 30.0)})
    tilted_table = build_machine("wCFXYZt", rotation_deg={"X": (45.0, 0.0, 0.0)})
    for machine in (skew, tilted_table, slant_lathe(90.0), *map(load_machine, machine_names())):
        np.testing.assert_array_equal(build_layout(machine).slant, np.eye(3))
    slant = build_layout(build_machine("wFXYZt", rotation_deg={"X": (30.0, 0.0, 0.0)})).slant
    cosine, sine = np.cos(np.radians(30.0)), 0.5
    expected = [[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]]
    np.testing.assert_allclose(slant, expected, atol=1e-12)


def arm_machine(chain, **points):
    rng = np.random.default_rng(5)
    names = parse_chain(chain).tool
    offset_mm = {name: tuple(map(float, rng.normal(0.0, 200.0, 3))) for name in names}
    turns = {name: tuple(map(float, rng.choice([0.0, 90.0, -90.0, 35.0], 3))) for name in names}
    return build_machine(chain, offset_mm={**offset_mm, **points}, rotation_deg=turns)


TIP = {"t": (30.0, 0.0, 150.0)}
ARMS = {
    "robot": load_machine("ur10"),
    "coincident joints": build_machine("wFC1B1C2B2C3t"),
    "any": arm_machine("wFC1B1C2A1C3t", **TIP),
    "flange apart": arm_machine("wFA1B1C2A2t", S=(0.0, 50.0, 100.0), **TIP),
    "tool point at the flange": arm_machine("wFC1B1C2A2B3t", S=(0.0, 0.0, 80.0)),
    "on a rail": arm_machine("wFXC1B1C2B2t", **TIP),
    "on a lift": arm_machine("wFZC1B1C2B2C3t", **TIP),
    "before a table": arm_machine("wCFC1B1C2B2C3t", **TIP),
}


@pytest.mark.parametrize("name", ARMS)
def test_links_of_an_arm_hang_together_and_its_tool_ends_at_the_tool_point(name):
    machine = ARMS[name]
    bodies, poses = generate_bodies(machine), build_layout(machine).poses
    shapes = {
        frame: [apply_mesh(shape, poses[frame]) for b in bodies if b.frame == frame
                for shape in components(b)]
        for frame in ("R", *machine.chain.tool, "S", "t")
    }  # fmt: skip
    for (frame, parents), children in zip(shapes.items(), list(shapes.values())[1:], strict=False):
        pairs = product(parents, children)
        assert any(have_contact(*pair) for pair in pairs), f"{frame} and the next body are apart"
    tool = np.concatenate([shape.vertices for shape in shapes["t"]])
    along = (tool - poses["t"][:3, 3]) @ (poses["S"][:3, 3] - poses["t"][:3, 3])
    assert along.min() == pytest.approx(0.0, abs=1e-3 * max(np.ptp(along), 1.0))
    assert {"C1_joint", "C1_link"} <= {b.name for b in bodies} or name != "robot"


def apply_mesh(shape, pose):
    moved = shape.copy()
    moved.apply_transform(pose)
    return moved


def have_contact(one, other):
    """Whether two convex shapes have a point in common, within 0.1 mm."""
    normals = np.concatenate([one.face_normals, other.face_normals])
    corners = np.concatenate([one.triangles[:, 0], other.triangles[:, 0]])
    behind = np.einsum("fi,fi->f", normals, corners) + 0.1
    return linprog(np.zeros(3), A_ub=normals, b_ub=behind, bounds=(None, None)).success


def test_an_arm_needs_four_joints_in_series_on_at_most_one_slide():
    for chain, is_one in (
        ("wFC1B1C2t", False), ("wFC1B1C2B2t", True), ("wFXYC1B1C2B2t", False),
        ("wFC1B1XC2B2t", False), ("wC1B1C2B2FZt", False),
    ):  # fmt: skip
        assert is_arm(build_layout(build_machine(chain))) is is_one, chain


@pytest.fixture(scope="module")
def scene():
    return warpspace.load_scene("dvf5000_general")


@pytest.fixture(scope="module")
def bodies(scene):
    return {body.name: body for body in load_bodies(scene.machine)}


def amplitudes(scene):
    keys = scene.parameter_keys
    values = np.random.default_rng(4).normal(0, 20, len(keys))
    return dict(zip(keys, values.tolist(), strict=True))


def nominal(scene, body, **positions):
    motion = scene_motions(scene, View(), {}, positions)
    return place_points(motion[body.frame], body.vertices_mm, 0.0)


def test_every_part_of_the_machine_is_there(bodies):
    assert set(bodies) == {
        "R_bed", "R_column", "R_towers", "X_saddle", "Y_saddle", "Z_ram", "S_spindle", "t_tool",
        "B_cradle", "C_table",
    }  # fmt: skip


def test_table_is_500_across_with_its_top_in_the_workpiece_frame(scene, bodies):
    table = nominal(scene, bodies["C_table"], B=0.0, C=0.0)
    assert table[:, 2].max() == pytest.approx(0.0, abs=1e-4)
    assert np.ptp(table[:, 0]) == pytest.approx(500.0, abs=1e-3)


def test_bent_tool_point_lies_in_the_deformed_grid(scene, bodies):
    values = amplitudes(scene)
    at = {**scene.workspace.positions, "X": 120.0, "Y": -80.0, "Z": -333.0, "B": -25.0, "C": 40.0}
    for loop in Loop:
        for reference in (None, {"X": 0.0, "Y": 0.0, "Z": -280.0}):
            view = View(loop, "machine", reference)
            coordinates = complete_coordinates(scene.machine, at)
            tip = scene_motions(scene, View(), {}, at)["t"].nominal[:3, 3]
            basis = build_basis(
                scene.model, scene.errors, scene.parameter_keys, coordinates, view, tip
            )
            field = basis.evaluate(np.array(list(values.values())))
            motions = scene_motions(scene, view, values, at)
            frame = "w" if loop is Loop.WORKPIECE else "t"
            inside = np.linalg.inv(motions[frame].nominal) @ [*tip, 1.0]
            for factor in (1.0, 2000.0):
                drawn = place_points(motions[frame], inside[:3], factor)
                assert drawn == pytest.approx(tip + factor * 1e-3 * field.error_um, abs=1e-9)


def test_machine_without_a_file_of_bodies_has_generated_ones_and_a_broken_file_is_refused(tmp_path):
    generated = generate_bodies(build_machine("wFXYZt"))
    assert load_bodies(build_machine("wFXYZt")) == generated
    assert load_bodies(build_machine("wFXYZt", body_dir=str(tmp_path))) == generated
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / BODY_FILE).write_bytes(b"not a file of arrays")
    with pytest.raises(OptionError, match="no file of machine bodies"):
        load_bodies(build_machine("wFXYZt", body_dir=str(tmp_path / "bad")))


def test_bodies_of_absent_axes_are_left_out(scene):
    lean = build_machine("wCFXYZt", body_dir=scene.machine.body_dir)
    assert "B_cradle" not in {body.name for body in load_bodies(lean)}


SCRIPT = run_path(str(assets_dir() / "machines" / "dvf5000" / "build_bodies.py"))
join_shapes, write_bodies = SCRIPT["join_shapes"], SCRIPT["write_bodies"]
HERE = np.array([10.0, 20.0, 30.0])


def test_written_bodies_are_read_back_with_their_edges_lines_and_colours(tmp_path):
    bodies = [
        join_shapes("X_saddle", DARK, [box((0, 1000), (0, 20), (0, 30))], HERE),
        join_shapes("C_table", METAL, [cylinder(50.0, (0.0, 20.0), inner=10.0)], HERE),
    ]
    line = np.array([[[0.0, 0.0, 20.5], [50.0, 0.0, 20.5]], [[0.0, 0.0, 20.5], [0.0, 50.0, 20.5]]])
    write_bodies(tmp_path / "bodies.glb", bodies, {"C_table": line})
    for read, body in zip(read_bodies(tmp_path / "bodies.glb"), bodies, strict=True):
        assert (read.name, read.frame, read.colour) == (body.name, body.frame, body.colour)
        np.testing.assert_allclose(read.vertices_mm, body.vertices_mm, atol=1e-4)
        np.testing.assert_array_equal(read.triangles, body.triangles)
        edges = [body.edges_mm, line[: 2 * (body.name == "C_table")]]
        np.testing.assert_allclose(read.edges_mm, np.concatenate(edges), atol=1e-4)
