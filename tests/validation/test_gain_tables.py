"""Gains as printed in tables 4-3 (page 50) and 4-4 (page 54) of the thesis: 88 numbers."""

import pytest

import warpspace

HALF_DIGIT = 0.005 + 1e-9

# Typed from the print: |E|, x, y, z in µm/µrad.
TABLE_4_3 = """
EAX  1.05 0    0.47 0.94
EBX  0.49 0.47 0    0.14
ECX  0.95 0.94 0.14 0
EAY  1.26 0    0.66 1.07
EBY  0.66 0.66 0    0.07
ECY  1.08 1.07 0.07 0
EAZ  0.99 0    0.96 0.24
EBZ  0.96 0.96 0    0
ECZ  0.24 0.24 0    0
EC0Y 1.3  1.3  0.07 0
EA0Z 1.46 0    1.44 0.24
EB0Z 1.44 1.44 0    0
"""
TABLE_4_4 = """
EAB  0.49 0.27 0.4  0.27
EBB  0.49 0.48 0    0.48
ECB  0.27 0.27 0.27 0.27
EAC  0.53 0.53 0.45 0.53
EBC  0.45 0.45 0.45 0.45
ECC  0.27 0.27 0.27 0.27
EA0B 0.49 0    0.48 0.27
EC0B 0.49 0.27 0.48 0
EA0C 0.53 0.27 0.45 0.27
EB0C 0.53 0.53 0    0.53
"""


def cases(table, where):
    rows = [line.split() for line in table.strip().splitlines()]
    return [
        pytest.param(key, column, float(value), id=f"{where}-{key}-{column}")
        for key, *values in rows
        for column, value in zip(("norm", "x", "y", "z"), values, strict=True)
    ]


@pytest.fixture(scope="module")
def tool_gains():
    scene = warpspace.load_scene("dvf5000_nominal")
    return {gain.key: gain for gain in warpspace.gains(scene, at={"Y": -225, "Z": -480})}


@pytest.fixture(scope="module")
def workpiece_gains():
    scene = warpspace.load_scene("dvf5000_nominal")
    found = warpspace.gains(scene, loop="workpiece", over_travel=True, step_deg=10)
    return {gain.key: gain for gain in found}


@pytest.mark.parametrize(("key", "column", "printed"), cases(TABLE_4_3, "table_4_3_page_50"))
def test_gain_of_the_tool_loop(tool_gains, key, column, printed):
    assert abs(getattr(tool_gains[key], column)) == pytest.approx(printed, abs=HALF_DIGIT)


@pytest.mark.parametrize(("key", "column", "printed"), cases(TABLE_4_4, "table_4_4_page_54"))
def test_gain_of_the_workpiece_loop(workpiece_gains, key, column, printed):
    assert getattr(workpiece_gains[key], column) == pytest.approx(printed, abs=HALF_DIGIT)


def test_figure_4_3_page_51_largest_gains_in_the_order_of_the_text(tool_gains):
    turning = [key for key, gain in tool_gains.items() if gain.parameter.is_rotation]
    assert turning[:6] == ["EA0Z", "EB0Z", "EC0Y", "EAY", "ECY", "EAX"]


def test_the_lever_of_the_1_44_is_810_and_150_and_480_mm(tool_gains):
    gain = tool_gains["EA0Z"]
    heights = {name: vector[2] for name, vector in gain.lever_parts_mm}
    assert heights == {"Z motion": -480.0, "S": -810.0, "t": -150.0}
    assert gain.y == pytest.approx(1.44)


def test_the_exact_maximum_is_above_what_steps_of_10_degrees_find(workpiece_gains):
    scene = warpspace.load_scene("dvf5000_nominal")
    fine = {g.key: g for g in warpspace.gains(scene, loop="workpiece", over_travel=True)}
    exact = (400.0**2 + 275.0**2) ** 0.5 / 1000.0
    assert workpiece_gains["EBB"].x == pytest.approx(0.4839, abs=5e-5)
    assert fine["EBB"].x == pytest.approx(exact, abs=4e-5 * exact)
    assert fine["EBB"].x <= exact + 1e-12
