"""Measures of a part as cut, against closed forms, the bench and their own budgets."""

import numpy as np
import pytest
import trimesh

from bench_scenes import scene_with
from unit.parts.test_features import FRUSTUM, part_of, plate_of_holes
from warpspace import load_scene
from warpspace.bench.kinds.ball_plate import BallPlate, left_over
from warpspace.bench.placing import ball_point
from warpspace.bench.plan import simulate
from warpspace.exceptions import SceneError
from warpspace.parts.inspection import features_table, inspect
from warpspace.parts.part import fit_out, make_points, place_part

CUBE = trimesh.creation.box((100.0, 100.0, 100.0))


def inspected(scene, mesh, tolerances="", place=None):
    part = part_of(mesh.copy())
    made = make_points(scene, place_part(part, scene, place).vertices_mm)
    found = inspect(scene, part, made, ("tolerances.toml", tolerances) if tolerances else None)
    return {one.name: one for one in found}


def rounded(mesh):
    mesh.vertices = np.round(mesh.vertices, 3)
    return mesh


def entry(**keys):
    return "[[features]]\n" + "".join(f"{key} = {value!r}\n" for key, value in keys.items())


BESIDE = entry(**{"is": "plane", "near": [0, 50, 0], "name": "back"})


def test_the_squareness_of_a_cube_is_that_of_the_machine():
    asked = entry(**{"is": "plane", "near": [50, 0, 0], "measure": "squareness", "to": ["back"],
                     "tolerance_urad": 30})  # fmt: skip
    found = inspected(scene_with(EC0Y=40.0), CUBE, BESIDE + asked)
    (one,) = (row for part in found.values() for name, row in part.measures.items() if "to" in name)
    assert one["nominal_deg"] == pytest.approx(90.0)
    assert one["placed_difference_urad"] == pytest.approx(40.0, abs=1e-3)
    assert one["budget"] == {"EC0Y": pytest.approx(40.0, abs=1e-3)}
    assert one["verdict"] == "missed"


def test_a_scale_is_a_distance_and_a_location_is_no_error_of_a_part():
    asked = entry(**{"is": "plane", "near": [0, -50, 0], "measure": "distance", "to": ["back"],
                     "tolerance_um": [0, 20.5]})  # fmt: skip
    scene = scene_with(EYY=(0.0, 90.0), EX0C=30.0)  # 90 µm over 450 mm
    found = inspected(scene, CUBE, BESIDE + asked)
    (one,) = (row for part in found.values() for name, row in part.measures.items() if "to" in name)
    assert (one["nominal_mm"], one["difference_um"]) == pytest.approx((100.0, 20.0), abs=1e-6)
    assert one["verdict"] == "kept"
    side = next(part for part in found.values() if "to" not in str([*part.measures]))
    assert set(side.measures) == {"flatness", "position"}
    located = inspected(scene_with(EX0C=30.0, EY0C=10.0), CUBE)
    rows = [part.measures["position"] for part in located.values()]
    assert max(row["difference_um"] for row in rows) == pytest.approx(30.0, abs=1e-6)
    assert max(row["placed_difference_um"] for row in rows) < 1e-6


def test_a_scale_opens_holes_and_cones_and_moves_them():
    scale = 2e-4
    scene = scene_with(EXX=(0.0, 550e3 * scale), EYY=(0.0, 450e3 * scale))
    hole = inspected(scene, plate_of_holes())["cylinder 1"].measures
    assert hole["diameter"]["placed_difference_um"] == pytest.approx(16e3 * scale, abs=1e-3)
    assert hole["cylindricity"]["placed_difference_um"] == pytest.approx(0.0, abs=1e-3)
    away = 60e3 * np.sqrt(2.0) * scale
    assert hole["position"]["placed_difference_um"] == pytest.approx(away, abs=1e-3)
    assert hole["position"]["budget"]["EXX"] == pytest.approx(away / 2.0, abs=1e-3)
    cone = inspected(scene, trimesh.creation.revolve(FRUSTUM, sections=90))["cone 1"]
    opened = cone.measures["half_angle"]
    slope = 0.4 * scale * 1e6  # sin φ cos φ for tan φ = 30 / 60
    assert abs(opened["placed_difference_urad"]) == pytest.approx(slope, abs=0.1)
    assert opened["nominal_deg"] == pytest.approx(26.56505118)


def test_a_doubtful_verdict_is_none():
    scene = scene_with(EXX=5000.0, EC0Y=4000.0, ECZ=3000.0, EAX=(0.0, 9000.0))
    plain = inspected(scene, plate_of_holes())["cylinder 1"].measures["position"]
    band = [0, plain["placed_difference_um"] + 1e-6]
    asked = entry(**{"is": "cylinder 1", "measure": "position", "tolerance_um": band})
    found = inspected(scene, plate_of_holes(), asked)["cylinder 1"]
    assert found.measures["position"]["verdict"] == "in doubt"
    assert found.measures["position"]["doubt_um"] > 1e-3


@pytest.mark.parametrize("name", ["dvf5000_first", "dvf5000_second"])
@pytest.mark.parametrize("place", [None, (60.0, -40.0, 250.0, 0.0, 0.0, 90.0)])
@pytest.mark.parametrize(
    "mesh",
    [
        plate_of_holes(),
        rounded(plate_of_holes()),
        trimesh.creation.icosphere(3, 80.0),
        trimesh.creation.revolve(FRUSTUM, sections=90),
    ],
    ids=["plate", "rounded plate", "ball", "frustum"],
)
def test_budgets_close(name, place, mesh):
    asked = entry(**{"is": "cylinder 3", "measure": "position",
                     "to": ["plane 1", "plane 3", "plane 4"]})  # fmt: skip
    asked = asked if len(mesh.faces) == 1200 else ""
    found = inspected(load_scene(name), mesh, asked, place)
    assert found
    for feature in found.values():
        for row in feature.measures.values():
            unit = "urad" if "nominal_deg" in row else "um"
            whole = row[f"placed_difference_{unit}"]
            assert sum(row["budget"].values()) == pytest.approx(whole, rel=0.01, abs=0.01)
        assert feature.budget == feature.measures[feature.budget_of]["budget"]
    assert len(features_table([*found.values()]).rows) == sum(
        len(f.measures) for f in found.values()
    )


def test_a_plate_of_holes_is_the_ball_plate_of_the_bench():
    scene = load_scene("dvf5000_first")
    test = BallPlate(balls=3, pitch_mm=60.0, positions=1)
    plan = test.plan(scene)
    sites = {name: np.broadcast_to(at, 9) for name, at in plan.coordinates.items()}
    made = make_points(scene, ball_point(scene.model, sites))
    balls = left_over(plan, simulate(scene, plan, exact=False))
    assert np.abs(fit_out(made.point_mm, made.error_um) - balls).max() < 1e-6


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ("[[feature]]\n", "feature: unknown key: did you mean 'features'"),
        (entry(**{"is": "plain 1"}), "unknown feature: did you mean 'plane 1'"),
        (entry(**{"is": "plane 1", "mesure": "flatness"}), "did you mean 'measure'"),
        (entry(**{"is": "plane 1", "measure": "diameter"}), "diameter of a plane; expected a"),
        (entry(**{"is": "plane 1", "measure": "angle"}), "angle to 0 features; expected 1"),
        (entry(**{"is": "plane 1", "measure": "angle", "to": ["plane 2"], "tolerance_um": 1}),
         "tolerance_um of angle; expected tolerance_urad"),
        (entry(**{"is": "plane 1", "measure": "squareness", "to": ["plane 1"]}),
         "squareness at a nominal angle of 180°"),
        (entry(**{"is": "plane 1", "tolerance_um": 1}), "expected a measure"),
        (entry(**{"is": "plane 1", "name": "plane 2"}), "another feature has it"),
        (entry(**{"is": "plane 1", "measure": "flatness", "tolerance_um": -1}), "at least 0"),
        (entry(**{"is": "cone", "near": [0, 0, 0]}), "unknown feature"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_tolerances_is_said(toml, said):
    with pytest.raises(SceneError) as refused:
        inspected(scene_with(), CUBE, toml)
    assert said in str(refused.value)
    assert "tolerances.toml" in str(refused.value)
