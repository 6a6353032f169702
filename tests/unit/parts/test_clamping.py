"""Where to clamp a part: closed forms of an error that grows along X, and the travel."""

import numpy as np
import pytest
import trimesh

import warpspace
from warpspace.analysis.description import ignore_progress
from warpspace.exceptions import OptionError
from warpspace.parts.clamp import Clamp, ClampResult
from warpspace.parts.sample_pieces import build_piece
from warpspace.parts.workpiece import evaluate_points, load_workpiece, place_workpiece
from warpspace.scene.library import parse_scene

AXES = "X = [-200, 200]\nY = [-150, 150]\nZ = [-100, 100]"
HEAD = (
    f"title = 'plain'\n[machine]\nchain = 'wFXYZt'\n[machine.travel]\n{AXES}\n[workspace]\n{AXES}"
)


def clamp(tmp_path, name="cube", size=100.0, long=1.0, **asked) -> ClampResult:
    file = tmp_path / "part.stl"
    file.write_text(build_piece(name, size)[".stl"])
    trimesh.load_mesh(file).apply_scale([long, 1.0, 1.0]).export(file)
    scene = parse_scene(f"{HEAD}\n[errors]\nEXX = {{ poly = [0.0, 0.1] }}", "plain")
    return Clamp(file=str(file), **asked).run(scene, ignore_progress)


def test_a_scale_is_least_about_its_zero(tmp_path):
    found = clamp(tmp_path, place=(50.0, 0.0, 0.0), grid=5)
    assert found.present.max_um == pytest.approx(10.0)  # 0.1 µm/mm at x = 100
    assert found.best.max_um == pytest.approx(5.0)
    assert found.gain_um == pytest.approx(5.0)
    assert found.best.placed_um == pytest.approx(found.present.placed_um)
    x = sorted({round(one.place[0], 6) for one in found.places})
    assert x == [-150.0, -75.0, 0.0, 75.0, 150.0]
    assert {round(one.place[2], 6) for one in found.places} == {0.0}
    assert len(found.places) == 25


def test_a_turn_lays_the_short_side_along_a_growing_error(tmp_path):
    asked = {"long": 2.0, "grid": 3, "place": (0.0, 0.0, 0.0)}
    kept, turned = (clamp(tmp_path, turns=turns, **asked) for turns in ("none", "C"))
    assert kept.best.max_um == pytest.approx(10.0)
    assert turned.best.max_um == pytest.approx(5.0)
    assert turned.best.place[5] in (90.0, 270.0)


def test_all_places_are_within_the_travel_in_all_orientations(tmp_path):
    path = tmp_path / "part.stl"
    path.write_text(build_piece("contour")[".stl"])
    scene = warpspace.load_scene("dvf5000_first")
    found = warpspace.clamp(scene, file=str(path), turns="all", grid=2)
    assert len({one.place[3:] for one in found.places}) == 24
    mesh = load_workpiece(path)
    for one in found.places[::17]:
        made = evaluate_points(scene, place_workpiece(mesh, scene, one.place).vertices_mm)
        assert not made.outside.any()
        length = np.linalg.norm(made.error_um, axis=1)
        assert one.max_um == pytest.approx(length.max(), rel=0.02)
    assert found.best.max_um <= found.present.max_um


def test_what_does_not_fit_is_said(tmp_path):
    with pytest.raises(OptionError, match="fits nowhere"):
        clamp(tmp_path, "plate", 900.0)
