"""The result of a diagnosis: probabilities, elements, remedies, checks."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import warpspace
from warpspace import load_scene
from warpspace.bench.base import find_test
from warpspace.bench.plan import simulate
from warpspace.cli.analyses import command_of
from warpspace.diagnosis.causes import CauseSet
from warpspace.diagnosis.diagnose import Diagnose, Explanations, load_remedies
from warpspace.exceptions import OptionError
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.resources import assets_dir
from warpspace.scene.library import scene_names

OVAL = "circle of 100 mm oval by 60 µm at 45°, same in both directions"


@pytest.fixture(scope="module")
def scene():
    return load_scene("machine_gantry_mill")


@pytest.fixture(scope="module")
def xy(scene, tmp_path_factory):
    """A circular test on a machine whose X and Y are 150 µrad out of square."""
    test = find_test("circular")(plane="XY", radius_mm=150.0, points=36)
    errors = ErrorSet({"EC0Y": Constant((0.0, 1.0), 150.0)})
    plan = test.plan(scene)
    radial = simulate(replace(scene, errors=errors), plan)
    radial += np.random.default_rng(1).normal(0.0, 1.0, len(radial))
    rows = ["direction,angle_deg,radial_um"]
    for sense, angle, value in zip(
        plan.marks["sense"], plan.marks["angle_deg"], radial, strict=True
    ):
        rows.append(f"{'+' if sense > 0 else '-'},{angle:g},{value:.4f}")
    path = tmp_path_factory.mktemp("readings") / "xy.csv"
    path.write_text("\n".join(rows), "utf-8")
    return str(path)


def run(scene, **options):
    return Diagnose(**options).run(scene, lambda _: None)


def test_a_squareness_is_named_with_joint_effect_and_check(scene, xy):
    result = run(scene, data=(xy,), kinds=("circular:plane=XY:radius=150",))
    first = result.causes[0]
    assert first.causes == ("EC0Y",)
    assert share(result, "EC0Y") > 0.95
    assert first.element == "joint of Y and X: squareness of Y to X"
    assert first.effect.startswith("up to ")
    assert first.confirm.information_bits >= 0.0
    assert first.confirm.minutes > 0.0
    assert [*result.next] == sorted(result.next, key=lambda t: -t.information_bits / t.minutes)


def share(result, name):
    groups = ((entry.probability, (entry.causes, *entry.group)) for entry in result.causes)
    return sum(share for share, group in groups if any(name in causes for causes in group))


def test_a_symptom_and_readings_are_one_diagnosis(scene, xy):
    """A circle in XY does not see Z; a symptom does."""
    options = {"data": (xy,), "kinds": ("circular:plane=XY:radius=150",)}
    alone = run(scene, **options)
    joined = run(scene, **options, symptoms=("step of 60 µm where Z reverses",))
    pair = {"EC0Y", "reversal of Z"}
    assert not any({*entry.causes} == pair for entry in alone.causes)
    assert {*max(joined.causes, key=lambda entry: entry.probability).causes} == pair


def test_probabilities_sum_to_one_in_json(scene):
    document = run(scene, symptoms=(OVAL,)).as_json()
    assert [*document] == ["causes", "not_geometric", "within_tolerance", "next"]
    total = sum(entry["probability"] for entry in document["causes"])
    total += document["not_geometric"] + document["within_tolerance"]
    assert total == pytest.approx(1.0, abs=1e-9)
    keys = ["causes", "probability", "group", "element", "effect", "confirm", "remedy"]
    assert all([*entry] == keys for entry in document["causes"])
    steps = ["test", "options", "information_bits", "minutes"]
    assert all([*step] == steps for step in document["next"])
    names = [name for e in document["causes"] for c in (e["causes"], *e["group"]) for name in c]
    count = len(CauseSet(scene).causes)
    assert len(set(names)) == count
    assert len(names) == count + count * (count - 1)


def test_readings_without_information_are_said_to_reveal_nothing():
    """A symptom of a tenth of the tolerance, and one with many causes."""
    scene = load_scene("machine_gantry_mill")
    result = run(scene, symptoms=("step of 1 µm where Y reverses",))
    assert any("reveal no cause" in caveat for caveat in result.caveats())
    result = run(scene, symptoms=(OVAL.replace("same", "opposite"),))
    assert any("do not separate 4 causes" in caveat for caveat in result.caveats())
    alike = {"reversal of X", "reversal of Y", "servo mismatch of X", "servo mismatch of Y"}
    assert {*result.causes[0].causes, *result.causes[0].single_causes} == alike


def test_a_taper_that_no_cause_makes_is_not_geometric():
    """wFXYZt: Y rides on X, so that the distance of two flanks along Y cannot change with X."""
    result = run(load_scene("dvf5000_first"), symptoms=("taper 0.1 on 300 along X across Y",))
    assert result.not_geometric > 0.9


def test_every_cause_of_every_machine_has_an_element_and_a_remedy():
    count = 0
    for name in scene_names():
        scene = load_scene(name)
        if scene.tolerances.missing(scene.parameter_keys):
            continue
        causes = CauseSet(scene)
        explanations = Explanations(causes, None, None, ())
        for cause in causes.causes:
            element, remedy = explanations._find_remedy(cause.name)
            assert "{" not in element
            assert remedy.endswith(")")
            count += 1
    assert count > 500


def test_remedies_have_text_and_source():
    rows = tomllib.loads((assets_dir() / "remedies.toml").read_text("utf-8"))
    assert rows.keys() == load_remedies().keys()
    for row in rows.values():
        assert {*row} == {"element", "remedy", "source"}
        assert row["remedy"].endswith(".")
        assert "ISO" in row["source"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"kinds": ("a", "b"), "symptoms": (OVAL,)},
            "2 values of kinds for 0 files; expected 1 or 0",
        ),
        ({"symptoms": (OVAL,) * 13}, "13 values of symptoms; expected at most 12"),
        ({"noise_um": 0.0}, "noise_um"),
    ],
)
def test_options_that_do_not_fit_are_refused(scene, options, message):
    with pytest.raises(OptionError, match=message):
        run(scene, **options)


def test_the_command_is_the_function(scene, xy):
    arguments = ["machine_gantry_mill", "--data", xy, "--kind", "circular:plane=XY:radius=150"]
    said = CliRunner().invoke(command_of(Diagnose), [*arguments, "--json"])
    assert said.exit_code == 0, said.output
    result = warpspace.diagnose(scene, data=(xy,), kinds=("circular:plane=XY:radius=150",))
    assert json.loads(said.stdout) == result.as_json()
