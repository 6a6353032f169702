"""`warpspace machines` lists the bundled machines, `check` speaks of meshes."""

import json
from pathlib import Path

from click.testing import CliRunner
from trimesh import Trimesh, creation

from warpspace.cli.main import cli
from warpspace.scene.machines import load_machine, machine_names


def run(*arguments):
    return CliRunner().invoke(cli, list(arguments))


def test_machines_are_listed_with_chain_source_and_picture():
    found = json.loads(run("machines", "--json").output)["machines"]
    assert [row["name"] for row in found] == list(machine_names())
    for row in found:
        machine = load_machine(row["name"])
        assert row["chain"] == str(machine.chain)
        assert row["source"] == machine.source
        assert row["title"] == machine.title
        assert Path(row["picture"]).is_file()
    text = run("machines").output
    for name in machine_names():
        assert name in text


def test_check_names_a_mesh_that_is_not_closed_and_refuses_an_empty_one(tmp_path):
    whole = creation.box(extents=(100.0, 60.0, 40.0))
    Trimesh(whole.vertices, whole.faces[:-1]).export(tmp_path / "open.stl")
    (tmp_path / "empty.stl").write_bytes(b"")
    for name in ("open", "empty"):
        text = f'machine = "scara"\n[bodies]\nZ = "{name}.stl"\n'
        (tmp_path / f"{name}.toml").write_text(text)
    opened = run("check", str(tmp_path / "open.toml"), "--json")
    assert opened.exit_code == 0
    assert "not closed" in " ".join(json.loads(opened.output)["notes"])
    refused = run("check", str(tmp_path / "empty.toml"))
    assert refused.exit_code == 2
    assert "bodies.Z" in refused.output
    assert "the file is empty" in refused.output
    assert "Traceback" not in refused.output
