"""Numbers of the volume through the command line: the same for coarse and fine grids."""

import json

import pytest


@pytest.mark.parametrize("scene", ["dvf5000_first", "dvf5000_second"])
def test_11_and_31_nodes_agree_within_half_a_per_cent(warpspace, scene: str) -> None:
    coarse, fine = (
        json.loads(warpspace("field", scene, "--grid", nodes, "--json").out)["statistics"]
        for nodes in (11, 31)
    )
    for key in ("mean_um", "rms_um", "p95_um", "max_um"):
        assert coarse[key] == pytest.approx(fine[key], rel=0.005)


def test_the_worst_point_is_printed_as_an_argument_that_gives_it_back(warpspace) -> None:
    out = warpspace("field", "dvf5000_first", "--grid", 5).out
    assert "max at axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51 mm" in out
    argument = next(line for line in out.splitlines() if "--at" in line).split()
    found = json.loads(warpspace("field", "dvf5000_first", *argument, "--json").out)
    assert found["statistics"]["max_um"] == pytest.approx(51.72, abs=0.01)
    assert found["statistics"]["max_at_axes"] == {"X": 275, "Y": -225, "Z": -480, "B": 0, "C": 0}


@pytest.mark.parametrize("command", ["field", "gains"])
def test_positions_outside_the_travel_are_warned_of(warpspace, command: str) -> None:
    result = warpspace(command, "dvf5000_first", "--at", "X=900", "--json")
    assert result.status == 0
    assert "--at X=900 is outside the travel of X, -275 to 275 mm" in result.err
    assert warpspace(command, "dvf5000_first", "--at", "X=275", "--json").err == ""


def test_measured_says_within_and_outside(warpspace) -> None:
    out = warpspace("measured", "dvf5000_second", "--tolerances", "dvf5000_proposed").out
    assert "within" in out
    assert "mean of the nodes 14.58 µm" in " ".join(out.split())


def test_long_tables_repeat_their_headings(capsys) -> None:
    from warpspace.cli.tables import Column, print_table

    print_table([Column("key"), Column("value", "µm")], [(str(n), "1") for n in range(85)])
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.split() == ["key", "[µm]"] for line in lines) == 3
