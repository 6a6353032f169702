"""The program: its commands, what they print and how they end."""

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import click
import numpy as np
import pytest
from trimesh import Trimesh, creation

import warpspace as api
from warpspace import evaluate, load_scene
from warpspace.cli import register_command
from warpspace.cli.main import BUNDLED, COMMANDS, cli
from warpspace.cli.shared_options import spell_json
from warpspace.exceptions import SceneError


@pytest.mark.parametrize(
    ("failure", "status", "message"),
    [
        (SceneError("a.toml", ["title = 5: expected a text"]), 2, "a.toml: title = 5"),
        (MemoryError(), 2, "not enough memory"),
        (ImportError("libx.so: failed to map segment from shared object"), 2, "not enough memory"),
        (RuntimeError("can't start new thread"), 2, "not enough memory"),
        (OSError(28, "No space left on device", "out.csv"), 2, "out.csv: No space left"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_foreseen_failure_is_one_message_and_a_status(
    failure, status, message, monkeypatch, warpspace
):
    def fail(**options):
        raise failure

    monkeypatch.setattr(cli, "main", fail)
    result = warpspace("check", "dvf5000_first")
    assert (result.status, result.out) == (status, "")
    assert message in result.err
    assert result.err.count("\n") == 1


@pytest.mark.parametrize(
    ("word", "expected"), [("dvf5000_f", ["plain,dvf5000_first"]), ("./x", ["file,./x"])]
)
def test_shell_completes_bundled_names_and_files(word, expected):
    given = {"COMP_WORDS": f"warpspace field {word}", "COMP_CWORD": "2"}
    environment = {**os.environ, **given, "_WARPSPACE_COMPLETE": "bash_complete"}
    code = "import sys; sys.argv = ['warpspace']; from warpspace.cli import main; main()"
    run = (sys.executable, "-c", code)
    result = subprocess.run(run, env=environment, capture_output=True, text=True, check=False)
    assert (result.stdout.split(), result.stderr) == (expected, "")


def test_every_command_of_a_module_is_listed():
    for task, names in BUNDLED.items():
        home = vars(import_module(f"warpspace.cli.commands.{task}")).values()
        assert {one.name for one in home if isinstance(one, click.Command)} == {*names.split()}
    assert len(COMMANDS) == len(list(COMMANDS)) >= 15
    for name, command in COMMANDS.items():
        assert command.name == name
        assert command.help


def test_a_plug_in_adds_a_command(warpspace):
    @click.command("tell-time")
    @click.argument("where")
    def tell_time(where):
        """Say what time it is."""
        click.echo(f"noon in {where}")

    assert warpspace("tell-time", "Ulm").status == 2
    with pytest.raises(ValueError, match="'field'"):
        register_command(click.Command("field"))
    register_command(tell_time)
    try:
        assert "Say what time it is." in warpspace("--help").out
        assert warpspace("tell-time", "Ulm").out == "noon in Ulm\n"
        with pytest.raises(ValueError, match="'tell-time'"):
            register_command(tell_time)
    finally:
        del COMMANDS["tell-time"]
    assert "tell-time" not in warpspace("--help").out


def test_one_task_imports_no_other_and_help_imports_no_tables():
    code = (
        "import sys; from warpspace.cli.main import cli; cli.commands['list'];"
        "known = [n.rpartition('.')[2] for n in sys.modules if 'cli.commands.' in n];"
        "print(known, 'rich' in sys.modules);"
        "cli.main(['--help'], standalone_mode=False);"
        "print('rich' in sys.modules, 'numpy' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lines = found.stdout.splitlines()
    assert (lines[0], lines[-1]) == ("['machine'] False", "False False")


FIELD = ("field", "dvf5000_first", "--at", "X=0,Y=-225,Z=-480,B=0,C=0")


def test_field_csv_can_be_read_back_as_an_error_table(tmp_path, warpspace):
    points = [option for x in (-275, 0, 275) for option in ("--at", f"X={x},Y=0,Z=-280")]
    warpspace("field", "dvf5000_first", *points, "--csv", tmp_path / "run.csv")
    path = tmp_path / "again.toml"
    path.write_text(
        'machine = "dvf5000"\n[errors]\n'
        'EXX = { csv = "run.csv", column = "error_relative_R_x_um" }\n',
        encoding="utf-8",
    )
    first = api.evaluate(api.load_scene("dvf5000_first"), at={"X": 0.0, "Z": -280.0})
    again = api.evaluate(api.load_scene(path), at={"X": 0.0, "Z": -280.0})
    assert again.error_um[0] == pytest.approx(first.error_um[0], abs=1e-6)


def test_version_is_the_package_s(warpspace):
    assert api.__version__ in warpspace("--version").out


def run_module(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "warpspace", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        timeout=120,
        check=False,
        **options,
    )


def test_module_runs_as_a_process_in_any_folder(tmp_path):
    result = run_module(*FIELD, "--json", stdout=subprocess.PIPE, cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert json.loads(result.stdout)["points"][0]["axes"]["Z"] == -480


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a full device")
def test_full_disk_is_one_message():
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        result = run_module(*FIELD, stdout=full)
    assert result.returncode == 2
    assert "No space left" in result.stderr
    assert "Traceback" not in result.stderr


def test_reader_that_goes_away_is_no_error():
    command = f"{sys.executable} -m warpspace field dvf5000_first --grid 11 --json | head -c 10"
    result = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False
    )
    assert (result.stdout, result.stderr) == ('{"points":', "")


def test_json_is_printed_in_pieces_and_is_one_object_with_every_point(monkeypatch, warpspace):
    """A grid of 101 took 2.2 GB."""
    lengths: list[int] = []

    def count(value):
        lengths.extend([len(value)] if isinstance(value, list) else [])
        return spell_json(value)

    monkeypatch.setattr("warpspace.cli.shared_options.spell_json", count)
    monkeypatch.setattr("warpspace.cli.field_output.POINTS_AT_ONCE", 150)
    result = warpspace("field", "dvf5000_first", "--grid", 7, "--json")
    assert result.status == 0, result.err
    assert lengths == [150, 150, 43]
    assert result.out.count("\n") == 1
    keys = "points loop frame statistics statistics_nodes second_order_um"
    assert {*result.json} == {*keys.split()}
    errors = np.array([point["error_um"] for point in result.json["points"]])
    expected = evaluate(load_scene("dvf5000_first"), grid=7).error_um.reshape(-1, 3)
    np.testing.assert_array_equal(errors, expected)


def test_check_names_a_mesh_that_is_not_closed_and_refuses_an_empty_one(tmp_path, warpspace):
    whole = creation.box(extents=(100.0, 60.0, 40.0))
    Trimesh(whole.vertices, whole.faces[:-1]).export(tmp_path / "open.stl")
    (tmp_path / "empty.stl").write_bytes(b"")
    for name in ("open", "empty"):
        text = f'machine = "scara"\n[bodies]\nZ = "{name}.stl"\n'
        (tmp_path / f"{name}.toml").write_text(text)
    opened = warpspace("check", str(tmp_path / "open.toml"), "--json")
    assert opened.status == 0
    assert "not closed" in " ".join(opened.json["remarks"])
    refused = warpspace("check", str(tmp_path / "empty.toml"))
    refused.refused("bodies.Z", "the file is empty")
