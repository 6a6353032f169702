"""Error motions of axes: first order against the exact chain, and what scenes say of themselves."""

import numpy as np
import pytest

from warpspace.field.evaluate import evaluate_exact
from warpspace.picture.axis_motion import evaluate_axis_motion, is_moved, name_trace
from warpspace.picture.traces import TraceLine, evaluate_traces, trace_lines
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import Scene

TOOL_SIDE = """
[machine]
chain = "wFXYZACt"
[workspace]
X = [0, 300]
Y = [0, 200]
Z = [0, 100]
[points_mm]
traces = [[120, 40, -60]]
[errors]
EXC = { harmonics = [[3, 6.0, 20.0]] }
EAC = 12
EBA = { harmonics = [[1, 9.0, 0.0]] }
EC0A = 25
"""


def lines_of(scene: Scene) -> dict[str, TraceLine]:
    return {name_trace(line.trace): line for line in trace_lines(evaluate_traces(scene, 1.0))}


@pytest.mark.parametrize(
    "scene",
    [load_scene("teach_wobbling_table"), load_scene("teach_tilted_c"), parse_scene(TOOL_SIDE, "t")],
    ids=lambda scene: scene.name,
)
def test_first_order_is_the_exact_model_within_its_second_order(scene: Scene) -> None:
    for name, line in lines_of(scene).items():
        assert is_moved(line)
        first = evaluate_axis_motion(scene, line)
        exact = evaluate_axis_motion(scene, line, evaluate_exact)
        assert first is not None
        assert exact is not None
        for one, other in zip(first.motions, exact.motions, strict=True):
            np.testing.assert_allclose(one.values, other.values, atol=5e-3, err_msg=name)
            assert one.motion_value == pytest.approx(other.motion_value, abs=0.01)


def test_wobbling_table_tilts_once_and_runs_out_twice_a_turn() -> None:
    scene = load_scene("teach_wobbling_table")
    motion = evaluate_axis_motion(scene, lines_of(scene)["C at B 0°, point (275, 0, 0) mm"])
    assert motion is not None
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


def test_point_on_the_axis_has_no_motion() -> None:
    scene = parse_scene(
        '[machine]\nchain="wCFt"\n[workspace]\nC=0\n[points_mm]\ntraces=[[0,0,50]]\n'
        "[errors]\nEXC=5\n",
        "on",
    )
    (line,) = lines_of(scene).values()
    assert name_trace(line.trace) == "C, point (0, 0, 50) mm"
    assert evaluate_axis_motion(scene, line) is None
