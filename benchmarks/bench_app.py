"""The app's speed: serving, page, one slider move on the server, bytes of a move, click to pixels.

Click to pixels is measured in a software-rendered Chromium beside a bare viser page: the app's own
scene and text messages of two slider moves, recorded until all is at rest and replayed by one
callback: the picture at once, what follows it as long after it as the app sent it. What is
compared is our part, not the renderer of this machine. It is measured as the app starts, and with
all views on: cut octant, isolines, arrows, bent machine.

A page is interactive when its picture is seen and its sliders are there; beside it stands viser's
page with nothing in it. viser fades its canvas in when the photograph that lights it has been
worked in, so for both pages the picture counts as seen when the canvas is opaque; what they take
until they are drawn, however faintly, is printed too.

In software a frame takes some 300 ms, and viser goes on drawing for a while after each change: the
time ends with the first frame that has the new shape.
"""

import asyncio
import contextlib
import copy
import io
import os
import shutil
import statistics
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does

import viser
from playwright.sync_api import Browser, Page, Playwright, sync_playwright
from table import Row, Section
from timing import cheapest, python
from viser.infra import WebsockClientConnection
from websockets.asyncio.server import ServerConnection

from warpspace.app.browser.page import page_script
from warpspace.app.browser.viser_private import send_script
from warpspace.app.drawing.box import SURFACE
from warpspace.app.drawing.shapes import light_scene
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.tree import put
from warpspace.scene.library import load_scene

PAGE: Any = {"width": 1440, "height": 900}
MOVES = 20
TOGETHER_S = 0.003  # messages of one picture are queued within it
CHROMIUM = [
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
# viser would reject the events of the page's own scripts and end the connection
SILENT = "warpspaceViser.send = () => {};"
SHOWN_MS = 500  # until a page that is at rest is the one in front
SETTLED_MS = 1500  # until what follows at rest has been sent and drawn, too
MOVE = """([uuid, action, value]) => {
  const shape = () => {  // changes with new points, and with a new node of viser
    const parts = [];
    warpspaceViser.node('/box/surface')?.traverse(part => {
      const at = part.isMesh && part.geometry.attributes.position;
      if (at) parts.push(part.geometry.uuid, at.version);
    });
    return parts.join();
  };
  const before = shape(), m = window.__viserMutable, start = performance.now();
  const { scene } = m, { onAfterRender } = scene, gl = m.canvas.getContext('webgl2');
  return new Promise((done, fail) => {
    const end = setTimeout(() => fail(new Error('nothing moved')), 60000);
    scene.onAfterRender = function (...given) {
      onAfterRender.apply(this, given);
      const now = shape();
      if (!now || now === before) return;
      scene.onAfterRender = onAfterRender;
      clearTimeout(end);
      queueMicrotask(() => {  // reading waits until the renderer is done with this frame
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        done(performance.now() - start);
      });
    };
    if (uuid) m.sendMessage({type: 'GuiUpdateMessage', uuid, updates: {value: String(value)}});
    else warpspacePage.send(action, value);
  });
}"""
SLIDER = '{"do":"SetError","key":"EAX"}'
OURS_READY = f"""() => window.__viserMutable?.nodeRefFromName['/box/surface']
    && document.querySelector(`input[data-set='{SLIDER}']`)"""
BARE_READY = "() => window.__viserMutable?.nodeRefFromName['/box/surface'] && window.warpspaceMesh"
EMPTY_READY = "() => window.__viserMutable?.canvas"
OPAQUE = "() => getComputedStyle(window.__viserMutable.canvas).opacity > 0.99"
DRAWN = """() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => {
  const gl = window.__viserMutable.canvas.getContext('webgl2');
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  done();
})))"""
PAGES = 5


def median_ms(action: Callable[[int], object], count: int) -> float:
    """Median processor time of an action, ms: other load on the machine does not count."""
    times = []
    for number in range(count):
        start = time.thread_time()
        action(number)
        times.append((time.thread_time() - start) * 1e3)
    return statistics.median(times)


def serving_s() -> float:
    """Time from the command until the page is served."""
    command = [Path(sys.executable).with_name("warpspace"), "view", "--no-browser"]
    start = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        line = running.stdout.readline()
        url = next(word for word in line.split() if word.startswith("http"))
        with urllib.request.urlopen(url) as page:
            page.read(100)
        elapsed_s = time.perf_counter() - start
        running.terminate()
        running.communicate()
    return elapsed_s


def model_part() -> dict[str, float]:
    """The model alone: a slider move, and a new rotary position."""
    live, state = LiveModel(), start_state(load_scene("dvf5000_first"))
    live.evaluate(state)
    return {
        "model_ms": median_ms(lambda n: live.evaluate(state.with_amplitude("EAX", n / 10)), 50),
        "new_place_ms": median_ms(
            lambda n: live.evaluate(put(state, "positions.B", str(-1 - n))), 10
        ),
    }


class Recorder:
    """Recorder of the app's sessions: messages, durations of steps, bytes on the wire."""

    def __init__(self) -> None:
        self.bytes_sent = 0
        self.messages: list[tuple[float, Any]] = []
        self.step_ms: list[float] = []
        self.recording = True
        send, queue = ServerConnection.send, WebsockClientConnection.queue_message
        step = Session._follow  # noqa: SLF001

        async def count(connection: Any, message: Any, *args: Any, **kwargs: Any) -> None:
            self.bytes_sent += 0 if isinstance(message, str) else len(message)
            await send(connection, message, *args, **kwargs)

        def note(connection: Any, message: Any) -> None:
            if self.recording:
                self.messages.append((time.monotonic(), message))
            queue(connection, message)

        def timed(session: Session) -> None:
            start = time.thread_time()
            step(session)
            self.step_ms.append((time.thread_time() - start) * 1e3)

        ServerConnection.send = count
        WebsockClientConnection.queue_message = note
        Session._follow = timed  # noqa: SLF001

    @contextlib.contextmanager
    def into(self) -> Iterator[list[tuple[float, Any]]]:
        """Collect the messages of a while, each with when it was queued."""
        self.messages = []
        yield self.messages
        self.messages = []


def is_picture(message: Any) -> bool:
    """Check that a message belongs to the 3-D scene or the camera."""
    return hasattr(message, "owner") or type(message).__name__.startswith("SetCamera")


def replayed(messages: list[Any]) -> Iterator[Any]:
    """Select messages of the drawing, of pieces of the page, and of drawn nodes that move."""
    ours = ("warpspacePage.show(", "warpspaceOverlay.", "warpspaceMesh.")
    for message in messages:
        lines = getattr(message, "source", "").split("\n")
        script = "\n".join(line for line in lines if line.startswith(ours))
        if is_picture(message):
            yield message
        elif script:
            yield type(message)(source=script)


def shows_box(message: Any) -> bool:
    """Check that a message draws the box anew: its points alone, or the node of its surface."""
    if getattr(message, "name", "") == SURFACE:
        return "glb_data" in getattr(message, "updates", {})
    return "warpspaceMesh.bend(" in getattr(message, "source", "")


def as_sent(messages: list[tuple[float, Any]]) -> list[tuple[float, list[Any]]]:
    """Return the picture of a move, and later messages with their delay, s."""
    picture = next(at for at, message in messages if shows_box(message))
    batches = [(0.0, [m for at, m in messages if at <= picture + TOGETHER_S])]
    for at, message in messages:
        if at > picture + TOGETHER_S:
            batches.append((at - picture, [message]))
    return [(at, list(replayed(batch))) for at, batch in batches]


class BarePage:
    """A viser page with the same nodes and texts, one text box and nothing behind it."""

    def __init__(self, start: list[Any], moves: list[list[tuple[float, list[Any]]]]) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(host="127.0.0.1", port=8580, verbose=False)
        self.url = f"http://127.0.0.1:{self.server.get_port()}"
        light_scene(self.server.scene)
        send_script(self.server, f"{page_script()}\n{SILENT}")
        self.server.on_client_connect(lambda client: self.build(client, start, moves))

    def build(
        self,
        client: viser.ClientHandle,
        start: list[Any],
        moves: list[list[tuple[float, list[Any]]]],
    ) -> None:
        """Replay the page and the first picture."""
        text = client.gui.add_text("EAX", "0")
        self.carrier = text._impl.uuid  # noqa: SLF001

        def replay(messages: list[Any]) -> None:
            with client.atomic():
                for message in messages:
                    again = copy.copy(message)
                    if hasattr(again, "owner"):
                        again.owner = client.scene._owner_id  # noqa: SLF001
                    client._websock_connection.queue_message(again)  # noqa: SLF001
            client.flush()

        replay(list(replayed(start)))

        @text.on_update
        async def _(_: object) -> None:
            done = 0.0
            for at, messages in moves[round(float(text.value) * 10) % 2]:
                await asyncio.sleep(at - done)
                done = at
                replay(messages)


def open_page(browser: Browser, url: str, ready: str) -> Page:
    """Open a page and wait until it has drawn."""
    page = browser.new_page(viewport=PAGE)
    page.goto(f"{url}/?fixedDpr=1")
    page.wait_for_function(ready)
    page.wait_for_timeout(4000)
    page.evaluate(DRAWN)  # a page that is still drawing would answer late
    return page


def values(count: int) -> list[float]:
    """Positions of the slider, alternating between the two pictures of the bare page."""
    return [round(0.1 * (number + 1), 1) for number in range(count)]


def timed_move(page: Page, slider: str | None, value: float) -> float:
    """Click to pixels of one move of a slider on a page that has nothing left to draw, ms."""
    page.bring_to_front()
    page.wait_for_timeout(SHOWN_MS)
    page.evaluate(DRAWN)
    elapsed_ms = page.evaluate(MOVE, [slider, SLIDER, value])
    page.wait_for_timeout(SETTLED_MS)
    page.evaluate(DRAWN)  # the pages share one renderer: what is left would meet the other
    return elapsed_ms


def all_views(state: AppState) -> AppState:
    """Switch on what costs most."""
    return replace(
        state,
        look=replace(state.look, surface="cut", isolines=True, arrows=True),
        machine=replace(state.machine, shown=True, bent=True),
    )


def launch(playwright: Playwright) -> Browser:
    """Start Chromium."""
    path = shutil.which("chromium") or shutil.which("google-chrome")
    return playwright.chromium.launch(executable_path=path, args=CHROMIUM)


def opened_ms(browser: Browser, url: str, ready: str) -> tuple[float, float]:
    """Time until a page that meets a condition is opaque, and until it is drawn at all, ms."""
    with browser.new_context(viewport=PAGE) as context:
        page = context.new_page()
        start = time.perf_counter()
        page.goto(f"{url}/?fixedDpr=1")
        page.wait_for_function(ready)
        page.evaluate(DRAWN)
        drawn = time.perf_counter()
        if not page.evaluate(OPAQUE):
            page.wait_for_function(OPAQUE)
            page.evaluate(DRAWN)
        return (time.perf_counter() - start) * 1e3, (drawn - start) * 1e3


def page_part() -> dict[str, float]:
    """Time until the page can be used, beside viser's page with nothing in it."""
    with contextlib.redirect_stdout(io.StringIO()):
        empty = viser.ViserServer(host="127.0.0.1", port=8590, verbose=False)
    times: dict[str, list[tuple[float, float]]] = {"ours": [], "empty": []}
    with sync_playwright() as playwright, Viewer(load_scene("dvf5000_first")) as viewer:
        browser = launch(playwright)
        for _ in range(PAGES + 1):
            times["ours"].append(opened_ms(browser, viewer.url, OURS_READY))
            times["empty"].append(
                opened_ms(browser, f"http://127.0.0.1:{empty.get_port()}", EMPTY_READY)
            )
        browser.close()
    with contextlib.redirect_stdout(io.StringIO()):
        empty.stop()
    figures: dict[str, float] = {}
    for at, name in enumerate(("page", "page_drawn")):
        ours, floor = (statistics.median(t[at] for t in times[w][1:]) for w in ("ours", "empty"))
        figures |= {f"{name}_ms": ours, f"empty_{name}_ms": floor, f"{name}_ratio": ours / floor}
    return figures


def browser_part(
    moves: int, recorder: Recorder, look: Callable[[AppState], AppState], suffix: str = ""
) -> dict[str, float]:
    """Time and bytes of a move in a browser, beside the bare page."""
    scene = load_scene("dvf5000_first")
    recorder.recording = True
    start_with = look(start_state(scene))
    with sync_playwright() as playwright, Viewer(scene, start=start_with) as viewer:
        browser = launch(playwright)
        with recorder.into() as start:
            ours = open_page(browser, viewer.url, OURS_READY)
            timed_move(ours, None, -0.3)  # from then on a move sends points and colours alone
        recorded: list[list[Any]] = []
        for value in (-0.1, -0.2):
            with recorder.into() as sent:
                timed_move(ours, None, value)
                recorded.append(as_sent(sent))
        recorder.recording = False
        bare = BarePage([message for _, message in start], recorded)
        plain = open_page(browser, bare.url, BARE_READY)
        recorder.step_ms.clear()
        app_ms: list[float] = []
        bare_ms: list[float] = []
        app_bytes = bare_bytes = 0
        for value in values(moves + 2):  # in turns, so that other load meets both
            before = recorder.bytes_sent
            app_ms.append(timed_move(ours, None, value))
            between = recorder.bytes_sent
            bare_ms.append(timed_move(plain, bare.carrier, value))
            app_bytes += between - before
            bare_bytes += recorder.bytes_sent - between
        browser.close()
        with contextlib.redirect_stdout(io.StringIO()):
            bare.server.stop()
    app, floor = statistics.median(app_ms[2:]), statistics.median(bare_ms[2:])
    times = {
        "whole_step_ms": statistics.median(recorder.step_ms),
        "bytes_per_move": app_bytes / (moves + 2),
        "bare_bytes_per_move": bare_bytes / (moves + 2),
        "click_to_pixels_ms": app,
        "bare_click_to_pixels_ms": floor,
        "click_to_pixels_ratio": app / floor,
    }
    return {name + suffix: value for name, value in times.items()}


def measure() -> Section:
    """Measure the server, the page and the moves of a slider."""
    times = {**model_part(), **page_part()}
    recorder = Recorder()
    times |= browser_part(MOVES, recorder, lambda state: state)
    times |= browser_part(MOVES, recorder, all_views, "_all_views")
    bare = cheapest(lambda: python("-c", "import viser")).wall_s
    page = "viser's page with nothing in it"
    rows = [
        Row(
            "view until the page is served, wall", serving_s(), "python, viser", bare, max_value=3.0
        ),
        Row(
            "page until it can be used, wall",
            times["page_ms"] / 1e3,
            page,
            times["empty_page_ms"] / 1e3,
            max_ratio=1.3,
        ),
        Row(
            "page until it is drawn, wall",
            times["page_drawn_ms"] / 1e3,
            page,
            times["empty_page_drawn_ms"] / 1e3,
        ),
    ]
    for suffix, suffix_text in (("", ""), ("_all_views", ", all views on")):
        rows += [
            Row(
                f"slider move, click to pixels, wall{suffix_text}",
                times[f"click_to_pixels_ms{suffix}"] / 1e3,
                "a bare viser page that replays it",
                times[f"bare_click_to_pixels_ms{suffix}"] / 1e3,
                max_ratio=1.1,
            ),
            Row(
                f"bytes of a slider move{suffix_text}",
                times[f"bytes_per_move{suffix}"] / 1e3,
                "a bare viser page that replays it",
                times[f"bare_bytes_per_move{suffix}"] / 1e3,
                "kB",
                max_value=200.0,
            ),
            Row(
                f"slider move on the server{suffix_text}",
                times[f"whole_step_ms{suffix}"] / 1e3,
                "the model alone",
                times["model_ms"] / 1e3,
            ),
        ]
    new_place = times["new_place_ms"] / 1e3
    rows.append(
        Row(
            "new rotary position, model",
            new_place,
            "a slider move",
            times["model_ms"] / 1e3,
            max_value=0.1,
        )
    )
    text = (
        "In a Chromium that renders in software. The bare page shows the app's own scene and text"
        " messages of two moves, recorded once and replayed by one callback, so that what is"
        " compared is our part, not the renderer."
    )
    return Section("The app in a browser", text, rows)
