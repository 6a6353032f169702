"""Foreign pages in a real browser that try to use the app: frames, sockets, forms, requests."""

import http.server
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.raw_client import running_app
from reliability.row import Outcome

TRIES = """async ({port, number}) => {
  const found = [], own = `127.0.0.1:${port}`, wait = ms => new Promise(r => setTimeout(r, ms));
  const host = number % 2 ? own : `localhost:${port}`;
  const socket = protocol => new Promise(resolve => {
    let tab;
    try { tab = new WebSocket(`ws://${host}/`, protocol ? [protocol] : []); }
    catch { return resolve(false); }
    tab.onopen = () => resolve(true); tab.onmessage = () => resolve(true);
    tab.onerror = () => resolve(false); setTimeout(() => resolve(false), 4000);
  });
  if (await socket(PROTOCOL)) found.push('socket');
  if (await socket('')) found.push('socket without protocol');
  for (const mode of ['cors', 'same-origin', 'no-cors'])
    try {
      const answer = await fetch(`http://${host}/`, {mode, credentials: 'include'});
      if ((await answer.text()).length) found.push(`fetch ${mode}`);
    } catch {}
  try {
    const request = new XMLHttpRequest();
    request.open('POST', `http://${host}/`, false); request.send('x');
    if (request.responseText) found.push('request');
  } catch {}
  const frame = document.createElement('iframe');
  frame.src = `http://${host}/`; document.body.append(frame); await wait(300);
  try { if (frame.contentDocument.querySelector('#root')) found.push('frame'); } catch {}
  frame.remove();
  const worker = new Worker(URL.createObjectURL(new Blob([`
    try { const s = new WebSocket('ws://${host}/', PROTOCOL);
      s.onopen = () => postMessage(true); s.onerror = () => postMessage(false); }
    catch { postMessage(false); }`])));
  const told = new Promise(resolve => {
    worker.onmessage = event => resolve(event.data); setTimeout(() => resolve(false), 4000);
  });
  if (await told)
    found.push('socket of a worker');
  worker.terminate();
  return found;
}"""
PER_PAGE = 8
"""Ways in that a page tries."""


@contextmanager
def _foreign_site() -> Iterator[str]:
    """Serve a page of another port, which is another origin."""

    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>foreign</title><body></body>")

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def run(count: int) -> Outcome:
    """Try so many ways in."""
    import viser
    from playwright.sync_api import sync_playwright

    faults: list[str] = []
    done = 0
    script = TRIES.replace("PROTOCOL", f"'viser-v{viser.__version__}'")
    with (
        tempfile.TemporaryDirectory() as folder,
        running_app(Path(folder)) as app,
        _foreign_site() as site,
        sync_playwright() as playwright,
    ):
        browser = _launch(playwright)
        port = int(app.url.rpartition(":")[2])
        page = browser.new_page()
        while done < count:
            page.goto(site)
            found = page.evaluate(script, {"port": port, "number": done // PER_PAGE})
            faults += [f"a foreign page got in by {way}" for way in found]
            done += PER_PAGE
        version = browser.version
        browser.close()
    return Outcome(
        done, f"none got in (Chromium {version}: sockets, requests, frames, workers)", faults[:20]
    )


def _launch(playwright: object) -> object:
    """Start Chromium: that of the system, or playwright's own."""
    import shutil

    chromium = playwright.chromium  # pyright: ignore[reportAttributeAccessIssue]
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    return chromium.launch(executable_path=path, args=["--no-sandbox"])
