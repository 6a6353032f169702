"""Writing files so that nothing half-written is ever left behind."""

import os
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from warpspace.exceptions import OutputError


def check_target(path: str | Path, endings: Sequence[str] = (), *, overwrite: bool = True) -> Path:
    """Refuse a target that cannot or must not be written, before any work is done for it.

    Parameters
    ----------
    path : str or Path
        The target.
    endings : sequence of str, optional
        Endings that are known, for instance ".glb"; any where none is given.
    overwrite : bool, optional
        Whether an existing file may be replaced.

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
    ending = target.suffix.lower()
    if endings and ending not in endings:
        given = f"unknown ending {ending!r}" if ending else "no ending"
        raise OutputError(f"{target}: {given}; expected one of {', '.join(endings)}")
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            target.lstat()  # unlike exists(), says why a name is impossible
        if target.is_dir():
            raise OutputError(f"{target}: is a folder; expected the name of a file to write")
        if not target.parent.is_dir():
            raise OutputError(f"{target}: the folder {target.parent} does not exist")
        if target.exists():
            if not target.is_file():
                raise OutputError(f"{target}: is no regular file; expected the name of a file")
            if not overwrite:
                raise OutputError(f"{target}: exists already; --force replaces it")
        # a link stays, the file behind it is replaced
        return target.resolve() if target.is_symlink() else target
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise OutputError(f"{target}: cannot be written: {reason}") from error


@contextmanager
def write_atomically(path: str | Path, *, overwrite: bool = True) -> Generator[Path]:
    """Give a temporary file beside the target; rename it onto the target when all went well.

    Parameters
    ----------
    path : str or Path
        The target. An existing file is replaced only by a complete new one.
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
    """
    target = check_target(path, overwrite=overwrite)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(
            suffix=target.suffix, prefix=".warpspace-", dir=target.parent
        )
        os.close(handle)
        temporary = Path(name)
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        check_target(path, overwrite=overwrite)
        temporary.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    """Read the process's file mode mask."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
