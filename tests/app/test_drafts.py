"""What a busy server shows while a slider moves, and the process that works it out."""

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.map_mesh import drafted, grid_pieces, map_mesh
from warpspace.app.server import followers as parts_module
from warpspace.app.server.followers import Followers, make_draft
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Comparison
from warpspace.app.viewport.drafts import box_picture, build_draft, only_moved
from warpspace.app.viewport.painter import Painter

STATE = start_state(load_scene("dvf5000_first"))
LIVE = LiveModel()


def looking(**look: object) -> AppState:
    return replace(STATE, look=replace(STATE.look, **look))


@pytest.mark.parametrize("surface", ["surface", "cut", "grid"])
def test_a_draft_has_every_second_node_and_the_same_lines(surface: str) -> None:
    picture = LIVE.evaluate(looking(surface=surface))
    thin = drafted(picture)
    vertices = {tuple(v) for v in np.round(map_mesh(picture).vertices_mm, 6)}
    few = {tuple(v) for v in np.round(map_mesh(thin).vertices_mm, 6)}
    assert few < vertices
    assert len(few) < len(vertices) / 3
    ends = {tuple(p) for p in np.round(grid_pieces(picture).reshape(-1, 3), 3)}
    assert {tuple(p) for p in np.round(grid_pieces(thin).reshape(-1, 3), 3)} < ends
    assert thin.statistics is picture.statistics
    assert thin.scale is picture.scale
    assert len(box_picture(thin).surface) < len(box_picture(picture).surface) / 2


@pytest.mark.parametrize("nodes", [3, 11, 13, 19])
def test_what_thinning_would_change_is_not_thinned(nodes: int) -> None:
    picture = LIVE.evaluate(STATE.with_nodes(nodes))
    assert drafted(picture) is picture


def test_slices_are_not_thinned() -> None:
    picture = LIVE.evaluate(looking(surface="slices"))
    assert drafted(picture) is picture


def test_numbers_of_a_draft_are_those_of_all_nodes() -> None:
    picture = LIVE.evaluate(STATE.with_amplitude("EAX", 33.0))
    assert f"{picture.statistics.max_um:.2f} µm" in build_draft(picture).texts["summary"]


def test_only_amplitudes_are_drafted() -> None:
    moved = STATE.with_amplitude("EAX", 3.0)
    assert only_moved(STATE, moved)
    assert only_moved(moved, STATE)
    assert not only_moved(STATE, moved.with_nodes(11))
    assert not only_moved(STATE, moved.with_shown(ghost=False))
    compared = replace(STATE, comparison=Comparison(b=Comparison().a))
    assert not only_moved(compared, compared.with_amplitude("EAX", 3.0))


@pytest.fixture
def painter() -> Iterator[Painter]:
    made = Painter()
    yield made
    made.close()


def started(painter: Painter) -> Painter:
    """Wait until the other process works."""
    for _ in range(600):
        if painter.paint(STATE) is not None:
            return painter
        time.sleep(0.1)
    raise AssertionError("the painter did not start within a minute")


def test_the_other_process_draws_the_same(painter: Painter) -> None:
    assert painter.paint(STATE) is None, "it must not keep anybody waiting while it starts"
    started(painter)
    for state in (STATE, STATE.with_amplitude("EAX", 12.0), looking(isolines=True, surface="cut")):
        found, wanted = painter.paint(state), build_draft(LIVE.evaluate(state))
        assert found is not None
        assert found.box.surface == wanted.box.surface
        assert found.texts == wanted.texts
        np.testing.assert_array_equal(found.box.grid, wanted.box.grid)
        assert (found.box.isolines is None) == (not state.look.isolines)


def test_without_the_other_process_the_app_goes_on(
    painter: Painter, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    started(painter)
    painter._process.terminate()
    painter._process.join()
    moved = STATE.with_amplitude("EAX", 5.0)
    assert painter.paint(moved) is None
    assert painter.paint(moved) is None
    assert "goes on without it" in caplog.text
    monkeypatch.setattr(parts_module, "PAINTER", painter)
    assert make_draft(LIVE, moved).texts == build_draft(LIVE.evaluate(moved)).texts


class Follower:
    """A part that takes note of what it is shown."""

    def __init__(self) -> None:
        self.states: list[AppState] = []

    def show(self, picture: Any) -> None:
        self.states.append(picture.state)

    def read(self, state: AppState) -> AppState:
        return state


def test_all_that_was_put_off_follows_when_it_settles() -> None:
    picture, part = LIVE.evaluate(STATE), Follower()
    parts = Followers([part], [], picture)
    moved = STATE.with_amplitude("EAX", 5.0)
    assert not parts.takes_draft(moved)
    parts.waited(1.0)
    assert parts.takes_draft(moved)
    assert not parts.takes_draft(moved.with_nodes(11))
    parts.show_draft(moved, build_draft(LIVE.evaluate(moved)))
    assert parts.state is moved
    assert part.states == []
    assert not parts.is_due(paused=False)
    assert parts.is_due(paused=True)
    parts.settle(LIVE.evaluate(moved), lambda step: step())
    assert part.states == [moved]
    assert not parts.is_due(paused=True)
