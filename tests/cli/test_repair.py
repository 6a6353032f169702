"""The command repair."""

import json
from pathlib import Path

import pytest

from warpspace.scene.library import load_scene

FOUR = ["mean_um", "rms_um", "p95_um", "max_um"]
FAST = ("--grid", "7")


def test_json_has_the_keys_of_the_contract(warpspace) -> None:
    found = json.loads(warpspace("repair", "dvf5000_first", "--json").out)
    assert [list(one) for one in found["repairs"]] == [["adjust", *FOUR]] * 3
    assert [len(one["adjust"]) for one in found["repairs"]] == [1, 2, 3]
    assert found["repairs"][0]["adjust"] == {"EA0Z": pytest.approx(20.24, abs=0.01)}
    assert list(found["before"]) == FOUR
    assert found["before"]["max_um"] == pytest.approx(51.72, abs=0.01)
    first = found["errors"][0]
    assert list(first) == ["key", "unit", "present", "left_out", "best"]
    assert (first["key"], first["unit"], first["present"]) == ("EA0Z", "µrad", 33.9)
    assert list(first["left_out"]) == FOUR
    assert first["left_out"]["max_um"] == pytest.approx(63.59, abs=0.01)
    assert list(first["best"]) == ["value", *FOUR]
    assert found["adjustable"] == {"EC0Y": 200.0, "EA0Z": 200.0, "EB0Z": 200.0}
    assert found["all_sets_compared"] == [True, True, True]


def test_max_any_error_and_limits(warpspace) -> None:
    arguments = ("--objective", "max", "--adjustable", "all", "--count", "2", "--limit", "±50")
    result = warpspace(
        "repair", "dvf5000_first", *arguments, "--limit", "ea0z=±10,EAY=20", *FAST, "--json"
    )
    found = json.loads(result.out)
    assert len(found["adjustable"]) == 21
    assert (found["adjustable"]["EA0Z"], found["adjustable"]["EAX"]) == (10.0, 50.0)
    last = found["repairs"][-1]
    assert last["max_um"] < found["repairs"][0]["max_um"] < found["before"]["max_um"]
    present = load_scene("dvf5000_first").errors
    for key, value in last["adjust"].items():
        assert abs(value - present.amplitude(key)) <= found["adjustable"][key] + 1e-9


def test_text_says_what_each_error_gives_and_the_best_sets(warpspace, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    out = warpspace("repair", "dvf5000_first").out
    assert "before: mean 30.89, RMS 31.69, P95 41.27, max 51.72 µm" in out
    row = next(line for line in out.splitlines() if line.strip().startswith("EA0Z"))
    numbers = ["33.9", "µrad", "34.13", "36.93", "63.59", "20.2", "24.65", "26.54", "50.23"]
    assert row.split()[1:] == numbers
    assert "EA0Z 33.9 → 20.24 µrad" in out
    assert "adjusted: EC0Y, EA0Z, EB0Z; each by at most ±200 µm or µrad" in out
    assert "all sets compared" in out
    assert max(map(len, out.splitlines())) <= 80


def test_nothing_to_repair_is_said(warpspace) -> None:
    out = warpspace("repair", "dvf5000_nominal", *FAST).out
    assert "No point is off in this loop: there is nothing to repair." in out
    assert json.loads(warpspace("repair", "dvf5000_nominal", *FAST, "--json").out)["repairs"] == []


def test_repaired_scene_is_what_was_promised(warpspace, tmp_path: Path) -> None:
    target = tmp_path / "repaired.toml"
    found = json.loads(
        warpspace("repair", "dvf5000_first", "--count", "2", *FAST, "-o", target, "--json").out
    )
    scene = load_scene(target)
    assert scene.title == "DVF5000, first machine measured, repaired"
    for key, value in found["repairs"][-1]["adjust"].items():
        assert scene.errors.amplitude(key) == value
    again = json.loads(warpspace("repair", target, *FAST, "--json").out)
    promised = {name: found["repairs"][-1][name] for name in FOUR}
    assert again["before"] == pytest.approx(promised)
    warpspace("repair", "dvf5000_first", *FAST, "-o", target).refused("repaired.toml", "exists")


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_plot(warpspace, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"repair.{ending}"
    assert warpspace("repair", "dvf5000_first", *FAST, "--plot", target).status == 0
    assert target.read_bytes()[:4] in (b"\x89PNG", b"<?xm", b"%PDF")


BAD = {
    "count of zero": (("--count", "0"), "0 adjustments; expected 1 to 12"),
    "count of a text": (("--count", "some"), "'--count'", "'some'"),
    "objective of no kind": (("--objective", "mean"), "'--objective'", "'mean'"),
    "unknown error": (("--adjustable", "EQ0"), "EQ0"),
    "error of another loop": (("--adjustable", "EA0C"), "EA0C", "moves no point", "EA0Z"),
    "no error": (("--adjustable", ","), "--adjustable ','", "such as EA0Z"),
    "limit of a text": (("--limit", "much"), "--limit 'much'", "KEY=VALUE"),
    "limit below zero": (("--limit", "EA0Z=-3"), "--limit 'EA0Z=-3'", "above 0"),
    "infinite limit": (("--limit", "inf"), "--limit 'inf'", "KEY=VALUE"),
    "huge limit": (("--limit", "1e9"), "limit of all errors: ±1e+09", "100000"),
    "limit of what is not adjusted": (("--limit", "EAX=3"), "limit of EAX", "EC0Y, EA0Z, EB0Z"),
    "large grid": (("--grid", "60"), "grid: 60 nodes", "2 to 41"),
    "other ending": (("-o", "x.png"), "x.png", ".toml"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_options(warpspace, case: str) -> None:
    options, *words = BAD[case]
    warpspace("repair", "dvf5000_first", *options).refused(*words)


def test_nothing_to_write_is_refused(warpspace, tmp_path: Path) -> None:
    target = tmp_path / "x.toml"
    warpspace("repair", "dvf5000_nominal", *FAST, "-o", target).refused("nothing to adjust")
    assert not target.exists()
