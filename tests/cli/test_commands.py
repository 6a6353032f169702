"""Commands `field`, `check` and `scenes`: text, the JSON contract, CSV, and as a subprocess."""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warpspace as api
from warpspace.scene.library import scene_names

POINT = ("--at", "X=0,Y=-225,Z=-480,B=0,C=0")


def only_object(text: str) -> dict:
    """Read stdout that must be exactly one JSON object on one line."""
    assert text.count("\n") == 1
    found = json.loads(text)
    assert isinstance(found, dict)
    return found


def test_field_at_points_prints_the_json_contract(warpspace) -> None:
    result = warpspace("field", "dvf5000_first", *POINT, "--at", "x=10;b=-30", "--json")
    assert (result.status, result.err) == (0, "")
    found = only_object(result.out)
    assert set(found) == {"points", "statistics"}
    keys = {"mean_um", "rms_um", "p95_um", "max_um", "max_at_mm", "max_at_axes"}
    assert set(found["statistics"]) == keys
    first, second = found["points"]
    expected = {"axes", "nominal_mm", "error_um", "norm_um", "orientation_urad"}
    assert set(first) == set(second) == expected
    assert first["axes"] == {"X": 0, "Y": -225, "Z": -480, "B": 0, "C": 0}
    assert second["axes"] == {"X": 10, "Y": 0, "Z": -280, "B": -30, "C": 0}
    field = api.evaluate(api.load_scene("dvf5000_first"), at={"X": 0, "Y": -225, "Z": -480})
    assert first["error_um"] == pytest.approx(field.error_um.tolist())
    assert first["nominal_mm"] == pytest.approx(field.nominal_mm.tolist())
    assert first["orientation_urad"] == pytest.approx(field.orientation_urad.tolist())
    assert first["norm_um"] == pytest.approx(float(field.norm_um))


def test_field_over_the_grid_has_every_node_and_its_statistics(warpspace) -> None:
    found = only_object(warpspace("field", "dvf5000_first", "--grid", 11, "--json").out)
    norms = [point["norm_um"] for point in found["points"]]
    assert len(norms) == 11**3
    assert found["statistics_nodes"]["mean_um"] == pytest.approx(31.66, abs=0.02)
    cube = np.reshape(norms, (11, 11, 11))
    mean = np.trapezoid(np.trapezoid(np.trapezoid(cube, dx=0.1), dx=0.1), dx=0.1)
    assert found["statistics"]["mean_um"] == pytest.approx(float(mean))  # 30.95 µm
    assert found["statistics"]["max_um"] == pytest.approx(max(norms))
    worst = found["points"][int(np.argmax(norms))]
    assert found["statistics"]["max_at_mm"] == pytest.approx(worst["nominal_mm"])
    assert found["statistics"]["max_at_axes"] == worst["axes"]


def test_field_without_options_evaluates_21_nodes_per_axis(warpspace) -> None:
    result = warpspace("field", "dvf5000_first")
    assert result.status == 0
    assert "DVF5000, first machine measured · tool loop · first order" in result.out
    # 30.89 µm: trapezoidal rule over 21³ nodes; 31.27 µm: their plain mean
    assert "9261 points, over the volume: mean 30.89" in result.out
    assert "each node counted once: mean 31.27" in result.out


@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
@pytest.mark.parametrize("frame", ["machine", "workpiece"])
@pytest.mark.parametrize("exact", [False, True])
def test_field_options_mean_what_the_python_function_means(
    loop: str, frame: str, exact: bool, warpspace
) -> None:
    scene, options = "teach_tilted_c", ["--exact"] if exact else []
    at = {"X": 10.0, "Y": 20.0, "Z": -100.0, "B": -30.0, "C": 60.0}
    spelled = ",".join(f"{axis}={value}" for axis, value in at.items())
    result = warpspace(
        "field", scene, "--at", spelled, "--loop", loop, "--frame", frame, "--json", *options
    )
    (point,) = only_object(result.out)["points"]
    field = api.evaluate(api.load_scene(scene), at=at, loop=loop, frame=frame, exact=exact)
    assert point["error_um"] == pytest.approx(field.error_um.tolist(), abs=1e-12)
    assert (point["norm_um"] > 1.0) == (loop != "tool")


def test_field_lists_points_with_units_and_says_when_there_are_more(warpspace) -> None:
    points = [option for x in range(25) for option in ("--at", f"X={x}")]
    result = warpspace("field", "dvf5000_first", *points)
    first = result.out.partition("error x")[0]
    assert "axis X" in first
    assert "in R x" in first
    rows = re.findall(r"^ +(\d+) +(\d+) +0 +-280 +0 +0 +\d+ ", first, re.MULTILINE)
    assert rows == [(str(x + 1), str(x)) for x in range(20)]
    assert "|E|" in result.out
    assert "µm" in result.out
    assert "µrad" in result.out
    assert "5 more" in result.out
    assert "25 points" in result.out


def test_field_csv_holds_the_same_numbers_as_json(tmp_path: Path, warpspace) -> None:
    target = tmp_path / "field.csv"
    result = warpspace("field", "dvf5000_first", "--grid", 3, "--csv", target, "--json")
    points = only_object(result.out)["points"]
    with target.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(points) == 27
    for row, point in zip(rows, points, strict=True):
        for axis, value in point["axes"].items():
            assert float(row[f"axis_{axis}_{'mm' if axis in 'XYZ' else 'deg'}"]) == value
        for index, letter in enumerate("xyz"):
            at = point["nominal_mm"][index], point["error_um"][index]
            assert float(row[f"R_{letter}_mm"]) == pytest.approx(at[0])
            assert float(row[f"error_{letter}_um"]) == pytest.approx(at[1], abs=1e-8)
            tilt = point["orientation_urad"][index]
            assert float(row[f"orientation_{letter}_urad"]) == pytest.approx(tilt, abs=1e-8)
        assert float(row["norm_um"]) == pytest.approx(point["norm_um"])
    assert list(tmp_path.iterdir()) == [target]


def test_field_csv_can_be_read_back_as_an_error_table(tmp_path: Path, warpspace) -> None:
    points = [option for x in (-275, 0, 275) for option in ("--at", f"X={x},Y=0,Z=-280")]
    warpspace("field", "dvf5000_first", *points, "--csv", tmp_path / "run.csv")
    path = tmp_path / "again.toml"
    path.write_text(
        'machine = "dvf5000"\n[errors]\nEXX = { csv = "run.csv", column = "error_x_um" }\n',
        encoding="utf-8",
    )
    first = api.evaluate(api.load_scene("dvf5000_first"), at={"X": 0.0, "Z": -280.0})
    again = api.evaluate(api.load_scene(path), at={"X": 0.0, "Z": -280.0})
    assert again.error_um[0] == pytest.approx(first.error_um[0], abs=1e-6)


def test_check_says_what_a_scene_holds(warpspace) -> None:
    result = warpspace("check", "dvf5000_first")
    assert (result.status, result.err) == (0, "")
    for fragment in ("dvf5000_first: valid", "wCBFXYZt", "7 of 41", "EAX", "µm", "-480 … -80 mm"):
        assert fragment in result.out


def test_check_prints_one_json_object(warpspace) -> None:
    found = only_object(warpspace("check", "dvf5000_first", "--json").out)
    assert found["scene"] == "dvf5000_first"
    assert found["chain"] == "wCBFXYZt"
    assert found["parameters"] == 41
    assert sorted(found["non_zero"]) == ["EA0Z", "EAX", "EAY", "EAZ", "EB0Z", "EC0Y", "ECY"]
    assert 0.0 < found["linearisation_error_um"] <= 0.01


def test_check_remarks_on_a_volume_beyond_the_travel(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "far.toml"
    path.write_text('machine = "dvf5000"\n[workspace]\nZ = [-600, 0]\n', encoding="utf-8")
    result = warpspace("check", path)
    assert result.status == 0
    assert "workspace.Z -600 … 0 mm reaches beyond the travel -480 … 0 mm" in result.out


def test_scenes_lists_every_bundled_scene_with_its_title(warpspace, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    found = only_object(warpspace("scenes", "--json").out)
    assert [row["name"] for row in found["scenes"]] == list(scene_names())
    text = warpspace("scenes").out
    assert text.count("\n") == len(scene_names())
    for row in found["scenes"]:
        assert row["name"] in text
        assert row["title"] in text


@pytest.mark.parametrize("arguments", [("-h",), ("--help",), ("field", "-h"), ("check", "-h")])
def test_help_is_everywhere(arguments, warpspace) -> None:
    result = warpspace(*arguments)
    assert (result.status, result.err) == (0, "")
    assert result.out.startswith("Usage:")


def test_version_is_the_package_s(warpspace) -> None:
    assert api.__version__ in warpspace("--version").out


def run_module(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    """Run the command as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "warpspace", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        timeout=120,
        check=False,
        **options,
    )


def test_module_runs_as_a_process_in_any_folder(tmp_path: Path) -> None:
    result = run_module(
        "field", "dvf5000_first", *POINT, "--json", stdout=subprocess.PIPE, cwd=tmp_path
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert only_object(result.stdout)["points"][0]["axes"]["Z"] == -480


def test_process_refuses_bad_input_with_status_2(tmp_path: Path) -> None:
    result = run_module("check", "nowhere.toml", stdout=subprocess.PIPE, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.startswith("warpspace: nowhere.toml: no such scene or file")
    assert "Traceback" not in result.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a full device")
def test_full_disk_is_one_message() -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        result = run_module("field", "dvf5000_first", *POINT, stdout=full)
    assert result.returncode == 2
    assert "No space left" in result.stderr
    assert "Traceback" not in result.stderr


def test_reader_that_goes_away_is_no_error() -> None:
    command = f"{sys.executable} -m warpspace field dvf5000_first --grid 21 --json | head -c 10"
    result = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False
    )
    assert (result.stdout, result.stderr) == ('{"points":', "")
