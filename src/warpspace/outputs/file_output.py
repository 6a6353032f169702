"""Atomic writing of files: no partial files, no replacement without consent.

The name of a temporary file contains the machine and the process that it belongs to:
``.warpspace-<machine>-<process>-<random><ending>``.
"""

import os
import re
import secrets
import shutil
import socket
import stat
import sys
import tempfile
import time
import zlib
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import compress
from pathlib import Path
from typing import Any

from warpspace.exceptions import OutputError


def check_target(
    path: str | Path,
    endings: Sequence[str] = (),
    *,
    overwrite: bool = True,
    inputs: Iterable[Path] = (),
) -> Path:
    """Check that a target can and may be written, before any work is done for it."""
    target = Path(path)
    try:
        exists = _exists(target)
        if exists and target.is_dir():
            raise OutputError(f"{target}: is a folder; expected the name of a file to write")
        if not target.parent.is_dir():
            raise OutputError(f"{target}: the folder {target.parent} does not exist")
        if exists and not target.is_file():
            raise OutputError(f"{target}: is no regular file; expected the name of a file")
        ending = target.suffix.lower()
        if endings and ending not in endings:
            ending_problem = f"unknown ending {ending!r}" if ending else "no ending"
            raise OutputError(f"{target}: {ending_problem}; expected one of {', '.join(endings)}")
        if exists:
            for source in inputs:
                if _is_same(target, source):
                    raise OutputError(
                        f"{target}: is an input of its own output"
                        f"{'' if source == target else f' ({source})'}; expected another name"
                    )
            if not overwrite:
                raise OutputError(f"{target}: exists already; --force replaces it")
        # a link stays, the file behind it is replaced
        return target.resolve() if target.is_symlink() else target
    except (OSError, ValueError) as error:
        raise OutputError(f"{target}: cannot be written: {_reason(error)}") from error


@contextmanager
def write_atomically(
    path: str | Path, *, overwrite: bool = True, original: bytes | None = None
) -> Generator[Path]:
    """Provide a temporary file beside the target; rename it onto the target on success."""
    with write_together([path], overwrite=overwrite, original=original) as (temporary,):
        yield temporary


def write_content(content: bytes, path: str | Path, *, overwrite: bool = True) -> None:
    with write_atomically(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(content)


@contextmanager
def write_together(
    paths: Iterable[str | Path], *, overwrite: bool = True, original: bytes | None = None
) -> Generator[list[Path]]:
    """Provide temporary files beside targets; replace all targets in their order, or none.

    `original` is the content of the first target from which its new content was derived: a target
    that has changed since then is refused.
    """
    targets = [check_target(path, overwrite=overwrite) for path in paths]
    # named before they are created: a signal in between leaves no file behind
    temporaries, backups = (
        [_temporary(target) for target in targets], [_temporary(target) for target in targets]
    )  # fmt: skip
    try:
        for temporary in temporaries:
            clear_leftovers(temporary.parent)
            temporary.touch(mode=0o600, exist_ok=False)
        yield temporaries
        for target, temporary, backup in zip(targets, temporaries, backups, strict=True):
            check_target(target, overwrite=overwrite)
            temporary.chmod(_mode(target))
            _flush(temporary)
            if target != targets[-1] and target.exists():
                shutil.copy2(target, backup)
        if original is not None and targets[0].read_bytes() != original:
            raise OutputError(f"{targets[0]}: has changed since it was read; repeat the command")
        try:
            for target, temporary in zip(targets, temporaries, strict=True):
                temporary.replace(target)
        except BaseException:
            moved = [not temporary.exists() for temporary in temporaries]
            pairs = () if all(moved) else zip(targets, backups, strict=True)
            for target, backup in compress(pairs, moved):
                backup.replace(target) if backup.exists() else target.unlink()
            raise
        with suppress(OSError):  # not every system opens folders
            for folder in {target.parent for target in targets}:
                _flush(folder)
    except OSError as error:
        names = ", ".join(map(str, targets))
        raise OutputError(f"{names}: cannot be written: {_reason(error)}") from error
    finally:
        for path in (*temporaries, *backups):
            with suppress(OSError):
                path.unlink(missing_ok=True)


def _temporary(target: Path) -> Path:
    return target.parent / f"{temporary_prefix()}{secrets.token_hex(6)}{target.suffix}"


def _exists(path: Path) -> bool:
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _is_same(target: Path, source: Path) -> bool:
    try:
        return target.samefile(source)
    except (OSError, ValueError):
        return False


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _mode(target: Path) -> int:
    with suppress(FileNotFoundError):
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _flush(path: Path) -> None:
    """Flush a file or folder to the disk, so that a power cut cannot empty it."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


_NAME = re.compile(r"\.warpspace-([0-9a-f]{8})-(\d{1,10})-")
_OLD_S = 24 * 3600.0
"""No write takes this long: older temporary files of other machines are leftovers."""


def temporary_prefix() -> str:
    """Return the prefix of this process's temporary files."""
    return f".warpspace-{_machine()}-{os.getpid()}-"


def clear_leftovers(folder: Path) -> None:
    """Remove the temporary files in a folder whose process has ended."""
    with suppress(OSError), os.scandir(folder) as entries:
        temporaries = [Path(entry.path) for entry in entries if _NAME.match(entry.name)]
        for path in temporaries:
            with suppress(OSError):
                if _is_left_over(path):
                    if stat.S_ISDIR(path.lstat().st_mode):
                        shutil.rmtree(path, ignore_errors=True)
                    else:
                        path.unlink(missing_ok=True)


@contextmanager
def temporary_folder() -> Generator[Path]:
    """Provide a temporary folder of the system, removed afterwards."""
    clear_leftovers(Path(tempfile.gettempdir()))
    with tempfile.TemporaryDirectory(prefix=temporary_prefix()) as name:
        yield Path(name)


def _is_left_over(path: Path) -> bool:
    name, about = _NAME.match(path.name), path.lstat()
    if name is None or (hasattr(os, "geteuid") and about.st_uid != os.geteuid()):
        return False
    if name[1] == _machine() and sys.platform != "win32":  # regardless of its age
        return not _runs(int(name[2]))
    return time.time() - about.st_mtime > _OLD_S


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _machine() -> str:
    return f"{zlib.crc32(socket.gethostname().encode()):08x}"


def mesh_files(
    target: Path, frames: Iterable[str], *, overwrite: bool, inputs: Iterable[Path]
) -> dict[str, Path]:
    files = {frame: target.with_name(f"{target.stem}_{frame}.stl") for frame in frames}
    read = tuple(inputs)
    for file in files.values():
        check_target(file, overwrite=overwrite, inputs=read)
    return files


def write_with_meshes(
    target: Path,
    text: bytes,
    files: Mapping[str, Path],
    meshes: Mapping[str, Any],
    *,
    overwrite: bool,
) -> None:
    """Write a file and its meshes, all or none."""
    with write_together([*files.values(), target], overwrite=overwrite) as temporaries:
        for temporary, frame in zip(temporaries, files, strict=False):
            meshes[frame].export(temporary, file_type="stl")
        temporaries[-1].write_bytes(text)
