"""Numbers that commands print agree with each other, and say what they leave out."""

import csv

import pytest

import warpspace as package
from warpspace.exceptions import OptionError
from warpspace.resources import scenes_dir
from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate


def test_a_placed_part_is_asked_for_in_the_relative_loop(warpspace):
    scene = ("dvf5000_second", "--placed")
    lying = warpspace("field", "dvf5000_second", "--loop", "relative", "--json").json
    placed = warpspace("field", *scene, "--json").json
    assert placed["statistics"]["rms_um"] == pytest.approx(2.750, abs=0.001)
    assert lying["statistics"]["rms_um"] == pytest.approx(14.841, abs=0.001)
    node = placed["points"][-1]
    at = ",".join(f"{axis}={place}" for axis, place in node["axes"].items())
    (same,) = warpspace("field", *scene, "--at", at, "--json").json["points"]
    assert same["error_um"] == pytest.approx(node["error_um"], abs=1e-9)
    compared = warpspace("compare", "dvf5000_nominal", *scene, "--json").json
    assert compared["b"]["rms_um"] == pytest.approx(placed["statistics"]["rms_um"])
    repair = warpspace("adjust", *scene, "--count", 1, "--json").json
    assert repair["before"]["rms_um"] == pytest.approx(placed["statistics"]["rms_um"])
    out = " ".join(warpspace("field", *scene, "--grid", 3).out.split())
    assert "relative loop · placement of the workpiece fitted out" in out


def test_the_worst_point_is_printed_as_an_argument_that_gives_it_back(warpspace):
    out = warpspace("field", "dvf5000_first", "--grid", 5).out
    assert "max at axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51 mm" in out
    argument = next(line for line in out.splitlines() if "--at" in line).split()
    found = warpspace("field", "dvf5000_first", *argument, "--json").json
    assert found["statistics"]["max_um"] == pytest.approx(51.72, abs=0.01)
    assert found["statistics"]["max_at_axes"] == {"X": 275, "Y": -225, "Z": -480, "B": 0, "C": 0}


@pytest.mark.parametrize("command", ["field", "gains"])
def test_positions_outside_the_travel_are_warned_of(warpspace, command):
    result = warpspace(command, "dvf5000_first", "--at", "X=900", "--json")
    assert result.status == 0
    assert "--at X=900 is outside the travel of X, -275 to 275 mm" in result.err
    assert warpspace(command, "dvf5000_first", "--at", "X=275", "--json").err == ""


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
[tolerances]
default = { translation = 10, rotation = 3000, squareness = 3000 }
"""
QUICK = ("--samples", "2000")
COMMANDS = {
    "check": (),
    "field": ("--grid", "5"),
    "field at": ("--at", "X=275,Y=225,Z=-480"),
    "compare": ("dvf5000_first", "--grid", "5"),
    "adjust": ("--grid", "5"),
    "check against": ("--against", "own"),
    "montecarlo": QUICK,
    "montecarlo rows": ("--rows", "--tolerance", "EC0Y=10,3000", *QUICK),
    "concepts": ("dvf5000_first", *QUICK),
    "allocate": ("--limit", "4000", *QUICK),
}


@pytest.fixture
def gantry(tmp_path):
    path = tmp_path / "gantry.toml"
    path.write_text(GANTRY, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", COMMANDS)
def test_three_milliradians_are_said_with_the_number_in_the_json_object(warpspace, gantry, name):
    command = name.split(maxsplit=1)[0]
    loud = warpspace(command, gantry, *COMMANDS[name], "--json")
    assert loud.status == 0, loud.err
    assert loud.err.count(SAID) == 1
    found = loud.json["second_order_um"]
    assert found > 1.0
    if name in {"check", "check against", "field", "compare"}:
        scene = parse_scene(GANTRY, "gantry")
        first, exact = (evaluate(scene, grid=5, exact=exact).error_um for exact in (False, True))
        largest_um = float(abs(exact - first).max())
        assert largest_um <= found <= largest_um * 3**0.5


@pytest.mark.parametrize(("command", "ending"), [("draw", ".svg"), ("export", ".csv")])
def test_files_say_it_and_so_does_the_command(warpspace, gantry, tmp_path, command, ending):
    target = tmp_path / f"out{ending}"
    result = warpspace(command, gantry, "-o", target, "--grid", "5")
    assert result.status == 0, result.err
    assert SAID in result.err
    assert SAID in target.read_text(encoding="utf-8")


def test_the_exact_field_says_nothing(warpspace, gantry):
    assert warpspace("field", gantry, "--exact", "--grid", "5").err == ""


def test_a_repair_is_verified_with_the_exact_chain(warpspace, gantry):
    wide = ("adjust", gantry, "--limit", "9000", "--count", "1", "--grid", "5")
    (found,) = warpspace(*wide, "--json").json["adjustments"]
    text = GANTRY
    for key, value in found["adjust"].items():
        text = text.replace(f"{key} = 3000\n", f"{key} = {value!r}\n", 1)
    target = gantry.with_name("repaired.toml")
    target.write_text(text, encoding="utf-8")
    exact = warpspace("field", target, "--exact", "--grid", "5", "--json").json
    for name, value in found["exact"].items():
        assert value == pytest.approx(exact["statistics"][name], rel=1e-9)
    assert abs(found["exact"]["rms_um"] - found["rms_um"]) > 0.01
    assert "by the exact chain (exact − first order): set 1: " in warpspace(*wide).out


def test_an_allocation_is_verified_with_the_exact_chain(warpspace, gantry):
    wide = ("allocate", gantry, "--limit", "5000", *QUICK)
    found = warpspace(*wide, "--json").json["exact"]
    assert found["machines"] == 2000
    assert 0.9 < found["probability"] < 1.0
    assert found["first_order"] == pytest.approx(found["probability"], abs=0.02)
    out = " ".join(warpspace(*wide).out.split())
    assert f"exact chain: {100 * found['probability']:.2f} % of 2,000 of these machines" in out


SAMPLES = ("--samples", "20000")


@pytest.fixture
def machines(warpspace, tmp_path):
    paths = [tmp_path / "tool.toml", tmp_path / "table.toml"]
    for chain, path in zip(("wCBFXYZt", "wCBYXFZt"), paths, strict=True):
        assert warpspace("new-machine", chain, "-o", path, "--title", path.stem).status == 0
    return paths


def test_concepts_agree_with_montecarlo_and_contributions(warpspace, machines):
    limit = ("--limit", "25")
    found = warpspace("concepts", *machines, *limit, *SAMPLES, "--json").json
    assert found["tolerances"] == {"translation": 10.0, "rotation": 20.0, "squareness": 25.0}
    for path, concept in zip(machines, found["concepts"], strict=True):
        alone = warpspace(
            *("montecarlo", path, *SAMPLES, "--limit", "25", "--over", "max"),
            *("--grid", "11", "--loop", "relative", "--json"),
        ).json
        for key in ("mean_um", "p95_um", "max_um"):
            assert concept[key] == alone[key]
        assert concept["probability"] == alone["specification"]["probability"]
        shares = warpspace("contributions", path, "--loop", "relative", "--json").json
        leading = [(row["key"], row["share"]) for row in shares["contributions"][:3]]
        assert [(row["key"], row["share"]) for row in concept["errors"]] == leading
    # the axes of the second machine carry the table, nearer to the workpiece: shorter levers
    assert found["concepts"][0]["mean_um"] != found["concepts"][1]["mean_um"]


def test_tolerances_are_those_of_the_first_scene_unless_each_has_its_own(warpspace, machines):
    text = machines[1].read_text(encoding="utf-8")
    machines[1].write_text(text.replace("translation = 10", "translation = 100"), encoding="utf-8")
    same = warpspace("concepts", *machines, *SAMPLES, "--json").json
    own = warpspace("concepts", *machines, *SAMPLES, "--own-tolerances", "--json").json
    assert same["concepts"][0] == own["concepts"][0]
    assert own["concepts"][1]["mean_um"] > 3.0 * same["concepts"][1]["mean_um"]
    assert own["tolerances"] is None


def test_missing_tolerances_are_said(warpspace, machines):
    text = machines[0].read_text(encoding="utf-8")
    machines[0].write_text(text.replace(", rotation = 20", ""), encoding="utf-8")
    warpspace("concepts", *machines).refused("tool", "tolerances.default has no rotation")


FEW = ("--samples", "3000")
ROWS = ("montecarlo", "--rows")


def test_a_row_is_what_montecarlo_gives_for_the_same_scene(warpspace, tmp_path):
    steps = ("--tolerance", "EAX=5:20:2", "--tolerance", "translation=4,8")
    found = warpspace(*ROWS, "dvf5000_general", *steps, "--limit", "40", *FEW, "--json").json
    assert found["tolerances"] == {"EAX": [5.0, 20.0], "translation": [4.0, 8.0]}
    rows = found["rows"]
    assert [(row["EAX"], row["translation"]) for row in rows] == [
        *[(5.0, 4.0), (5.0, 8.0), (20.0, 4.0), (20.0, 8.0)]
    ]
    scene = tmp_path / "s.toml"
    text = (scenes_dir() / "dvf5000_general.toml").read_text("utf-8")
    changed = text.replace("{ translation = 10,", "{ translation = 8,") + "EAX = 20\n"
    assert changed.count("translation = 8") == 1
    scene.write_text(changed, encoding="utf-8")
    run = ("montecarlo", scene, "--limit", "40", *FEW, "--json")
    alone = warpspace(*run).json
    for key in ("mean_um", "median_um", "p95_um", "p99_um", "max_um"):
        assert rows[3][key] == pytest.approx(alone[key], rel=1e-12), key
    assert rows[3]["probability"] == alone["specification"]["probability"]


def test_a_fleet_of_a_folder(warpspace, tmp_path):
    for name, width in (("b", 20), ("a", 10)):
        (tmp_path / f"{name}.toml").write_text(
            f'title = "=machine {name}"\nmachine = "dvf5000"\n[tolerances]\n'
            f"default = {{ translation = {width}, rotation = {width}, squareness = {width} }}\n"
        )
    target = tmp_path / "fleet.csv"
    printed = warpspace(*ROWS, tmp_path, *FEW, "-o", target)
    assert printed.status == 0, printed.err
    rows = list(csv.DictReader(target.read_text("utf-8").splitlines()))
    assert [row["scene"] for row in rows] == ["a", "b"]
    assert rows[0]["title"] == "'=machine a"
    assert float(rows[1]["mean_um"]) == pytest.approx(2.0 * float(rows[0]["mean_um"]))
    both = warpspace("montecarlo", tmp_path, *FEW, "--json").json["scenes"]
    assert [float(row["mean_um"]) for row in rows] == [one["mean_um"] for one in both]
    table = warpspace("montecarlo", tmp_path, *FEW)
    assert table.out.count("\n  a ") == 1
    warpspace(*ROWS, tmp_path, *FEW, "-o", target).refused("--force")


def test_every_machine_is_written(warpspace, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    target = tmp_path / "m.parquet"
    run = ("montecarlo", "dvf5000_general", "dvf5000_proposed", "--samples", "9000", "--json")
    found = warpspace(*run, "-o", target).json["scenes"]
    table = pq.read_table(target)
    assert table.num_rows == 18_000
    names = table["scene"].to_pylist()
    assert names == ["dvf5000_general"] * 9000 + ["dvf5000_proposed"] * 9000
    assert table["machine"].to_pylist() == [*range(9000)] * 2
    values = table["error_um"].to_numpy()
    assert values[:9000].max() == found[0]["max_um"]
    assert values[9000:].mean() == pytest.approx(found[1]["mean_um"], rel=1e-12)


def test_a_folder_with_a_scene_that_is_none_is_refused(warpspace, tmp_path):
    (tmp_path / "bad.toml").write_text("machine = 3")
    warpspace(*ROWS, "dvf5000_general", tmp_path).refused("bad.toml")


def test_the_same_from_python():
    scene = package.load_scene("dvf5000_general")
    points = list(package.sweep(iter([scene]), {"EAX": [5.0, 20.0]}))
    assert [point.half_widths for point in points] == [{"EAX": 5.0}, {"EAX": 20.0}]
    assert points[0].scene.tolerances.get("EAX").half_width == 5.0
    with pytest.raises(OptionError, match="no half width"):
        list(package.sweep([scene], {"EAX": []}))
