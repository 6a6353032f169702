"""The commands gains, montecarlo, contributions, ballbar, measured and thesis."""

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from warpspace.machine.parameters import PARAMETERS

FORMATS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
PLOTS = {
    "gains": ("gains", "dvf5000_general", "--at", "Y=-225,Z=-480"),
    "gains over the travel": ("gains", "dvf5000_general", "--loop", "workpiece", "--max"),
    "montecarlo": ("montecarlo", "dvf5000_general", "--samples", "2000", "--spec-um", "50"),
    "contributions": ("contributions", "dvf5000_general"),
    "sobol": ("contributions", "dvf5000_proposed", "--sobol", "64"),
    "ballbar": ("ballbar", "dvf5000_first", "--plane", "YZ", "--radius", "150"),
    "ballbar without errors": ("ballbar", "dvf5000_nominal", "--plane", "XY", "--radius", "50"),
}


def test_gains_json_has_the_keys_of_the_contract(warpspace) -> None:
    result = warpspace("gains", "dvf5000_general", "--at", "X=0,Y=-225,Z=-480", "--json")
    (rows,) = json.loads(result.out).values()
    assert {tuple(row) for row in rows} == {("key", "symbol", "unit", "x", "y", "z", "norm")}
    first = rows[0]
    assert (first["key"], first["symbol"], first["unit"]) == ("EA0Z", "α_YZ", "µm/µrad")
    assert first["y"] == pytest.approx(1.44)
    assert len(rows) == 21


def test_gains_text_explains_the_lever_and_marks_key_errors(warpspace, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    out = warpspace("gains", "dvf5000_general", "--at", "Y=-225,Z=-480").out
    line = next(line for line in out.splitlines() if "EA0Z" in line)
    assert line.startswith("  *")
    assert "-1440 mm = -480 Z motion -810 S -150 t" in line
    assert sum(" key " in line for line in out.splitlines()[3:-1]) == 7


def test_gains_csv(warpspace, tmp_path: Path) -> None:
    target = tmp_path / "gains.csv"
    warpspace("gains", "dvf5000_general", "--max", "--loop", "workpiece", "--csv", target)
    rows = list(csv.DictReader(target.read_text("utf-8").splitlines()))
    assert {row["key"] for row in rows} <= set(PARAMETERS)
    assert sum(row["thesis_key_error"] == "1" for row in rows) == 6
    byname = {row["key"]: row for row in rows}
    assert float(byname["EAC"]["norm"]) == pytest.approx(0.5274, abs=1e-4)


def test_montecarlo_json_has_the_keys_of_the_contract(warpspace) -> None:
    arguments = ("montecarlo", "dvf5000_general", "--samples", "20000", "--seed", "3", "--json")
    found = json.loads(warpspace(*arguments).out)
    assert list(found) == [
        *("samples", "seed", "distribution", "loop", "over", "mean_um", "mode_um"),
        *("median_um", "p95_um", "p99_um", "max_um", "histogram"),
    ]
    assert found["mean_um"] == pytest.approx(41.1, abs=0.8)
    assert list(found["histogram"]) == ["edges_um", "counts"]
    assert sum(found["histogram"]["counts"]) == 20000
    assert len(found["histogram"]["edges_um"]) == len(found["histogram"]["counts"]) + 1
    assert found == json.loads(warpspace(*arguments, "--workers", "3").out)


@pytest.mark.parametrize("over", ["sampled", "max", "mean"])
def test_montecarlo_says_what_it_did(warpspace, over: str) -> None:
    result = warpspace(
        *("montecarlo", "dvf5000_general", "--samples", "3000", "--over", over, "--spec-um", "45"),
        *("--distribution", "normal", "--clip"),
    )
    assert result.err == ""
    assert "95 % interval" in result.out
    assert "clipped" in result.out
    assert ("from trace(J Σ Jᵀ)" in result.out) == (over == "sampled")


def test_specification_in_json(warpspace) -> None:
    found = json.loads(
        warpspace(
            *("montecarlo", "dvf5000_general", "--samples", "500", "--spec-um", "40", "--json")
        ).out
    )["specification"]
    assert found["low"] < found["probability"] < found["high"]


def test_contributions_json(warpspace) -> None:
    found = json.loads(warpspace("contributions", "dvf5000_general", "--sobol", "32", "--json").out)
    assert sum(row["share"] for row in found["contributions"]) == pytest.approx(1.0)
    assert all(row["sobol_total"] is not None for row in found["contributions"])
    assert "Sobol first" in warpspace("contributions", "dvf5000_general", "--sobol", "32").out


def test_ballbar_json_has_the_keys_of_the_contract(warpspace) -> None:
    found = json.loads(
        warpspace("ballbar", "teach_squareness", "--plane", "XY", "--radius", "150", "--json").out
    )
    assert list(found) == ["circular_deviation_um", "squareness_urad", "radial_um"]
    assert found["squareness_urad"] == pytest.approx(30.0, abs=0.1)
    assert found["circular_deviation_um"] == pytest.approx(4.5)
    assert len(found["radial_um"]) == 360


def test_ballbar_takes_a_centre(warpspace, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    result = warpspace(
        *("ballbar", "dvf5000_first", "--plane", "XZ", "--radius", "50", "--center", "X=100,Z=-200")
    )
    assert "centre X 100, Y 0, Z -200" in result.out
    assert "look like squareness" in result.out


def test_measured_machines(warpspace) -> None:
    arguments = ("measured", "dvf5000_first", "dvf5000_second", "--tolerances", "dvf5000_proposed")
    found = json.loads(warpspace(*arguments, "--json").out)["machines"]
    assert [machine["measured_um"] for machine in found] == [32.0, 15.0]
    assert [sum(c["passes"] for c in machine["checks"]) for machine in found] == [1, 6]
    assert [round(m["statistics_nodes"]["mean_um"], 2) for m in found] == [31.66, 14.58]
    # trapezoidal rule over the nodes, by numpy.trapezoid along each axis
    assert [round(m["predicted"]["mean_um"], 2) for m in found] == [30.95, 14.56]
    out = warpspace(*arguments, "--loop", "relative").out
    assert "LaserTRACER 32 µm" in out
    assert "no tolerance" not in out


def test_thesis_prints_every_row_and_leaves_with_zero(warpspace, tmp_path: Path) -> None:
    page = tmp_path / "thesis.md"
    text = warpspace("thesis", "--markdown", page).out
    result = warpspace("thesis", "--json")
    assert result.status == 0
    rows = json.loads(result.out)["rows"]
    needed = ["source", "key", "printed", "computed", "agrees"]
    assert all(list(row)[:5] == needed for row in rows)
    assert all(row["agrees"] or row["note"] for row in rows)
    assert page.read_text("utf-8").startswith("# The thesis")
    assert "234 of 244 agree. The others:" in text
    assert "> after motion: 40 of 40 gains" in text


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("plot", PLOTS)
def test_plots_are_written_twice_alike(warpspace, tmp_path: Path, plot: str, ending: str) -> None:
    files = [tmp_path / f"{run}{ending}" for run in "ab"]
    for file in files:
        result = warpspace(*PLOTS[plot], "--plot", file)
        assert (result.status, result.err) == (0, "")
    first, second = (file.read_bytes() for file in files)
    assert first.startswith(FORMATS[ending])
    assert first == second
    assert len(first) > 3000
    assert {file.name for file in tmp_path.iterdir()} == {file.name for file in files}


CIRCLE = ("ballbar", "dvf5000_first", "--plane", "XY", "--radius")
SAMPLE = ("montecarlo", "dvf5000_general")
BAD = {
    "no tolerances": (("montecarlo", "dvf5000_nominal"), "has no tolerances"),
    "no samples": ((*SAMPLE, "--samples", "0"), "samples: 0"),
    "too many samples": ((*SAMPLE, "--samples", "10000000000000"), "samples: 10000000000000"),
    "negative specification": ((*SAMPLE, "--spec-um", "-1"), "specification: -1 µm"),
    "no number as specification": ((*SAMPLE, "--spec-um", "nan"), "specification: nan"),
    "negative seed": ((*SAMPLE, "--seed", "-1"), "seed: -1"),
    "no workers": ((*SAMPLE, "--workers", "0"), "workers: 0"),
    "flat cylinder": ((*SAMPLE, "--loop", "workpiece", "--cylinder", "5x0"), "height 0 mm"),
    "cylinder of words": ((*SAMPLE, "--cylinder", "big"), "--cylinder 'big'"),
    "unknown picture": ((*SAMPLE, "--plot", "x.jpg"), "'.jpg'"),
    "circle too large": ((*CIRCLE, "300"), "leaves the working volume"),
    "circle off centre": ((*CIRCLE, "100", "--center", "X=250"), "X would run 150 … 350 mm"),
    "circle of no axis": ((*CIRCLE, "100", "--center", "Q=1"), "--center 'Q=1'"),
    "no radius": ((*CIRCLE, "nan"), "radius: nan"),
    "no share": (("gains", "dvf5000_first", "--share", "0"), "share: 0"),
    "step of nothing": (("gains", "dvf5000_first", "--max", "--step", "0"), "step: 0°"),
    "step at a point": (("gains", "dvf5000_first", "--step", "5"), "--step belongs to --max"),
    "two points": (("gains", "dvf5000_first", "--at", "X=1", "--at", "X=2"), "expected one point"),
    "odd sobol": (("contributions", "dvf5000_general", "--sobol", "7"), "power of two"),
    "sobol of nothing": (("contributions", "dvf5000_general", "--sobol", "0"), "power of two"),
    "page of no kind": (("thesis", "--markdown", "x.txt"), "'.txt'"),
    "table of no kind": (("gains", "dvf5000_first", "--csv", "x.txt"), "'.txt'"),
    "no machine": (("measured",), "Missing argument"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_message(warpspace, tmp_path, monkeypatch, case: str) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, *fragments = BAD[case]
    warpspace(*arguments).refused(*fragments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("EAX = -5", "tolerances.EAX"),
        ("EAX = { centre = 1 }", "tolerances.EAX"),
        ("EAX = 5", "no half width for EXX, EYX"),
    ],
)
def test_bad_tolerances_are_one_message(warpspace, tmp_path, text: str, fragment: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(f'machine = "dvf5000"\n[tolerances]\n{text}\n', encoding="utf-8")
    warpspace("montecarlo", scene).refused(fragment)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_ends_cleanly(tmp_path: Path) -> None:
    target = tmp_path / "x.png"
    command = [sys.executable, "-m", "warpspace", *SAMPLE, "--samples", "900000000"]
    # what a shell runs in the background is deaf to it, and so are its children
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen(
            [*command, "--plot", str(target)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    finally:
        signal.signal(signal.SIGINT, before)
    try:
        time.sleep(3.0)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 130
    assert out == ""
    assert err.strip() == "warpspace: interrupted"
    assert list(tmp_path.iterdir()) == []
