"""Why: a click finds the point, and its contributions close with the second-order remainder."""

from dataclasses import replace

import numpy as np
import pytest
from markupsafe import Markup

from warpspace.app.evaluation.budget import answer, pick, with_lever, with_picked
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.readouts.budget import answer_html
from warpspace.app.state.app_state import start_state
from warpspace.app.state.history import History
from warpspace.app.state.picked import Picked
from warpspace.kinematics.model import Loop
from warpspace.scene.library import load_scene, scene_names

LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"))


def look_at(picture: LivePicture, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    eye = picture.drawn_mm.reshape(-1, 3).mean(axis=0) + np.array([1500.0, -4000.0, 2500.0])
    return eye, target - eye


@pytest.mark.parametrize("surface", ["surface", "cut", "slices"])
def test_a_ray_through_a_drawn_node_finds_its_axis_positions(surface: str) -> None:
    state = replace(START, look=START.look.with_choice(surface=surface), nodes=11)
    picture = LIVE.evaluate(state.with_shown(traces=False))
    drawn = picture.slices[0].drawn_mm if picture.slices else picture.drawn_mm
    grid = picture.slices[0].grid if picture.slices else picture.grid
    front = drawn[2, 0, 3] if not picture.slices else drawn.reshape(11, 11, 3)[4, 2]
    picked = pick(picture, *look_at(picture, front + 1e-6))
    assert picked is not None
    assert picked.point_mm is None
    if not picture.slices:
        for axis, index in (("X", (2, 0, 0)), ("Y", (0, 0, 0)), ("Z", (0, 0, 3))):
            there = grid.coordinates[axis].reshape(-1)[max(index)]
            assert picked.at[axis] == pytest.approx(there, abs=0.01)


def test_a_ray_past_everything_and_hostile_rays_find_nothing() -> None:
    picture = LIVE.evaluate(START)
    eye, towards = look_at(picture, picture.drawn_mm[0, 0, 0])
    assert pick(picture, eye, -towards) is None
    for bad in (np.nan, np.inf, 1e300):
        assert pick(picture, np.full(3, bad), towards) is None
    assert pick(picture, eye, np.zeros(3)) is None
    assert pick(picture, np.zeros(2), towards) is None


def test_a_trace_in_front_of_the_box_is_what_a_click_on_it_means() -> None:
    picture = LIVE.evaluate(START.with_amplitude("EXC", 1.0))
    lines = picture.traces[0]
    hits = [
        (picked, trace.point_mm)
        for trace, points in zip(lines.group.traces, lines.actual_mm, strict=True)
        for target in points[::6]
        if (picked := pick(picture, *look_at(picture, target))) is not None
    ]
    assert sum(picked.point_mm == point for picked, point in hits) > 20
    assert all(p.loop is Loop.WORKPIECE for p, _ in hits if p.point_mm is not None)


def test_a_trace_that_is_not_drawn_is_not_clicked() -> None:
    picture = LIVE.evaluate(START)
    for points in picture.traces[0].actual_mm:
        for target in points[::6]:
            picked = pick(picture, *look_at(picture, target))
            assert picked is None or picked.point_mm is None


def test_contributions_add_up_to_the_error_with_the_remainder() -> None:
    state = START.with_amplitude("EBX", 12.0)
    picture = LIVE.evaluate(state)
    picked = pick(picture, *look_at(picture, picture.drawn_mm[7, 0, 11]))
    assert picked is not None
    found = answer(state, picked, picture.exaggeration)
    total = sum(part.error_um for part in found.explanation.contributions)
    np.testing.assert_allclose(
        total + found.explanation.remainder_um, found.explanation.error_um, atol=1e-12
    )
    assert np.linalg.norm(found.explanation.remainder_um) < 0.01
    along = sum(part.along_um for part in found.explanation.contributions)
    assert along == pytest.approx(float(np.linalg.norm(total)))
    np.testing.assert_allclose(found.drawn_mm, picture.drawn_mm[7, 0, 11], atol=0.05)


def test_what_is_excluded_contributes_nothing() -> None:
    from warpspace.app.state.edits import with_excluded

    picture = LIVE.evaluate(START)
    picked = pick(picture, *look_at(picture, picture.drawn_mm[7, 0, 11]))
    assert picked is not None
    found = answer(with_excluded(START, "EC0Y", True), picked, 1.0).explanation
    assert "EC0Y" not in {part.key for part in found.contributions}


def test_the_text_lists_every_contribution_and_closes() -> None:
    picture = LIVE.evaluate(START)
    picked = pick(picture, *look_at(picture, picture.drawn_mm[7, 0, 11]))
    assert picked is not None
    text = answer_html(answer(START, picked, 1.0), "EC0Y", lambda key: Markup(f'id="{key}"'))
    for key in ("EC0Y", "EA0Z", "EAZ"):
        assert f'data-contribution="{key}"' in text
    for words in ("2nd-order rest", "error, exact chain", "lever", "across the axis"):
        assert words in text


def test_picking_and_choosing_are_undone() -> None:
    picture = LIVE.evaluate(START)
    picked = pick(picture, *look_at(picture, picture.drawn_mm[7, 0, 11]))
    history = History(START).push(with_picked(START, picked), 0.0)
    history = history.push(with_lever(history.present, "EC0Y"), 10.0)
    assert history.present.lever == "EC0Y"
    assert history.undo().present.lever == ""
    assert history.undo().undo().present.picked is None
    assert with_lever(history.present, "EC0Y").lever == ""
    assert with_lever(START, "<script>").lever == ""


@pytest.mark.parametrize("name", scene_names())
def test_a_node_is_asked_about_where_it_is_drawn(name: str) -> None:
    picture = LiveModel().evaluate(replace(start_state(load_scene(name)), nodes=3))
    grid = picture.grid
    for node in np.ndindex(grid.shape):
        at = {
            axis: float(np.broadcast_to(v, grid.shape)[node])
            for axis, v in grid.coordinates.items()
        }
        found = answer(picture.state, Picked(at), picture.exaggeration)
        shown = found.explanation.nominal_mm + found.shift_mm
        assert shown == pytest.approx(grid.nominal_mm[node], abs=1e-9)
