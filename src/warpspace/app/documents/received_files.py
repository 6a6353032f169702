"""Files that a browser sends: a name that can be used, and the text in them."""

import re

from warpspace.app.browser.uploads import size_message
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_SCENE_BYTES

_UNSAFE = re.compile(r"[^A-Za-z0-9._ -]+")
LONGEST_NAME = 60


def safe_name(name: str, fallback: str = "scene") -> str:
    """Make a file name of what a user or a browser calls something.

    Parameters
    ----------
    name : str
        Anything: folders, ``../``, control characters and reserved letters are dropped.
    fallback : str, optional
        Where nothing is left.

    Returns
    -------
    str
        Without an ending.
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    stem = last.rsplit(".", 1)[0] if "." in last.strip(".") else last
    clean = _UNSAFE.sub("_", stem).strip(" ._-")[:LONGEST_NAME].strip(" ._-")
    return clean or fallback


def safe_file_name(name: str) -> str:
    """Make a file name that keeps its ending, or gets ``.txt`` where it has none.

    Parameters
    ----------
    name : str
        Anything, as for `safe_name`.

    Returns
    -------
    str
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    ending = last.rsplit(".", 1)[-1] if "." in last else "txt"
    return f"{safe_name(last, 'file')}.{safe_name(ending, 'txt')}"


def upload_text(
    content: bytes, source: str, most_bytes: int = MAX_SCENE_BYTES, what: str = "scene file"
) -> str:
    """Read the bytes of an uploaded file.

    Parameters
    ----------
    content : bytes
    source : str
        Name of the file, for messages.
    most_bytes : int, optional
    what : str, optional
        What is expected.

    Raises
    ------
    OptionError
        If it is too large or no UTF-8 text.
    """
    if len(content) > most_bytes:
        raise OptionError(size_message(source, len(content), most_bytes, what))
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise OptionError(
            f"{source} is not UTF-8 text (byte {error.start}); expected a {what}"
        ) from None
