"""Sweeps and fleets on the command line: rows, tables, and what is refused."""

import csv
import json

import pytest

import warpspace as package
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.resources import scenes_dir

FEW = ("--samples", "3000")


def test_a_row_is_what_montecarlo_gives_for_the_same_scene(warpspace, tmp_path):
    steps = ("--tolerance", "EAX=5:20:2", "--tolerance", "translation=4,8")
    found = json.loads(
        warpspace("sweep", "dvf5000_general", *steps, "--limit-um", "40", *FEW, "--json").out
    )
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
    run = ("montecarlo", scene, "--spec-um", "40", *FEW, "--json")
    alone = json.loads(warpspace(*run).out)
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
    printed = warpspace("sweep", tmp_path, *FEW, "-o", target)
    assert printed.status == 0, printed.err
    rows = list(csv.DictReader(target.read_text("utf-8").splitlines()))
    assert [row["scene"] for row in rows] == ["a", "b"]
    assert rows[0]["title"] == "'=machine a"
    assert float(rows[1]["mean_um"]) == pytest.approx(2.0 * float(rows[0]["mean_um"]))
    both = json.loads(warpspace("montecarlo", tmp_path, *FEW, "--json").out)["scenes"]
    assert [float(row["mean_um"]) for row in rows] == [one["mean_um"] for one in both]
    table = warpspace("montecarlo", tmp_path, *FEW)
    assert table.out.count("\n  a ") == 1
    warpspace("sweep", tmp_path, *FEW, "-o", target).refused("--force")


def test_every_machine_is_written(warpspace, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    target = tmp_path / "m.parquet"
    run = ("montecarlo", "dvf5000_general", "dvf5000_proposed", "--samples", "9000", "--json")
    found = json.loads(warpspace(*run, "-o", target).out)["scenes"]
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
    warpspace("sweep", "dvf5000_general", tmp_path).refused("bad.toml")


def test_the_same_from_python():
    scene = package.load_scene("dvf5000_general")
    points = list(package.sweep(iter([scene]), {"EAX": [5.0, 20.0]}))
    assert [point.half_widths for point in points] == [{"EAX": 5.0}, {"EAX": 20.0}]
    assert points[0].scene.tolerances.get("EAX").half_width == 5.0
    with pytest.raises(UnknownNameError, match="parameter or tolerance class 'EAQ'"):
        list(package.sweep([scene], {"EAQ": [1.0]}))
    with pytest.raises(OptionError, match="no half width"):
        list(package.sweep([scene], {"EAX": []}))
