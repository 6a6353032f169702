"""The worked budget of docs/uncertainty.md: its files, its commands, its numbers by hand."""

import math
import shlex

import pytest

from doc_pages import DOCS, blocks, section

PAGE = section(DOCS / "uncertainty.md", "A complete budget, from reading to verdict") or ""
COMMANDS = [shlex.split(line)[1:] for line in PAGE.splitlines() if line.startswith("    warpspace")]


@pytest.fixture
def answers(warpspace, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "laser_x.csv").write_text(*blocks(PAGE, "text"), encoding="utf-8")
    (tmp_path / "width.toml").write_text(*blocks(PAGE, "toml"), encoding="utf-8")
    calibrate, piece, part = COMMANDS
    found = warpspace(*calibrate, "--json").json
    assert warpspace(*piece).status == 0
    point = warpspace("field", "measured.toml", "--at", "X=275,Y=225,Z=-80", "--json").json
    return found, point, warpspace(*part, "--json").json, part, warpspace


def test_each_number_of_the_worked_budget_is_that_of_the_program(answers, tmp_path):
    found, point, made, part, warpspace = answers
    amplitude = (0.3 * (6.25 - 1.65) + 0.1 * (4.9 - 3.15) + 0.5 * 8.1) / 0.7
    scatter = math.hypot(0.3, 0.005 / math.sqrt(3.0)) / math.sqrt(1.4)
    scale = 0.55 * math.sqrt(0.25**2 + (0.5**2 + (11.5 * 0.25) ** 2 + 2.0**2) / 3.0)
    u, freedom = math.hypot(scatter, scale), 4.0 * (1.0 + (scale / scatter) ** 2) ** 2
    (row,) = found["parameters"]
    assert row["value"] == pytest.approx(amplitude, abs=1e-6)
    assert row["standard_uncertainty"] == pytest.approx(u, rel=1e-4)
    shares = {one["name"]: one["share_of_map"] for one in found["instrument"]["contributions"]}
    assert shares["temperature of the machine"] == pytest.approx(0.62, abs=0.005)
    (at,) = point["points"]
    assert at["error_um"] == pytest.approx([amplitude, 0.0, 0.0], abs=1e-6)
    assert at["u95_um"][0] == pytest.approx(2.0 * u, rel=2e-3)  # k = 2.001
    (left,) = (one for one in made["features"] if one["name"] == "left")
    width = left["measures"]["distance to right"]
    assert width["placed_difference_um"] == pytest.approx(amplitude * 160.0 / 550.0, abs=1e-4)
    assert width["u95_placed_difference_um"] == pytest.approx(2.0 * u * 160.0 / 550.0, rel=2e-3)
    assert (width["verdict"], round(width["probability"], 4)) == ("pass", 0.9765)
    narrow = (tmp_path / "width.toml").read_text("utf-8").replace("= 3\n", "= 2.8\n")
    (tmp_path / "width.toml").write_text(narrow, encoding="utf-8")
    (left,) = (one for one in warpspace(*part, "--json").json["features"] if one["name"] == "left")
    told = left["measures"]["distance to right"]
    assert (told["verdict"], round(told["probability"], 3)) == ("undecided", 0.918)
    for number in (amplitude, u, scatter, 2.0 * u, width["placed_difference_um"]):
        assert any(f"{number:.{digits}f}" in PAGE for digits in (2, 3, 4)), number
    assert f"{freedom:.0f}" in PAGE
