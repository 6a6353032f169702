"""What the commands write over: nothing unasked, and never what they read."""

import os
import stat
from pathlib import Path

import pytest

SCENE = """
title = "small"
machine = "dvf5000"
[errors]
EXX = { csv = "measured.csv", column = "error" }
"""
WRITERS = {
    "field": (("field", "{scene}", "--grid", "3", "--csv"), "x.csv"),
    "field parquet": (("field", "{scene}", "--grid", "3", "-o"), "x.parquet"),
    "field npz": (("field", "{scene}", "--grid", "3", "-o"), "x.npz"),
    "field vts": (("field", "{scene}", "--grid", "3", "-o"), "x.vts"),
    "gains csv": (("gains", "{scene}", "--csv"), "x.csv"),
    "gains plot": (("gains", "{scene}", "--plot"), "x.svg"),
    "montecarlo": (("montecarlo", "{scene}", "--samples", "200", "--plot"), "x.svg"),
    "machines sampled": (("montecarlo", "{scene}", "--samples", "200", "-o"), "x.csv"),
    "sweep": (("sweep", "{scene}", "--samples", "200", "-o"), "x.parquet"),
    "contributions": (("contributions", "{scene}", "--plot"), "x.svg"),
    "ballbar": (("ballbar", "{scene}", "--plane", "XY", "--radius", "100", "--plot"), "x.svg"),
    "test": (("test", "straightness", "{scene}", "--plot"), "x.svg"),
    "snapshot": (("snapshot", "{scene}", "-o"), "x.svg"),
    "compare": (("compare", "{scene}", "{scene}", "-o"), "x.svg"),
    "report": (("report", "{scene}", "-o"), "x.html"),
    "animate": (("animate", "{scene}", "-o"), "x.gif"),
    "export": (("export", "{scene}", "-o"), "x.csv"),
    "thesis": (("thesis", "--markdown"), "x.md"),
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Give a scene that reads a CSV file."""
    (tmp_path / "measured.csv").write_text("X,error\n-275,0\n275,4\n", encoding="utf-8")
    path = tmp_path / "s.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def command(writer: str, scene: Path) -> list[str]:
    """Spell a command that writes a file, its target left out."""
    return [part.format(scene=scene) for part in WRITERS[writer][0]]


@pytest.mark.parametrize("writer", WRITERS)
def test_an_existing_file_stays_unless_forced(
    writer: str, scene: Path, tmp_path: Path, warpspace
) -> None:
    target = tmp_path / WRITERS[writer][1]
    target.write_text("mine", encoding="utf-8")
    warpspace(*command(writer, scene), target).refused("exists already; --force replaces it")
    assert target.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("writer", WRITERS)
def test_a_scene_is_no_target(writer: str, scene: Path, warpspace) -> None:
    warpspace(*command(writer, scene), scene, "--force").refused("unknown ending '.toml'")
    assert scene.read_text(encoding="utf-8") == SCENE


@pytest.mark.parametrize("writer", [name for name in WRITERS if name != "thesis"])
@pytest.mark.parametrize("link", ["symbolic", "hard"])
@pytest.mark.parametrize("source", ["s.toml", "measured.csv"])
def test_what_is_read_is_never_replaced_under_another_name(
    writer: str, link: str, source: str, scene: Path, tmp_path: Path, warpspace
) -> None:
    before = (tmp_path / source).read_bytes()
    target = tmp_path / WRITERS[writer][1]
    if link == "symbolic":
        target.symlink_to(source)
    else:
        os.link(tmp_path / source, target)
    warpspace(*command(writer, scene), target, "--force").refused("is read for")
    assert (tmp_path / source).read_bytes() == before


def test_the_errors_of_a_scene_are_never_replaced(scene: Path, tmp_path: Path, warpspace) -> None:
    target = tmp_path / "measured.csv"
    before = target.read_bytes()
    warpspace(*command("field", scene), target, "--force").refused("measured.csv: is read for")
    assert target.read_bytes() == before


@pytest.mark.parametrize("mode", [0o600, 0o664])
@pytest.mark.parametrize("writer", ["field", "gains plot"])
def test_a_replaced_file_keeps_its_mode(
    writer: str, mode: int, scene: Path, tmp_path: Path, warpspace
) -> None:
    target = tmp_path / WRITERS[writer][1]
    target.write_text("old", encoding="utf-8")
    target.chmod(mode)
    assert warpspace(*command(writer, scene), target, "--force").status == 0
    assert stat.S_IMODE(target.stat().st_mode) == mode
    assert target.read_text(encoding="utf-8") != "old"


def test_a_loop_of_links_is_refused(scene: Path, tmp_path: Path, warpspace) -> None:
    target = tmp_path / "x.csv"
    target.symlink_to(target)
    warpspace(*command("field", scene), target).refused("x.csv", "symbolic links")
    warpspace("check", target).refused("x.csv")
