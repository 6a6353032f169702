"""Pieces to start with: volumes by closed forms, features found, programs on their surfaces."""

import math
from pathlib import Path

import numpy as np
import pytest

import warpspace
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.interpreter import read_program
from warpspace.parts.program import trace_program
from warpspace.parts.sample_pieces import ON_RING, PIECES, build_piece
from warpspace.parts.workpiece import load_workpiece
from warpspace.scene.library import parse_scene

PLAIN = (
    "[machine]\nchain = 'wFXYZt'\n[workspace]\nX = [-500, 500]\nY = [-500, 500]\nZ = [-500, 500]"
)
SHARE = math.sin(2.0 * math.pi / ON_RING) * ON_RING / (2.0 * math.pi)  # of a circle's area
CONE = 50.0 - 50.0 * math.tan(math.radians(15.0))
VOLUMES = {
    "cube": 100.0**3,
    "cone": SHARE * math.pi / 3.0 * 50.0 * (50.0**2 + 50.0 * CONE + CONE**2),
    "plate": 240.0**2 * 20.0 - 9.0 * SHARE * math.pi * 12.0**2 * 20.0,
    "contour": 160.0**2 * 40.0 + 2.0 * 79.195959**2 * 10.0
    + SHARE * math.pi * (52.0**2 * 10.0 - 16.0**2 * 60.0),
}  # fmt: skip


@pytest.mark.parametrize("name", PIECES)
def test_pieces_hold_together(name: str, tmp_path: Path):
    for ending, text in build_piece(name).items():
        (tmp_path / f"a{ending}").write_text(text)
    mesh = load_workpiece(tmp_path / "a.stl")
    assert not mesh.warnings
    assert mesh.surface.volume == pytest.approx(VOLUMES[name], rel=1e-7)
    scene = warpspace.load_scene("dvf5000_first")
    features = str(tmp_path / "a.toml")
    found = warpspace.part(scene, file=str(tmp_path / "a.stl"), features=features).features
    verdicts = [one for row in found for one in row.measures.values() if "verdict" in one]
    assert len(verdicts) == Path(features).read_text().count("measure")
    scene = parse_scene(f"title = 'plain'\n{PLAIN}", "plain")
    read = read_program(scene, (tmp_path / "a.ngc").read_text().splitlines(), ControlSettings())
    assert not read.refused
    assert not read.remarks
    path = trace_program(read)
    low = path.tip_mm[path.tip_mm[:, 2] <= mesh.vertices_mm[:, 2].max()][:, :2]
    widest = np.abs(mesh.vertices_mm[:, :2]).max()
    assert np.abs(low).max() <= widest + 1e-6
