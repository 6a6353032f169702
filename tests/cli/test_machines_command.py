"""`warpspace machines` lists the bundled machines, `check` speaks of meshes."""

import json
from pathlib import Path

from trimesh import Trimesh, creation

from warpspace.scene.machines import load_machine, machine_names


def test_machines_are_listed_with_chain_source_and_picture(warpspace):
    found = json.loads(warpspace("machines", "--json").out)["machines"]
    assert [row["name"] for row in found] == list(machine_names())
    for row in found:
        machine = load_machine(row["name"])
        assert row["chain"] == str(machine.chain)
        assert row["source"] == machine.source
        assert row["title"] == machine.title
        assert Path(row["picture"]).is_file()
    text = warpspace("machines").out
    for name in machine_names():
        assert name in text


def test_check_names_a_mesh_that_is_not_closed_and_refuses_an_empty_one(tmp_path, warpspace):
    whole = creation.box(extents=(100.0, 60.0, 40.0))
    Trimesh(whole.vertices, whole.faces[:-1]).export(tmp_path / "open.stl")
    (tmp_path / "empty.stl").write_bytes(b"")
    for name in ("open", "empty"):
        text = f'machine = "scara"\n[bodies]\nZ = "{name}.stl"\n'
        (tmp_path / f"{name}.toml").write_text(text)
    opened = warpspace("check", str(tmp_path / "open.toml"), "--json")
    assert opened.status == 0
    assert "not closed" in " ".join(json.loads(opened.out)["notes"])
    refused = warpspace("check", str(tmp_path / "empty.toml"))
    refused.refused("bodies.Z", "the file is empty")
