"""States that cannot be evaluated are reverted, and a scene whose part cannot be read opens."""

import logging
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.wire import opened
from reliability.failing import ERRORS, STAGES, WAYS, Review, reviewed
from warpspace.app.browser import actions as do
from warpspace.app.evaluation import live_picture
from warpspace.app.evaluation.live_model import DrawnScale, LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.resources import scenes_dir
from warpspace.scene.library import load_scene


@pytest.fixture(scope="module")
def review():
    with reviewed() as found:
        yield found


@settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.sampled_from([*STAGES]), st.sampled_from(ERRORS), st.sampled_from(WAYS),
    st.sampled_from([1.5, 2.5, 4.5]),
)  # fmt: skip
def test_a_state_that_fails_at_any_stage_is_reverted_and_both_tabs_go_on(
    review: Review, stage: str, raised: Callable[[], Exception], way: str, value: float
) -> None:
    assert review.fail(stage, raised, way, value) == []


def test_an_exception_of_the_program_is_logged_once_for_both_tabs(
    review: Review, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        assert review.fail("field", MemoryError, "edit", 3.5) == []
    assert len(caplog.records) == 1


def test_a_panel_that_fails_whatever_is_shown_does_not_hold_the_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        raise KeyError("x")

    with opened(load_scene("dvf5000_first")) as (wire, session):
        monkeypatch.setattr(STAGES["conditions"][0], "render", fail)
        for value in ("3", "4"):
            wire.say(do.SetError("EXX", value))
            assert wire.read_until(
                lambda: session.display.scheduler.due_in_s is None and any(wire.toasts)
            )
            wire.toasts.clear()
        wire.say(do.SetError("EXX", "5"))
        assert wire.read_until(lambda: any(wire.toasts))
        assert wire.toasts[0][1] == "The action failed"
        assert session.state.amplitudes["EXX"] == 5.0


@pytest.mark.parametrize("name", ["part_overlay", "path_overlay"])
def test_a_scene_whose_part_cannot_be_evaluated_opens_without_it(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    original = getattr(live_picture, name)

    def fail(state: object) -> object:
        if original(state) is not None:
            raise OverflowError("too large")
        return None

    monkeypatch.setattr(live_picture, name, fail)
    with opened(load_scene("part_on_dvf5000")) as (wire, session):
        assert wire.read_until(lambda: bool(wire.toasts))
        assert "OverflowError: too large" in wire.toasts[0][2]
        wire.say(do.SetError("EXX", "3"))
        assert wire.read_until(lambda: 'data-text="3"' in wire.pieces["error.EXX"])
        assert session.state.part.mesh is None


def test_a_scene_whose_part_cannot_be_read_opens_with_a_message(tmp_path: Path) -> None:
    shutil.copytree(scenes_dir() / "parts", tmp_path / "parts")
    shutil.copy(scenes_dir() / "part_on_dvf5000.toml", tmp_path / "mine.toml")
    (tmp_path / "parts" / "contour.stl").write_bytes(b"solid \0")
    with opened(load_scene(str(tmp_path / "mine.toml"))) as (wire, _):
        assert wire.read_until(lambda: bool(wire.toasts))
        assert "contour.stl" in wire.toasts[0][2]


def test_a_story_whose_step_cannot_be_evaluated_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    evaluate = LiveModel.evaluate

    def fail(self: LiveModel, state: AppState, *scale: DrawnScale | None) -> LivePicture:
        if is_told:
            raise MemoryError
        return evaluate(self, state, *scale)

    is_told = list[bool]()
    monkeypatch.setattr(LiveModel, "evaluate", fail)
    with opened(load_scene("review_dvf5000")) as (wire, session):
        before = session.state
        is_told.append(True)
        wire.say(do.Signal.START_STORY)
        assert wire.read_until(lambda: bool(wire.toasts))
        is_told.clear()
        wire.say(do.SetError("EXX", "3"))
        assert wire.read_until(lambda: 'data-text="3"' in wire.pieces["error.EXX"])
        assert session.state.amplitudes == {**before.amplitudes, "EXX": 3.0}
