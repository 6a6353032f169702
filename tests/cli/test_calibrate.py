"""The command calibrate."""

import csv
import json
from pathlib import Path

import pytest

from warpspace.calibration.readings import find_data
from warpspace.scene.library import load_scene

TCP = ("calibrate", "fork_head_bc", "--data", "tcp_on.csv", "--kind", "sphere-tcp")
HEADER = "b_deg,c_deg,x_mm,y_mm,z_mm"
KEYS = [
    *("parameters", "rank", "confounded", "rms_before_mm", "rms_after_mm"),
    *("rms_predicted_before_mm", "rms_predicted_after_mm"),
]


def test_json_has_the_keys_of_the_contract(warpspace) -> None:
    found = json.loads(warpspace(*TCP, "--json").out)
    assert set(KEYS) <= set(found)
    assert found["rms_before_mm"] == pytest.approx(0.27828, abs=1e-5)
    assert found["rms_after_mm"] < 0.078
    assert found["rms_predicted_before_mm"] is None
    first = found["parameters"][0]
    assert {"key", "value", "standard_uncertainty", "identifiable"} <= set(first)
    assert found["rank"] == sum(
        one["standard_uncertainty"] is not None for one in found["parameters"]
    )
    assert ["EXB", "EZB", "EB0B"] in found["confounded"]


def test_circles_with_tcp_off(warpspace) -> None:
    found = json.loads(
        warpspace("calibrate", "fork_head_bc", "--data", "tcp_off.csv", "--json").out
    )
    circle = next(one for one in found["circles"] if one["axis"] == "B")
    assert circle["radius_mm"] == pytest.approx(308.963734, abs=1e-6)
    assert circle["centre_mm"] == pytest.approx([305.669816, -589.742446], abs=1e-6)
    assert any("B turns against" in note for note in found["notes"])


def test_text_says_what_is_told_and_what_is_not(warpspace) -> None:
    out = warpspace(*TCP, "--next", "1").out
    assert "0.2783 mm before, 0.0615 mm after" in out
    assert "cannot be told apart" in out
    assert "map after" in out
    assert "told in part" in out


def test_calibrated_scene_opens_and_leaves_what_was_promised(warpspace, tmp_path: Path) -> None:
    target = tmp_path / "fitted.toml"
    found = json.loads(warpspace(*TCP, "-o", target, "--json").out)
    scene = load_scene(str(target))
    assert scene.title == "Fork head B-C, a real machine, calibrated"
    for one in found["parameters"]:
        assert scene.errors.amplitude(one["key"]) == pytest.approx(one["value"])
    again = json.loads(warpspace("calibrate", target, "--data", "tcp_on.csv", "--json").out)
    assert again["rms_before_mm"] == pytest.approx(found["rms_after_mm"])
    warpspace(*TCP, "-o", target).refused("fitted.toml", "exists")


def test_data_is_never_replaced(warpspace, tmp_path: Path) -> None:
    data = tmp_path / "data.toml"
    data.write_bytes(find_data("tcp_on.csv").read_bytes())
    warpspace("calibrate", "fork_head_bc", "--data", data, "-o", data, "--force").refused(
        "data.toml"
    )
    assert data.read_bytes() == find_data("tcp_on.csv").read_bytes()


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_chart(warpspace, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"calibration.{ending}"
    assert warpspace(*TCP, "--plot", target).status == 0
    assert target.stat().st_size > 10_000


def test_csv_holds_each_residual(warpspace, tmp_path: Path) -> None:
    target = tmp_path / "residuals.csv"
    found = json.loads(warpspace(*TCP, "--csv", target, "--json").out)
    with target.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 23
    told = found["fitted"][0]["readings"]
    assert [float(row["after_z_mm"]) for row in rows] == [one["after_mm"][2] for one in told]
    assert rows[0]["line"] == "5"


BAD = {
    "no rotary positions": ("x_mm,y_mm,z_mm\n1,2,3\n", ("no axis positions", "b_deg, c_deg")),
    "unknown axis": ("a_deg,x_mm,y_mm,z_mm\n1,2,3,4\n", ("no axis A", "B, C")),
    "not a number": (f"{HEADER}\n0,0,1,2,oops\n", ("line 2", "z_mm = 'oops'", "finite")),
    "nan": (f"{HEADER}\n0,0,1,nan,3\n", ("line 2", "y_mm = 'nan'")),
    "short row": (f"{HEADER}\n0,0,1\n", ("line 2", "3 fields", "expected 5")),
    "header only": (f"{HEADER}\n", ("no rows",)),
    "empty": ("", ("empty",)),
    "all at one pose": (f"{HEADER}\n" + "10,0,1,2,3\n" * 9, ("one pose",)),
    "too few": (f"{HEADER}\n0,0,1,2,3\n10,0,1,2,3\n", ("expected at least",)),
    "wrong unit": (f"{HEADER}\n0,0,350000,3000,3\n10,0,357000,3,3\n", ("or in another unit",)),
    "twice": ("b_deg,b_deg,x_mm,y_mm,z_mm\n0,0,1,2,3\n", ("'b_deg' twice",)),
    "uncertainty": (f"{HEADER},u_um\n0,0,1,2,3,0\n10,0,1,2,3,1\n", ("u_um = 0", "above 0")),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_readings_are_refused_in_one_message(warpspace, tmp_path: Path, case: str) -> None:
    text, words = BAD[case]
    data, target = tmp_path / "readings.csv", tmp_path / "fitted.toml"
    data.write_text(text, encoding="utf-8")
    warpspace(
        *("calibrate", "fork_head_bc", "--data", data, "--kind", "sphere-tcp", "-o", target)
    ).refused(*words)
    assert not target.exists()


OPTIONS = {
    "key": (("--fit", "EX0A"), ("EX0A",)),
    "no key": (("--fit", "EX9"), ("EX9",)),
    "twice": (("--fit", "EX0B,EX0B"), ("EX0B", "twice")),
    "curve": (("--fit", "EX0B:square"), (":constant", ":ramp")),
    "kind": (("--kind", "spheres"), ("spheres", "did you mean")),
    "next": (("--next", "0"), ("--next 0", "1 to 10")),
    "data": (("--data", "nothing.csv"), ("nothing.csv", "no such file")),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_bad_options_are_refused(warpspace, case: str) -> None:
    options, words = OPTIONS[case]
    warpspace("calibrate", "fork_head_bc", "--data", "tcp_on.csv", *options).refused(*words)


def test_priors_need_tolerances_and_take_them(warpspace) -> None:
    found = json.loads(warpspace(*TCP, "--priors", "--json").out)
    assert all(one["standard_uncertainty"] is not None for one in found["parameters"])
    assert found["rms_after_mm"] < 0.1
    assert any("readings without u_um are taken as ±" in note for note in found["notes"])


def test_thousandfold_errors_are_refused(warpspace, tmp_path: Path) -> None:
    data = tmp_path / "points.csv"
    data.write_text("x_mm,ex_mm,ey_mm,ez_mm\n0,12,200,3\n100,10,20,30\n", encoding="utf-8")
    warpspace("calibrate", "fork_head_bc", "--data", data).refused("unit", "expected less than 100")


def test_readings_of_a_test_and_error_vectors_together(warpspace, tmp_path: Path) -> None:
    circle, points = tmp_path / "circle.csv", tmp_path / "points.csv"
    found = json.loads(
        warpspace(
            "test", "circular", "dvf5000_first", "--radius", "100", "--points", "36", "--json"
        ).out
    )
    rows = zip(found["angle_deg"], found["radial_um"], strict=True)
    text = "\n".join(f"{angle},{value}" for angle, value in rows)
    circle.write_text(f"angle_deg,radial_um\n{text}\n", encoding="utf-8")
    points.write_text(
        "session,z_mm,ex_um,ey_um,ez_um\na,-480,0,0,0\na,-80,0,0,8\na,-280,0,0,4\n",
        encoding="utf-8",
    )
    both = ("calibrate", "dvf5000_nominal", "--data", circle, "--data", points)
    kinds = ("--kind", "circular:plane=XY:radius=100", "--kind", "points")
    told = json.loads(warpspace(*both, *kinds, "--fit", "EC0Y,EZZ", "--json").out)
    by_key = {one["key"]: one["value"] for one in told["parameters"]}
    squareness = found["squareness_urad"]
    assert by_key["EC0Y"] == pytest.approx(squareness, rel=0.02)
    assert by_key["EZZ"] == pytest.approx(8.0, rel=1e-4)
    warpspace(*both, *kinds, "--kind", "points").refused("3 times for 2 files")
    warpspace(*both[:4], "--kind", "circular:size=3").refused("size")
    warpspace(*both[:4], "--kind", "circular:radius=wide").refused("wide", "number")
