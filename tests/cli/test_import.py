"""The commands import, formats and template."""

import json
from pathlib import Path

import numpy as np
import pytest

from warpspace.machine.curves.directional import Directional
from warpspace.machine.curves.two_arguments import TwoArguments
from warpspace.scene.library import load_scene
from warpspace.scene.pipeline import evaluate

RUNS = """X [mm],run,direction,EXX [um],u(EXX) [um]
-250,1,+,0.0,0.3
0,1,+,1.5,0.3
250,1,+,3.0,0.4
250,1,-,2.0,0.4
0,1,-,0.4,0.3
-250,1,-,-1.0,0.3
-250,2,+,0.2,0.3
0,2,+,1.7,0.3
250,2,+,3.2,0.4
250,2,-,2.2,0.4
0,2,-,0.6,0.3
-250,2,-,-0.8,0.3
"""
TWO = """Z X EXX EBX
-400 -200 0.02 0.00042
-400 200 0.0 0.00011
-100 -200 0.01 0.0004
-100 200 0.03 0.00015
"""
NAMES = (
    "csv",
    "iso-text",
    "isg-csv",
    "rtl",
    "sinumerik-enc",
    "sinumerik-cec",
    "heidenhain",
    "fanuc-3d",
    "linuxcnc-comp",
    "linuxcnc-matrix",
    "klipper",
    "marlin",
)


def write(folder: Path, name: str, text: str) -> Path:
    """Write a file."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_runs_are_imported_with_directions_uncertainties_and_readings(
    tmp_path: Path, warpspace
) -> None:
    target = tmp_path / "scene.toml"
    file = write(tmp_path, "x.csv", RUNS)
    result = warpspace("import", file, "--machine", "dvf5000", "-o", target, "--json")
    assert "csv" in result.err
    assert "recognised" in result.err
    found = json.loads(result.out)
    assert (found["format"], found["recognised"], found["machine"]) == ("csv", True, "dvf5000")
    (one,) = found["errors"]
    assert (one["key"], one["unit"], one["runs"], one["directions"]) == ("EXX", "µm", 4, "+ -")
    assert one["mean_reversal"] == pytest.approx(np.mean([1.0, 1.1, 1.0]))
    scene = load_scene(target)
    curve = scene.errors.functions["EXX"]
    assert isinstance(curve, Directional)
    assert curve.forward.evaluate(np.array(0.0)) == pytest.approx(1.6)
    assert curve.backward.evaluate(np.array(250.0)) == pytest.approx(2.1)
    assert scene.measured["EXX"].count == 12
    assert scene.uncertainty["EXX"].evaluate(np.array(250.0)) == pytest.approx(0.4)
    assert warpspace("check", target).status == 0


def test_an_error_of_two_axes_acts_over_both(tmp_path: Path, warpspace) -> None:
    target = tmp_path / "scene.toml"
    file = write(tmp_path, "v.csv", TWO)
    out = warpspace("import", file, "--machine", "dvf5000_nominal", "-o", target).out
    for fragment in ("over Z", "assumed: ", "mm, rad", "right-hand rule"):
        assert fragment in " ".join(out.split())
    scene = load_scene(target)
    assert isinstance(scene.errors.functions["EXX"], TwoArguments)
    field = evaluate(scene, at={"X": [-200.0, 200.0, 0.0], "Z": [-400.0, -100.0, -250.0], "Y": 0.0})
    # positioning 20, 30 and the mean of four; pitch acts on z and, by its lever, on x
    bare = load_scene(target).errors
    assert bare.evaluate_at("EXX", {"X": np.array(0.0), "Z": np.array(-250.0)}) == pytest.approx(15)
    assert field.error_um.shape == (3, 3)


def test_errors_of_a_scene_stay_where_others_are_imported(tmp_path: Path, warpspace) -> None:
    target = tmp_path / "scene.toml"
    file = write(tmp_path, "c.csv", "EC0Y [arcsec]\n10\n")
    out = warpspace("import", file, "--machine", "dvf5000_first", "-o", target).out
    scene = load_scene(target)
    assert scene.errors.amplitude("EC0Y") == pytest.approx(48.481, abs=1e-3)
    assert scene.errors.amplitude("EA0Z") == 33.9
    said = " ".join(out.split())
    assert "replaced: EC0Y" in said
    assert "kept from dvf5000_first" in said


def test_without_a_machine_there_are_three_axes_with_the_travels_of_the_data(
    tmp_path: Path, warpspace
) -> None:
    target = tmp_path / "scene.toml"
    out = warpspace("import", write(tmp_path, "x.csv", RUNS), "-o", target).out
    assert "no machine named" in " ".join(out.split())
    assert load_scene(target).machine.axes["X"].travel == (-250.0, 250.0)
    file = write(tmp_path, "c1.csv", "C [deg],ECC [urad]\n0,1\n180,2\n")
    warpspace("import", file, "-o", target, "--force").refused("expected --machine", "C")


@pytest.mark.parametrize(
    ("text", "options", "fragments"),
    [
        (RUNS.replace("-250", "-900"), (), ("x.csv", "-900 … 250", "travel", "-275 … 275")),
        ("U [mm],EXU [um]\n0,1\n1,2\n", (), ("x.csv", "EXU", "no axis U")),
        ("hello\n", (), ("line 1", "no format")),
        (RUNS, ("--format", "csvv"), ("csvv", "csv")),
        (RUNS, ("--format", "klipper"), ("x.csv", "no skew factors")),
        (RUNS, ("--variant", "alternative"), ("--variant", "csv")),
        (RUNS, ("--sign", "error"), ("--sign", "csv")),
        (RUNS, ("--axis", "Q"), ("--axis",)),
        (RUNS.replace("0.4,0.3", "0,4,0.3", 1), (), ("line 6", "6 fields", "decimal commas")),
    ],
)
def test_a_refused_import_changes_nothing(
    text: str, options: tuple[str, ...], fragments: tuple[str, ...], tmp_path: Path, warpspace
) -> None:
    target = write(tmp_path, "scene.toml", "mine")
    file = write(tmp_path, "x.csv", text)
    before = sorted(tmp_path.iterdir())
    warpspace("import", file, "--machine", "dvf5000", "-o", target, "--force", *options).refused(
        *fragments
    )
    assert target.read_text(encoding="utf-8") == "mine"
    assert sorted(tmp_path.iterdir()) == before


def test_what_is_read_is_never_written_over(tmp_path: Path, warpspace) -> None:
    file = write(tmp_path, "x.toml", RUNS)
    warpspace("import", file, "-o", file, "--force").refused("is read for")
    warpspace("import", tmp_path / "none.csv", "-o", tmp_path / "s.toml").refused("no such file")
    warpspace("import", tmp_path, "-o", tmp_path / "s.toml").refused("is a folder")


def test_formats_lists_all_by_name(warpspace) -> None:
    found = json.loads(warpspace("formats", "--json").out)["formats"]
    assert tuple(one["name"] for one in found) == NAMES
    assert all(one["reads"] and one["holds"] and one["source"] for one in found)
    assert [one["name"] for one in found if not one["writes"]] == ["rtl"]
    out = warpspace("formats").out
    assert all(name in out for name in NAMES)


@pytest.mark.parametrize("axis", ["X", "c", "B"])
def test_a_template_that_is_filled_in_is_imported(axis: str, tmp_path: Path, warpspace) -> None:
    text = warpspace("template", axis).out
    header = next(line for line in text.splitlines() if line and not line.startswith("#"))
    assert header.startswith(f"{axis.upper()} [{'mm' if axis == 'X' else 'deg'}],run,direction")
    rows = [line for line in text.splitlines() if line and line[0] in "-0123456789"]
    assert len(rows) == 10
    filled = text
    for row in rows:
        start = ",".join(row.split(",")[:3])
        filled = filled.replace(row, start + "," + ",".join(["1"] * 12))
    file = write(tmp_path, "t.csv", filled)
    target = tmp_path / "s.toml"
    positions = warpspace("import", file, "--machine", "dvf5000", "-o", target)
    if axis == "B":
        positions.refused("beyond its travel")
        return
    assert positions.status == 0, positions.err
    assert len(list(load_scene(target).errors)) == 6
    given = warpspace("template", axis, "--positions", "1,2,4", "-o", tmp_path / "u.csv")
    assert given.status == 0
    assert "\n4,1,+" in (tmp_path / "u.csv").read_text(encoding="utf-8")


def test_a_template_needs_an_axis_and_ascending_positions(warpspace) -> None:
    warpspace("template", "Q").refused("axis 'Q'")
    warpspace("template", "X", "--positions", "2,1").refused("ascending")
    warpspace("template", "X", "--positions", "a").refused("numbers")


def test_a_template_over_two_axes_that_is_filled_in_is_imported(tmp_path: Path, warpspace) -> None:
    text = warpspace("template", "Y", "--positions=-200,0,200", "--over", "z=-400,-100").out
    header = next(line for line in text.splitlines() if line and not line.startswith("#"))
    assert header.startswith("Y [mm],Z [mm],EXY [um],EYY [um]")
    filled = text.replace(",,,,,,", ",1,2,3,4,5,6.5")
    assert filled.count(",6.5") == 6
    target = tmp_path / "s.toml"
    result = warpspace(
        "import", write(tmp_path, "t.csv", filled), "--machine", "dvf5000", "-o", target, "--json"
    )
    found = {one["key"]: one for one in json.loads(result.out)["errors"]}
    assert found["ECY"]["kind"] == "over Z"
    assert found["ECY"]["points"] == 6
    curve = load_scene(str(target)).errors.functions["ECY"]
    assert isinstance(curve, TwoArguments)
    assert curve.values == ((6.5, 6.5),) * 3
    warpspace("template", "Y", "--over", "Y").refused("another axis than Y")
    warpspace("template", "Y", "--over", "Q=1,2").refused("--over 'Q=1,2'")
    warpspace("template", "Y", "--over", "Z=2,1").refused("--over '2,1'; expected ascending")
