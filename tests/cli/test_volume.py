"""Numbers of the volume through the command line: the same for coarse and fine grids."""

import json

import pytest


def test_a_placed_part_is_asked_for_in_the_relative_loop(warpspace):
    scene = ("dvf5000_second", "--placed")
    lying = json.loads(warpspace("field", "dvf5000_second", "--loop", "relative", "--json").out)
    placed = json.loads(warpspace("field", *scene, "--json").out)
    assert placed["statistics"]["rms_um"] == pytest.approx(2.750, abs=0.001)
    assert lying["statistics"]["rms_um"] == pytest.approx(14.841, abs=0.001)
    node = placed["points"][-1]
    at = ",".join(f"{axis}={place}" for axis, place in node["axes"].items())
    (same,) = json.loads(warpspace("field", *scene, "--at", at, "--json").out)["points"]
    assert same["error_um"] == pytest.approx(node["error_um"], abs=1e-9)
    compared = json.loads(warpspace("compare", "dvf5000_nominal", *scene, "--json").out)
    assert compared["b"]["rms_um"] == pytest.approx(placed["statistics"]["rms_um"])
    repair = json.loads(warpspace("repair", *scene, "--count", 1, "--json").out)
    assert repair["before"]["rms_um"] == pytest.approx(placed["statistics"]["rms_um"])
    out = " ".join(warpspace("field", *scene, "--grid", 3).out.split())
    assert "relative loop · placement of the workpiece fitted out" in out


def test_the_worst_point_is_printed_as_an_argument_that_gives_it_back(warpspace):
    out = warpspace("field", "dvf5000_first", "--grid", 5).out
    assert "max at axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51 mm" in out
    argument = next(line for line in out.splitlines() if "--at" in line).split()
    found = json.loads(warpspace("field", "dvf5000_first", *argument, "--json").out)
    assert found["statistics"]["max_um"] == pytest.approx(51.72, abs=0.01)
    assert found["statistics"]["max_at_axes"] == {"X": 275, "Y": -225, "Z": -480, "B": 0, "C": 0}


@pytest.mark.parametrize("command", ["field", "gains"])
def test_positions_outside_the_travel_are_warned_of(warpspace, command):
    result = warpspace(command, "dvf5000_first", "--at", "X=900", "--json")
    assert result.status == 0
    assert "--at X=900 is outside the travel of X, -275 to 275 mm" in result.err
    assert warpspace(command, "dvf5000_first", "--at", "X=275", "--json").err == ""


def test_long_tables_repeat_their_headings(capsys):
    from warpspace.analysis.blocks import Column
    from warpspace.cli.tables import print_table

    print_table([Column("key"), Column("value", unit="µm")], [(str(n), "1") for n in range(85)])
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.split() == ["key", "[µm]"] for line in lines) == 3
