"""Errors by direction of travel: what each format holds of them, and what it says it does not."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.formats.compensation.compensate import Compensation, Plan, compensate
from warpspace.formats.importing import read_errors
from warpspace.formats.kind import ReadOptions
from warpspace.formats.registry import formats
from warpspace.formats.source import source_of_text
from warpspace.formats.terms import Line, Product
from warpspace.formats.to_scene import into_scene
from warpspace.machine.curves.directional import Directional
from warpspace.machine.errors import ErrorSet
from warpspace.machine.travel import TravelDirection
from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import evaluate

NODES = 9
POSITIONING = "EXX = { forward = { poly = [4, 0.01] }, backward = { poly = [-4, 0.01] } }"
ROLL = "EAY = { forward = { ramp = 30 }, backward = { ramp = 10 } }\nEYY = { ramp = 6 }\nEC0Y = 20"
SURFACES = (
    'EXY = { forward = { table2 = { axes = ["Y", "Z"], Y = [-225, 100, 225], Z = [-480, -80],'
    ' values = [[0, 1], [2, 5.5], [-1, 3]] } }, backward = { table2 = { axes = ["Y", "Z"],'
    " Y = [-225, 225], Z = [-480, -200, -80], values = [[0, 2, 1], [4, 2.25, 5]] } } }"
)
WRITTEN = {one.name: one for one in formats() if one.can_write}
BOTH_HELD = {"csv", "sinumerik-cec"}
"""Formats that hold directions of all errors."""
ONE_HELD = BOTH_HELD | {"linuxcnc-comp", "heidenhain"}
"""Formats that hold that of a positioning error alone."""


def scene_with(errors: str) -> Scene:
    """Give a scene of errors."""
    return parse_scene(
        'machine = "dvf5000"\n[workspace]\nX = [-275, 275]\nY = [-225, 225]\nZ = [-480, -80]\n'
        f"[errors]\n{errors}\n",
        "scene",
    )


def plan(name: str) -> Plan:
    """Ask for a small table."""
    return Plan(name, 5 if not WRITTEN[name].grid.startswith("none") else None)


def read_back(found: Compensation, scene: Scene) -> Scene:
    """Import what was written."""
    sources = [
        source_of_text(text, f"compensation{add or found.format.endings[0]}")
        for add, text in found.files.items()
    ]
    reading = read_errors(sources, ReadOptions(scene.machine))
    return into_scene(reading, replace(scene, errors=ErrorSet()), "", "written").scene


def looking(scene: Scene, direction: str) -> Scene:
    """Give a scene that looks at a direction of travel."""
    return replace(scene, model=replace(scene.model, direction=direction))


@pytest.mark.parametrize("errors", [POSITIONING, ROLL])
@pytest.mark.parametrize("name", WRITTEN)
def test_every_format_holds_the_directions_or_says_that_it_does_not(name: str, errors: str) -> None:
    found = compensate(scene_with(errors), plan(name), NODES)
    there, back = found.directions["forward"], found.directions["backward"]
    reversal = [
        float(np.linalg.norm(one.error_um - other.error_um, axis=-1).max())
        for one, other in ((there.before, back.before), (there.after, back.after))
    ]
    assert reversal[0] > 5.0
    said = [note for note in found.notes if note.startswith("direction of travel is not held")]
    if name in (ONE_HELD if errors == POSITIONING else BOTH_HELD):
        assert reversal[1] < 0.3
        assert not said
        assert there.after_statistics.rms_um < 0.1 * there.before_statistics.rms_um
    else:
        assert reversal[1] > 0.5 * reversal[0]
        (note,) = said
        for fragment in ("EXX" if errors == POSITIONING else "EAY", f"{reversal[1]:.3g} µm after"):
            assert fragment in note
    # the mean of both ways is what a scene looks at that says nothing
    mean = (there.before.error_um + back.before.error_um) / 2.0
    assert found.before.error_um == pytest.approx(mean, abs=1e-3)


@pytest.mark.parametrize("name", ["sinumerik-cec", "csv"])
def test_what_is_before_and_after_is_that_of_the_direction_looked_at(name: str) -> None:
    scene = scene_with(f"{POSITIONING}\n{ROLL}")
    files = None
    for way in ("mean", "forward", "backward", "difference"):
        found = compensate(looking(scene, way), plan(name), NODES)
        files = files or found.files
        assert found.files == files, way
        assert found.after_statistics.max_um < 0.02, way
        if way in found.directions:
            assert found.before_statistics == found.directions[way].before_statistics


@pytest.mark.parametrize("name", ["sinumerik-enc", "iso-text", "isg-csv", "fanuc-3d"])
def test_one_value_for_both_directions_is_that_of_the_scene(name: str) -> None:
    scene = scene_with(POSITIONING)
    for way in ("mean", "forward", "backward"):
        found = compensate(looking(scene, way), plan(name), NODES)
        assert found.after_statistics.max_um < 0.9, way
        other = "forward" if way == "backward" else "backward"
        assert found.directions[other].after_statistics.rms_um > 3.0


def test_cross_tables_of_one_direction_come_back_as_errors_by_direction() -> None:
    scene = scene_with(POSITIONING)
    found = compensate(scene, plan("sinumerik-cec"), NODES)
    text = found.files[""]
    assert "$AN_CEC_DIRECTION[0]=1\n" in text
    assert "$AN_CEC_DIRECTION[1]=-1\n" in text
    curve = read_back(found, scene).errors.functions["EXX"]
    assert isinstance(curve, Directional)
    assert curve.forward.evaluate(np.array([0.0, 100.0])) == pytest.approx([4.0, 5.0], abs=1e-3)
    assert curve.backward.evaluate(np.array([0.0, 100.0])) == pytest.approx([-4.0, -3.0], abs=1e-3)
    roll = scene_with(ROLL)
    back = read_back(compensate(roll, plan("sinumerik-cec"), NODES), roll)
    for way in ("forward", "backward"):
        there, here = (evaluate(looking(one, way), grid=5).error_um for one in (roll, back))
        assert np.abs(there - here).max() < 0.02


def test_backlash_is_written_where_a_table_corrects_one_axis() -> None:
    scene = scene_with(POSITIONING)
    found = compensate(scene, plan("heidenhain"), NODES)
    head = found.files["_X.COM"].splitlines()[1]
    assert head.split() == ["NR", "AXISPOS", "BACKLASH", "X"]
    assert "BACKLASH" not in found.files["_Y.COM"]
    curve = read_back(found, scene).errors.functions["EXX"]
    assert isinstance(curve, Directional)
    assert curve.forward.evaluate(np.array(0.0)) == pytest.approx(4.0, abs=0.06)
    assert curve.backward.evaluate(np.array(0.0)) == pytest.approx(-4.0, abs=0.06)
    both = compensate(scene_with(f"{POSITIONING}\nEYX = {{ ramp = 5 }}"), plan("heidenhain"), NODES)
    assert "BACKLASH" not in both.files["_X.COM"]
    assert any("direction of travel" in note for note in both.notes)


def test_directions_are_kept_in_the_own_table_and_by_linuxcnc() -> None:
    scene = scene_with("EXX = { forward = { poly = [2, 0.01] }, backward = { poly = [-1, 0.01] } }")
    back = read_back(compensate(scene, Plan("csv", 3), NODES), scene)
    assert isinstance(back.errors.functions["EXX"], Directional)
    found = compensate(scene, Plan("linuxcnc-comp", 3), NODES)
    curve = read_back(found, scene).errors.functions["EXX"]
    assert isinstance(curve, Directional)
    assert curve.forward.evaluate(np.array(0.0)) == pytest.approx(2.0, abs=1e-3)
    assert curve.backward.evaluate(np.array(0.0)) == pytest.approx(-1.0, abs=1e-3)
    for way in ("forward", "backward", "mean"):
        left = compensate(looking(scene, way), Plan("linuxcnc-comp", 3), NODES)
        assert left.after_statistics.max_um < 0.002, way


def test_surfaces_by_direction_stand_in_the_own_table_to_the_printed_digits() -> None:
    scene = scene_with(SURFACES)
    found = compensate(scene, Plan("csv", 3), NODES)
    assert "Y [mm],Z [mm],direction,EXY [um]\n-225.0,-480.0,+,0.0\n" in found.files[""]
    back = read_back(found, scene)
    at = np.meshgrid(np.linspace(-225, 225, 31), np.linspace(-480, -80, 29), indexing="ij")
    coordinates = dict(zip("YZ", at, strict=True))
    for way in TravelDirection:
        there, here = (one.errors.evaluate_at("EXY", coordinates, way) for one in (scene, back))
        assert here == pytest.approx(there, abs=1e-6), way
    assert found.after_statistics.max_um < 1e-3
    isg = compensate(scene, Plan("isg-csv", 3), NODES)
    assert any("direction of travel is not held" in note for note in isg.notes)
    assert isg.after_statistics.max_um < 1e-3


def test_a_product_of_tables_in_one_direction_is_half_in_the_mean() -> None:
    first = Line("Y", "X", (0.0, 1.0), (2.0, 2.0), direction=1)
    second = Line("Z", "X", (0.0, 1.0), (3.0, 3.0))
    at = {"Y": np.array(0.5), "Z": np.array(0.5)}
    values = [float(Product(first, second).corrections(at, way)["X"]) for way in (1, -1, 0)]
    assert values == [6.0, 0.0, 3.0]
    twice = Product(first, replace(second, direction=1))
    assert float(twice.corrections(at, 0)["X"]) == 3.0
