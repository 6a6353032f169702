"""A real Chromium: a foreign page is refused, and a token works as long as the tab lives."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING

import pytest
import viser

from app.page_tab import open_page, wait_until_open
from warpspace.app.server.doors import Access
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser
TOKEN = "a-token-of-a-test"
FOREIGN = "<!doctype html><title>another site</title><p>Hello"
SOCKET = """([url, version]) => new Promise(done => {
  const socket = new WebSocket(url, ["viser-v" + version]);
  const end = word => { socket.close(); done(word); };
  socket.onopen = () => end("open");
  socket.onerror = () => end("refused");
  setTimeout(() => end("no answer"), 10000);
})"""
FRAME = """url => new Promise(done => {
  const frame = document.createElement("iframe");
  frame.src = url;
  frame.onload = () => done(frame.contentDocument === null ? "loaded" : "empty");
  document.body.append(frame);
  setTimeout(() => done("no answer"), 10000);
})"""
FETCH = """url => fetch(url).then(answer => answer.text(), () => "refused")"""


@contextmanager
def foreign_site() -> Iterator[str]:
    """Serve a page of another origin: the same machine, another port."""

    class Site(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(FOREIGN.encode())

        def log_message(self, *_: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Site) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def framed(page: "Page", viewer: Viewer) -> str:
    """Show the app in a frame of a page; give what the frame holds then."""
    page.evaluate(FRAME, f"{viewer.url}/")
    frame = page.frames[-1]
    assert frame is not page.main_frame
    return frame.url


@pytest.mark.parametrize("shared", [False, True])
def test_a_foreign_page_gets_neither_socket_nor_frame_nor_text(page: "Page", shared: bool) -> None:
    scene = load_scene("dvf5000_nominal")
    with Viewer(scene, shared=shared) as viewer, foreign_site() as site:
        socket = viewer.url.replace("http", "ws", 1)
        for name in (socket, socket.replace("127.0.0.1", "localhost")):
            page.goto(site)
            assert page.evaluate(SOCKET, [name, viser.__version__]) == "refused"
        assert viewer.sessions == ()
        assert page.evaluate(FETCH, viewer.url) == "refused"
        assert framed(page, viewer).startswith("chrome-error://")
        assert viewer.sessions == ()
        # the very same from the app's own page, so that the test itself is right
        page.goto(viewer.url)
        assert page.evaluate(SOCKET, [socket, viser.__version__]) == "open"


def test_a_link_to_another_server_is_refused(page: "Page") -> None:
    with Viewer(load_scene("dvf5000_nominal")) as viewer:
        answer = page.goto(f"{viewer.url}/?websocket=ws://127.0.0.1:1")
        assert answer is not None
        assert answer.status == 403
        assert "another server" in page.inner_text("body")


def test_the_page_itself_connects_to_no_other_server(page: "Page") -> None:
    with Viewer(load_scene("dvf5000_nominal")) as viewer, foreign_site() as site:
        page.goto(viewer.url)
        assert page.evaluate(FETCH, site) == "refused"
        other = site.replace("http", "ws", 1)
        assert page.evaluate(SOCKET, [other, viser.__version__]) == "refused"


def test_a_tab_with_the_token_lives_on(browser: "Browser") -> None:
    """Its page, its websocket, a connection that drops, a reload without the token's address."""
    scene = load_scene("dvf5000_first")
    moved = start_state(scene).with_amplitude("EXX", 7.0)
    with Viewer(scene, access=Access(token=TOKEN)) as viewer:
        tab = open_page(viewer, browser, f"&token={TOKEN}")
        assert "token" not in tab.page.evaluate("document.cookie")
        tab.send("EXX", "7")
        tab.until(lambda: tab.session.state == moved)
        before = tab.session
        viewer._server._websock_server.disconnect_all_clients()
        tab.until(lambda: before not in viewer.sessions)
        tab.until(lambda: any(s.token == before.token for s in viewer.sessions))
        tab.until(lambda: tab.session.state == moved)
        tab.page.goto(f"{viewer.url}/?fixedDpr=1")
        wait_until_open(tab.page)
        tab.until(lambda: tab.session.state == moved)
        assert tab.errors == []
        tab.page.context.close()
        stranger = browser.new_context().new_page()
        answer = stranger.goto(viewer.url)
        assert answer is not None
        assert answer.status == 403
        assert "asks for a token" in stranger.inner_text("body")
        stranger.context.close()
