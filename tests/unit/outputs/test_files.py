"""Files are written whole or not at all."""

import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from warpspace.exceptions import OutputError
from warpspace.outputs.file_output import (
    temporary_folder,
    temporary_prefix,
    write_atomically,
    write_together,
)
from warpspace.scene import text_files as scene_files
from warpspace.scene.text_files import lock_file


def test_new_file_appears_only_when_all_went_well(tmp_path):
    target = tmp_path / "out.csv"
    with write_atomically(target) as temporary:
        temporary.write_text("whole", encoding="utf-8")
        assert not target.exists()
        assert temporary.suffix == ".csv"
    assert target.read_text(encoding="utf-8") == "whole"
    assert list(tmp_path.iterdir()) == [target]
    assert not stat.S_IMODE(target.stat().st_mode) & 0o111


FULL = OSError(28, "No space left on device")


def write_half(target, failure):
    with write_atomically(target) as temporary:
        temporary.write_text("half", encoding="utf-8")
        raise failure


@pytest.mark.parametrize(
    ("failure", "kind", "said"),
    [
        (ValueError(), ValueError, None),
        (KeyboardInterrupt(), KeyboardInterrupt, None),
        (FULL, OutputError, r"out\.csv: cannot be written: No space"),
    ],
)
def test_failure_leaves_the_old_file_and_nothing_beside_it(tmp_path, failure, kind, said):
    target = tmp_path / "out.csv"
    target.write_text("old", encoding="utf-8")
    with pytest.raises(kind, match=said):
        write_half(target, failure)
    assert target.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "is a folder"),
        ("nowhere/out.csv", "does not exist"),
        ("nul\0.csv", "cannot be written"),
        ("/dev/null", "no regular file"),
    ],
)
def test_impossible_target_is_refused_before_any_work(tmp_path, name, reason):
    with pytest.raises(OutputError, match=reason), write_atomically(tmp_path / name):
        pytest.fail("the work was begun")
    assert Path("/dev/null").is_char_device()


def test_link_stays_a_link_to_the_new_file(tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    link = tmp_path / "out.csv"
    link.symlink_to(folder / "file.csv")
    with write_atomically(link) as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert link.is_symlink()
    assert (folder / "file.csv").read_text(encoding="utf-8") == "new"


def test_a_temporary_folder_clears_those_of_processes_that_have_ended(tmp_path, monkeypatch):
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
    os.utime(alive, (0.0, 0.0))  # the clock has been set since
    with temporary_folder() as folder:
        assert folder.is_dir()
        assert not left.exists()
        assert alive.is_dir()
    assert not folder.exists()


def write_two(paths):
    with write_together(paths) as temporaries:
        for temporary in temporaries:
            temporary.write_text("new", encoding="utf-8")


@pytest.mark.parametrize("failure", [FULL, KeyboardInterrupt()])
@pytest.mark.parametrize("renamed", [0, 1])
def test_several_files_are_replaced_together_or_not_at_all(tmp_path, monkeypatch, failure, renamed):
    paths = [tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "c.csv"]
    paths[0].write_text("old", encoding="utf-8")
    replace, targets = Path.replace, list[Path]()

    def fail(path, target):
        targets.append(target)
        if len(targets) == renamed + 1:
            raise failure
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises((OutputError, KeyboardInterrupt)):
        write_two(paths)
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    assert paths[0].read_text(encoding="utf-8") == "old"
    monkeypatch.undo()
    write_two(paths)
    assert sorted(tmp_path.iterdir()) == paths
    assert {path.read_text(encoding="utf-8") for path in paths} == {"new"}


def test_a_file_that_has_changed_since_it_was_read_is_not_replaced(tmp_path):
    target = tmp_path / "scene.toml"
    target.write_bytes(b"edited meanwhile")
    writing = write_atomically(target, original=b"as read")
    with pytest.raises(OutputError, match="has changed since it was read"), writing as temporary:
        temporary.write_bytes(b"derived")
    assert target.read_bytes() == b"edited meanwhile"


HOLD = """
import sys, time
from pathlib import Path
from warpspace.scene.text_files import lock_file
with lock_file(Path(sys.argv[1])):
    print("locked", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no locks")
def test_a_lock_is_waited_for_and_ends_with_the_process_that_held_it(tmp_path, monkeypatch):
    path, link = tmp_path / "scene.toml", tmp_path / "link.toml"
    path.touch()
    link.symlink_to(path)
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE)
    assert holder.stdout.readline() == b"locked\n"
    monkeypatch.setattr(scene_files, "LOCK_WAIT_S", 0.1)
    with pytest.raises(OutputError, match="locked by another process"), lock_file(link):
        pytest.fail("locked twice")
    holder.send_signal(signal.SIGKILL)
    holder.communicate()
    with lock_file(link):
        assert sorted(tmp_path.iterdir()) == [link, path]
