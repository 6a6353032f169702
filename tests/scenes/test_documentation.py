"""What the README and the page on scene files show works as it stands there."""

import re
from pathlib import Path

import pytest

from warpspace.scene.library import load_scene
from warpspace.scene.schema import (
    ConventionSection,
    PointsSection,
    ViewSection,
)

ROOT = Path(__file__).resolve().parents[2]


def _blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text("utf-8"), re.DOTALL)


def test_documented_scene_loads_and_names_every_key(tmp_path):
    (text, machine) = _blocks("docs/scenes.md", "toml")
    (tmp_path / "xm60_x.csv").write_text("X,pitch\n-275,0\n275,3.5\n")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    scene = load_scene(tmp_path / "mine.toml")
    assert scene.errors.amplitude("EBX") == 3.5
    for section in (ConventionSection, PointsSection, ViewSection):
        for key in section.model_fields:
            assert re.search(rf"^{key} = ", text, re.MULTILINE), key
    (tmp_path / "own.toml").write_text(machine, encoding="utf-8")
    assert str(load_scene(tmp_path / "own.toml").machine.chain) == "wAXFYZt"


def test_readme_snippet_prints_what_it_says(capsys):
    (snippet,) = _blocks("README.md", "python")
    exec(snippet, {})
    printed = capsys.readouterr().out.split()
    claimed = re.search(r"# ([\d.]+) µm", snippet)
    assert claimed is not None
    assert float(printed[0]) == pytest.approx(float(claimed.group(1)), abs=0.005)


def test_readme_names_every_command():
    from warpspace.cli.main import cli

    page = (ROOT / "README.md").read_text("utf-8")
    table = page[page.index("| command") : page.index("Shell completion")]
    assert set(re.findall(r"`(\w+)`", re.sub(r"\|[^|]*\|\n", "|\n", table))) == set(cli.commands)
