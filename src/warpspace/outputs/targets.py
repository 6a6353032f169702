"""Files that figures are written to: formats and refusals, checked before any work is done."""

import os
from pathlib import Path

from warpspace.exceptions import OptionError, OutputError

FORMATS = ("png", "svg", "pdf")


def figure_format(path: str | Path) -> str:
    """Read the format off a file name.

    Raises
    ------
    OptionError
        If the ending is none of png, svg, pdf.
    """
    ending = Path(path).suffix.lower().lstrip(".")
    if ending not in FORMATS:
        shown = f".{ending}" if ending else "no ending"
        raise OptionError(f"{path}: {shown}; expected a file name ending in .png, .svg or .pdf")
    return ending


def check_target(path: str | Path, *, force: bool) -> None:
    """Refuse a target that exists (unless forced) or cannot be written.

    Raises
    ------
    OutputError
        With the reason; before any work is done.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; expected the name of a file to write")
    if not target.parent.is_dir():
        raise OutputError(f"{target}: the folder {target.parent} does not exist")
    if target.exists() and not force:
        raise OutputError(f"{target}: exists already; --force replaces it")
    if not os.access(target.parent, os.W_OK):
        raise OutputError(f"{target}: the folder {target.parent.resolve()} is not writable")
