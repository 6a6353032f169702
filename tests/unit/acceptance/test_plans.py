"""Plans of acceptance tests: bundled ones, and a message for each invalid input."""

from dataclasses import replace

import numpy as np
import pytest

import warpspace
from warpspace.acceptance_tests.acceptance import Acceptance, find_worst_machine
from warpspace.acceptance_tests.plans import default_plan, load_plan, parse_plan, plan_names
from warpspace.acceptance_tests.polytope import cone_bound, icosahedron
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.machine.errors import Tolerance, ToleranceSet
from warpspace.scene.library import load_scene

SMALL = Acceptance(knots=2)


@pytest.fixture(scope="module")
def scene():
    return load_scene("dvf5000_general")


def plan(scene, *entries):
    text = "\n".join(f"[[acceptance]]\n{entry}" for entry in entries)
    return parse_plan(text, "plan.toml", scene)


def entry(**fields):
    return "\n".join(f"{key} = {value!r}" for key, value in fields.items())


@pytest.mark.parametrize("name", plan_names())
def test_bundled_plans_are_read_and_state_times(name, scene):
    tests = load_plan(name, scene)
    assert len(tests) >= 13
    assert all(test.minutes for test in tests)


def test_default_plan_follows_the_axes():
    names = {"dvf5000_general": "iso_5_axes_bc", "machine_trunnion_ac": "iso_5_axes_ac"}
    names["machine_bridge_cmm"] = "iso_3_axes"
    assert {name: default_plan(load_scene(name)) for name in names} == names


def test_options_are_those_of_the_bench(scene):
    (test,) = plan(
        scene,
        entry(test="circular", plane="YZ", radius_mm=50.25, limit_um=8, minutes=15)
        + "\nat = { X = 20.0 }",
    )
    assert (test.test.plane, test.test.radius_mm) == ("YZ", 50.25)
    assert dict(test.test.at) == {"X": 20.0}
    assert (test.limit, test.unit, test.minutes) == (8.0, "um", 15.0)
    assert test.name == "circular YZ 50.25 mm X=20"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"test": "circulr", "limit_um": 8}, "unknown test 'circulr'.*circular"),
        ({"test": 3, "limit_um": 8}, "unknown test '3'"),
        ({"test": "circular"}, "expected one limit"),
        ({"test": "circular", "limit": 8}, "limit: has no unit"),
        ({"test": "circular", "limit_mm": 8}, "limit_mm: has no unit.*expected one limit"),
        ({"test": "circular", "limit_um": 0}, "limit_um: 0; expected above 0"),
        ({"test": "circular", "limit_um": -3}, "limit_um: -3; expected above 0"),
        ({"test": "circular", "limit_um": "8"}, 'limit_um: "8"; expected above 0'),
        ({"test": "circular", "limit_um": 8, "minutes": 0}, "minutes: 0; expected above 0"),
        ({"test": "circular", "limit_um": 8, "radus_mm": 9}, "unknown option of circular"),
        ({"test": "circular", "limit_um": 8, "plane": "XA"}, "plane.*expected one of XY, XZ, YZ"),
        ({"test": "circular", "limit_um": 8, "data": "x.csv"}, "unknown option of circular"),
        ({"test": "circular", "limit_um": 8, "points": 1}, "points 1; expected 8 to"),
    ],
)
def test_an_invalid_entry_is_named(scene, fields, message):
    with pytest.raises(SceneError, match=rf"plan.toml: acceptance\[1\]: .*{message}"):
        plan(scene, entry(**fields))


@pytest.mark.parametrize("text", ["", "acceptance = 3", "acceptance = []", "acceptence = 1"])
def test_a_plan_without_tests_is_refused(scene, text):
    with pytest.raises(SceneError, match=r"expected 1 to 200 tests \[\[acceptance\]\]"):
        parse_plan(text, "plan.toml", scene)


def test_unknown_bundled_plan(scene):
    with pytest.raises(UnknownNameError, match="iso_3_axes"):
        load_plan("iso_3_axis", scene)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"test": "circular", "limit_um": 8, "radius_mm": 5000}, "leaves the working volume"),
        ({"test": "rotary-axis", "axis": "A", "limit_um": 8}, "unknown axis 'A'"),
        ({"test": "positioning", "limit_um": 8, "quantity": "R_um"}, "R_um has no linear form"),
        ({"test": "r-test", "limit_um": 8, "quantity": "rms_fitted_um"}, "has no linear form"),
        ({"test": "circular", "limit_um": 8, "points": 100_000}, "200,000 readings; expected"),
        ({"test": "circular", "limit_urad": 8}, "limit_urad; .* expects limit_um"),
    ],
)
def test_a_test_that_cannot_be_used_is_named(scene, fields, message):
    with pytest.raises(OptionError, match=message):
        find_worst_machine(scene, plan(scene, entry(**fields)), SMALL)


def test_missing_and_zero_tolerances(scene):
    missing = replace(scene, tolerances=ToleranceSet({"rotation": 20.0, "squareness": 25.0}))
    with pytest.raises(OptionError, match=r"unbounded: EXX, .* have no tolerance"):
        find_worst_machine(missing, (), SMALL)
    zero = replace(
        scene, tolerances=ToleranceSet(dict.fromkeys(("translation", "rotation", "squareness"), 0))
    )
    with pytest.raises(OptionError, match="all tolerances are zero"):
        find_worst_machine(zero, (), SMALL)


def test_conflicting_tests_are_named(scene):
    """A squareness of 100 ± 1 µrad passes neither of two tests; the third one has no part in it."""
    tolerances = ToleranceSet(scene.tolerances.default, {"EC0Y": Tolerance(100.0, 1.0)})
    bent = replace(scene, tolerances=tolerances)
    rigid = ToleranceSet({"translation": 0.0, "rotation": 0.0, "squareness": 0.0},
                         {"EC0Y": Tolerance(100.0, 1.0)})  # fmt: skip
    entries = [
        entry(test="squareness", plane="XY", limit_urad=10),
        entry(test="positioning", axis="Z", limit_um=10),
    ]
    with pytest.raises(OptionError, match=r"no machine .*: squareness XY cannot be passed"):
        find_worst_machine(replace(bent, tolerances=rigid), plan(scene, *entries), SMALL)


def test_cancellation(scene):
    class StoppedError(Exception):
        pass

    def stop(share):
        if share > 0.1:
            raise StoppedError

    with pytest.raises(StoppedError):
        find_worst_machine(scene, load_plan("iso_5_axes_bc", scene), SMALL, stop)


def test_progress_ascends(scene):
    shares = []
    find_worst_machine(scene, load_plan("iso_5_axes_bc", scene)[:3], SMALL, shares.append)
    ascending = np.maximum.accumulate(shares)
    assert ascending[-1] <= 1.0
    assert np.unique(ascending).size > 3


def test_factor_of_the_limits(scene):
    """One squareness alone: the largest |E| is in proportion to the limit of a circle."""
    tolerances = ToleranceSet(
        {"translation": 0.0, "rotation": 0.0, "squareness": 0.0}, {"EC0Y": Tolerance(0.0, 500.0)}
    )
    one = replace(scene, tolerances=tolerances)
    tests = plan(scene, entry(test="circular", limit_um=8))
    bound = find_worst_machine(one, tests, SMALL).bound_um[0]
    kept = find_worst_machine(one, tests, replace(SMALL, keep_um=bound / 4.0))
    assert kept.factor == pytest.approx(0.25, abs=0.01)
    assert kept.as_json()["factor"] == kept.factor
    assert find_worst_machine(one, tests, replace(SMALL, keep_um=4.0 * bound)).factor == 1.0
    blind = plan(scene, entry(test="positioning", axis="Z", limit_um=8))
    assert find_worst_machine(one, blind, replace(SMALL, keep_um=1.0)).factor is None


def test_next_test_of_a_squareness(scene):
    """A circle in XY finds EC0Y, which the circle of the plan does not."""
    tolerances = ToleranceSet(
        {"translation": 0.0, "rotation": 0.0, "squareness": 0.0}, {"EC0Y": Tolerance(0.0, 500.0)}
    )
    one = replace(scene, tolerances=tolerances)
    tests = plan(scene, entry(test="circular", plane="YZ", limit_um=8, minutes=15))
    result = find_worst_machine(one, tests, replace(SMALL, next_count=1))
    (step,) = result.next
    assert step.options["plane"] == "XY"
    assert step.minutes == 15.0
    assert step.bound_um < result.bound_um[0] / 2.0
    assert result.as_json()["next"][0]["bound_um"] == step.bound_um
    untimed = plan(scene, entry(test="circular", plane="YZ", limit_um=8))
    with pytest.raises(OptionError, match="expected minutes"):
        find_worst_machine(one, untimed, replace(SMALL, next_count=1))


def test_worst_machine_is_written_as_the_scene_proposed(scene):
    result = Acceptance(knots=2, plan="iso_3_axes").run(scene, ignore_progress)
    (change,) = result.changes()
    assert change.scene is result.machine
    assert result.as_json().keys() >= {
        "bound_um", "at", "direction", "without_tests_um", "tests", "errors",
    }  # fmt: skip
    assert "next" not in result.as_json()


def test_cone_bound_covers_random_vectors():
    """For vectors within the heights, no larger length in the cone than the bound; it is tight."""
    rng = np.random.default_rng(2)
    triangles = icosahedron()
    assert len(triangles) == 20
    for _ in range(50):
        corners = triangles[rng.integers(20)]
        heights = rng.uniform(0.2, 1.0, 3)
        bound = cone_bound(corners, heights)
        shares = rng.dirichlet(np.ones(3), 4000)
        units = shares @ corners
        units /= np.linalg.norm(units, axis=1, keepdims=True)
        longest = (heights / np.maximum(units @ corners.T, 1e-12)).min(axis=1)
        linear = units @ np.linalg.solve(corners, heights)
        assert longest.max() <= bound * (1.0 + 1e-12)
        assert linear.max() == pytest.approx(bound, rel=0.01)


def test_the_function_of_the_package_can_be_called_again():
    scene = warpspace.load_scene("machine_c_frame_mill")
    bounds = [warpspace.acceptance(scene, knots=2).bound_um for _ in range(2)]
    assert bounds[0] == bounds[1]
