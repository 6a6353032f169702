"""Temporary folders of the system: gone afterwards, and cleared where a process was killed."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from warpspace.outputs.leftovers import temporary_folder, temporary_prefix


def test_a_temporary_folder_clears_those_of_processes_that_have_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    ended = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"],
        check=True, capture_output=True, text=True,
    ).stdout.strip()  # fmt: skip
    machine = temporary_prefix().split("-")[1]
    left = tmp_path / f".warpspace-{machine}-{ended}-abc"
    (left / "inside").mkdir(parents=True)
    alive = tmp_path / f"{temporary_prefix()}abc"
    alive.mkdir()
    with temporary_folder() as folder:
        assert folder.is_dir()
        assert not left.exists()
        assert alive.is_dir()
    assert not folder.exists()
