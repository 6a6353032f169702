import numpy as np
import pytest

import warpspace
from warpspace.bodies.body_file import BODY_FILE
from warpspace.bodies.generated.generate import generate_bodies
from warpspace.bodies.placed import load_bodies, place_points, view_motions
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, build_basis
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.description import build_machine


@pytest.fixture(scope="module")
def scene():
    return warpspace.load_scene("dvf5000_general")


@pytest.fixture(scope="module")
def bodies(scene):
    return {body.name: body for body in load_bodies(scene.machine)}


def amplitudes(scene):
    """One value for every parameter, so that each of them has to be right."""
    rng = np.random.default_rng(4)
    return {key: float(value) for key, value in zip(
        scene.parameter_keys, rng.normal(0, 20, len(scene.parameter_keys)), strict=True
    )}  # fmt: skip


def volume(body):
    a, b, c = (body.vertices_mm[body.triangles[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def nominal(scene, body, **positions):
    motion = view_motions(scene.model, scene.errors, {}, {**scene.workspace.positions, **positions})
    return place_points(motion[body.frame], body.vertices_mm, 0.0)


def test_every_part_of_the_machine_is_there_and_right_side_out(bodies):
    assert set(bodies) == {
        "R_bed", "R_column", "R_towers", "X_saddle", "Y_saddle", "Z_ram", "S_spindle", "t_tool",
        "B_cradle", "C_table",
    }  # fmt: skip
    for body in bodies.values():
        assert volume(body) > 0.0
        assert body.triangles.max() < len(body.vertices_mm)
        assert len(body.edges_mm) > 0
        assert np.ptp(body.colour) <= 24, "bodies are grey: colour means error"


def test_tool_ends_in_the_tool_point(scene, bodies):
    tip = bodies["t_tool"].vertices_mm
    assert tip[:, 2].min() == pytest.approx(0.0, abs=1e-4)
    assert tip[np.argmin(tip[:, 2])][:2] == pytest.approx((0, 0), abs=8.01)


def test_table_is_500_across_with_its_top_in_the_workpiece_frame(scene, bodies):
    table = nominal(scene, bodies["C_table"], B=0.0, C=0.0)
    assert table[:, 2].max() == pytest.approx(0.0, abs=1e-4)
    assert np.ptp(table[:, 0]) == pytest.approx(500.0, abs=1e-3)


def test_nothing_but_the_table_reaches_into_the_working_volume(scene, bodies):
    low, high = np.array([-275, -225, 0.5]), np.array([275, 225, 429])
    for name in ("R_bed", "R_column", "R_towers", "B_cradle", "C_table"):
        points = nominal(scene, bodies[name])
        triangles = points[bodies[name].triangles]
        # no triangle's box meets the volume (boxes and cylinders: coarse, but on the safe side)
        apart = (triangles.max(axis=1) < low) | (triangles.min(axis=1) > high)
        assert apart.any(axis=1).all(), name


def test_moving_bodies_clear_column_and_towers_over_the_travels(scene, bodies):
    fixed = [nominal(scene, bodies[name]) for name in ("R_column", "R_towers")]
    boxes = [(p.min(axis=0), p.max(axis=0)) for p in (fixed[0], fixed[1][fixed[1][:, 1] > 0],
                                                      fixed[1][fixed[1][:, 1] < 0])]  # fmt: skip
    for name in ("Z_ram", "S_spindle", "Y_saddle"):
        for y in (-225.0, 225.0):
            for z in (-480.0, 0.0):
                points = nominal(scene, bodies[name], Y=y, Z=z)
                for low, high in boxes:
                    apart = (points.max(axis=0) <= low + 1e-3) | (points.min(axis=0) >= high - 1e-3)
                    assert apart.any(), (name, y, z)


def test_bent_tool_point_lies_in_the_deformed_grid(scene, bodies):
    values = amplitudes(scene)
    at = {**scene.workspace.positions, "X": 120.0, "Y": -80.0, "Z": -333.0, "B": -25.0, "C": 40.0}
    for loop in Loop:
        for reference in (None, {"X": 0.0, "Y": 0.0, "Z": -280.0}):
            view = View(loop, "machine", reference)
            coordinates = complete_coordinates(scene.machine, at)
            tip = view_motions(scene.model, scene.errors, {}, at)["t"].nominal[:3, 3]
            basis = build_basis(
                scene.model, scene.errors, scene.parameter_keys, coordinates, view, tip
            )
            field = basis.evaluate(np.array(list(values.values())))
            motions = view_motions(scene.model, scene.errors, values, at, view)
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
