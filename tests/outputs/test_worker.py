"""The renderer's own process: a crash loses one figure only."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from warpspace import load_scene
from warpspace.exceptions import OptionError, RenderError
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.processes import FigureWorker
from warpspace.scene.library import parse_scene

pytestmark = [pytest.mark.render, pytest.mark.usefixtures("renderer")]
SMALL = FigureSettings(size=(400, 300), grid=3)


@pytest.mark.nightly
def test_a_crash_loses_one_figure_only():
    scene = load_scene("dvf5000_first")
    with FigureWorker() as worker:
        first = worker.begin("error-map", [scene], SMALL)()
        with pytest.raises(RenderError, match="renderer crashed; other figures are not affected"):
            worker.call("error-map", os.abort)()
        assert worker.begin("error-map", [scene], SMALL)() == first


def test_messages_come_through():
    scene = parse_scene('title="x"\n[machine]\nchain="wFXt"\n[workspace]\nX=[0,9]\n', "x")
    with FigureWorker() as worker:
        with pytest.raises(OptionError, match="does not extend along X, Y and Z"):
            worker.begin("slices", [scene], SMALL)()
        with pytest.raises(OptionError, match="unknown figure"):
            worker.begin("slizes", [scene], SMALL)()
        with pytest.raises(OptionError, match="tolerance"):
            worker.begin("montecarlo", [scene], SMALL)()
        assert worker.begin("error-map", [scene], SMALL)().startswith(b"\x89PNG")


@pytest.mark.nightly
def test_concurrent_requests_queue():
    scene = load_scene("dvf5000_first")
    with FigureWorker() as worker, ThreadPoolExecutor(4) as threads:
        figures = threads.map(lambda _: worker.begin("error-map", [scene], SMALL)(), range(4))
        assert len(set(figures)) == 1


def test_a_figure_that_takes_too_long_is_given_up():
    with FigureWorker(timeout_s=0.05) as worker:
        started = time.monotonic()
        with pytest.raises(RenderError, match="was stopped"):
            worker.call("error-map", time.sleep, 60)()
        assert time.monotonic() - started < 20.0


def test_a_system_without_opengl_is_told_what_to_install():
    code = "from warpspace.outputs.drawing.off_screen import check_renderer; check_renderer()"
    bare = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere"}
    done = subprocess.run([sys.executable, "-c", code], env=bare, capture_output=True, check=False)
    assert done.returncode == 1
    said = done.stderr.decode()
    assert "NoRendererError" in said
    assert "apt-get install libegl1 libgl1-mesa-dri" in said
