"""The public function `evaluate` and what lies around it."""

import numpy as np
import pytest

from warpspace import evaluate, load_scene
from warpspace.exceptions import OptionError, UnknownNameError, WarpspaceError
from warpspace.field.evaluate import amplitudes_of
from warpspace.field.grid import build_grid
from warpspace.picture.scene_picture import evaluate_picture
from warpspace.scene.library import parse_scene, scene_names
from warpspace.scene.machines import load_machine, machine_names
from warpspace.scene.pipeline import (
    choose_view,
    grid_basis,
    linearisation_error_um,
)

FIRST = load_scene("dvf5000_first")


def test_points_and_grid_agree_where_they_meet() -> None:
    grid = evaluate(FIRST, grid=3)
    corner = evaluate(FIRST, at={"X": 275.0, "Y": 225.0, "Z": -80.0})
    np.testing.assert_allclose(grid.error_um[2, 2, 2], corner.error_um, atol=1e-10)
    np.testing.assert_allclose(grid.nominal_mm[2, 2, 2], corner.nominal_mm, atol=1e-10)


@pytest.mark.parametrize("exact", [False, True])
def test_error_of_a_moving_workpiece_is_evaluated_where_the_tool_is(exact: bool) -> None:
    text = '[machine]\nchain = "wXFYZt"\n[errors]\nECX = 10\nEAY = { ramp = 5 }\n'
    scene = parse_scene(text, "table")
    field = evaluate(scene, grid=3, loop="relative", exact=exact)
    assert np.ptp(field.nominal_mm.reshape(-1, 3), axis=0).tolist() == [500.0, 500.0, 500.0]
    node = evaluate(scene, at={"X": -250, "Y": 250, "Z": 0}, loop="relative", exact=exact)
    np.testing.assert_allclose(field.error_um[0, 2, 1], node.error_um, atol=1e-10)


def test_batch_of_points_keeps_its_shape() -> None:
    field = evaluate(FIRST, at={"X": np.zeros((4, 1)), "Y": np.zeros(5)})
    assert field.error_um.shape == (4, 5, 3)
    assert evaluate(FIRST, at={}).error_um.shape == (3,)


def test_workpiece_loop_takes_its_functional_point_at_points_and_the_node_over_the_grid() -> None:
    point = evaluate(FIRST, at={"B": 0.0}, loop="workpiece").nominal_mm
    np.testing.assert_allclose(point, [0.0, 275.0, 450.0], atol=1e-12)
    grids = [evaluate(FIRST, grid=2, loop=loop).nominal_mm for loop in ("tool", "workpiece")]
    np.testing.assert_array_equal(*grids)


@pytest.mark.parametrize("exact", [False, True])
def test_scene_with_a_reference_holds_its_point_still(exact: bool) -> None:
    text = 'machine = "dvf5000"\nview.reference = { Z = -100 }\n[errors]\nEC0Y = 30\nEAX = 9\n'
    scene = parse_scene(text, "held")
    field = evaluate(scene, at={"X": [0.0, 100.0], "Y": 0.0, "Z": -100.0}, exact=exact)
    np.testing.assert_allclose(field.error_um[0], 0.0, atol=1e-9)
    grid = evaluate(scene, grid=3, exact=exact)
    assert grid.error_um.shape == (3, 3, 3, 3)
    assert grid.norm_um.max() > 1.0


def test_basis_of_the_grid_gives_the_field_of_the_grid() -> None:
    grid = build_grid(FIRST.model, FIRST.workspace, 4)
    basis = grid_basis(FIRST, grid)
    assert basis.keys == FIRST.parameter_keys
    field = basis.evaluate(amplitudes_of(FIRST.errors, basis.keys))
    np.testing.assert_allclose(field.error_um, evaluate(FIRST, grid=4).error_um, atol=1e-10)


def test_picture_holds_the_field_of_its_loop_and_its_statistics() -> None:
    picture = evaluate_picture(load_scene("teach_tilted_c"), grid=4, loop="relative")
    assert picture.view.loop == "relative"
    assert picture.field.error_um.shape == (4, 4, 4, 3)
    assert picture.statistics.max_um == pytest.approx(float(picture.field.norm_um.max()))
    assert picture.statistics.max_um > 1.0


def test_linearisation_error_shrinks_with_the_square() -> None:
    def scaled(factor: float) -> float:
        text = f'machine = "dvf5000"\n[errors]\nEAX = {4000 * factor}\nEB0Z = {3000 * factor}\n'
        return linearisation_error_um(parse_scene(text, "large"), 3)

    assert scaled(1.0) / scaled(0.5) == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"at": {"X": 0.0}, "grid": 5}, "not both"),
        ({"loop": "machine"}, "loop 'machine'; expected one of tool, workpiece, relative"),
        ({"frame": "tool"}, "frame 'tool'; expected one of machine, workpiece"),
        ({"grid": 1}, "expected 2 to 101"),
        ({"grid": 2.5}, "expected whole numbers"),
        ({"at": {"X": np.nan}}, "axis X at nan; expected finite numbers"),
        ({"at": {"A": 0.0}}, "unknown axis 'A'; expected one of X, Y, Z, B, C"),
        ({"at": {"X": [1.0, 2.0], "Y": [1.0, 2.0, 3.0]}}, "one batch shape"),
        ({"at": {"X": 1e9}}, "EAX reaches 1e.07 µrad"),
    ],
)
def test_impossible_argument_is_refused_with_what_was_expected(arguments, reason: str) -> None:
    with pytest.raises(WarpspaceError, match=reason):
        evaluate(FIRST, **arguments)


def test_view_of_a_scene_carries_its_reference() -> None:
    assert choose_view(FIRST, "tool").reference is None
    with pytest.raises(OptionError, match="frame"):
        choose_view(FIRST, "tool", "nowhere")


def test_bundled_scenes_are_listed_with_the_machine_before_the_lessons() -> None:
    names = list(scene_names())
    assert names == sorted(names, key=lambda name: (name.startswith("teach"), name))


def test_bundled_machine_is_loaded_and_an_unknown_one_refused() -> None:
    assert "dvf5000" in machine_names()
    assert str(load_machine("dvf5000").chain) == "wCBFXYZt"
    with pytest.raises(UnknownNameError, match="unknown machine 'dvf': did you mean 'dvf5000'"):
        load_machine("dvf")
