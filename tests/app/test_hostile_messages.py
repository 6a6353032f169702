"""Clients that send anything and vanish at any time: others are served, nothing is left behind."""

import asyncio
import itertools
import logging
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from app.raw_client import (
    App,
    Tab,
    come_and_go,
    dial,
    nonsense,
    running_app,
    send_all,
    steadily,
    until,
    upload,
)
from page_protocol import CAMERA, pack
from warpspace.app.browser.incoming import may_pass, may_set
from warpspace.app.server.repeated_lines import RepeatedLines
from warpspace.app.server.viewer import Viewer
from warpspace.scene.library import load_scene

MESSAGES = 10_000
CONNECTIONS = 200


@pytest.fixture
def app(tmp_path: Path) -> Iterator[App]:
    with running_app(tmp_path) as running:
        yield running


@pytest.mark.proof
def test_ten_thousand_hostile_messages_leave_an_honest_tab_served(app: App) -> None:
    async def run() -> tuple[list[float], float]:
        async with Tab(app) as honest, Tab(app) as hostile:
            kinds = nonsense(list(hostile.widgets.values())[:12])
            assert len(kinds) > 250
            await honest.answer_s(20.0)
            before = app.memory_mb
            messages = list(itertools.islice(itertools.cycle(kinds), MESSAGES))
            own = asyncio.create_task(steadily(hostile.socket, messages[::5]))
            other = asyncio.create_task(
                send_all(app, [m for at, m in enumerate(messages) if at % 5])
            )
            taken: list[float] = []
            for value in itertools.count(1):
                taken.append(await honest.answer_s(value % 10 + 0.5))
                if own.done() and other.done():
                    break
                await asyncio.sleep(0.1)
            await asyncio.gather(own, other)
            taken.append(await honest.answer_s(15.0))
            # the tab that was steered by force still does what it is asked for
            taken.append(await hostile.answer_s(12.0))
            return taken, app.memory_mb - before

    taken, growth = asyncio.run(run())
    assert max(taken) < 1.0, [round(seconds, 2) for seconds in taken]
    assert growth < 30.0
    assert len(app.log) < 12, "\n".join(app.log[:40])


def test_others_are_answered_while_the_worst_files_that_are_allowed_are_read(app: App) -> None:
    points = ",".join(f"[{index},{index % 7}]" for index in range(240_000))
    files = [
        f'title = "{entry[:1]}"\nx = [{entry}]'.encode()
        for entry in (points, "1," * 900_000, "[]," * 300_000, "\n" * 900_000)
    ]

    async def run() -> tuple[list[float], float]:
        async with Tab(app) as honest, Tab(app) as other:
            await honest.answer_s(20.0)
            before = app.memory_mb
            for number, content in enumerate(files):
                for message in upload(other.widgets["Open"], f"file{number}", content):
                    await other.socket.send(message)
            taken: list[float] = []
            end = time.monotonic() + 60.0
            for value in itertools.count(1):
                taken.append(await honest.answer_s(value % 10 + 0.5))
                if sum("file" in notice for notice in other.notices) == len(files):
                    return taken, app.memory_mb - before
                assert time.monotonic() < end, other.notices
                await asyncio.sleep(0.05)
            raise AssertionError

    taken, growth = asyncio.run(run())
    assert max(taken) < 1.0, [round(seconds, 2) for seconds in taken]
    assert growth < 200.0


@pytest.mark.proof
def test_two_hundred_connections_that_vanish_leave_nothing_behind(app: App) -> None:
    # libraries are loaded, viser's pool has its threads, and the heap its size for so many at once
    asyncio.run(come_and_go(app, CONNECTIONS))
    threads, memory = app.settles(0, 5.0), app.memory_mb
    asyncio.run(come_and_go(app, CONNECTIONS))
    assert app.settles(threads + 3) <= threads + 3
    assert app.memory_mb - memory < 30.0
    assert len(app.log) < 12, "\n".join(app.log[:40])


def test_clients_that_read_nothing_do_not_hold_up_the_end() -> None:
    viewer = Viewer(load_scene("dvf5000_first"))
    app = App(viewer.url.replace("http", "ws", 1), psutil.Process(), Path())

    async def run() -> float:
        sockets = [await dial(app) for _ in range(3)]
        for socket in sockets:
            await socket.send(pack(CAMERA))
            socket.transport.pause_reading()
        await until(lambda: len(viewer.sessions) == 3, 20.0)
        await asyncio.sleep(1.0)  # the pages are on their way to them
        began = time.monotonic()
        viewer.stop()
        taken = time.monotonic() - began
        for socket in sockets:
            socket.transport.abort()
            await socket.wait_closed()
        return taken

    assert asyncio.run(run()) < 4.0  # viser would wait for 6 s


def test_what_a_page_really_says_passes() -> None:
    for message in (
        CAMERA,
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": "t", "width": 1280}},
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": [1, 2.5, 3]}},
        {"type": "ScenePointerMessage", "event_type": "click", "ray_origin": [1, 2, 3.5],
         "ray_direction": [0, 0, 1], "screen_pos": [[0.5, 0.5]], "modifier": None},
        {"type": "CommandTriggerMessage", "uuid": "a"},
        {"type": "FileTransferStartUpload", "source_component_uuid": "a", "transfer_uuid": "b",
         "filename": "s.toml", "mime_type": "", "part_count": 1, "size_bytes": 900},
        {"type": "FileTransferPart", "source_component_uuid": "a", "transfer_uuid": "b",
         "part_index": 0, "content": b"title"},
    ):  # fmt: skip
        assert may_pass(pack(message)), message


def test_what_makes_no_sense_does_not_pass() -> None:
    fine = [message for message in nonsense(["a"]) if may_pass(message)]
    # what kind a widget has is known later, and so is which widgets and uploads there are
    assert len(fine) < 10
    assert all(b"GuiUpdateMessage" in message and b"\xa5value" in message for message in fine)


@pytest.mark.parametrize(
    ("present", "value"),
    [(1.5, 2), (3, 2.5), (True, False), ("a", "b"), ((1.0, 2.0), [3, 4]), ((), [])],
)
def test_a_value_of_the_same_kind_may_be_set(present: object, value: object) -> None:
    assert may_set(present, {"value": value})


@pytest.mark.parametrize(
    ("present", "value"),
    [(1.5, True), (1.5, "2"), (True, 1), ("a", 1.0), ((1.0, 2.0), [3.0]), ((1.0,), ["a"]),
     (None, "a"), ((1.0,), 1.0), (3, float("nan")), (3, 1e300)],
)  # fmt: skip
def test_a_value_of_another_kind_may_not(present: object, value: object) -> None:
    assert not may_set(present, {"value": value})


def test_only_the_value_of_a_widget_may_be_set_and_only_to_what_there_is() -> None:
    assert not may_set("a", {"value": "b", "uuid": "c"})
    assert not may_set("a", {"uuid": "c"})
    assert not may_set("a", {})
    assert may_set("a", {"value": "b"}, ("a", "b"))
    assert not may_set("a", {"value": "c"}, ("a", "b"))


def test_lines_of_one_kind_are_counted() -> None:
    now = [0.0]
    limit = RepeatedLines(lambda: now[0])

    def lines(name: str, message: str, *args: object, raised: bool = False) -> list[str]:
        info = (ValueError, ValueError("x"), None) if raised else None
        record = logging.LogRecord(name, logging.ERROR, "", 0, message, args, info)
        return [record.getMessage()] if limit.filter(record) else []

    assert lines("warpspace.a", "session %d", 1) == ["session 1"]
    assert lines("warpspace.a", "session %d", 2) == lines("warpspace.a", "session %d", 3) == []
    assert lines("warpspace.b", "session %d", 4) == ["session 4"]
    now[0] = 61.0
    assert lines("warpspace.a", "session %d", 5) == ["session 5 (2 more before it)"]
    # a library's traceback is one line
    assert lines("asyncio", "never retrieved\nfuture: 1", raised=True) == [
        "never retrieved (ValueError)"
    ]
    assert lines("asyncio", "never retrieved\nfuture: 2", raised=True) == []
