"""Requests of foreign pages, under foreign names and without the token are refused, raw."""

import logging
import os
import socket
import time
from contextlib import nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosedError
from websockets.http11 import Request
from websockets.protocol import State

from app.wire import dial
from page_client import pack, said
from reliability import doors
from reliability.doors import GUESSES, HOSTS, ORIGINS, PATHS, TOKEN, UPGRADE
from warpspace.app.browser import actions as do
from warpspace.app.server import connection_guard, viewer
from warpspace.app.server.connection_guard import Limits, Rate
from warpspace.app.server.request_policy import Access, HostPort, RequestPolicy, read_place
from warpspace.app.server.viewer import Viewer, served_names
from warpspace.exceptions import OptionError
from warpspace.scene.library import load_scene

KINDS = pytest.mark.parametrize("upgrade", [{}, UPGRADE], ids=["page", "websocket"])
SCENE = load_scene("dvf5000_nominal")


@pytest.fixture(scope="module", params=[False, True], ids=["own", "shared"])
def running(request):
    with Viewer(SCENE, shared=request.param) as found:
        yield found


@pytest.fixture(scope="module")
def guarded():
    """An app that asks for a token and stands behind a proxy."""
    with Viewer(SCENE, access=Access(("review.example",), TOKEN)) as found:
        yield found


def ask(running, path="/", /, upgrade=None, **headers):
    """Ask an app that runs here; what is None is not sent."""
    sent = {"Host": f"127.0.0.1:{running.port}", **(upgrade or {}), **headers}
    return doors.ask(
        running.port, path, {name: one for name, one in sent.items() if one is not None}
    )


def good(upgrade):
    return 101 if upgrade else 200


@KINDS
@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LOCALHOST", "[::1]"])
def test_the_page_itself_is_answered(running, upgrade, name):
    host = f"{name}:{running.port}"
    for headers in ({"Host": host}, {"Host": host, "Origin": f"http://{host}"}):
        assert ask(running, upgrade=upgrade, **headers)[0] == good(upgrade)


@KINDS
@pytest.mark.parametrize("origin", ORIGINS)
def test_a_foreign_page_is_refused(running, upgrade, origin):
    status, headers, text = ask(running, upgrade=upgrade, Origin=origin.format(port=running.port))
    assert (status, headers["x-frame-options"]) == (403, "DENY")
    assert "own page" in text


@KINDS
@pytest.mark.parametrize("host", [*HOSTS, None, "review.example"])
def test_a_foreign_name_is_refused(running, upgrade, host):
    """A name of a foreign page that has been made to point here, with the Origin to it."""
    host = host and host.format(port=running.port)
    for more in ({}, {"Origin": f"http://{host}"}):
        status, _, text = ask(running, upgrade=upgrade, Host=host, **more)
        assert status == 403
        assert "--allow-host" in text or not more


@pytest.mark.parametrize("path", ["/", "/nothing", "/?token=x"])
def test_no_answer_can_be_framed(running, path):
    _, headers, _ = ask(running, path)
    assert headers["x-frame-options"] == "DENY"
    policy = headers["content-security-policy"].split("; ")
    assert {"default-src 'self'", "frame-ancestors 'none'", "object-src 'none'"} <= set(policy)


def test_a_link_leads_the_page_to_no_other_server(running):
    for away in ("ws://evil.example", "wss://evil.example", "", "ws://127.0.0.1:1"):
        for name in ("websocket", "%77ebsocket"):
            assert ask(running, f"/?{name}={away}")[0] == 403
    for away in ("https://evil.example/x", "data:x"):
        assert ask(running, f"/?view=x&playbackPath={away}")[0] == 403
    assert ask(running, f"/?websocket=ws://127.0.0.1:{running.port}/")[0] == 200


def test_each_kind_is_logged_once(caplog):
    with caplog.at_level(logging.WARNING), Viewer(SCENE) as running:
        for number in range(5):
            ask(running, Host=f"evil{number}.example\xe9")
            ask(running, upgrade=UPGRADE, Origin=f"http://evil{number}.example")
    assert [record.name for record in caplog.records] == [connection_guard.__name__] * 2
    assert caplog.text.isascii()


@KINDS
def test_a_token_is_asked_for(guarded, upgrade):
    for path in (*PATHS, "/assets", *(f"/?token={guess}" for guess in GUESSES)):
        status, headers, text = ask(guarded, path, upgrade=upgrade)
        assert status == 403
        assert "token" in text
        assert TOKEN not in text
        assert "set-cookie" not in headers
    assert ask(guarded, f"/?view=x&token={TOKEN}", upgrade=upgrade)[0] == good(upgrade)


def test_the_cookie_of_the_page_is_enough_for_its_websocket(guarded):
    _, headers, _ = ask(guarded, f"/?token={TOKEN}")
    cookie, *attributes = headers["set-cookie"].split("; ")
    assert set(attributes) == {"Path=/", "HttpOnly", "SameSite=Strict"}
    assert TOKEN not in cookie
    name, _, value = cookie.partition("=")
    assert ask(guarded, f"/?token={value}")[0] == 403
    assert ask(guarded, Cookie=f"{name}={TOKEN}")[0] == 403
    # of a server behind the same proxy that asks for the same token
    assert ask(guarded, Cookie=f"warpspace_token_1={value}")[0] == 200
    for upgrade in ({}, UPGRADE):
        foreign = {"Cookie": cookie, "Origin": "http://evil.example"}
        assert ask(guarded, upgrade=upgrade, Cookie=f"x=y; {cookie}")[0] == good(upgrade)
        for headers in ({"Cookie": f"{cookie}x"}, foreign):
            assert ask(guarded, upgrade=upgrade, **headers)[0] == 403
    assert guarded.link == f"{guarded.url}/?token={TOKEN}"


@pytest.mark.skipif(os.name != "posix", reason="accounts as POSIX has them")
@pytest.mark.parametrize(
    ("uid", "shell", "logged_in", "others"),
    [
        (1000, "/bin/bash", ["1000"], False),
        (1001, "/usr/bin/zsh", [], True),
        (1001, "/usr/sbin/nologin", [], False),
        (33, "/bin/sh", ["33"], False),
        (65534, "/bin/sh", [], False),
        (1000, "/bin/bash", ["1000", "250123"], True),
    ],
)
def test_other_users_of_the_machine_are_known(monkeypatch, uid, shell, logged_in, others):
    entry = SimpleNamespace(pw_uid=uid, pw_shell=shell)
    monkeypatch.setattr("pwd.getpwall", lambda: [entry])
    monkeypatch.setattr(viewer.Path, "iterdir", lambda _: map(Path, logged_in))
    monkeypatch.setattr("os.getuid", lambda: 1000)
    assert viewer.has_other_users() is others


@pytest.mark.parametrize(("token", "said"), [(None, 1), (TOKEN, 0)])
def test_a_shared_machine_is_offered_a_token(monkeypatch, token, said):
    warnings: list[str] = []
    monkeypatch.setattr(viewer, "has_other_users", lambda: True)
    monkeypatch.setattr(viewer, "open_browser", Mock(side_effect=KeyboardInterrupt))
    monkeypatch.setattr(viewer, "limit_log", lambda: None)
    viewer.run_viewer(SCENE, {}, host="127.0.0.1", port=None, access=Access(token=token),
                      browser=True, say=lambda _: None, warn=warnings.append)  # fmt: skip
    assert sum("--token TEXT" in text for text in warnings) == said


def test_a_proxy_is_allowed(guarded):
    path, proxy = f"/?token={TOKEN}", "https://review.example"
    kept = ask(guarded, path, UPGRADE, Host="review.example", Origin=proxy)
    changed = ask(guarded, path, UPGRADE, Origin=proxy)  # a proxy that puts its own Host there
    assert kept[0] == changed[0] == 101
    assert ask(guarded, path, UPGRADE, Origin="https://review.example:1")[0] == 403


def test_all_addresses_of_a_machine_are_served_but_not_all_names():
    served_here = RequestPolicy(served_names("0.0.0.0", "0.0.0.0"), 8080, everywhere=True)
    served = ("localhost:8080", "192.0.2.7", f"{socket.gethostname()}:8080")
    for host in (*served, "evil.example", "192.0.2.8"):
        refused = served_here.check(Request("/", Headers(Host=host)), "192.0.2.7")
        assert (refused is None) is (host in served), host


def test_one_address_of_a_machine_is_served_under_its_name(monkeypatch):
    monkeypatch.setattr(viewer.socket, "gethostname", lambda: "Lathe")
    found = [(0, 0, 0, "", ("192.0.2.7", 0))]
    monkeypatch.setattr(viewer.socket, "getaddrinfo", lambda *_: found)
    assert served_names("192.0.2.7", "192.0.2.7") == {"192.0.2.7", "lathe"}
    assert served_names("192.0.2.8", "192.0.2.8") == {"192.0.2.8"}


def test_places():
    assert read_place("[::ffff:127.0.0.1]:80") == HostPort("127.0.0.1", 80)
    assert read_place("Review.Example:8443") == HostPort("review.example", 8443)
    for text in ("", "a b", "a/b", "[zz]", "a:", "a:b", "x@y", "a\0"):
        assert read_place(text) is None


def test_a_token_is_made_where_others_reach_the_app():
    first, second = (Access().choose_token(local=False) for _ in range(2))
    assert len(first) >= 20
    assert first != second
    assert Access().choose_token(local=True) is None
    assert Access(token=TOKEN).choose_token(local=True) == TOKEN
    assert Access(no_token=True).choose_token(local=False) is None


@pytest.mark.parametrize(
    ("access", "problem"),
    [
        (Access(token="short"), "12 to 200"),
        (Access(token="with a blank in it"), "12 to 200"),
        (Access(token=TOKEN, no_token=True), "exclude"),
        (Access(allow_hosts=("http://review.example",)), "--allow-host 'http"),
    ],
)
def test_access_that_cannot_be_given(access, problem):
    with pytest.raises(OptionError, match=problem):
        Viewer(SCENE, access=access)


def test_an_app_that_cannot_be_guarded_does_not_start(monkeypatch):
    monkeypatch.setattr(viewer, "serve_with", lambda _: nullcontext(list[bool]()))
    with pytest.raises(OptionError, match="in an unknown way"):
        Viewer(SCENE)


@pytest.fixture
def limited(monkeypatch):
    """Gives an app with other limits."""

    def start(**limits):
        monkeypatch.setattr(
            viewer, "Guard", lambda doors: connection_guard.Guard(doors, Limits(**limits))
        )
        return Viewer(SCENE)

    return start


def closed_by(wire):
    """Read until the other side has closed the connection; tell how and why it did."""
    try:
        while True:
            wire.recv(timeout=20.0)
    except ConnectionClosedError as closed:
        return closed.rcvd.code, closed.rcvd.reason


def test_sessions_are_limited(limited, caplog):
    with limited(sessions=1) as running:
        with dial(running):
            for upgrade in ({}, UPGRADE):
                status, _, text = ask(running, upgrade=upgrade)
                assert status == 503
                assert "close one" in text
        left = time.monotonic() + 20.0
        while ask(running)[0] != 200:  # until the tab that was closed counts no more
            assert time.monotonic() < left
            time.sleep(0.1)
    assert caplog.text.count("1 tabs") == 1


def test_the_rate_of_messages_is_limited(limited, caplog):
    message, rate = pack(said(do.Run("nobody"))), {"messages_per_second": 0.001, "burst": 20}
    with limited(**rate) as running, dial(running) as honest, dial(running) as flood:
        for _ in range(20):
            honest.send(message)
        with suppress(ConnectionClosedError):  # it may be shut out before all is sent
            for _ in range(50):
                flood.send(message)
        assert closed_by(flood) == (1008, "more than 0.001 messages a second")
        honest.ping().wait(20.0)
        assert honest.protocol.state is State.OPEN
    assert caplog.text.count("messages a second") == 1


def test_the_size_of_messages_is_limited(limited, caplog):
    with limited(message_bytes=1000) as running, dial(running) as wire:
        wire.send(b"x" * 1001)
        assert closed_by(wire)[0] == 1009
    assert caplog.text.count("too large") == 1


def test_a_rate_may_be_exceeded_for_a_moment():
    now = [0.0]
    rate = Rate(Limits(messages_per_second=10.0, burst=5), lambda: now[0])
    for at, taken in ((0.0, 5), (0.25, 2), (1000.0, 5)):
        now[0] = at
        assert [rate.take() for _ in range(taken + 1)] == [True] * taken + [False]
