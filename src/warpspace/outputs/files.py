"""Writing files: nothing half-written is ever left behind, and nothing is replaced unasked."""

import os
import tempfile
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from warpspace.exceptions import OutputError
from warpspace.outputs.leftovers import clear_leftovers, temporary_prefix


def check_target(
    path: str | Path,
    endings: Sequence[str] = (),
    *,
    overwrite: bool = True,
    inputs: Iterable[Path] = (),
) -> Path:
    """Refuse a target that cannot or must not be written, before any work is done for it.

    Parameters
    ----------
    path : str or Path
        The target.
    endings : sequence of str, optional
        Endings that are known, for instance ".glb"; any where none is given.
    overwrite : bool, optional
        Whether an existing file may be replaced.
    inputs : iterable of Path, optional
        Files that are read for what is written: never replaced, under whatever name. Asked for
        only where the target exists.

    Returns
    -------
    Path
        The file to write; a symbolic link is followed.

    Raises
    ------
    OutputError
        If the ending is unknown, the folder does not exist, or the target is a folder, a device or
        a file that must not be replaced.
    """
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
            given = f"unknown ending {ending!r}" if ending else "no ending"
            raise OutputError(f"{target}: {given}; expected one of {', '.join(endings)}")
        if exists:
            for source in inputs:
                if _is_same(target, source):
                    raise OutputError(
                        f"{target}: is read for what it would be replaced with"
                        f"{'' if source == target else f' ({source})'}; expected another name"
                    )
            if not overwrite:
                raise OutputError(f"{target}: exists already; --force replaces it")
        # a link stays, the file behind it is replaced
        return target.resolve() if target.is_symlink() else target
    except (OSError, ValueError) as error:
        raise OutputError(f"{target}: cannot be written: {_reason(error)}") from error


@contextmanager
def write_atomically(path: str | Path, *, overwrite: bool = True) -> Generator[Path]:
    """Give a temporary file beside the target; rename it onto the target when all went well.

    Parameters
    ----------
    path : str or Path
        The target. An existing file is replaced only by a complete new one, which gets its mode.
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Yields
    ------
    Path
        The temporary file; same ending as the target, same folder.

    Raises
    ------
    OutputError
        If the target cannot be written; the message names it and the reason.

    Notes
    -----
    What a process that was killed has left in the folder is removed first.
    """
    target = check_target(path, overwrite=overwrite)
    temporary: Path | None = None
    try:
        clear_leftovers(target.parent)
        handle, name = tempfile.mkstemp(
            suffix=target.suffix, prefix=temporary_prefix(), dir=target.parent
        )
        temporary = Path(name)
        os.close(handle)
        yield temporary
        check_target(path, overwrite=overwrite)
        temporary.chmod(_mode(target))
        _flush(temporary)
        temporary.replace(target)
        with suppress(OSError):  # not every system opens folders
            _flush(target.parent)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {_reason(error)}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _exists(path: Path) -> bool:
    """Tell whether there is something behind a name; say why a name is impossible."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _is_same(target: Path, source: Path) -> bool:
    """Tell whether two names mean one file: by links, or by another way of writing the path."""
    try:
        return target.samefile(source)
    except (OSError, ValueError):
        return False


def _reason(error: Exception) -> str:
    """Say what the system complained about."""
    return getattr(error, "strerror", None) or str(error)


def _mode(target: Path) -> int:
    """Give the mode of the file that is replaced, or that of a new file."""
    with suppress(FileNotFoundError):
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _flush(path: Path) -> None:
    """Wait until a file or folder is on the disk, so that a power cut cannot empty it."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
