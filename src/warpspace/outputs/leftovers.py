"""Temporary files that a killed process has left behind, and how they are told from others.

The name of a temporary file says which machine and which process it belongs to:
``.warpspace-<machine>-<process>-<random><ending>``.
"""

import os
import re
import shutil
import socket
import stat
import sys
import tempfile
import time
import zlib
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

_NAME = re.compile(r"\.warpspace-([0-9a-f]{8})-(\d{1,10})-")
_OLD_S = 24 * 3600.0
"""Nothing is written for so long: older files are left over, whichever machine wrote them."""


def temporary_prefix() -> str:
    """Give what the names of this process's temporary files begin with."""
    return f".warpspace-{_machine()}-{os.getpid()}-"


def clear_leftovers(folder: Path) -> None:
    """Remove the temporary files in a folder whose process has ended.

    Parameters
    ----------
    folder : Path
        Only files and folders directly in it that belong to the user are looked at.

    Notes
    -----
    Processes are known on this machine only. Files that another machine wrote into a shared
    folder are removed when they are a day old. What cannot be removed stays.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        found = [Path(entry.path) for entry in entries if _NAME.match(entry.name)]
        for path in found:
            with suppress(OSError):
                if _is_left_over(path):
                    _remove(path)


@contextmanager
def temporary_folder() -> Generator[Path]:
    """Give a folder of the system's for temporary files, gone afterwards.

    What a killed process has left there is removed by the next that asks for one.
    """
    clear_leftovers(Path(tempfile.gettempdir()))
    with tempfile.TemporaryDirectory(prefix=temporary_prefix()) as name:
        yield Path(name)


def _is_left_over(path: Path) -> bool:
    """Tell whether nobody will rename or remove a temporary file any more."""
    name, about = _NAME.match(path.name), path.lstat()
    if name is None or (hasattr(os, "geteuid") and about.st_uid != os.geteuid()):
        return False
    if time.time() - about.st_mtime > _OLD_S:
        return True
    return name[1] == _machine() and not _runs(int(name[2]))


def _runs(process: int) -> bool:
    """Tell whether there is a process of a number; assume it where nobody can tell."""
    if sys.platform == "win32":  # asking would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it."""
    if stat.S_ISDIR(path.lstat().st_mode):
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _machine() -> str:
    """Give a short mark of this machine, or of the container that the process runs in."""
    return f"{zlib.crc32(socket.gethostname().encode()):08x}"
