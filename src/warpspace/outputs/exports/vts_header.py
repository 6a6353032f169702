"""What a VTK file says of its sizes, checked before VTK allocates and reads what it says."""

import base64
import binascii
import re
import struct
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from warpspace.exceptions import SceneError
from warpspace.machine.limits import GRID_NODES

MAX_COMPONENTS = 9
MAX_BLOCKS = 100_000
"""Compressed pieces of one array; writers make one of 32 kB at least."""
MAX_TUPLES = 4_000_000
"""Nodes of a grid, or characters of what a file says of itself."""
MAX_ARRAY_BYTES = 100_000_000
_COUNTS = {"NumberOfComponents": MAX_COMPONENTS, "NumberOfTuples": MAX_TUPLES}
_EXTENTS = ("WholeExtent", "Extent")
_APPENDED = re.compile(rb"<AppendedData[^>]*?>\s*_")
_WIDTHS = {"UInt32": ("I", 4), "UInt64": ("Q", 8)}


def check_header(path: Path, source: str) -> None:
    """Refuse a file whose sizes no field of warpspace has.

    VTK believes them: with a few digits changed it would allocate and fill gigabytes, or not come
    to an end.

    Parameters
    ----------
    path : Path
    source : str
        What the file is called in messages.

    Raises
    ------
    SceneError
        If the file is no XML, or a size in it is none.
    """
    _Header(path.read_bytes(), source).check()


class _Header:
    """The elements of a file, as expat finds them."""

    def __init__(self, content: bytes, source: str) -> None:
        self._source = source
        # behind this mark ParaView writes raw bytes, which are no XML
        mark = _APPENDED.search(content)
        self._text = content if mark is None else content[: mark.start()]
        self._appended = b"" if mark is None else content[mark.end() :]
        self._raw = mark is not None and b"base64" not in mark[0]
        self._is_whole = mark is None
        self._order, self._width, self._compressed = "<", "UInt32", False
        self._inline: list[str] | None = None

    def check(self) -> None:
        """Read the elements."""
        parser = expat.ParserCreate()
        parser.EntityDeclHandler = self._entity
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._words
        try:
            parser.Parse(self._text, self._is_whole)
        except expat.ExpatError as error:
            self._refuse(str(error))

    def _refuse(self, what: str) -> NoReturn:
        raise SceneError(self._source, [f"is no VTK structured grid (.vts): {what}"])

    def _entity(self, *_: object) -> None:
        self._refuse("it defines entities")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        """Look at the sizes that an element gives."""
        for key in _EXTENTS:
            if key in attributes and not _is_extent(attributes[key]):
                self._refuse(f"{name} has {key} {attributes[key][:80]!r}")
        for key, largest in (
            ("NumberOfComponents", MAX_COMPONENTS),
            ("NumberOfTuples", MAX_ARRAY_BYTES),
        ):
            if key in attributes and not _is_count(attributes[key], largest):
                self._refuse(f"{name} has {key} {attributes[key][:80]!r}")
        if name == "VTKFile":
            self._order = ">" if attributes.get("byte_order") == "BigEndian" else "<"
            self._width = attributes.get("header_type", "UInt32")
            self._compressed = bool(attributes.get("compressor"))
            if self._width not in _WIDTHS:
                self._refuse(f"{name} has header_type {self._width[:80]!r}")
        kind = attributes.get("format")
        if name == "DataArray" and kind == "binary":
            self._inline = []
        elif name == "DataArray" and kind == "appended":
            offset = attributes.get("offset", "")
            if not _is_count(offset, len(self._appended)):
                self._refuse(f"{name} has offset {offset[:80]!r}")
            self._check_sizes(self._appended[int(offset) : int(offset) + 64], raw=self._raw)

    def _words(self, text: str) -> None:
        """Collect the beginning of an array."""
        if self._inline is not None and sum(map(len, self._inline)) < 64:
            self._inline.append(text.strip())

    def _end(self, name: str) -> None:
        """Look at the sizes at the beginning of an array."""
        if name == "DataArray" and self._inline is not None:
            self._check_sizes("".join(self._inline).encode("ascii", "replace"), raw=False)
            self._inline = None

    def _check_sizes(self, begin: bytes, *, raw: bool) -> None:
        """Read the sizes in front of an array: bytes, or blocks and bytes of a block."""
        letter, width = _WIDTHS[self._width]
        count = 3 if self._compressed else 1
        need = count * width
        if not raw:
            spelt = begin[: 4 * -(-need // 3)]
            try:
                begin = base64.b64decode(spelt, validate=True)
            except binascii.Error:
                self._refuse("an array is no base64")
        if len(begin) < need:
            if not begin.strip(b"\0"):
                return  # an empty array
            self._refuse("an array is cut")
        sizes = struct.unpack(f"{self._order}{count}{letter}", begin[:need])
        blocks, size, last = sizes if self._compressed else (1, *sizes, 0)
        too_long = blocks > MAX_BLOCKS or blocks * size > MAX_ARRAY_BYTES or last > max(size, 1)
        if too_long or (last and not blocks):  # VTK writes through a null pointer for the latter
            self._refuse(f"an array of {blocks:,} × {size:,} bytes")


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
