"""A server that is killed while a page shows it, and started again on the same port."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from app.frames import new_visitor
from app.page_tab import Tab, open_page, wait_until_open
from warpspace.app.server.viewer import Viewer
from warpspace.scene.library import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser
BOX = "#warpspace-server"
SECONDS = 90.0


class Served:
    """The app in a process of its own, on one port."""

    def __init__(self, scene: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self._process: Any = None
        self.start(scene)

    def start(self, scene: str, *options: str) -> None:
        """Start it and wait until it answers."""
        command = [sys.executable, "-m", "warpspace", "view", scene, "--no-browser", "--port"]
        self._process = subprocess.Popen(
            [*command, str(self.port), *options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        until = time.monotonic() + SECONDS
        while time.monotonic() < until:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            assert self._process.poll() is None
            time.sleep(0.1)
        pytest.fail("the server does not start")

    def kill(self) -> None:
        """End it without a word."""
        os.kill(self._process.pid, signal.SIGKILL)
        self._process.wait()


@pytest.fixture
def served() -> Iterator[Served]:
    server = Served("dvf5000_first")
    yield server
    server.kill()


def number_box(page: "Page", label: str) -> Any:
    """Number box of an error."""
    return page.locator(f"input[data-number='{label}']")


def maximum(page: "Page") -> str:
    """The largest error, as the page spells it."""
    return page.inner_text("[data-value='max']")


def wait_for_maximum(page: "Page", wanted: str) -> None:
    """Wait until the page says a largest error."""
    script = "w => document.querySelector(\"[data-value='max']\")?.innerText === w"
    page.wait_for_function(script, arg=wanted, timeout=SECONDS * 1000)


def test_killed_server_is_said_and_its_tab_restored(
    served: Served, browser: "Browser", tmp_path: Path
) -> None:
    page = new_visitor(browser).new_page()
    page.goto(f"{served.url}/?fixedDpr=1")
    wait_until_open(page)
    opened = maximum(page)
    box = number_box(page, "EAX")
    box.fill("12")
    box.press("Enter")
    page.wait_for_function(
        "w => document.querySelector(\"[data-value='max']\").innerText !== w", arg=opened
    )
    page.wait_for_function(
        "JSON.parse(sessionStorage.getItem('warpspace-kept') ?? '{}').text?.includes('EAX=12')"
    )
    changed = maximum(page)

    served.kill()
    page.wait_for_selector(BOX, timeout=SECONDS * 1000)
    said = page.inner_text(BOX)
    assert "does not answer" in said
    assert re.search(r"Kept in this tab: .* as of \d", said)
    page.wait_for_function(f"/tried again every second; so far for [2-9] s/.test("
                           f"document.querySelector('{BOX}').innerText)")  # fmt: skip
    assert page.get_attribute(BOX, "role") == "alert"
    assert maximum(page) == changed  # the last picture stays
    page.screenshot(path=str(tmp_path / "lost.png"))

    served.start("dvf5000_second")  # another scene: what comes back is the tab's own
    page.wait_for_selector(f"{BOX}[role=status]", timeout=SECONDS * 1000)
    wait_until_open(page)
    wait_for_maximum(page, changed)
    said = page.inner_text(BOX)
    assert "This tab is restored" in said
    assert "Not restored: what Undo and Redo could go back to;" in said
    assert number_box(page, "EAX").input_value() == "12"
    page.screenshot(path=str(tmp_path / "back.png"))
    page.get_by_role("button", name="Close", exact=True).click()
    assert page.locator(BOX).count() == 0

    # Undo goes to what the server was started with, Redo back again
    page.locator("canvas").first.focus()
    page.keyboard.press("Control+z")
    page.wait_for_function(
        "w => document.querySelector(\"[data-value='max']\").innerText !== w", arg=changed
    )
    page.keyboard.press("Control+Shift+z")
    wait_for_maximum(page, changed)
    page.context.close()


def test_interrupted_connection_says_that_all_is_there(browser: "Browser") -> None:
    scene = load_scene("dvf5000_nominal")
    with Viewer(scene) as viewer:
        tab = open_page(viewer, browser)
        tab.send("EXX", "7")
        tab.until(lambda: tab.session.state.amplitudes["EXX"] == 7.0)
        lost = """() => { window.__seen = []; new MutationObserver(() => {
          const box = document.querySelector('#warpspace-server');
          if (box) window.__seen.push(box.getAttribute('role'));
        }).observe(document.body, {childList: true}); }"""
        tab.page.evaluate(lost)
        # viser connects at once while the page is in front: as if it were not
        tab.page.evaluate("document.hasFocus = () => false")
        viewer._server._websock_server.disconnect_all_clients()
        tab.page.wait_for_selector(f"{BOX}[role=alert]")
        assert "as soon as this page is in front" in tab.page.inner_text(BOX)
        tab.page.evaluate("() => { document.hasFocus = () => true; window.dispatchEvent("
                          "new Event('focus')); }")  # fmt: skip
        tab.page.wait_for_selector(f"{BOX}[role=status]")
        assert "everything is as it was, Undo too" in tab.page.inner_text(BOX)
        assert tab.session.state.amplitudes["EXX"] == 7.0
        assert tab.page.evaluate("window.__seen").count("alert") == 1
        tab.page.context.close()


def test_page_that_kept_nothing_readable_says_that_it_begins_anew(browser: "Browser") -> None:
    scene = load_scene("dvf5000_nominal")
    with Viewer(scene) as viewer:
        tab: Tab = open_page(viewer, browser)
        forged = """text => sessionStorage.setItem('warpspace-kept',
          JSON.stringify({at: 0, text}))"""
        viewer._memory._cache.clear()
        tab.page.evaluate("sessionStorage.setItem('warpspace-tab', 'f'.repeat(32))")
        tab.page.evaluate(forged, '{"file": "<img src=x onerror=alert(1)>"}')
        tab.page.reload()
        tab.page.wait_for_selector(f"{BOX}[role=status]", timeout=SECONDS * 1000)
        assert "could not be restored" in tab.page.inner_text(BOX)
        assert tab.page.locator(f"{BOX} img").count() == 0
        wait_until_open(tab.page)
        tab.page.context.close()
