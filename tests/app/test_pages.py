"""Pages: built in steps, their jobs and turns, added analyses, machines that stand still."""

import re
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from unittest.mock import Mock

import pytest

from app.parts import Nobody
from app.wire import Wire, dial, opened
from still_scenes import TEXTS, still_scene
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.registry import register, unregister
from warpspace.app.browser import actions as do
from warpspace.app.documents.output_services import CancelledError, Services
from warpspace.app.evaluation import cache
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels.error_list import used_keys
from warpspace.app.panels.panel import MOST_FILES, Context, Jobs, Panel
from warpspace.app.server import session
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.library import load_scene

FIRST = load_scene("dvf5000_first")
KEYS = set(used_keys(start_state(FIRST)))
"""Errors that a page lists at first: those that are not zero."""


@pytest.fixture(scope="module")
def running():
    with Viewer(FIRST) as found:
        yield found


@pytest.fixture
def viewer(running):
    """The app with no page: those of the test before are ended first."""
    while running.sessions:
        time.sleep(0.01)
    return running


@pytest.fixture
def wire(viewer):
    with dial(viewer) as socket:
        yield Wire(socket)


def test_a_picture_in_the_memory_of_an_old_one_is_rendered_again():
    drawn, panel = LiveModel().evaluate(start_state(FIRST)), Panel(Nobody())
    assert len({panel.dependencies(replace(drawn)) for _ in range(100)}) == 100


def test_what_lies_around_the_map_comes_when_that_is_drawn(wire, monkeypatch):
    monkeypatch.setattr(session, "ANSWER_S", 1e6)
    assert wire.read_until(lambda: wire.stage == "opening" and wire.calls["Page.drawn"] == 1)
    assert "GlbMessage" in wire.kinds
    assert {*wire.sliders} >= KEYS
    lines = wire.kinds.count("LineSegmentsMessage")
    assert not wire.read_until(lambda: wire.is_open, seconds=0.5)
    assert wire.kinds.count("LineSegmentsMessage") == lines
    wire.say(do.Signal.DRAWN)
    assert wire.read_until(lambda: wire.is_open)
    assert wire.kinds.count("LineSegmentsMessage") > lines


def test_a_broken_update_is_said_and_takes_nothing_else_with_it(wire, viewer, caplog):
    assert wire.read_until(lambda: wire.is_open)
    own = viewer.sessions[-1]
    own.context.post(Mock(side_effect=RuntimeError("a wheel came off")))
    own.context.post(lambda state: state.with_amplitude("EXX", 4.0))
    assert wire.read_until(lambda: wire.toasts and own.state.amplitudes["EXX"] == 4.0)
    assert "a wheel came off" in str(wire.toasts)
    assert "a wheel came off" in caplog.text


def test_pages_that_open_at_once_get_all_of_it(viewer, monkeypatch, caplog):
    monkeypatch.setattr(session, "ANSWER_S", 0.0)
    with ExitStack() as stack:
        wires = [Wire(stack.enter_context(dial(viewer))) for _ in range(8)]
        for wire in wires:
            assert wire.read_until(lambda wire=wire: wire.is_open)
            assert wire.pieces == wires[0].pieces
            assert wire.toasts == []
    assert not caplog.records


def test_a_page_that_leaves_while_it_is_built_ends_its_session(viewer, monkeypatch):
    reached, left, build = threading.Event(), threading.Event(), Session.draw_surroundings

    def build_late(own, picture):
        reached.set()
        assert left.wait(20.0)
        return build(own, picture)

    monkeypatch.setattr(Session, "draw_surroundings", build_late)
    monkeypatch.setattr(session, "ANSWER_S", 0.0)
    with dial(viewer) as socket:
        Wire(socket)
        assert reached.wait(20.0)
        (own,) = viewer.sessions
    while viewer.sessions:
        time.sleep(0.01)
    left.set()
    own.worker.join(20.0)
    assert not own.worker.is_alive()


def test_what_comes_just_as_a_wait_ends_is_not_lost():
    class Late(threading.Event):
        def wait(self, timeout=None):
            woken = super().wait(0.0)
            self.set()
            return woken

    context = object.__new__(Context)
    context._wake = Late()
    assert [context.wait(0.0), context.wait(0.0)] == [False, True]


def test_what_fails_because_a_page_has_just_gone_is_no_error(viewer, monkeypatch, caplog):
    told, stop = threading.Event(), Session.stop
    fail = Mock(side_effect=RuntimeError("Cannot assign to a removed handle"))
    monkeypatch.setattr(Session, "stop", lambda own: told.wait(20.0) and stop(own))
    with dial(viewer) as socket:
        Wire(socket).read_until(lambda: bool(viewer.sessions))
        (own,) = viewer.sessions
        own.run_guarded(fail)
        assert "Cannot assign" in caplog.text
        caplog.clear()
    while viewer.server.get_clients():
        time.sleep(0.01)
    own.run_guarded(fail)
    told.set()
    assert not caplog.records


def test_a_page_is_told_of_values_that_are_rejected_and_of_no_others(wire, viewer):
    assert wire.read_until(lambda: wire.is_open)
    (own,) = viewer.sessions
    for value, count in (("abc", 1), ("50", 1), ("9e9", 2)):  # invalid, valid, clamped
        wire.say(do.SetLeaf("exaggeration", value))
        assert wire.read_until(lambda value=value: value != "50" or own.state.exaggeration == 50.0)
        assert wire.read_until(lambda count=count: wire.calls["Page.settle"] == count)


@pytest.fixture
def watched(monkeypatch):
    """Jobs, with what they show and report."""
    monkeypatch.setattr("warpspace.app.panels.panel.TICK_S", -1.0)
    bars, failures = list[str](), list[Exception]()
    found = Jobs(Panel(Nobody()), lambda: bars.append(str(found.html())), failures.append)
    return found, bars, failures


def test_one_job_after_the_other_says_how_far_it_is_and_hands_over_what_it_raises(watched):
    (found, bars, failures), go = watched, threading.Event()
    done = []

    def work(job):
        for share in (0.25, 0.5):
            job.report_progress(share)
        go.wait(10)
        raise WarpspaceError("broken")

    found.start("one", work, lambda _: None)
    for number in range(MOST_FILES):
        found.start(f"n{number}", lambda _, number=number: number, done.append)
    with pytest.raises(OptionError, match=f"more: {MOST_FILES} jobs are waiting"):
        found.start("more", work, lambda _: None)
    go.set()
    while not failures or bars[-1]:
        time.sleep(0.01)
    assert done == [*range(MOST_FILES)]
    said = [text[1] for bar in bars if (text := re.search("<span>(.*?)</span>", bar))]
    assert any(re.match("one.* Then: n0, n1, ", text) for text in said)
    assert not found.busy
    assert [str(error) for error in failures] == ["broken"]


def test_cancelling_frees_the_place_at_once(watched):
    (found, _, failures), told, go = watched, threading.Event(), threading.Event()

    def slow(job):
        go.wait(10)
        with pytest.raises(CancelledError):
            job.report_progress(0.5)
        told.set()
        raise RuntimeError("too late")

    found.start("slow", slow, failures.append)
    found.cancel()
    assert not found.busy
    go.set()
    assert told.wait(20)
    assert failures == []


def test_what_is_made_for_a_page_that_has_gone_is_given_up():
    begun, given_up = threading.Event(), threading.Event()

    def draw(_picture, _figure, cancelled):
        begun.set()
        if cancelled.wait(10):
            given_up.set()
        return b""

    with opened(FIRST, services=Services(draw_figure=draw)) as (wire, _):
        wire.say(do.Signal.SAVE_FIGURE)
        assert begun.wait(20)
    assert given_up.wait(20)


@dataclass(frozen=True, kw_only=True)
class Counted(Result):
    """How many errors there are."""

    errors: int

    def blocks(self):
        yield f"This scene has {self.errors} errors."


class Notes(Analysis):
    """Count the errors of SCENE."""

    name, task = "notes", "understand"

    def run(self, scene, watch):
        return Counted(errors=len(list(scene.errors)))


def test_an_added_analysis_is_a_section_of_its_task_and_runs_there():
    register(Notes)
    try:
        with opened(FIRST) as (wire, _):
            assert "<h3>Notes</h3>" in wire.pieces["section.notes"]
            wire.say(do.Input.FOLD_SECTION("notes"))
            assert wire.read_until(lambda: "has 7 errors" in wire.pieces["section.notes"])
    finally:
        unregister("notes")


def test_one_piece_of_work_waits_for_another_and_may_be_given_up():
    def give_up():
        raise CancelledError

    with cache.exclusive_work(lambda: None), pytest.raises(CancelledError):
        cache.exclusive_work(give_up).__enter__()
    with cache.exclusive_work(give_up):  # free again
        pass


@pytest.mark.parametrize("name", TEXTS)
def test_a_page_opens_with_its_map_and_without_a_problem(name, monkeypatch):
    monkeypatch.setattr(session, "ANSWER_S", 0.0)
    with opened(still_scene(name)) as (wire, _):
        assert "GlbMessage" in wire.kinds
        assert wire.toasts == []
