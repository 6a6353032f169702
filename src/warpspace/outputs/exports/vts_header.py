"""What a VTK file says of itself, checked before VTK allocates what it says."""

from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from warpspace.exceptions import SceneError
from warpspace.machine.limits import GRID_NODES

MAX_COMPONENTS = 9
_EXTENTS = ("WholeExtent", "Extent")
_APPENDED = b"<AppendedData"


def check_header(path: Path, source: str, limit_bytes: int) -> None:
    """Refuse a file whose sizes no field of warpspace has.

    VTK believes them: with a few digits changed it would allocate and fill gigabytes.

    Parameters
    ----------
    path : Path
    source : str
        What the file is called in messages.
    limit_bytes : int
        Largest number of values of an array.

    Raises
    ------
    SceneError
        If the file is no XML, or a size in it is none.
    """
    # behind this mark ParaView writes raw bytes, which are no XML
    text, mark, _ = path.read_bytes().partition(_APPENDED)
    parser = expat.ParserCreate()

    def refuse(what: str) -> NoReturn:
        raise SceneError(source, [f"is no VTK structured grid (.vts): {what}"])

    def entity(*_: object) -> None:
        refuse("it defines entities")

    def start(name: str, attributes: dict[str, str]) -> None:
        for key in _EXTENTS:
            if key in attributes and not _is_extent(attributes[key]):
                refuse(f"{name} has {key} {attributes[key][:80]!r}")
        for key, largest in (
            ("NumberOfComponents", MAX_COMPONENTS),
            ("NumberOfTuples", limit_bytes),
        ):
            if key in attributes and not _is_count(attributes[key], largest):
                refuse(f"{name} has {key} {attributes[key][:80]!r}")

    parser.EntityDeclHandler = entity
    parser.StartElementHandler = start
    try:
        parser.Parse(text, not mark)
    except expat.ExpatError as error:
        refuse(str(error))


def _is_extent(text: str) -> bool:
    """Tell whether six numbers give the first and last nodes of a grid."""
    parts = text.split()
    if len(parts) != 6 or not all(_is_count(part, GRID_NODES[1]) for part in parts):
        return False
    first, last = parts[::2], parts[1::2]
    return all(int(low) <= int(high) for low, high in zip(first, last, strict=True))


def _is_count(text: str, largest: int) -> bool:
    """Tell whether a text is a whole number within bounds."""
    return text.isascii() and text.isdigit() and len(text) < 20 and int(text) <= largest
