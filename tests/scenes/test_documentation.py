"""What the README and the page on scene files show works as it stands there."""

import re
from pathlib import Path

import pytest

from warpspace.app.server.tabs import tabs
from warpspace.kinematics.conventions.registry import convention_names
from warpspace.machine.curves.registry import curve_kinds
from warpspace.scene.library import load_scene
from warpspace.scene.schema import (
    ConventionSection,
    PointsSection,
    ViewSection,
)

ROOT = Path(__file__).resolve().parents[2]
PAGES = (ROOT / "README.md", ROOT / "CONVENTIONS.md", *sorted((ROOT / "docs").glob("*.md")))


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
    assert set(re.findall(r"`([\w-]+)`", re.sub(r"\|[^|]*\|\n", "|\n", table))) == set(cli.commands)


def test_every_picture_that_is_linked_exists_and_every_other_picture_is_linked():
    linked = {
        (page.parent / target).resolve()
        for page in PAGES
        for target in re.findall(r"!\[[^\]]+\]\(([^)]+\.png)\)", page.read_text("utf-8"))
    }
    machines = (ROOT / "assets" / "machines").glob("*/picture.png")
    assert linked == {*(ROOT / "docs" / "images").glob("*.png"), *machines}


def test_pictures_are_small():
    sizes = [path.stat().st_size for path in (ROOT / "docs" / "images").glob("*.png")]
    assert sum(sizes) < 3.5e6
    machines = [p.stat().st_size for p in (ROOT / "assets/machines").glob("*/picture.png")]
    assert max(machines) < 2e5


def test_there_is_one_picture_of_every_tab():
    server = ROOT / "src/warpspace/app/server"
    layout = "".join((server / name).read_text("utf-8") for name in ("layout.py", "contents.py"))
    named = re.findall(r'(?:add_tab|set_panel_label)\("([^"]+)"\)', layout)
    every = {tab.name for tab in tabs()} | set(named) - {"warpspace"}
    script = (ROOT / "examples/screenshots.py").read_text("utf-8")
    visits = re.findall(r'"tab_(\w+)": Visit\(\w+, "([^"]+)"', script)
    # the heading is on every picture
    assert sorted(tab for _, tab in visits) == sorted(every)
    assert len(visits) > 10
    page = (ROOT / "docs/app.md").read_text("utf-8")
    for name, tab in visits:
        assert name == tab.lower().replace(" ", "_")
        assert f"](images/tab_{name}.png)" in page


def test_every_kind_of_curve_and_every_convention_is_documented():
    for page in ("docs/scenes.md", "CONVENTIONS.md"):
        text = (ROOT / page).read_text("utf-8")
        for kind in curve_kinds():
            for form in kind.forms:
                assert f"{{ {form[0]}" in text, (page, form)
        for name in convention_names():
            assert f'"{name}"' in text, (page, name)
