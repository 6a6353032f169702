"""A page is built in steps: map and sliders first, the rest as fast as the page draws it."""

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from app.wire import OPEN, Wire, dial
from warpspace.app.browser.opening import drawn_script
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.server import page_steps
from warpspace.app.server.contents import PageContents
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.state.listing import used_keys
from warpspace.scene.library import load_scene

KEYS = set(used_keys(start_state(load_scene("dvf5000_first"))))
"""Errors that a page lists at first: those that are not zero."""


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    with Viewer(load_scene("dvf5000_first")) as running:
        yield running


@pytest.fixture
def wire(viewer: Viewer) -> Iterator[Wire]:
    with dial(viewer) as socket:
        yield Wire(socket)


def test_the_map_and_its_first_sliders_come_before_all_else(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_a_slider_that_is_moved_early_has_its_curve_shown(
    wire: Wire, viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_steps, "ANSWER_S", 1e6)
    assert wire.read_until(lambda: "EAX" in wire.keys)
    wire.update(wire.widgets["EAX"], 3.0)
    (session,) = viewer.sessions
    while session.state.amplitudes["EAX"] != 3.0:
        time.sleep(0.01)
    while OPEN not in wire.scripts:
        asked = len(wire.scripts)
        wire.update(*wire.question)
        assert wire.read_until(lambda asked=asked: len(wire.scripts) > asked)
    assert any(value.startswith("EAX") for value in wire.chosen)


def test_a_page_that_does_not_answer_gets_all_of_it(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.05)
    assert wire.read_until(lambda: OPEN in wire.scripts)
    assert wire.keys == KEYS


def test_pages_that_open_at_once_get_all_of_it(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.0)
    with ExitStack() as stack:
        wires = [Wire(stack.enter_context(dial(viewer))) for _ in range(8)]
        for wire in wires:
            assert wire.read_until(lambda wire=wire: OPEN in wire.scripts)
            assert wire.keys == KEYS
            assert "Conventions of the scene" in wire.labels
            assert "NotificationShowMessage" not in wire.kinds
    assert not caplog.records


def test_a_page_that_leaves_while_it_is_built_leaves_nothing_behind(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    reached, left, build = threading.Event(), threading.Event(), PageContents._build_behind

    def build_late(contents: PageContents, picture: LivePicture) -> Any:
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


def test_what_comes_just_as_a_wait_ends_is_not_lost(
    wire: Wire, viewer: Viewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert wire.read_until(lambda: bool(viewer.sessions))
    session = viewer.sessions[-1]
    assert wire.read_until(lambda: "GlbMessage" in wire.kinds)  # its worker runs
    session.stop()
    session._worker.join(20.0)
    done: list[str] = []

    class Late(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            if super().wait(0.0):
                return True
            session.context.act(lambda: done.append("upload"))
            return False

    session.context._wake, session._stopped = Late(), threading.Event()

    def follow() -> None:
        action = session.context.take_action()
        assert action is not None
        action()

    monkeypatch.setattr(session, "_follow", follow)
    session._turn()
    assert done == []
    session._turn()
    assert done == ["upload"]


def test_what_fails_because_a_page_has_just_gone_is_no_error(
    viewer: Viewer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    told, stop = threading.Event(), Session.stop
    for limit in list(caplog.handler.filters):  # a test before this one may have run the program
        caplog.handler.removeFilter(limit)

    while viewer.sessions:  # pages of the test before this one are still being ended
        time.sleep(0.01)

    def stop_late(session: Session) -> None:
        assert told.wait(20.0)
        stop(session)

    def fail() -> None:
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


def test_the_scripts_carry_what_the_page_is_to_say() -> None:
    assert '"some-widget"' in drawn_script("some-widget", 7)
    assert '"7"' in drawn_script("some-widget", 7)
    assert "requestAnimationFrame" in drawn_script("some-widget", 7)
