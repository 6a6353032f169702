"""Pages: built in steps, their jobs and turns, tabs of plug-ins, machines that stand still."""

import threading
import time
from contextlib import ExitStack

import pytest

from app.wire import OPEN, Wire, dial, opened
from still_scenes import TEXTS, still_scene
from warpspace.app.documents.services import CancelledError, Jobs, Progress, Services
from warpspace.app.evaluation import allocation, cache, calibration, compensation, concepts
from warpspace.app.panels import repair
from warpspace.app.server import page_steps
from warpspace.app.server.page_steps import PageContents
from warpspace.app.server.session import Session
from warpspace.app.server.tabs import Tab, register_tab, tabs, unregister_tab
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.state.listing import used_keys
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


def test_the_map_and_its_first_sliders_come_before_all_else(wire, monkeypatch):
    monkeypatch.setattr(page_steps, "ANSWER_S", 1e6)
    assert wire.read_until(lambda: any("opening" in script for script in wire.scripts))
    assert "GlbMessage" in wire.kinds
    assert wire.keys == {"EAX"}  # those of X that are not zero
    first = set(wire.labels)
    assert not wire.read_until(lambda: set(wire.labels) != first, seconds=0.5)
    # the next step when the page has drawn the first one: what lies on and around the map
    lines = wire.kinds.count("LineSegmentsMessage")
    wire.update(*wire.question)
    assert wire.read_until(lambda: wire.kinds.count("LineSegmentsMessage") > lines)
    assert set(wire.labels) == first
    # an answer to a question of before does not count
    wire.update(wire.question[0], "1")
    assert not wire.read_until(lambda: set(wire.labels) != first, seconds=0.5)
    while OPEN not in wire.scripts:
        asked = len(wire.scripts)
        wire.update(*wire.question)
        assert wire.read_until(lambda asked=asked: len(wire.scripts) > asked)
    assert wire.keys == KEYS
    assert {"Scene", "Structural loop", "Conventions of the scene"} <= set(wire.labels)


def test_a_page_that_does_not_answer_gets_all_of_it_and_every_control_explains_itself(
    wire, viewer, monkeypatch
):
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.05)
    assert wire.read_until(lambda: OPEN in wire.scripts)
    assert wire.keys == KEYS
    for handle in viewer.sessions[-1]._client.gui._gui_input_handle_from_uuid.values():
        assert not getattr(handle, "visible", True) or getattr(handle, "hint", "none needed"), (
            f"{handle.label} does not explain itself"
        )


def test_a_broken_update_is_said_and_takes_nothing_else_with_it(wire, viewer, caplog):
    def broken(_):
        raise RuntimeError("a wheel came off")

    assert wire.read_until(lambda: OPEN in wire.scripts)
    session = viewer.sessions[-1]
    session.context.post(broken)
    session.context.post(lambda state: state.with_amplitude("EXX", 4.0))
    assert wire.read_until(lambda: "NotificationShowMessage" in wire.kinds)
    assert wire.read_until(lambda: session.state.amplitudes["EXX"] == 4.0)
    assert "a wheel came off" in str(wire.messages)
    assert "a wheel came off" in caplog.text


def test_pages_that_open_at_once_get_all_of_it(viewer, monkeypatch, caplog):
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.0)
    with ExitStack() as stack:
        wires = [Wire(stack.enter_context(dial(viewer))) for _ in range(8)]
        for wire in wires:
            assert wire.read_until(lambda wire=wire: OPEN in wire.scripts)
            assert wire.keys == KEYS
            assert "Conventions of the scene" in wire.labels
            assert "NotificationShowMessage" not in wire.kinds
    assert not caplog.records


def test_a_page_that_leaves_while_it_is_built_leaves_nothing_behind(viewer, monkeypatch):
    reached, left, build = threading.Event(), threading.Event(), PageContents._build_behind

    def build_late(contents, picture):
        reached.set()
        assert left.wait(20.0)
        return build(contents, picture)

    monkeypatch.setattr(PageContents, "_build_behind", build_late)
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.0)
    places = viewer._places._tabs
    with dial(viewer) as socket:
        Wire(socket)
        assert reached.wait(20.0)
        (session,) = viewer.sessions
        assert places["View"]._children
    while viewer.sessions:
        time.sleep(0.01)
    left.set()
    session._worker.join(20.0)
    assert not session._worker.is_alive()
    assert {name: len(tab._children) for name, tab in places.items() if tab._children} == {}


def test_what_comes_just_as_a_wait_ends_is_not_lost(wire, viewer, monkeypatch):
    assert wire.read_until(lambda: bool(viewer.sessions))
    session = viewer.sessions[-1]
    assert wire.read_until(lambda: "GlbMessage" in wire.kinds)  # its worker runs
    session.stop()
    session._worker.join(20.0)
    done: list[str] = []

    class Late(threading.Event):
        def wait(self, timeout=None):
            if super().wait(0.0):
                return True
            session.context.act(lambda: done.append("upload"))
            return False

    session.context._wake, session._stopped = Late(), threading.Event()

    def follow():
        action = session.context.take_action()
        assert action is not None
        action()

    monkeypatch.setattr(session, "_follow", follow)
    session._turn()
    assert done == []
    session._turn()
    assert done == ["upload"]


def test_what_fails_because_a_page_has_just_gone_is_no_error(viewer, monkeypatch, caplog):
    told, stop = threading.Event(), Session.stop

    def stop_late(session):
        assert told.wait(20.0)
        stop(session)

    def fail():
        raise RuntimeError("Cannot assign to a removed handle")

    monkeypatch.setattr(Session, "stop", stop_late)
    with dial(viewer) as socket:
        Wire(socket).read_until(lambda: bool(viewer.sessions))
        (session,) = viewer.sessions
        session._guarded(fail)
        assert "Cannot assign" in caplog.text
        caplog.clear()
    while viewer._server.get_clients():
        time.sleep(0.01)
    session._guarded(fail)
    told.set()
    assert not caplog.records


class Watcher:
    """Collects what jobs report."""

    def __init__(self):
        self.progress: list[Progress | None] = []
        self.failures: list[Exception] = []
        self.ended, self.failed = threading.Event(), threading.Event()
        self.jobs = Jobs(self._report, self._fail)

    def _report(self, progress):
        self.progress.append(progress)
        if progress is None:
            self.ended.set()

    def _fail(self, _, error):
        self.failures.append(error)
        self.failed.set()


def test_one_job_at_a_time_and_progress_never_claims_to_be_done():
    watcher, go = Watcher(), threading.Event()
    assert watcher.jobs.start("one", lambda _: go.wait(10) and None, 0.2)
    assert not watcher.jobs.start("two", lambda _: None, 0.2)
    assert not watcher.ended.wait(0.6)
    go.set()
    assert watcher.ended.wait(20)
    assert watcher.failures == []
    percents = [p.percent for p in watcher.progress if p is not None]
    assert percents == sorted(percents)
    assert max(percents) < 100.0
    assert not watcher.jobs.busy


def test_cancelling_frees_the_place_at_once_and_what_a_job_raises_is_handed_over():
    watcher, go = Watcher(), threading.Event()
    watcher.jobs.start("slow", lambda _: go.wait(10) and None, 1.0)
    watcher.jobs.cancel()
    assert watcher.failed.wait(20)
    assert isinstance(watcher.failures[0], CancelledError)
    assert not watcher.jobs.busy
    go.set()

    def work(_):
        raise RuntimeError("broken")

    watcher = Watcher()
    watcher.jobs.start("bad", work, 1.0)
    assert watcher.failed.wait(20)
    assert str(watcher.failures[0]) == "broken"


def test_what_is_made_for_a_page_that_has_gone_is_given_up():
    begun, given_up = threading.Event(), threading.Event()

    def draw(_, cancelled):
        begun.set()
        if cancelled.wait(10):
            given_up.set()
        return b""

    with opened(FIRST, services=Services(draw_figure=draw)) as (_, session, panels):
        session.context.act(panels["FilesPanel"]._figure)
        assert begun.wait(20)
    assert given_up.wait(20)


SHOWN: list[float] = []


class NotesPanel:
    def __init__(self, context, state):
        context.gui.add_button(f"Notes on {state.scene.title}")

    def read(self, state):
        return state

    def show(self, picture):
        SHOWN.append(picture.statistics.mean_um)


def test_an_added_tab_appears_and_follows_the_picture():
    register_tab(Tab("Notes", "settings", [NotesPanel]))
    try:
        assert [tab.name for tab in tabs() if tab.place == "settings"][-1] == "Notes"
        with opened(FIRST) as (wire, _, _):
            assert "Notes on DVF5000, first machine measured" in wire.labels
            before = len(SHOWN)
            wire.update(wire.widgets["EAX"], 33.0)
            assert wire.read_until(lambda: len(SHOWN) > before)
            assert SHOWN[-1] != SHOWN[0]
    finally:
        unregister_tab("Notes")


class GoneError(Exception):
    """Nobody waits any more."""


def test_one_piece_of_work_waits_for_another_and_may_be_given_up():
    def give_up():
        raise GoneError

    with cache.taken_turn(lambda: None), pytest.raises(GoneError), cache.taken_turn(give_up):
        raise AssertionError
    with cache.taken_turn(give_up):  # free again
        pass


@pytest.mark.parametrize("module", [allocation, calibration, compensation, concepts, repair])
def test_all_kinds_of_fits_share_one_turn(module):
    assert module.taken_turn is cache.taken_turn
    assert not [name for name, value in vars(module).items() if type(value) is type(cache._TURN)]


@pytest.mark.parametrize("name", TEXTS)
def test_a_page_opens_with_its_map_and_without_a_problem(name, monkeypatch):
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.0)
    with opened(still_scene(name)) as (wire, _, _):
        assert "GlbMessage" in wire.kinds
        assert "NotificationShowMessage" not in wire.kinds
