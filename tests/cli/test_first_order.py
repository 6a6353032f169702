"""Every command whose numbers are of first order says when that is not enough, and by how much."""

import json

import pytest

from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate

SAID = "first order; the exact chain differs by up to"
GANTRY = """title = "Gantry, 3 mrad out of square"
machine = "dvf5000"
[workspace]
X = [-275, 275]
Y = [-225, 225]
Z = [-480, -80]
[errors]
EC0Y = 3000
EA0Z = 3000
[uncertainty]
EC0Y = 1
[tolerances]
default = { translation = 10, rotation = 3000, squareness = 3000 }
"""
QUICK = ("--samples", "2000")
COMMANDS = {
    "check": (),
    "field": ("--grid", "5"),
    "field at": ("--at", "X=275,Y=225,Z=-480"),
    "compare": ("dvf5000_first", "--grid", "5"),
    "repair": ("--grid", "5"),
    "measured": (),
    "ballbar": ("--plane", "XY", "--radius", "100"),
    "montecarlo": QUICK,
    "montecarlo uncertain": ("--from", "uncertainty", *QUICK),
    "sweep": ("--tolerance", "EC0Y=10,3000", *QUICK),
    "concepts": ("dvf5000_first", *QUICK),
    "allocate": ("--limit-um", "4000", *QUICK),
}
FILES = {"draw": ".svg", "export": ".csv"}


@pytest.fixture
def gantry(tmp_path):
    path = tmp_path / "gantry.toml"
    path.write_text(GANTRY, encoding="utf-8")
    return path


def exact_minus_first_um():
    scene = parse_scene(GANTRY, "gantry")
    both = (evaluate(scene, grid=5, exact=exact).error_um for exact in (False, True))
    return float(abs(next(both) - next(both)).max())


@pytest.mark.parametrize("name", COMMANDS)
def test_three_milliradians_are_said_with_the_number_in_the_json_object(warpspace, gantry, name):
    command = name.split(maxsplit=1)[0]
    loud = warpspace(command, gantry, *COMMANDS[name], "--json")
    assert loud.status == 0, loud.err
    assert loud.err.count(SAID) == 1
    found = json.loads(loud.out)["second_order_um"]
    assert found > 1.0
    if name in {"check", "field", "compare", "measured"}:
        assert exact_minus_first_um() <= found <= exact_minus_first_um() * 3**0.5


@pytest.mark.parametrize("command", ["draw", "export"])
def test_files_say_it_and_so_does_the_command(warpspace, gantry, tmp_path, command):
    target = tmp_path / f"out{FILES[command]}"
    result = warpspace(command, gantry, "-o", target, "--grid", "5")
    assert result.status == 0, result.err
    assert SAID in result.err
    assert SAID in target.read_text(encoding="utf-8")


def test_the_exact_field_says_nothing(warpspace, gantry):
    assert warpspace("field", gantry, "--exact", "--grid", "5").err == ""


def test_a_repair_is_verified_with_the_exact_chain(warpspace, gantry):
    wide = ("repair", gantry, "--limit", "9000", "--count", "1", "--grid", "5")
    (found,) = json.loads(warpspace(*wide, "--json").out)["repairs"]
    text = GANTRY
    for key, value in found["adjust"].items():
        text = text.replace(f"{key} = 3000\n", f"{key} = {value!r}\n", 1)
    target = gantry.with_name("repaired.toml")
    target.write_text(text, encoding="utf-8")
    exact = json.loads(warpspace("field", target, "--exact", "--grid", "5", "--json").out)
    for name, value in found["exact"].items():
        assert value == pytest.approx(exact["statistics"][name], rel=1e-9)
    assert abs(found["exact"]["rms_um"] - found["rms_um"]) > 0.01
    assert "by the exact chain (exact − first order): set 1: " in warpspace(*wide).out


def test_an_allocation_is_verified_with_the_exact_chain(warpspace, gantry):
    wide = ("allocate", gantry, "--limit-um", "5000", *QUICK)
    found = json.loads(warpspace(*wide, "--json").out)["exact"]
    assert found["machines"] == 2000
    assert 0.9 < found["probability"] < 1.0
    assert found["first_order"] == pytest.approx(found["probability"], abs=0.02)
    out = " ".join(warpspace(*wide).out.split())
    assert f"exact chain: {100 * found['probability']:.2f} % of 2,000 of these machines" in out
