"""Long work: one at a time, with progress, cancelled, failing."""

import threading

from app.wire import OPEN, Wire, dial
from warpspace.app.documents.jobs import Jobs, Progress
from warpspace.app.documents.services import CancelledError, Request, Services
from warpspace.app.server.viewer import Viewer
from warpspace.scene.library import load_scene


class Watcher:
    """Collects what jobs report."""

    def __init__(self) -> None:
        self.progress: list[Progress | None] = []
        self.failures: list[Exception] = []
        self.ended, self.failed = threading.Event(), threading.Event()
        self.jobs = Jobs(self._report, self._fail)

    def _report(self, progress: Progress | None) -> None:
        self.progress.append(progress)
        if progress is None:
            self.ended.set()

    def _fail(self, _: str, error: Exception) -> None:
        self.failures.append(error)
        self.failed.set()


def test_one_job_at_a_time_and_progress_never_claims_to_be_done() -> None:
    watcher, go = Watcher(), threading.Event()
    assert watcher.jobs.start("one", lambda _: go.wait(10) and None, 0.2)
    assert not watcher.jobs.start("two", lambda _: None, 0.2)
    assert not watcher.ended.wait(0.6)
    go.set()
    assert watcher.ended.wait(5)
    assert watcher.failures == []
    percents = [p.percent for p in watcher.progress if p is not None]
    assert percents == sorted(percents)
    assert max(percents) < 100.0
    assert not watcher.jobs.busy


def test_cancelling_frees_the_place_at_once() -> None:
    watcher, go = Watcher(), threading.Event()
    watcher.jobs.start("slow", lambda _: go.wait(10) and None, 1.0)
    watcher.jobs.cancel()
    assert watcher.failed.wait(2)
    assert isinstance(watcher.failures[0], CancelledError)
    assert not watcher.jobs.busy
    go.set()


def test_what_a_job_raises_is_handed_over() -> None:
    watcher = Watcher()

    def work(_: threading.Event) -> None:
        raise RuntimeError("broken")

    watcher.jobs.start("bad", work, 1.0)
    assert watcher.failed.wait(5)
    assert str(watcher.failures[0]) == "broken"


def test_what_is_made_for_a_page_that_has_gone_is_given_up() -> None:
    begun, given_up = threading.Event(), threading.Event()

    def draw(_: Request, cancelled: threading.Event) -> bytes:
        begun.set()
        if cancelled.wait(10):
            given_up.set()
        return b""

    scene = load_scene("dvf5000_first")
    with Viewer(scene, services=Services(draw_figure=draw)) as viewer:
        with dial(viewer) as socket:
            wire = Wire(socket)
            assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
            (session,) = viewer.sessions
            (panel,) = [p for p in session.display.panels if type(p).__name__ == "FilesPanel"]
            session.context.act(panel._figure)
            assert begun.wait(10)
        assert given_up.wait(5)
