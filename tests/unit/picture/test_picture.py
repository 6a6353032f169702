"""One picture in numbers: sizes, words of conventions, axis motion, concepts."""

from dataclasses import replace

import numpy as np
import pytest

from still_scenes import still_scene
from warpspace.analysis.commands.concepts import Concepts, compare_concepts
from warpspace.field.evaluate import evaluate_exact
from warpspace.outputs.figures.side_by_side import picture_concept
from warpspace.picture.formatting import convention_sentences, convention_words
from warpspace.picture.model import evaluate_picture
from warpspace.picture.traces import (
    evaluate_axis_motion,
    evaluate_traces,
    is_moved,
    name_trace,
    trace_lines,
)
from warpspace.scene.library import load_scene, parse_scene

TOOL_SIDE = """
machine.chain = "wFXYZACt"
workspace = { X = [0, 300], Y = [0, 200], Z = [0, 100] }
[points_mm]
traces = [[120, 40, -60]]
[errors]
EXC = { harmonics = [[3, 6.0, 20.0]] }
EAC = 12
EBA = { harmonics = [[1, 9.0, 0.0]] }
EC0A = 25
"""


def lines_of(scene):
    return {name_trace(line.trace): line for line in trace_lines(evaluate_traces(scene, 1.0))}


@pytest.mark.parametrize(
    "scene",
    [load_scene("teach_wobbling_table"), load_scene("teach_tilted_c"), parse_scene(TOOL_SIDE, "t")],
    ids=lambda scene: scene.name,
)
def test_first_order_is_the_exact_model_within_its_second_order(scene):
    for name, line in lines_of(scene).items():
        assert is_moved(line)
        first = evaluate_axis_motion(scene, line)
        exact = evaluate_axis_motion(scene, line, evaluate_exact)
        for one, other in zip(first.motions, exact.motions, strict=True):
            np.testing.assert_allclose(one.values, other.values, atol=5e-3, err_msg=name)
            assert one.motion_value == pytest.approx(other.motion_value, abs=0.01)


def test_wobbling_table_tilts_once_and_runs_out_twice_a_turn():
    scene = load_scene("teach_wobbling_table")
    motion = evaluate_axis_motion(scene, lines_of(scene)["C at B 0°, point (275, 0, 0) mm"])
    assert motion.radius_mm == pytest.approx(275.0)
    theta = np.deg2rad(motion.angle_deg)
    # the point lies on x of the table: EXC is radial, EZC axial, EBC tilts x-z
    assert motion.radial.values == pytest.approx(4.0 * np.cos(2.0 * theta), abs=1e-9)
    assert motion.axial.values == pytest.approx(3.0 * np.cos(theta - np.pi / 4.0), abs=1e-9)
    assert motion.tilt.values == pytest.approx(15.0 * np.sin(theta), abs=1e-9)
    assert (motion.radial.times_a_turn, motion.tilt.times_a_turn) == (2, 1)
    assert motion.radial.motion_value == pytest.approx(8.0)
    # from one point, a tilt once a turn is that of the axis average line
    assert motion.tilt.peak_to_valley == pytest.approx(30.0)
    assert motion.tilt.motion_value == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("error", "displaced_um", "inclined_urad"),
    # by hand: an inclination of 20 µrad displaces the centre of a circle 450 mm up by 9 µm
    [("EX0C = 6", 6.0, 0.0), ("EY0C = -4", 4.0, 0.0), ("EA0C = 20", 9.0, 20.0), ("EZC = 5", 0, 0)],
)
def test_location_errors_displace_and_incline_the_axis(error, displaced_um, inclined_urad):
    scene = parse_scene(
        '[machine]\nchain="wCFt"\n[machine.travel]\nC=[0, 360]\n[workspace]\nC=0\n[points_mm]\n'
        f"traces=[[275,0,450]]\n[errors]\n{error}\n",
        "table",
    )
    (line,) = lines_of(scene).values()
    motion = evaluate_axis_motion(scene, line)
    found = motion.radial.once_a_turn, motion.tilt.once_a_turn
    assert found == pytest.approx((displaced_um, inclined_urad), abs=1e-9)
    assert [one.motion_value for one in motion.motions] == pytest.approx([0.0] * 3, abs=1e-9)


def test_point_on_the_axis_has_no_motion():
    scene = parse_scene(
        '[machine]\nchain="wCFt"\n[workspace]\nC=0\n[points_mm]\ntraces=[[0,0,50]]\n'
        "[errors]\nEXC=5\n",
        "on",
    )
    (line,) = lines_of(scene).values()
    assert name_trace(line.trace) == "C, point (0, 0, 50) mm"
    assert evaluate_axis_motion(scene, line) is None


MIXED = 'machine = "dvf5000"\nconvention.component_errors = { rotary = "before_motion" }\n'


def test_all_conventions_are_named_with_their_axes():
    scene = parse_scene(MIXED, "mixed")
    expected = "component errors after the motion of X Y Z, before the motion of B C"
    assert convention_words(scene) == expected
    first, second = convention_sentences(scene)
    assert first.startswith("Component errors of X, Y, Z ")
    assert second.startswith("Component errors of B, C ")
    assert "(before the motion)" in second
    picture = evaluate_picture(scene, grid=3)
    assert picture.settings["component_errors"]["B"] == "before_motion"
    assert picture.settings["component_errors"]["X"] == "after_motion"
    assert "B=before_motion" in picture.remarks["component_errors"]
    # one convention is named once, whoever it is of
    one = load_scene("dvf5000_first")
    assert convention_words(one) == "component errors after the motion"
    assert len(convention_sentences(one)) == 1
    picture = evaluate_picture(one, grid=3)
    assert picture.settings["component_errors"] == "after_motion"
    assert picture.size_mm == picture.grid.longest_edge_mm == 550.0
    axes = tuple((axis, "before_motion") for axis in scene.machine.axes)
    own = replace(scene, model=replace(scene.model, own_component_errors=axes))
    assert convention_words(own) == "component errors before the motion"


@pytest.mark.parametrize(
    ("name", "size_mm"),
    [
        *[(name, 500.0) for name in ("wFXt", "wFt, one still axis", "nothing moves")],
        *[("only Y moves", 300.0), ("wCFt, traces", 2.0 * np.hypot(200.0, 50.0)), ("wCFt", 100.0)],
    ],
)
def test_size_of_a_line_and_of_a_point(name, size_mm):
    picture = evaluate_picture(still_scene(name), grid=3)
    assert picture.size_mm == pytest.approx(size_mm)
    # drawn displaced by about a tenth of it
    drawn_mm = picture.exaggeration * picture.statistics.max_um * 1e-3
    assert name.startswith("wCFt") or 0.05 * size_mm < drawn_mm < 0.2 * size_mm  # no errors


def test_its_statistics_are_of_what_it_colours():
    (concept,) = compare_concepts([load_scene("dvf5000_first")], Concepts(samples=200))
    picture = picture_concept(concept, 5)
    found, values = picture.statistics, picture.values
    assert found.max_um == pytest.approx(values.max())
    assert found.max_um > 0.0
    assert found.mean_um == pytest.approx(float(np.sum(picture.grid.weights * values)))
    worst = np.unravel_index(int(np.argmax(values)), values.shape)
    assert found.max_at_mm == pytest.approx(tuple(picture.grid.nominal_mm[worst]))
