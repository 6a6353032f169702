"""The length that a picture is sized by: of an edge, of traces, of travel, or 100 mm."""

import pytest

from still_scenes import still_scene
from warpspace import load_scene
from warpspace.picture.scene_picture import evaluate_picture


@pytest.mark.parametrize(
    ("name", "size_mm"),
    [
        ("wFXt", 500.0),
        ("only Y moves", 300.0),
        ("wCFt, traces", 2.0 * (200.0**2 + 50.0**2) ** 0.5),
        ("wCFt", 100.0),
        ("wFt, one still axis", 500.0),
        ("nothing moves", 500.0),
    ],
)
def test_size_of_a_line_and_of_a_point(name: str, size_mm: float) -> None:
    assert evaluate_picture(still_scene(name), grid=3).size_mm == pytest.approx(size_mm)


def test_a_volume_is_sized_by_its_longest_edge() -> None:
    picture = evaluate_picture(load_scene("dvf5000_first"), grid=3)
    assert picture.size_mm == picture.grid.longest_edge_mm == 550.0


def test_a_point_is_drawn_displaced_by_about_a_tenth_of_its_size() -> None:
    picture = evaluate_picture(still_scene("nothing moves"), grid=3)
    drawn_mm = picture.exaggeration * picture.statistics.max_um * 1e-3
    assert 0.05 * picture.size_mm < drawn_mm < 0.2 * picture.size_mm
