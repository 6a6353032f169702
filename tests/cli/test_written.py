"""What commands write: files of every kind, nothing unasked over what is there, and no formulas."""

import csv
import io
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from products import first, pairwise
from warpspace import __version__
from warpspace.outputs.figures import registry
from warpspace.resources import scenes_dir
from warpspace.scene.library import load_scene

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
    "rows": (("montecarlo", "{scene}", "--rows", "--samples", "200", "-o"), "x.parquet"),
    "contributions": (("contributions", "{scene}", "--plot"), "x.svg"),
    "test": (("test", "straightness", "{scene}", "--plot"), "x.svg"),
    "draw": (("draw", "{scene}", "-o"), "x.svg"),
    "compare": (("compare", "{scene}", "{scene}", "-o"), "x.svg"),
    "report": (("report", "{scene}", "-o"), "x.html"),
    "draw moving": (("draw", "{scene}", "-o"), "x.gif"),
    "export": (("export", "{scene}", "-o"), "x.csv"),
    "thesis": (("thesis", "--markdown"), "x.md"),
    "new machine": (("new-machine", "wFXt", "-o"), "x.toml"),
    "adjust": (("adjust", "{scene}", "--grid", "3", "-o"), "x.toml"),
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


FIVE_AXES = """title = "W"
[machine]
chain = "wCbWXYZt"
[errors]
EXX = 3.0
EAW = 4.0
"""


def cells(content):
    assert content.endswith(b"\n")
    assert b"\r\n" not in content
    return list(csv.reader(io.StringIO(content.decode(), newline="")))


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "=w.toml"
    path.write_text(FIVE_AXES, encoding="utf-8")
    return path


def test_gains_have_the_unit_of_every_axis(machine, warpspace, tmp_path):
    target = tmp_path / "gains.csv"
    assert warpspace("gains", machine, "--csv", target).status == 0
    head = cells(target.read_bytes())[0]
    assert {"W_mm", "X_mm", "C_deg"} <= set(head)
    assert "W_deg" not in head


def test_the_name_of_a_scene_is_no_formula(machine, warpspace, tmp_path):
    target = tmp_path / "field.csv"
    result = warpspace("export", machine, "-o", target, "--grid", "2")
    assert result.status == 0, result.err
    for row in cells(target.read_bytes())[1:]:
        assert {"'=w", f"warpspace {__version__}"} <= {*row}
        assert not any(cell.startswith(("=", "+", "@", "\t", "\r")) for cell in row)


def test_sessions_that_differ_in_their_sign_stay_apart(warpspace, tmp_path):
    """`-run1` was written as `run1`."""
    data, target = tmp_path / "=data.csv", tmp_path / "residuals.csv"
    rows = [f"{x},{y},{x / 50},{y / 90},1,{name}" for x in (-100, 0, 100) for y in (-100, 100)
            for name in ("-run1", "run1")]  # fmt: skip
    data.write_text("x_mm,y_mm,ex_um,ey_um,ez_um,session\n" + "\n".join(rows), encoding="utf-8")
    result = warpspace("calibrate", "dvf5000_nominal", "--data", data, "--csv", target)
    assert result.status == 0, result.err
    head, *written = cells(target.read_bytes())
    assert {row[head.index("session")] for row in written} == {"'-run1", "run1"}
    assert {row[head.index("file")] for row in written} == {"'=data.csv"}


FORMATS = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
PLOTS = {
    "gains": ("gains", "dvf5000_general", "--at", "Y=-225,Z=-480"),
    "gains over the travel": ("gains", "dvf5000_general", "--loop", "workpiece", "--max"),
    "montecarlo": ("montecarlo", "dvf5000_general", "--samples", "2000", "--limit", "50"),
    "contributions": ("contributions", "dvf5000_general"),
    "tables": ("compensate", "dvf5000_first", "--sweep", "3,5", "--format", "sinumerik-enc"),
    "sobol": ("contributions", "dvf5000_proposed", "--sobol", "64"),
    "circular": ("test", "circular", "dvf5000_first", "--plane", "YZ", "--radius", "150"),
    "circular without errors": ("test", "circular", "dvf5000_nominal", "--radius", "50"),
}


@pytest.mark.parametrize(("plot", "ending"), pairwise([*PLOTS], [*FORMATS]))
def test_plots_are_written_twice_alike(warpspace, tmp_path, plot, ending):
    files = [tmp_path / f"{run}{ending}" for run in "ab"]
    for file in files:
        result = warpspace(*PLOTS[plot], "--plot", file)
        assert (result.status, result.err) == (0, "")
    first, second = (file.read_bytes() for file in files)
    assert first.startswith(FORMATS[ending])
    assert first == second
    assert len(first) > 3000
    assert {file.name for file in tmp_path.iterdir()} == {file.name for file in files}


SMALL = ("--size", "400x300", "--grid", "3")


def test_the_command_names_every_figure_of_one_scene(warpspace):
    words = warpspace("draw", "--help").out.replace(",", " ").replace(".", " ").split()
    assert set(registry.figure_names()) <= set(words)


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
@pytest.mark.parametrize("ending", first("png", "svg", "pdf"))
def test_a_snapshot_is_written(warpspace, tmp_path, ending):
    target = tmp_path / f"map.{ending}"
    result = warpspace("draw", "dvf5000_first", "-o", target, *SMALL)
    assert result.status == 0, result.err
    assert target.stat().st_size > 5000
    assert list(tmp_path.iterdir()) == [target]


def test_the_table_that_was_written_is_imported_again(tmp_path, warpspace):
    target = tmp_path / "m.cma"
    arguments = ("compensate", "dvf5000_first", "--format", "heidenhain", "--grid", "X=3,Y=9")
    assert warpspace(*arguments, "-o", target).status == 0
    files = sorted(tmp_path.iterdir())
    assert [file.name for file in files] == ["m.cma", "m_X.COM", "m_Y.COM", "m_Z.COM"]
    scene = tmp_path / "back.toml"
    result = warpspace("import", *files, "--machine", "dvf5000_nominal", "-o", scene)
    assert result.status == 0, result.err
    assert {"EXX", "EYX", "EZX", "EYY"} <= set(load_scene(scene).errors)


def test_existing_files_and_the_scene_itself_stay(tmp_path, warpspace):
    table = tmp_path / "t_X.COM"
    table.write_text("mine", encoding="utf-8")
    target = tmp_path / "t.cma"
    arguments = ("compensate", "dvf5000_first", "--format", "heidenhain", "-o", target)
    warpspace(*arguments).refused("t_X.COM", "exists already")
    assert table.read_text(encoding="utf-8") == "mine"
    assert not target.exists()


def test_tables_are_replaced_together_or_not_at_all(tmp_path, warpspace, monkeypatch):
    command = ("compensate", "dvf5000_first", "--format", "linuxcnc-comp", "--force", "-o")
    assert warpspace(*command, tmp_path / "t.comp").status == 0
    paths = sorted(tmp_path.iterdir())
    assert len(paths) > 1
    for path in paths:
        path.write_bytes(b"old")
    replace, targets = Path.replace, list[Path]()

    def fill_the_disk(path, target):
        targets.append(target)
        if len(targets) == len(paths):
            raise OSError(28, "No space left on device")
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", fill_the_disk)
    warpspace(*command, tmp_path / "t.comp").refused("No space left")
    assert sorted(tmp_path.iterdir()) == paths
    assert {path.read_bytes() for path in paths} == {b"old"}


WRITE_AND_DIE = """
import os, sys
from pathlib import Path
import numpy as np
from warpspace.cli.shared_options import write_texts
from warpspace.scene.library import load_scene
from dataclasses import replace
from warpspace.machine.errors import Covariance
from warpspace.scene.scene_writer import scene_files

folder, scale, last = Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
scene = load_scene("dvf5000_first")
rows = tuple(map(tuple, (scale * np.eye(31)).tolist()))
covariance = Covariance(scene.parameter_keys[:31], rows)
texts = scene_files(replace(scene, covariance=covariance), "x")
move, count = Path.replace, 0
def move_or_die(path, target):
    global count
    count += 1
    if count > last:
        os._exit(9)
    return move(path, target)
Path.replace = move_or_die
write_texts({folder / "x.npz": texts[".npz"], folder / "x.toml": texts[""]}, force=True)
"""


def test_a_scene_is_refused_with_the_covariance_of_another_calibration(tmp_path, warpspace):
    def write(scale, last):
        line = [sys.executable, "-c", WRITE_AND_DIE, str(tmp_path), str(scale), str(last)]
        return subprocess.run(line, check=False).returncode

    assert write(1.0, 2) == 0
    assert warpspace("check", tmp_path / "x.toml").status == 0
    assert write(2.0, 1) == 9  # ended between the two files
    warpspace("check", tmp_path / "x.toml").refused("x.npz", "is not the matrix of this scene")
    assert write(2.0, 2) == 0
    assert warpspace("check", tmp_path / "x.toml").status == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.npz", "x.toml"]


def test_a_log_of_adjustments_is_extended_and_never_damaged(tmp_path, warpspace):
    text = (scenes_dir() / "dvf5000_first.toml").read_text("utf-8")
    scene, log = tmp_path / "m.toml", tmp_path / "log.toml"
    scene.write_text(f"{text}\n[uncertainty]\nEA0Z = 1\nEB0Z = 1\nEB0B = 1\n", encoding="utf-8")
    call = ("adjust", scene, "--grid", "3", "--count", "1", "--log", log)
    first = warpspace(*call, "-o", tmp_path / "after.toml", "--json").json
    (act,) = first["adjustments"][0]["acts"]
    assert log.read_text("utf-8") == (
        f'[[done]]\nacts = {{ "{act["adjuster"]}" = {act["change"]} }}\n'
        "before = { EA0Z = 33.9 }\n"
    )
    again = ("adjust", tmp_path / "after.toml", "--grid", "3", "--done", log, "--json")
    learned = warpspace(*again).json["stiffness"]
    assert [one["factor"] for one in learned] == pytest.approx([1.0, 1.0])
    before = log.read_bytes()
    warpspace(*call, "-o", log).refused("log.toml")
    log.write_bytes(before + b"[[done]]\nacts = 3\n")
    warpspace(*again).refused("done[1].acts = 3", "expected a table")
    warpspace(*call).refused("done[1].acts = 3")
    assert log.read_bytes() == before + b"[[done]]\nacts = 3\n"
    warpspace("adjust", "machine_scara", "--log", log).refused("--log", "has no adjusters")
