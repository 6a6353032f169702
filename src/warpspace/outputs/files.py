"""Writing files so that nothing half-written is ever left behind."""

import os
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from warpspace.exceptions import OutputError


@contextmanager
def write_atomically(path: str | Path) -> Generator[Path]:
    """Give a temporary file beside the target; rename it onto the target when all went well.

    Parameters
    ----------
    path : str or Path
        The target. An existing file is replaced only by a complete new one.

    Yields
    ------
    Path
        The temporary file; same ending as the target, same folder.

    Raises
    ------
    OutputError
        If the target cannot be written; the message names it and the reason.
    """
    target = Path(path)
    if target.is_symlink():
        target = target.resolve()  # the link stays, the file behind it is replaced
    if target.is_dir():
        raise OutputError(f"{path}: is a folder; expected the name of a file to write")
    if target.exists() and not target.is_file():
        raise OutputError(f"{path}: is no regular file; expected the name of a file to write")
    if not target.parent.is_dir():
        raise OutputError(f"{target}: the folder {target.parent} does not exist")
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(
            suffix=target.suffix, prefix=".warpspace-", dir=target.parent
        )
        os.close(handle)
        temporary = Path(name)
        yield temporary
        temporary.chmod(0o666 & ~_umask())
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
