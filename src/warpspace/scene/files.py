"""Reading the files of a scene, with limits and messages that say what is wrong."""

import tomllib
from pathlib import Path

from warpspace.exceptions import SceneError
from warpspace.scene.outline import check_outline


def read_text(path: Path, limit_bytes: int, source: str | None = None) -> str:
    """Read a text file that a user named.

    Parameters
    ----------
    path : Path
    limit_bytes : int
        Largest size accepted.
    source : str, optional
        How the file is called in messages; its path by default.

    Returns
    -------
    str

    Raises
    ------
    SceneError
        If it is missing, no regular file, too large, unreadable or not UTF-8.
    """
    source = source or str(path)
    check_file(path, limit_bytes, source)
    try:
        with path.open("rb") as file:
            content = file.read(limit_bytes + 1)
        if len(content) > limit_bytes:  # some files of the system say that they are empty
            raise SceneError(source, [f"is too long; expected at most {limit_bytes:,} bytes"])
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = f"is not UTF-8 text (byte {error.start}); expected a UTF-8 file"
        raise SceneError(source, [text]) from None
    except OSError as error:
        raise SceneError(source, [f"cannot be read: {error.strerror or error}"]) from None


def check_file(path: Path, limit_bytes: int, source: str) -> None:
    """Refuse what is no file of limited size; a device or a pipe may never end.

    Raises
    ------
    SceneError
        If it is missing, no regular file or too large.
    """
    try:
        if path.is_dir():
            raise SceneError(source, ["is a folder; expected a file"])
        if not path.exists():
            raise SceneError(source, ["no such file"])
        if not path.is_file():
            raise SceneError(source, ["is no regular file; expected a file, no device or pipe"])
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(source, [f"cannot be read: {reason}"]) from None
    if size > limit_bytes:
        raise SceneError(
            source, [f"is {size:,} bytes long; expected at most {limit_bytes:,} bytes"]
        )


def parse_toml(text: str, source: str) -> dict[str, object]:
    """Parse TOML text.

    Raises
    ------
    SceneError
        If it is not TOML; the message has line and column. Also if its keys or its nesting go
        beyond what a scene needs.
    """
    check_outline(text, source)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise SceneError(source, ["is not valid TOML: nested too deeply"]) from None
    except ValueError as error:  # a syntax error, or a whole number Python refuses to read
        reason = str(error).partition(";")[0]
        raise SceneError(source, [f"is not valid TOML: {reason}"]) from None
