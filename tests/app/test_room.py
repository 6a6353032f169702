"""The room of the drawing: what a page says of it, values on isolines, bars of a picture."""

from dataclasses import replace
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from warpspace.app.browser.room import Room, column_widths, read_room
from warpspace.app.documents.view_image import HEAD_PX, view_png
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.tab_camera import TabCamera
from warpspace.geometry.isolines import isoline_levels
from warpspace.picture.isoline_labels import isoline_labels
from warpspace.scene.library import load_scene

LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"), nodes=9)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1,2,3,4",
        "1,900,700,80,-5",
        "1,nan,700,80,50",
        "1,50,700,80,50",
        "1,9e9,7,8,5",
        "²,9,9,9,9",
    ],
)
def test_a_room_that_cannot_be_is_none(text: str) -> None:
    assert read_room(text) is None


def test_a_room_is_read_and_keeps_a_part_for_the_drawing() -> None:
    assert read_room("17,930,1000,84,52") == Room(930.0, 1000.0, 84.0, 52.0)
    crowded = Room(390.0, 844.0, 600.0, 800.0)
    assert 1.0 - crowded.top_share - crowded.bottom_share == pytest.approx(0.2)


def test_columns_leave_half_of_a_small_page_nearly_and_none_of_a_phone() -> None:
    assert column_widths(390) == (0, 0)
    for width, share in ((1024, 0.42), (1600, 0.55), (3840, 0.7)):
        assert width - sum(column_widths(width)) >= share * width


def camera_at(position: tuple[float, ...], look_at: tuple[float, ...], fov: float) -> TabCamera:
    camera = SimpleNamespace(position=np.array(position), look_at=np.array(look_at), fov=fov)
    return TabCamera(SimpleNamespace(camera=camera))  # type: ignore[arg-type]


@pytest.mark.parametrize("fov", [np.deg2rad(22.0), np.deg2rad(3.0)])
def test_a_millimetre_of_the_picture_is_that_of_its_middle(fov: float) -> None:
    picture = LIVE.evaluate(START)
    middle = picture.grid.bounds_mm.mean(axis=0) / 100.0
    # 40 units away, looked at beside the middle: what counts is the depth along the line of sight
    position = middle + np.array([0.0, -40.0, 0.0])
    camera = camera_at(tuple(position), tuple(position + np.array([0.0, 7.0, 0.0])), float(fov))
    # 2·tan(fov/2)·depth units of 100 mm fill the height
    wanted = 900.0 / (2.0 * np.tan(fov / 2.0) * 40.0 * 100.0)
    assert camera.px_per_mm(picture, 900.0) == pytest.approx(wanted)
    behind = camera_at(tuple(position), tuple(position - np.array([0.0, 7.0, 0.0])), float(fov))
    assert behind.px_per_mm(picture, 900.0) is None


def test_the_bars_of_a_picture_have_their_length() -> None:
    picture = LIVE.evaluate(START)
    pixels = np.zeros((300, 600, 4), np.uint8)
    plain, drawn = (
        np.asarray(Image.open(BytesIO(view_png(pixels, picture, px)))).astype(int)
        for px in (None, 0.7)
    )
    # at most 150 px: 200 mm at 0.7 px, and 200 µm drawn ×1000, 140 px each, from 16 px on
    assert picture.exaggeration == 1000.0
    for line in (HEAD_PX + 300 - 18, HEAD_PX + 300 - 42):
        inked = np.flatnonzero(np.abs(drawn[line] - plain[line]).sum(axis=-1) > 300)
        row = inked[inked < 16 + 145]
        assert (row.min(), row.max()) == (pytest.approx(16, abs=1), pytest.approx(156, abs=1))


def test_labels_of_isolines_stand_on_lines_of_their_value() -> None:
    picture = LIVE.evaluate(START)
    labels = isoline_labels(picture)
    assert {label.value for label in labels} <= set(isoline_levels(picture.scale))
    assert len({label.value for label in labels}) >= 3
    low, high = picture.grid.bounds_mm
    seen: set[tuple[float, ...]] = set()
    for label in labels:
        # the field there, computed from the nodes around it: the nominal point by undoing the bend
        nearest = np.linalg.norm(picture.drawn_mm - label.at_mm, axis=-1)
        index = np.unravel_index(np.argsort(nearest, axis=None)[:8], picture.shape)
        assert picture.values[index].min() - 3.0 <= label.value <= picture.values[index].max() + 3.0
        face = (*label.outward, label.value)
        assert face not in seen
        seen.add(face)
        axis = int(np.abs(label.outward).argmax())
        side = high if label.outward[axis] > 0 else low
        assert abs(label.at_mm[axis] - side[axis]) < 0.12 * picture.size_mm


def test_slices_carry_values_too_and_zero_errors_none() -> None:
    sliced = LIVE.evaluate(replace(START, look=replace(START.look, surface="slices")))
    assert isoline_labels(sliced)
    still = START
    for key in START.active:
        still = still.with_amplitude(key, 0.0)
    assert isoline_labels(LIVE.evaluate(still)) == []
