"""Bodies of any machine, generated from its description alone."""

import time

import numpy as np
import pytest

from body_checks import assert_closed, components, nodes_inside, of_head
from warpspace.bodies.generated.generate import generate_bodies
from warpspace.bodies.generated.layout import build_layout
from warpspace.field.grid import build_grid
from warpspace.machine.description import build_machine
from warpspace.picture.bodies import place_bodies, scene_motions
from warpspace.scene.library import load_scene
from warpspace.scene.machines import load_machine, machine_names

LIBRARY = tuple(name for name in machine_names() if name != "dvf5000")
MAX_TRIANGLES = 20_000


def random_machine(seed: int):
    """One to eight axes of any letters on either side, with offsets and rotations now and then."""
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


@pytest.mark.parametrize("first", range(0, 60, 10))
def test_bodies_of_any_chain_are_closed_small_and_clear_of_the_volume(first):
    for seed in range(first, first + 10):
        machine = random_machine(seed)
        bodies, layout = generate_bodies(machine), build_layout(machine)
        assert {body.frame for body in bodies} >= {"R", "S", "t", *machine.axes}
        assert sum(len(body.triangles) for body in bodies) < MAX_TRIANGLES
        sides = [np.linspace(a, b, 6) for a, b in zip(layout.low_mm, layout.high_mm, strict=True)]
        nodes = np.stack(np.meshgrid(*sides), -1).reshape(-1, 3)
        for body in bodies:
            assert_closed(body)
            if not of_head(machine, body):
                pose = layout.poses[body.frame]
                placed = body.vertices_mm @ pose[:3, :3].T + pose[:3, 3]
                assert not nodes_inside(body, placed, nodes), (str(machine.chain), body.name)


@pytest.mark.parametrize("name", LIBRARY)
def test_bodies_of_a_library_machine_are_closed_small_grey_and_clear_of_its_volume(name):
    scene = load_scene(f"machine_{name}")
    placed = place_bodies(scene, scene_motions(scene, scene.view()), 0.0)
    nodes = build_grid(scene.model, scene.workspace, 7).nominal_mm.reshape(-1, 3)
    assert sum(len(part.body.triangles) for part in placed) < MAX_TRIANGLES
    for part in placed:
        assert_closed(part.body)
        assert np.ptp(part.body.colour) <= 24
        assert len(part.body.edges_mm) > 0
        if not of_head(scene.machine, part.body):
            assert not nodes_inside(part.body, part.nominal_mm, nodes), part.body.name


@pytest.mark.parametrize("name", LIBRARY)
def test_tool_ends_in_the_tool_point(name):
    bodies = {body.frame: body for body in generate_bodies(load_machine(name))}
    assert bodies["t"].vertices_mm[:, 2].min() == pytest.approx(0.0, abs=1e-9)


def test_table_of_a_c_axis_is_round_about_it_and_carries_the_workpiece_frame():
    machine = load_machine("trunnion_ac")
    table = next(body for body in generate_bodies(machine) if body.name == "C_table")
    radius = np.hypot(table.vertices_mm[:, 0], table.vertices_mm[:, 1])
    rim = radius[np.isclose(table.vertices_mm[:, 2], table.vertices_mm[:, 2].max())]
    assert rim.max() == pytest.approx(0.92 * 200.0, rel=1e-6)
    assert table.vertices_mm[:, 2].max() == pytest.approx(machine.fixed_mm["w"][2], abs=1e-9)


def test_trunnion_tilts_about_its_axis_between_two_towers():
    bodies = {body.name: body for body in generate_bodies(load_machine("trunnion_ac"))}
    towers = bodies["R_towers"].vertices_mm
    assert (towers[:, 0] < -250.0).any()
    assert (towers[:, 0] > 250.0).any()
    assert not (np.abs(towers[:, 0]) < 250.0).any()


def test_bodies_grow_with_travel():
    small = build_machine("wXYFZt", travel=dict.fromkeys("XYZ", (-50.0, 50.0)))
    large = build_machine("wXYFZt", travel=dict.fromkeys("XYZ", (-500.0, 500.0)))
    sizes = [
        {body.name: np.ptp(body.vertices_mm, axis=0) for body in generate_bodies(machine)}
        for machine in (small, large)
    ]
    for name in ("R_bed", "R_column", "X_table", "Y_saddle", "Z_headstock"):
        assert (sizes[1][name] > 3.0 * sizes[0][name]).all(), name


def test_a_place_in_the_library_is_what_its_structure_says():
    kinds = {
        "gantry_mill": "X_bridge", "bridge_cmm": "Y_bridge", "c_frame_mill": "Z_headstock",
        "trunnion_bc": "R_portal", "head_head_cb": "C_fork", "nutating_head": "C_wedge",
        "lathe_mill": "C1_chuck", "rotary_grinder": "t_wheel", "printer_3d": "Z_beam",
        "scara": "C2_arm", "fixed_spindle": "Z_lift", "horizontal_b_table": "B_table",
        "bridge_cmm ": "t_probe",
    }  # fmt: skip
    for name, body in kinds.items():
        assert body in {found.name for found in generate_bodies(load_machine(name.strip()))}


def test_bodies_are_generated_fast_and_kept():
    machine = build_machine("wCAFXYZt", travel={"X": (-251.0, 251.0)})
    generate_bodies(build_machine("wCAFXYZt"))  # imports trimesh
    start = time.process_time()
    bodies = generate_bodies(machine)
    assert time.process_time() - start < 0.1
    assert generate_bodies(build_machine("wCAFXYZt", travel={"X": (-251.0, 251.0)})) is bodies


def slant_lathe(degrees: float):
    """A lathe whose carriage Z and slide X lie on a bed that slopes up to the rear."""
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
        for shape in components(bodies[name], bodies[name].vertices_mm):
            np.testing.assert_allclose(np.abs(shape.face_normals).max(axis=1), 1.0, atol=1e-9)
    wedge = components(bodies["R_bed"], bodies["R_bed"].vertices_mm)[-1]
    floor = wedge.face_normals[:, 2] < -0.999
    assert wedge.area_faces[floor].sum() > 100.0**2
    assert wedge.bounds[0, 2] == pytest.approx(bodies["R_bed"].vertices_mm[:, 2].min())
    # the bed itself slopes by 45 degrees
    slab = components(bodies["R_bed"], bodies["R_bed"].vertices_mm)[0]
    up = slab.face_normals @ np.array([0.0, -1.0, 1.0]) / np.sqrt(2.0)
    assert up.max() == pytest.approx(1.0)
    for body in bodies.values():
        assert_closed(body)


@pytest.mark.parametrize("name", machine_names())
def test_machines_of_the_library_are_built_along_r(name):
    np.testing.assert_array_equal(build_layout(load_machine(name)).slant, np.eye(3))


def test_only_slides_that_are_square_and_leave_tables_level_make_a_slant():
    skew = build_machine("wFXYZt", rotation_deg={"Y": (0.0, 0.0, 30.0)})
    tilted_table = build_machine("wCFXYZt", rotation_deg={"X": (45.0, 0.0, 0.0)})
    for machine in (skew, tilted_table, slant_lathe(90.0)):
        np.testing.assert_array_equal(build_layout(machine).slant, np.eye(3))
    slant = build_layout(build_machine("wFXYZt", rotation_deg={"X": (30.0, 0.0, 0.0)})).slant
    cosine, sine = np.cos(np.radians(30.0)), 0.5
    expected = [[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]]
    np.testing.assert_allclose(slant, expected, atol=1e-12)
