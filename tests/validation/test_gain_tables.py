"""What the thesis says of its tables 4-3 and 4-4, whose numbers are in `test_thesis_rows.py`."""

import pytest

import warpspace


@pytest.fixture(scope="module")
def tool_gains():
    scene = warpspace.load_scene("dvf5000_nominal")
    return {gain.key: gain for gain in warpspace.gains(scene, at={"Y": -225, "Z": -480})}


def test_figure_4_3_page_51_largest_gains_in_the_order_of_the_text(tool_gains):
    turning = [key for key, gain in tool_gains.items() if gain.parameter.is_rotation]
    assert turning[:6] == ["EA0Z", "EB0Z", "EC0Y", "EAY", "ECY", "EAX"]


def test_the_lever_of_the_1_44_is_810_and_150_and_480_mm(tool_gains):
    gain = tool_gains["EA0Z"]
    heights = {name: vector[2] for name, vector in gain.lever_parts_mm}
    assert heights == {"Z motion": -480.0, "S": -810.0, "t": -150.0}
    assert gain.y == pytest.approx(1.44)


def test_the_exact_maximum_is_above_what_steps_of_10_degrees_find():
    scene = warpspace.load_scene("dvf5000_nominal")
    coarse, fine = (
        {gain.key: gain for gain in warpspace.gains(scene, loop="workpiece", **search)}["EBB"].x
        for search in ({"over_travel": True, "step_deg": 10}, {"over_travel": True})
    )
    exact = (400.0**2 + 275.0**2) ** 0.5 / 1000.0
    assert coarse == pytest.approx(0.4839, abs=5e-5)
    assert fine == pytest.approx(exact, abs=4e-5 * exact)
    assert fine <= exact + 1e-12
