"""What to measure next for a part or its verdicts, and that nothing is asked for in vain."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.calibration import Calibrate, read_readings
from warpspace.calibration.next_best import u95_at
from warpspace.calibration.solve import build_fit_parameters
from warpspace.exceptions import OptionError
from warpspace.parts.refinement import refine
from warpspace.parts.workpiece import load_workpiece, place_workpiece
from warpspace.scene.library import load_scene
from warpspace.scene.model import PartSource

SCENE = load_scene("part_on_dvf5000")
FEATURES = """[[features]]
name = "right"
is = "plane"
near = [80, 0, 20]
[[features]]
name = "left"
is = "plane"
near = [-80, 0, 20]
measure = "distance"
to = ["right"]
tolerance_um = 3
[[features]]
name = "back"
is = "plane"
near = [0.0, 80.0, 20.0]
measure = "squareness"
to = ["right"]
"""


@pytest.mark.parametrize("place", [(0.0,) * 6, (10.0, -20.0, 0.0, 0.0, 0.0, 90.0)])
def test_a_part_is_as_unsure_as_its_vertices_and_its_verdict_as_its_width(tmp_path, place):
    """A slope of positioning of 550 mm, u = 3 µm: a stretch by x that no placement takes up."""
    (tmp_path / "f.toml").write_text(FEATURES, encoding="utf-8")
    mesh = SCENE.part.path("file")
    scene = replace(SCENE, part=replace(SCENE.part, place=place))
    terms = build_fit_parameters(scene, ["EXX:ramp", "EZZ:ramp"])
    covariance = np.diag([9.0, 1e-18])
    fine, _ = refine(load_workpiece(mesh), scene)
    x = place_workpiece(fine, scene).vertices_mm[:, 0]
    wanted = 2.0 * 3.0 * np.sqrt(fine.shares @ (x - fine.shares @ x) ** 2) / 550.0
    assert u95_at(scene, terms, "part")(covariance) == pytest.approx(wanted, rel=1e-3)
    own = PartSource(mesh, place, features="f.toml", folder=str(tmp_path))
    wanted = 2.0 * 3.0 * 160.0 / 550.0 if place[-1] == 0.0 else 0.0  # turned, it lies along y
    told = u95_at(replace(scene, part=own), terms, "verdict")(covariance)
    assert told == pytest.approx(wanted, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("target", ["part", "verdict"])
def test_a_scene_without_a_part_is_told_so(target):
    scene = load_scene("dvf5000_nominal")
    with pytest.raises(OptionError, match=r"expected a scene whose \[part\] has"):
        u95_at(scene, build_fit_parameters(scene, ["EXX"]), target)
    bare = replace(SCENE, part=replace(SCENE.part, features=""))
    with pytest.raises(OptionError, match=r"\[part\] has tolerances"):
        u95_at(bare, build_fit_parameters(bare, ["EXX"]), "verdict")


def test_measurements_that_gain_nothing_are_not_listed():
    """The corner of this scene depends on what no candidate can show."""
    scene = load_scene("fork_head_bc")
    asked = Calibrate(next_count=3, target="corner")
    found = asked.fit_readings(scene, [read_readings("tcp_on.csv", scene)])
    assert all(one.after_um <= 0.99 * one.before_um for one in found.next_measurements)
    assert len(found.next_measurements) < 3
    assert any("measurement reduces U95" in note for note in found.notes)
