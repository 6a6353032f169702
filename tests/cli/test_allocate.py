"""The command allocate: what it writes keeps the limit, and what it cannot do it says."""

import json
import tomllib
from pathlib import Path

import pytest

QUICK = ("--samples", "20000")


def run(warpspace, *arguments: object) -> dict:
    result = warpspace("allocate", *arguments, "--json")
    assert result.status == 0, result.err
    return json.loads(result.out)


@pytest.mark.parametrize("over", ["sampled", "max"])
def test_the_written_scene_keeps_the_limit_by_the_command_montecarlo(
    warpspace, tmp_path: Path, over: str
) -> None:
    target = tmp_path / "new.toml"
    found = run(
        warpspace,
        *("dvf5000_first", "--limit-um", "40", "--probability", "0.95", "--over", over),
        *("-o", target),
    )
    check = json.loads(
        warpspace(
            *("montecarlo", target, "--spec-um", "40", "--over", over, "--seed", "11", "--json")
        ).out
    )
    probability = check["specification"]["probability"]
    # 100,000 machines each: the scale and this check are good to 0.07 % (1 σ)
    assert probability == pytest.approx(0.95, abs=0.003)
    assert found["probability"] == pytest.approx(0.95, abs=0.003)
    assert found["low"] < found["probability"] < found["high"]
    assert found["probability_before"] < 0.6
    written = tomllib.loads(target.read_text(encoding="utf-8"))["tolerances"]
    assert {key: written[key] for key in found["allocated"]} == {
        key: found["tolerances"][key] for key in found["allocated"]
    }


def test_json_has_the_keys_of_the_contract(warpspace) -> None:
    found = run(warpspace, "dvf5000_first", "--limit-um", "40", *QUICK)
    assert list(found) == [
        *("limit_um", "wanted", "loop", "over", "distribution", "tolerances", "allocated"),
        *("probability", "low", "high", "probability_before", "cost", "cost_before"),
        *("samples", "seed"),
    ]
    assert found["cost"] == pytest.approx(
        sum(1.0 / found["tolerances"][key] for key in found["allocated"])
    )


def test_fixed_ones_stay_dear_ones_are_wide_and_zeros_hold(warpspace) -> None:
    loop = ("--loop", "relative", *QUICK)
    plain = run(warpspace, "dvf5000_proposed", "--limit-um", "60", *loop)
    found = run(
        warpspace,
        *("dvf5000_proposed", "--limit-um", "60", "--fixed", "EXX, eyx", "--fixed", "EZX"),
        *("--cost", "EA0Z=20, EB0Z=20", *loop),
    )
    assert [found["tolerances"][key] for key in ("EXX", "EYX", "EZX")] == [10.0, 10.0, 10.0]
    assert not {"EXX", "EYX", "EZX", "EX0B"} & set(found["allocated"])
    assert found["tolerances"]["EX0B"] == 0.0
    for key in ("EA0Z", "EB0Z"):
        assert found["tolerances"][key] > 1.5 * plain["tolerances"][key]


def test_text_names_every_error_once_with_before_and_after(warpspace, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    result = warpspace("allocate", "dvf5000_first", "--limit-um", "40", *QUICK, "--fixed", "EXX")
    assert result.err == ""
    lines = {line.split()[0]: line for line in result.out.splitlines() if line.strip()}
    assert lines["EXX"].split() == ["EXX", *["positioning", "of", "X"], "10", "10", "µm", "fixed"]
    assert "evaluated at a random point" in result.out
    assert "95 % interval" in result.out


REFUSED = {
    "no limit": (("dvf5000_first",), "--limit-um"),
    "limit": (("dvf5000_first", "--limit-um", "-3"), "limit: -3 µm; expected"),
    "probability": (
        ("dvf5000_first", "--limit-um", "40", "--probability", "95"),
        "probability: 95; expected 0.5 to 0.9999",
    ),
    "cost": (("dvf5000_first", "--limit-um", "40", "--cost", "EXX=much"), "--cost 'EXX=much'"),
    "cost twice": (
        ("dvf5000_first", "--limit-um", "40", "--cost", "EXX=1", "--cost", "EXX=2"),
        "EXX is given twice",
    ),
    "unknown": (("dvf5000_first", "--limit-um", "40", "--fixed", "EXQ"), "EXQ"),
    "no tolerances": (("dvf5000_nominal", "--limit-um", "40"), "has no tolerances"),
    "samples": (("dvf5000_first", "--limit-um", "40", "--samples", "0"), "samples: 0"),
    "impossible": (
        ("dvf5000_first", "--limit-um", "1", "--fixed", "EXX,EYX,EZX,EXY,EYY", *QUICK),
        "no tolerance, however narrow, keeps 1 µm",
    ),
    "ending": (("dvf5000_first", "--limit-um", "40", "-o", "x.csv"), "unknown ending '.csv'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_in_one_message(warpspace, case: str) -> None:
    arguments, says = REFUSED[case]
    warpspace("allocate", *arguments).refused(says)


def test_an_existing_scene_is_replaced_only_when_forced_and_the_one_read_never(
    warpspace, tmp_path: Path
) -> None:
    source, target = tmp_path / "a.toml", tmp_path / "b.toml"
    text = 'machine = "dvf5000"\n[tolerances]\ndefault = { translation = 5, rotation = 5,'
    source.write_text(text + " squareness = 5 }\n", encoding="utf-8")
    target.write_text("mine", encoding="utf-8")
    arguments = ("allocate", source, "--limit-um", "40", *QUICK)
    warpspace(*arguments, "-o", target).refused("exists already; --force replaces it")
    warpspace(*arguments, "-o", source, "--force").refused("is read for what it would be replaced")
    assert warpspace(*arguments, "-o", target, "--force").status == 0
    assert "[tolerances]" in target.read_text(encoding="utf-8")
