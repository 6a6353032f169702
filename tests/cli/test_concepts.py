"""New machines and their comparison on the command line."""

import json

import pytest

SAMPLES = ("--samples", "20000")


@pytest.fixture
def machines(warpspace, tmp_path):
    paths = [tmp_path / "tool.toml", tmp_path / "table.toml"]
    for chain, path in zip(("wCBFXYZt", "wCBYXFZt"), paths, strict=True):
        assert warpspace("new-machine", chain, "-o", path, "--title", path.stem).status == 0
    return paths


def test_concepts_agree_with_montecarlo_and_contributions(warpspace, machines):
    limit = ("--limit-um", "25")
    found = json.loads(warpspace("concepts", *machines, *limit, *SAMPLES, "--json").out)
    assert found["tolerances"] == {"translation": 10.0, "rotation": 20.0, "squareness": 25.0}
    for path, concept in zip(machines, found["concepts"], strict=True):
        alone = json.loads(
            warpspace(
                *("montecarlo", path, *SAMPLES, "--spec-um", "25", "--over", "max"),
                *("--grid", "11", "--loop", "relative", "--json"),
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


def test_tolerances_are_those_of_the_first_scene_unless_each_has_its_own(warpspace, machines):
    text = machines[1].read_text(encoding="utf-8")
    machines[1].write_text(text.replace("translation = 10", "translation = 100"), encoding="utf-8")
    same = json.loads(warpspace("concepts", *machines, *SAMPLES, "--json").out)
    own = json.loads(warpspace("concepts", *machines, *SAMPLES, "--own-tolerances", "--json").out)
    assert same["concepts"][0] == own["concepts"][0]
    assert own["concepts"][1]["mean_um"] > 3.0 * same["concepts"][1]["mean_um"]
    assert own["tolerances"] is None


def test_missing_tolerances_are_said(warpspace, machines):
    text = machines[0].read_text(encoding="utf-8")
    machines[0].write_text(text.replace(", rotation = 20", ""), encoding="utf-8")
    warpspace("concepts", *machines).refused("tool", "tolerances.default has no rotation")
