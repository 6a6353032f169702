"""Acceptance: bounds of the measurands of a part, as JSON, as a table, and refused."""

import pytest
from trimesh import creation

from bench_scenes import THREE_AXES

SCENE = f"""{THREE_AXES}[part]
file = "box.stl"
features = "box.toml"
[tolerances]
default = {{ translation = 0, rotation = 0, squareness = 0 }}
EC0Y = 25
"""
FEATURES = """[[features]]
name = "side"
is = "plane"
near = [50, 0, 0]
[[features]]
name = "back"
is = "plane"
near = [0, 30, 0]
measure = "squareness"
to = ["side"]
tolerance_urad = 12
"""
PLAN = """[[acceptance]]
test = "circular"
plane = "XY"
radius_mm = 100
points = 72
limit_um = {limit}
"""


@pytest.fixture
def files(tmp_path):
    creation.box((100.0, 60.0, 40.0)).export(tmp_path / "box.stl")
    contents = {"scene": SCENE, "box": FEATURES, "plan": PLAN.format(limit=1)}
    for name, text in contents.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    return tmp_path / "scene.toml", tmp_path / "plan.toml"


def test_squareness_of_a_box_is_that_of_the_axes(files, warpspace):
    """A circle of R 100 mm within 1 µm leaves 10 µrad; the tolerance alone 25 µrad."""
    assert "measurands" not in warpspace("acceptance", *files, "--json").json
    (row,) = warpspace("acceptance", *files, "--part", "--json").json["measurands"]
    assert row.pop("bound") == pytest.approx([10.0, 10.0], rel=2e-3)
    assert row.pop("without_tests") == pytest.approx(25.0, rel=1e-6)
    assert row == {
        "name": "back", "measure": "squareness to side", "unit": "urad",
        "tolerance": [-12.0, 12.0], "is_kept": True,
    }  # fmt: skip


def test_table_states_the_verdict(files, warpspace):
    shown = warpspace("acceptance", *files, "--part").out
    assert "Measurands of the part" in shown
    assert shown.split()[-1] == "pass"
    files[1].write_text(PLAN.format(limit=2), encoding="utf-8")
    assert warpspace("acceptance", *files, "--part").out.split()[-1] == "undecided"
    assert "Measurands of the part" not in warpspace("acceptance", *files).out


def test_a_scene_without_a_part_is_refused(files, warpspace):
    refused = warpspace("acceptance", "dvf5000_first", "--part")
    refused.refused("--part: expected a scene whose [part] has a file")
    (files[0].parent / "box.toml").write_text(FEATURES.replace("back", "side"), encoding="utf-8")
    warpspace("acceptance", *files, "--part").refused("box.toml", "another feature has it", "side")
