"""What the commands write over: nothing unasked, and never what they read."""

import stat

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
    "draw": (("draw", "{scene}", "-o"), "x.svg"),
    "compare": (("compare", "{scene}", "{scene}", "-o"), "x.svg"),
    "report": (("report", "{scene}", "-o"), "x.html"),
    "draw moving": (("draw", "{scene}", "-o"), "x.gif"),
    "export": (("export", "{scene}", "-o"), "x.csv"),
    "thesis": (("thesis", "--markdown"), "x.md"),
    "new machine": (("new-machine", "wFXt", "-o"), "x.toml"),
    "repair": (("repair", "{scene}", "--grid", "3", "-o"), "x.toml"),
    "concepts": (("concepts", "{scene}", "{scene}", "--samples", "200", "--csv"), "x.csv"),
    "convert": (("convert", "{scene}", "--to", "squareness=over_90", "-o"), "x.toml"),
    "template": (("import", "--template", "X", "-o"), "x.csv"),
}


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "measured.csv").write_text("X,error\n-275,0\n275,4\n", encoding="utf-8")
    path = tmp_path / "s.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def command(writer, scene):
    return [part.format(scene=scene) for part in WRITERS[writer][0]]


@pytest.mark.parametrize("writer", WRITERS)
def test_an_existing_file_stays_unless_forced(writer, scene, tmp_path, warpspace):
    target = tmp_path / WRITERS[writer][1]
    target.write_text("mine", encoding="utf-8")
    warpspace(*command(writer, scene), target).refused("exists already; --force replaces it")
    assert target.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("mode", [0o600, 0o664])
@pytest.mark.parametrize("writer", ["field", "gains plot"])
def test_a_replaced_file_keeps_its_mode(writer, mode, scene, tmp_path, warpspace):
    target = tmp_path / WRITERS[writer][1]
    target.write_text("old", encoding="utf-8")
    target.chmod(mode)
    assert warpspace(*command(writer, scene), target, "--force").status == 0
    assert stat.S_IMODE(target.stat().st_mode) == mode
    assert target.read_text(encoding="utf-8") != "old"


def test_a_loop_of_links_is_refused(scene, tmp_path, warpspace):
    target = tmp_path / "x.csv"
    target.symlink_to(target)
    warpspace(*command("field", scene), target).refused("x.csv", "symbolic links")
    warpspace("check", target).refused("x.csv")
