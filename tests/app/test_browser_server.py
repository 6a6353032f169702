"""A real Chromium and its server: foreign pages, tokens, lost connections."""

import re
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

import pytest
import viser

from app.frames import new_visitor
from app.page_tab import Tab, open_page, wait_until_open
from app.wire import end_work
from page_client import running_app, selector
from warpspace.app.browser import actions as do
from warpspace.app.server.request_policy import Access
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.scene.library import load_scene

TOKEN = "a-token-of-a-test"
FOREIGN = "<!doctype html><title>another site</title><p>Hello"
SOCKET = """([url, version]) => new Promise(done => {
  const socket = new WebSocket(url, ["viser-v" + version]);
  const end = word => { socket.close(); done(word); };
  socket.onopen = () => end("open");
  socket.onerror = () => end("refused");
  setTimeout(() => end("no answer"), 60000);
})"""
FRAME = """url => new Promise(done => {
  const frame = document.createElement("iframe");
  frame.src = url;
  frame.onload = () => done(frame.contentDocument === null ? "loaded" : "empty");
  document.body.append(frame);
  setTimeout(() => done("no answer"), 60000);
})"""
FETCH = """([url, method]) => fetch(url, { method }).then(
  answer => answer.text(), () => "refused")"""


@contextmanager
def foreign_site():
    """Serve a page of another origin: the same machine, another port."""

    class Site(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(FOREIGN.encode())

        def log_message(self, *_): ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Site) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.mark.daily
def test_a_foreign_page_gets_neither_socket_nor_frame_nor_text(page):
    with Viewer(load_scene("dvf5000_nominal")) as viewer, foreign_site() as site:
        socket = viewer.url.replace("http", "ws", 1)
        for name in (socket, socket.replace("127.0.0.1", "localhost")):
            page.goto(site)
            assert page.evaluate(SOCKET, [name, viser.__version__]) == "refused"
            for method in ("GET", "POST"):
                asked = [name.replace("ws", "http", 1), method]
                assert page.evaluate(FETCH, asked) == "refused"
        assert viewer.sessions == ()
        page.evaluate(FRAME, f"{viewer.url}/")
        assert len(page.frames) == 2
        assert page.frames[1].url.startswith("chrome-error://")
        assert viewer.sessions == ()
        # the very same from the app's own page, so that the test itself is right
        page.goto(viewer.url)
        assert page.evaluate(SOCKET, [socket, viser.__version__]) == "open"
        # which connects to no other server
        assert page.evaluate(FETCH, [site, "GET"]) == "refused"
        other = site.replace("http", "ws", 1)
        assert page.evaluate(SOCKET, [other, viser.__version__]) == "refused"
        end_work(viewer)


@pytest.mark.nightly
def test_a_tab_with_the_token_lives_on(browser):
    """Its page, its websocket, a reload without the token's address, its links."""
    scene = load_scene("dvf5000_first")
    moved = start_state(scene).with_amplitude("EXX", 7.0)
    with Viewer(scene, access=Access(token=TOKEN)) as viewer:
        tab = open_page(viewer, browser, f"&token={TOKEN}")
        tab.until(lambda: "token" not in tab.page.evaluate("document.cookie"))
        tab.until(lambda: "token" not in tab.page.url)
        tab.until(lambda: "fixedDpr=1" in tab.page.url)
        tab.send(do.SetError("EXX", "7"))
        tab.until(lambda: tab.state == moved)
        tab.page.reload()
        wait_until_open(tab.page)
        tab.until(lambda: tab.shows_state(moved))
        # another tab of the same browser is another visitor
        fresh = Tab(tab.page.context.new_page(), viewer)
        fresh.until(lambda: fresh.shows_state(start_state(scene)))
        ended = fresh.session
        fresh.page.close()
        tab.until(lambda: ended not in viewer.sessions)
        tab.until(lambda: tab.state == moved)
        tab.page.evaluate(
            "() => { navigator.clipboard.writeText = async text => { window.put = text; }; }"
        )
        for name, carried in (("Copy link", []), ("Copy link with token", [TOKEN])):
            tab.click("Share")
            tab.click(name, within="#ws-window")
            tab.page.wait_for_function("window.put")
            copied = parse_qs(urlsplit(tab.page.evaluate("window.put")).query)
            tab.page.evaluate("window.put = ''")
            assert copied.get("token", []) == carried
            assert copied["view"]
            tab.says("The link works on this computer only", within="#ws-toasts")
            tab.until(lambda: "token" not in tab.page.url)
            tab.press("Escape")
        assert tab.errors == []
        tab.page.context.close()
        end_work(viewer)


BOX = "#warpspace-server"
SECONDS = 90.0
SAYS = "document.querySelector('[data-piece=head] .ws-numbers')?.innerText"


def maximum(page):
    """Mean and largest error, as the page spells them."""
    return page.inner_text("[data-piece=head] .ws-numbers")


def wait_for(page, wanted, *, other=False):
    """Wait until the page says a mean and largest error, or others."""
    script = f"([wanted, other]) => ({SAYS} === wanted) !== other"
    page.wait_for_function(script, arg=[wanted, other], timeout=SECONDS * 1000)


def change(page):
    """Change an error; give what is said of it once the tab has kept it."""
    before = maximum(page)
    page.evaluate("action => warpspacePage.send(action)", str(do.SetError("EAX", "-80")))
    wait_for(page, before, other=True)
    page.wait_for_function(
        "JSON.parse(sessionStorage.getItem('warpspace-kept') ?? '{}').text?.includes('EAX=-80')"
    )
    return maximum(page)


@pytest.mark.daily
def test_killed_server_is_said_and_its_tab_restored(browser, tmp_path):
    page = new_visitor(browser).new_page()
    with running_app("dvf5000_first", folder=tmp_path) as server:
        port = int(server.url.rpartition(":")[2])
        page.goto(f"http://127.0.0.1:{port}/?fixedDpr=1")
        wait_until_open(page)
        changed = change(page)
        server.process.kill()
        page.wait_for_selector(BOX, timeout=SECONDS * 1000)
    said = page.inner_text(BOX)
    assert "Connection to the server lost" in said
    assert re.search(r"Saved in this tab: .* as of \d", said)
    page.wait_for_function(f"/Reconnecting, for ([2-9]|\\d\\d+) s/.test("
                           f"document.querySelector('{BOX}').innerText)")  # fmt: skip
    assert page.get_attribute(BOX, "role") == "alert"
    assert maximum(page) == changed  # the last picture stays
    # another scene: what comes back is the tab's own
    with running_app("dvf5000_second", folder=tmp_path, port=port):
        page.wait_for_selector(f"{BOX}[role=status]", timeout=SECONDS * 1000)
        wait_until_open(page)
        wait_for(page, changed)
        said = page.inner_text(BOX)
        assert "This tab is restored" in said
        assert "Not restored: the history of Undo and Redo;" in said
        assert page.get_attribute(selector(do.SetError("EAX"), "box"), "data-text") == "-80"
        page.get_by_role("button", name="Close", exact=True).click()
        assert page.locator(BOX).count() == 0
        # Undo goes to what the server was started with, Redo back again
        page.locator("canvas").first.focus()
        page.keyboard.press("Control+z")
        wait_for(page, changed, other=True)
        page.keyboard.press("Control+Shift+z")
        wait_for(page, changed)
        page.context.close()


def test_interrupted_connection_says_that_all_is_there_and_a_lost_state_that_it_is_not(browser):
    with Viewer(load_scene("dvf5000_nominal")) as viewer:
        tab = open_page(viewer, browser)
        page = tab.page
        tab.send(do.SetError("EXX", "7"))
        tab.until(lambda: tab.state.amplitudes["EXX"] == 7.0)
        # viser connects at once while the page is in front: as if it were not
        page.evaluate("document.hasFocus = () => false")
        viewer.server._websock_server.disconnect_all_clients()
        page.wait_for_selector(f"{BOX}[role=alert]")
        tab.until(lambda: "as soon as this page is in the foreground" in page.inner_text(BOX))
        page.evaluate(
            "() => { document.hasFocus = () => true; window.dispatchEvent(new Event('focus')); }"
        )
        page.wait_for_selector(f"{BOX}[role=status]")
        tab.until(lambda: "the undo history are unchanged" in page.inner_text(BOX))
        box = selector(do.SetError("EXX"), "box")
        page.wait_for_selector(f"{box}[data-text='7']", state="attached")
        for keys, value in (("Control+z", 0.0), ("Control+Shift+z", 7.0)):
            tab.press(keys)
            tab.until(lambda value=value: tab.state.amplitudes["EXX"] == value)
        # what a page has kept may be anything; the server lets it keep what is shown at each rest
        page.evaluate("warpspacePage.server.keep = () => {}")
        page.evaluate("sessionStorage.setItem('warpspace-tab', 'f'.repeat(32))")
        page.evaluate(
            "text => sessionStorage.setItem('warpspace-kept', JSON.stringify({at: 0, text}))",
            '{"file": "<img src=x onerror=alert(1)>"}',
        )
        page.reload()
        page.wait_for_selector(f"{BOX}[role=status]", timeout=SECONDS * 1000)
        tab.until(lambda: "could not be restored" in page.inner_text(BOX))
        assert page.locator(f"{BOX} img").count() == 0
        wait_until_open(page)
        end_work(viewer)
        page.context.close()
