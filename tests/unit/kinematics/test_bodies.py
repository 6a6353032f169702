"""Bodies move as the field says: their drawn points lie on the deformed grid."""

import numpy as np
import pytest

from warpspace import evaluate, load_scene
from warpspace.field.evaluate import error_values
from warpspace.geometry.deform import deform
from warpspace.kinematics.bodies import body_motions
from warpspace.kinematics.model import ComponentErrors, Model, complete_coordinates
from warpspace.machine.description import build_machine


@pytest.mark.parametrize("exaggeration", [1.0, 1000.0])
def test_the_tool_point_is_drawn_where_the_deformed_grid_has_it(exaggeration):
    scene = load_scene("dvf5000_first")
    at = complete_coordinates(scene.machine, {"X": 275.0, "Y": -225.0, "Z": -480.0})
    bodies = body_motions(scene.model, error_values(scene.model, scene.errors, at), at)
    tip = bodies["t"].drawn(exaggeration) @ [0.0, 0.0, 0.0, 1.0]
    field = evaluate(scene, at=at)
    np.testing.assert_allclose(
        tip[:3], deform(field.nominal_mm, field.error_um, exaggeration), atol=1e-9
    )


def test_only_bodies_behind_an_error_move():
    scene = load_scene("teach_squareness")
    at = complete_coordinates(scene.machine, {"X": 10.0})
    bodies = body_motions(scene.model, error_values(scene.model, scene.errors, at), at)
    moved = {name for name, body in bodies.items() if np.any(body.rotation_rad != 0.0)}
    assert moved == {"Y", "Z", "S", "t"}


def test_errors_before_the_motion_stand_in_fixed_directions():
    machine = build_machine("wCFt")
    at = {"C": np.array(90.0)}
    after = body_motions(Model(machine), {"EAC": 10.0}, at)["C"]
    before = body_motions(Model(machine, ComponentErrors.BEFORE_MOTION), {"EAC": 10.0}, at)["C"]
    np.testing.assert_allclose(after.rotation_rad, [0.0, 1e-5, 0.0], atol=1e-18)
    np.testing.assert_allclose(before.rotation_rad, [1e-5, 0.0, 0.0], atol=1e-18)
