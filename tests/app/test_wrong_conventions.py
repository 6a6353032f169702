"""What data in a wrong convention would cost, against numbers by hand and against translations."""

import numpy as np
import pytest

from warpspace.app.tasks.conventions import convention_costs
from warpspace.field.evaluate import View, evaluate_first_order
from warpspace.field.grid import Workspace, build_grid
from warpspace.kinematics.conversion import move_measuring_line
from warpspace.kinematics.model import Model
from warpspace.machine.description import build_machine
from warpspace.machine.errors import Constant, ErrorSet, Ramp, Table
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene

SPAN = (-100.0, 100.0)
VOLUME = Workspace({"X": SPAN, "Y": (0.0, 0.0), "Z": (0.0, 0.0)})


def costs(errors, offset=0.0):
    machine = build_machine("wFXYZt", offset_mm={"t": (0.0, 0.0, offset)})
    return convention_costs(Scene("own", "", Model(machine), VOLUME, errors), View())


def test_a_pitch_on_an_arm():
    found = costs(ErrorSet({"EBX": Constant(SPAN, 10.0)}), offset=-300.0)
    assert found["measuring_line"] == pytest.approx((3.0, 3.0))
    assert found["squareness=over_90"] == (0.0, 0.0)


def test_the_sign_of_a_squareness_counts_twice():
    found = costs(ErrorSet({"EB0Z": Constant(SPAN, 10.0)}), offset=-300.0)
    assert found["squareness=over_90"] == pytest.approx((6.0, 6.0))
    assert found["squareness=under_90"] == (0.0, 0.0)
    found = costs(ErrorSet({"EA0Z": Constant(SPAN, 10.0)}), offset=-300.0)
    assert found["squareness=under_90"] == pytest.approx((6.0, 6.0))


def test_a_tilt_that_is_lost_with_the_reference_line():
    tilted = Table(SPAN, ((-100.0, 0.0), (100.0, 8.0)))
    found = costs(ErrorSet({"EYX": tilted}))
    for line in ("end_point", "least_squares", "minimum_zone"):
        mean, largest = found[line]
        assert mean == pytest.approx(4.0)
        assert largest == pytest.approx(8.0)


def test_a_curve_set_to_zero_in_the_middle():
    found = costs(ErrorSet({"EXX": Ramp(SPAN, 6.0)}))
    assert found["zero_at"] == pytest.approx((3.0, 3.0))


def test_it_is_the_difference_to_what_the_translation_gives():
    scene = load_scene("dvf5000_first")
    model, held = scene.model, {"X": 0.0, "Y": 0.0, "Z": -280.0}
    grid = build_grid(model, scene.workspace, 5)
    # the tool point in the frames of X, Y and Z where all stand in the middle: the offsets of the
    # frames behind each, and none of its own
    offsets = {name: np.array(axis.offset_mm) for name, axis in scene.machine.axes.items()}
    spindle = np.array(scene.machine.fixed_mm["S"]) + np.array(scene.machine.fixed_mm["t"])
    middle = {"Y": [0.0, 0.0, 0.0], "Z": [0.0, 0.0, -280.0]}
    z = spindle + np.array(scene.model.tool_point_mm)
    y = z + offsets["Z"] + middle["Z"]
    x = y + offsets["Y"] + middle["Y"]
    lines = {"X": tuple(x), "Y": tuple(y), "Z": tuple(z)}
    spans = {name: axis.travel for name, axis in scene.machine.axes.items()}
    moved = move_measuring_line(model, scene.errors, spans, lines, to_origin=True)
    for view in (View(), View(reference=held)):
        a, b = (
            evaluate_first_order(model, errors, grid.coordinates, view, grid.point_mm).error_um
            for errors in (scene.errors, moved)
        )
        largest = float(np.linalg.norm(b - a, axis=-1).max())
        found = convention_costs(scene, view, 5)
        assert found["measuring_line"][1] == pytest.approx(largest, abs=0.01)
