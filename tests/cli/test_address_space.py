"""400 MB of address space: one message, and nothing is left behind."""

import os
import subprocess
import sys

import pytest

from products import pairwise

resource = pytest.importorskip("resource")
LIMIT = 400_000 * 1024


def small():
    """Limit the address space as `ulimit -v 400000` does."""
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))


@pytest.mark.skipif(sys.platform != "linux", reason="others do not keep the limit")
@pytest.mark.parametrize(
    ("arguments", "threads"),
    pairwise(
        [
            ("field", "dvf5000_first", "--grid", "41", "--csv", "x.csv"),
            ("gains", "dvf5000_first", "--plot", "x.svg"),
            ("draw", "dvf5000_first", "-o", "x.png"),
            ("report", "dvf5000_first", "-o", "x.html"),
            ("test", "circular", "dvf5000_first", "--plot", "x.svg"),
            ("view", "--no-browser"),
        ],
        ["1", ""],
    ),
)
def test_a_small_address_space_gives_one_message(arguments, threads, tmp_path):
    found = subprocess.run(
        [sys.executable, "-m", "warpspace", *arguments],
        cwd=tmp_path,
        env={**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        preexec_fn=small,
    )
    assert found.returncode == 2, found
    assert found.stdout == ""
    assert found.stderr.startswith("warpspace: not enough memory: the address space is limited to")
    assert found.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "error",
    [
        ImportError("libx.so: failed to map segment from shared object"),
        RuntimeError("can't start new thread"),
    ],
    ids=["library", "thread"],
)
def test_libraries_and_threads_without_memory_give_the_same_message(error, warpspace, monkeypatch):
    def fail(*_):
        raise error

    monkeypatch.setattr("warpspace.scene.library.load_scene", fail)
    warpspace("check", "dvf5000_first").refused("not enough memory")


def test_other_errors_of_libraries_stay(warpspace, monkeypatch):
    def fail(*_):
        raise RuntimeError("a mistake of ours")

    monkeypatch.setattr("warpspace.scene.library.load_scene", fail)
    with pytest.raises(RuntimeError, match="a mistake of ours"):
        warpspace("check", "dvf5000_first")
