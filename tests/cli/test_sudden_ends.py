"""Whatever ends the program, no process lives on, and the next run finds and leaves nothing."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = [pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")]
MARK = "WARPSPACE_TEST_RUN"
MAIN = "from warpspace.cli import main; main()"
FIELD = ("field", "dvf5000_first", "--grid", "2", "--force", "--csv", "x.csv")
PICTURE = ("draw", "dvf5000_first", "--force", "-o", "x.png")
MOVIE = ("draw", "dvf5000_first", "--frames", "30", "--force", "-o", "x.gif")
REPORT = ("report", "dvf5000_first", "--force", "-o", "x.html")
SAMPLES = (
    *("montecarlo", "dvf5000_general", "--samples", "10000000", "--over", "max"),
    *("--workers", "2", "--force", "-o", "x.csv"),
)
WORKING = """
import os, signal, sys, time
from warpspace.cli import main
from warpspace.cli.main import cli
from warpspace.outputs.file_output import write_atomically
{}
cli.main = work
main()
"""
# writes slowly, so that it is hit while its temporary file is there
WRITER = WORKING.format("""
def work(**options):
    with write_atomically("x.csv") as temporary, temporary.open("w") as file:
        while True:
            file.write("0,1,2\\n"); file.flush(); time.sleep(0.001)
""")
# as dataclasses do while packages are imported
IN_EXEC = WORKING.format("""
def work(**options):
    exec("print('here', flush=True); time.sleep(60)")
""")
# Python drops what is raised in finalizers, where matplotlib and VTK have many
IN_FINALIZER = WORKING.format("""
class Thing:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)
def work(**options):
    Thing()
    time.sleep(20)
""")


def heed_signals():
    """Take signals as a program does that a user starts; tests may be started by `nohup`."""
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


def start(folder, *arguments, code=MAIN):
    with (folder / "log").open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-c", code, *arguments],
            cwd=folder,
            env={**os.environ, MARK: str(folder)},
            stdout=log,
            stderr=log,
            start_new_session=True,
            preexec_fn=heed_signals,  # noqa: PLW1509 - no threads here
        )


def processes(folder):
    mark = f"{MARK}={folder}".encode()
    found: list[int] = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (path / "environ").read_bytes().split(b"\0"):
                found.append(int(path.name))
        except OSError:
            continue
    return found


def all_have_ended(folder):
    until = time.monotonic() + 20.0
    while (left := processes(folder)) and time.monotonic() < until:
        time.sleep(0.05)
    return not left


def wait_until(fine, process):
    while not fine():
        assert process.poll() is None, process.args
        time.sleep(0.005)


def said(folder):
    return (folder / "log").read_text()


def hidden(folder):
    return [path.name for path in folder.glob(".warpspace-*")]


@pytest.mark.parametrize(
    ("command", "how"),
    [
        (PICTURE, signal.SIGTERM),
        (MOVIE, signal.SIGINT),
        (REPORT, signal.SIGKILL),
        (SAMPLES, signal.SIGHUP),
        *(
            pytest.param(command, how, marks=pytest.mark.nightly)
            for command in (PICTURE, MOVIE, REPORT, SAMPLES)
            for how in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
        ),
    ],
)
def test_processes_end_with_their_command(command, how, tmp_path):
    process = start(tmp_path, *command)
    maps = Path(f"/proc/{process.pid}/maps")
    drawing, working = (lambda: "vtk" in maps.read_text()), lambda: len(processes(tmp_path)) >= 3
    wait_until(drawing if command is PICTURE else working, process)
    time.sleep(0.3)
    if how == signal.SIGINT:
        os.killpg(process.pid, how)  # as a terminal does
    else:
        process.send_signal(how)
    status = process.wait(10)
    assert all_have_ended(tmp_path)
    assert "Traceback" not in said(tmp_path)
    if how != signal.SIGKILL:
        assert status == 128 + how
        word = "interrupted" if how == signal.SIGINT else "terminated"
        assert said(tmp_path).split() == ["warpspace:", word]
        assert hidden(tmp_path) == []


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_removes_the_temporary_file(how, tmp_path):
    process = start(tmp_path, code=WRITER)
    wait_until(lambda: hidden(tmp_path), process)
    process.send_signal(how)
    process.send_signal(how)  # some programs send it twice
    assert process.wait(10) == 128 + how
    assert hidden(tmp_path) == []


def test_the_next_run_clears_what_a_killed_one_left(tmp_path, warpspace, monkeypatch):
    process = start(tmp_path, code=WRITER)
    wait_until(lambda: hidden(tmp_path), process)
    alive = start(tmp_path, code=WRITER)
    wait_until(lambda: list(tmp_path.glob(f".warpspace-*-{alive.pid}-*")), alive)
    process.kill()
    process.wait()
    (tmp_path / ".warpspace-notes.csv").write_text("a user's own", "utf-8")
    monkeypatch.chdir(tmp_path)
    assert warpspace(*FIELD).status == 0
    left = hidden(tmp_path)
    alive.kill()
    alive.wait()
    assert len(left) == 2
    assert all(f"-{alive.pid}-" in name or name == ".warpspace-notes.csv" for name in left)


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_the_status_says_which_signal_it_was(how, tmp_path):
    process = start(tmp_path, code=IN_EXEC)
    wait_until(lambda: "here" in said(tmp_path), process)
    process.send_signal(how)
    assert process.wait(20) == 128 + how


def test_a_signal_that_comes_within_a_finalizer_is_heeded_without_a_traceback(tmp_path):
    process = start(tmp_path, code=IN_FINALIZER)
    assert process.wait(15) == 128 + signal.SIGTERM
    assert said(tmp_path).split() == ["warpspace:", "terminated"]


DRAWING_VIEW = """
import threading, time, sys
import warpspace.app.server.viewer as viewer
from warpspace.cli.services import build_services
from warpspace.scene.library import load_scene
serve = viewer.run_viewer
def run(scene, scenes, *, services, **options):
    def draw():
        from warpspace.outputs.drawing.settings import FigureSettings
        from warpspace.outputs.processes import FigureWorker
        try:
            with FigureWorker() as worker:
                while True:
                    worker.begin("error-map", [scene], FigureSettings())()
        except Exception as error:
            print("gave up", type(error).__name__, flush=True)
    threading.Thread(target=draw).start()
    serve(scene, scenes, services=services, **options)
viewer.run_viewer = run
from warpspace.cli import main
main()
"""


@pytest.mark.parametrize(
    "how", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.nightly)]
)
def test_view_ends_at_once_while_a_figure_is_drawn(how, tmp_path):
    process = start(tmp_path, "view", "--no-browser", code=DRAWING_VIEW)
    wait_until(lambda: len(processes(tmp_path)) >= 3 and "is shown at" in said(tmp_path), process)
    begin = time.monotonic()
    os.killpg(process.pid, how)
    assert process.wait(20) in (0, 128 + how)
    assert time.monotonic() - begin < 5.0
    assert all_have_ended(tmp_path)
    assert "Traceback" not in said(tmp_path)
    assert "stopped" in said(tmp_path)


SIGNALLED_THREAD = """
import signal, threading
from warpspace.app.server import viewer
from warpspace.cli import main
heard = threading.Event()
viewer.has_other_users = lambda: heard.set() or False
def send():
    heard.wait()
    threading.Event().wait(1.0)  # until the main thread waits for its end
    signal.pthread_kill(threading.get_ident(), signal.SIGTERM)
threading.Thread(target=send).start()
main()
"""


@pytest.mark.nightly
def test_view_heeds_a_signal_that_the_system_gives_to_another_thread(tmp_path):
    process = start(tmp_path, "view", "--no-browser", code=SIGNALLED_THREAD)
    assert process.wait(30) in (0, 128 + signal.SIGTERM)
    assert "stopped" in said(tmp_path)
