"""What every test shares: off-screen drawing, hypothesis profiles, no skips in CI."""

import logging
import os
import re
import sys
import time
import zlib
from datetime import UTC, datetime

# These are read when numpy, matplotlib and VTK are first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices; several test processes
os.environ["MPLBACKEND"] = "Agg"
if sys.platform == "linux":
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"

import shutil
import subprocess
from collections.abc import Iterator
from typing import TYPE_CHECKING, NoReturn

import hypothesis
import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

IN_CI = bool(os.environ.get("CI"))
BEGAN = time.monotonic()
LATE = pytest.StashKey[list[str]]()

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "ci" if IN_CI else "local")  # or nightly

hypothesis.settings.register_profile("local", deadline=None, max_examples=15)
hypothesis.settings.register_profile("ci", deadline=None, max_examples=15, derandomize=True)
hypothesis.settings.register_profile("nightly", deadline=None, max_examples=300, derandomize=IN_CI)
hypothesis.settings.load_profile(PROFILE)

NAMES_A_BROWSER = re.compile(r"\b(browser|page|tab|open_tab)\b")  # as .ci/tests.sh looks for them
CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Software WebGL, the page around it put together without it, and no calls home.
CHROMIUM_ARGS = [
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"),
    *("--no-sandbox", "--no-first-run", "--disable-quic", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]
# In a process of its own, since a machine without OpenGL may end it.
RENDERER_PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(True)
window.Render()
print(window.GetClassName() if window.SupportsOpenGL() else "")
"""


def _unavailable(what: str) -> NoReturn:
    """Skip where a developer's machine lacks something, fail where CI does."""
    if IN_CI:
        pytest.fail(f"CI skips nothing: {what}", pytrace=False)
    pytest.skip(what)


@pytest.fixture(autouse=True)
def _filters_of_logs():
    """Undo what a program that was run here has its log filtered by."""
    handlers = [one for one in (logging.lastResort, *logging.getLogger().handlers) if one]
    kept = [(handler, [*handler.filters]) for handler in handlers]
    yield
    for handler, filters in kept:
        handler.filters[:] = filters


@pytest.fixture(scope="session")
def chromium_path() -> str:
    for name in CHROMIUM_NAMES:
        if path := shutil.which(name):
            return path
    _unavailable("no Chromium found (Debian package chromium)")


@pytest.fixture(scope="session")
def browser(chromium_path: str) -> "Iterator[Browser]":
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=chromium_path, args=CHROMIUM_ARGS)
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: "Browser") -> "Iterator[Page]":
    """A fresh page of 1280 × 720 in a context of its own."""
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    yield context.new_page()
    context.close()


@pytest.fixture(scope="session")
def renderer() -> str:
    """Name of the VTK window class that draws off screen here."""
    try:
        command = [sys.executable, "-c", RENDERER_PROBE]
        probe = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired:
        _unavailable("VTK hangs when it draws off screen")
    if probe.returncode != 0 or not (name := probe.stdout.strip()):
        _unavailable("VTK cannot draw off screen (Debian packages libegl1 libgl1-mesa-dri)")
    return name


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add a box of time."""
    parser.addoption("--minutes", type=float, help="begin no test after so many minutes")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what needs the browser, and put another part first each day where time may run out.

    Of the journeys in a browser `make test` runs those marked as daily, the others are nightly.
    """
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker("browser")
            if not item.get_closest_marker("daily"):
                item.add_marker("nightly")
            if not NAMES_A_BROWSER.search(item.path.read_text("utf-8")):
                words = "names no browser, page, tab or open_tab: .ci/tests.sh would not find it"
                raise pytest.UsageError(f"{item.path}: {words}")
    if config.getoption("--minutes") is not None:
        day = datetime.now(UTC).date()
        items.sort(key=lambda item: zlib.crc32(f"{day} {item.path.name}".encode()))
    # what drives the browser keeps an event loop in its process, which others cannot have
    items.sort(key=lambda item: item.get_closest_marker("browser") is not None)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> bool | None:
    """Leave out what would begin too late."""
    minutes = item.config.getoption("--minutes")
    if minutes is None or time.monotonic() - BEGAN < 60.0 * minutes:
        return None
    item.config.stash.setdefault(LATE, []).append(item.nodeid)
    return True


def _skipped(config: pytest.Config) -> list[pytest.TestReport]:
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    return reporter.stats.get("skipped", []) if reporter else []


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    on_worker = hasattr(session.config, "workerinput")
    if IN_CI and not on_worker and _skipped(session.config) and exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what did not run in time, and why a CI run with skipped tests failed."""
    config = terminalreporter.config
    if late := config.stash.get(LATE, []):
        terminalreporter.section(f"{len(late)} tests not begun within the time")
        terminalreporter.line("\n".join(late))
    if IN_CI and (skipped := _skipped(config)):
        terminalreporter.section("skipped in CI", red=True)
        terminalreporter.line(f"{len(skipped)} skipped, and CI skips nothing: the run fails.")
