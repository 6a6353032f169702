"""New machines and their comparison on the command line."""

import csv
import json
from pathlib import Path

import pytest

SAMPLES = ("--samples", "20000")


@pytest.fixture
def machines(warpspace, tmp_path: Path) -> list[Path]:
    paths = [tmp_path / "tool.toml", tmp_path / "table.toml"]
    for chain, path in zip(("wCBFXYZt", "wCBYXFZt"), paths, strict=True):
        assert warpspace("new-machine", chain, "-o", path, "--title", path.stem).status == 0
    return paths


def test_a_new_machine_is_valid_and_is_not_replaced_unasked(warpspace, machines) -> None:
    assert "valid. tool" in warpspace("check", machines[0]).out
    before = machines[0].read_text(encoding="utf-8")
    warpspace("new-machine", "wFXt", "-o", machines[0]).refused("--force")
    assert machines[0].read_text(encoding="utf-8") == before
    assert warpspace("new-machine", "wFXt", "-o", machines[0], "--force").status == 0
    assert "wFXt, 1 axis" in warpspace("check", machines[0]).out


@pytest.mark.parametrize(
    ("chain", "said"),
    [("wQFXt", "wQFXt"), ("wXXFt", "twice"), ("wFt", "no axis"), ("", "cannot be read")],
)
def test_a_chain_that_is_none_is_refused(warpspace, tmp_path, chain, said) -> None:
    target = tmp_path / "new.toml"
    warpspace("new-machine", chain, "-o", target).refused(said)
    assert not target.exists()


def test_concepts_agree_with_montecarlo_and_contributions(warpspace, machines) -> None:
    limit = ("--limit-um", "25")
    found = json.loads(warpspace("concepts", *machines, *limit, *SAMPLES, "--json").out)
    assert found["tolerances"] == {"translation": 10.0, "rotation": 20.0, "squareness": 25.0}
    for path, concept in zip(machines, found["concepts"], strict=True):
        alone = json.loads(
            warpspace(
                *("montecarlo", path, *SAMPLES, "--spec-um", "25", "--loop", "relative", "--json")
            ).out
        )
        for key in ("mean_um", "p95_um", "max_um"):
            assert concept[key] == alone[key]
        assert concept["probability"] == alone["specification"]["probability"]
        shares = json.loads(warpspace("contributions", path, "--loop", "relative", "--json").out)
        leading = [(row["key"], row["share"]) for row in shares["contributions"][:3]]
        assert [(row["key"], row["share"]) for row in concept["errors"]] == leading
    # the axes of the second machine carry the table, nearer to the workpiece: shorter levers
    assert found["concepts"][0]["mean_um"] != found["concepts"][1]["mean_um"]


def test_tolerances_are_those_of_the_first_scene_unless_each_has_its_own(
    warpspace, machines
) -> None:
    text = machines[1].read_text(encoding="utf-8")
    machines[1].write_text(text.replace("translation = 10", "translation = 100"), encoding="utf-8")
    same = json.loads(warpspace("concepts", *machines, *SAMPLES, "--json").out)
    own = json.loads(warpspace("concepts", *machines, *SAMPLES, "--own-tolerances", "--json").out)
    assert same["concepts"][0] == own["concepts"][0]
    assert own["concepts"][1]["mean_um"] > 3.0 * same["concepts"][1]["mean_um"]
    assert own["tolerances"] is None


def test_the_csv_has_a_row_for_each_machine(warpspace, machines, tmp_path) -> None:
    target = tmp_path / "concepts.csv"
    result = warpspace("concepts", *machines, *SAMPLES, "--limit-um", "25", "--csv", target)
    assert result.status == 0, result.err
    assert "≤ 25 µm" in result.out
    rows = list(csv.DictReader(target.read_text(encoding="utf-8").splitlines()))
    assert [row["scene"] for row in rows] == ["tool", "table"]
    assert float(rows[0]["limit_um"]) == 25.0
    assert rows[0]["error_1"].startswith("E")
    warpspace("concepts", *machines, *SAMPLES, "--csv", target).refused("--force")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--limit-um", "0"), "expected above 0"),
        (("--limit-um", "nan"), "expected above 0"),
        (("--samples", "0"), "samples: 0"),
        (("--plot", "x.txt"), "unknown ending"),
        (("--size", "7"), "WIDTHxHEIGHT"),
    ],
)
def test_bad_options_are_refused(warpspace, machines, options, said) -> None:
    warpspace("concepts", *machines, *options).refused(said)


def test_missing_tolerances_and_too_many_scenes_are_said(warpspace, machines) -> None:
    text = machines[0].read_text(encoding="utf-8")
    machines[0].write_text(text.replace(", rotation = 20", ""), encoding="utf-8")
    warpspace("concepts", *machines).refused("tool", "tolerances.default has no rotation")
    warpspace("concepts", *[machines[1]] * 9).refused("at most 8")
    warpspace("concepts", machines[1], "--plot", "x.png").refused("two scenes")


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
def test_the_picture_is_drawn(warpspace, machines, tmp_path) -> None:
    target = tmp_path / "concepts.png"
    options = ("--size", "800x600", *SAMPLES, "--limit-um", "25")
    result = warpspace("concepts", *machines, *options, "--plot", target)
    assert result.status == 0, result.err
    assert target.read_bytes().startswith(b"\x89PNG")
