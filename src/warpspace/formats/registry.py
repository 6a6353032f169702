"""The formats there are, and from files to the errors in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.formats.kind import Format, ReadOptions
from warpspace.formats.kinds import (
    csv_own,
    fanuc_3d,
    heidenhain,
    linuxcnc,
    rtl,
    sinumerik,
    skew,
    volumetric,
)
from warpspace.formats.measured import Imported
from warpspace.formats.source import MAX_BYTES, Source, read_source, source_of_bytes
from warpspace.plugins import load_plugins
from warpspace.scene.files import check_file

_KINDS = (csv_own, volumetric, rtl, sinumerik, heidenhain, fanuc_3d, linuxcnc, skew)
_FORMATS: dict[str, Format] = {one.name: one for kind in _KINDS for one in kind.FORMATS}


def formats() -> tuple[Format, ...]:
    """List all formats."""
    load_plugins()
    return tuple(_FORMATS.values())


def find_format(name: str) -> Format:
    """Find a format by its name."""
    known = {one.name: one for one in formats()}
    if name not in known:
        raise UnknownNameError("format", name, known)
    return known[name]


def register_format(found: Format) -> None:
    """Add a format; it is then recognised, listed, read and written.

    Raises
    ------
    OptionError
        If another one has its name.
    """
    if found.name in _FORMATS:
        raise OptionError(f"format {found.name!r} is there already; expected a name of its own")
    _FORMATS[found.name] = found


def unregister_format(name: str) -> None:
    """Take a format away again."""
    del _FORMATS[name]


def recognise(sources: Sequence[Source]) -> Format:
    """Find the format of files that belong together."""
    found: dict[str, Format] = {}
    for source in sources:
        kind = next((one for one in formats() if one.recognise(source.head, source.name)), None)
        if kind is None:
            names = ", ".join(one.name for one in formats())
            first = next((line for line in source.lines if line.strip()), "")
            number = source.lines.index(first) + 1 if first else None
            said = (
                f"{source.at(number).shown if number else 'nothing'} is of no format that is known"
            )
            expected = (
                f"one of {names} (--format NAME says which; `warpspace import --formats` lists"
            )
            (source.at(number) if number else source).unsaid(said, f"{expected} what each holds)")
        found[kind.name] = kind
        if len(found) > 1:
            names = " and ".join(found)
            source.refuse(f"files of {names} at once", "one format an import")
    return next(iter(found.values()))


MOST_FILES = 64
HEAD_BYTES = 16


@dataclass(frozen=True)
class Reading:
    """What was read, and as what."""

    found: Imported
    format: Format
    recognised: bool  # whether the format was found in the files; if not, the user said it


@dataclass(frozen=True)
class _Unpublished:
    """Files whose structure nobody has published: named, with what to export instead."""

    what: str
    instead: str
    endings: tuple[str, ...] = ()
    starts: tuple[bytes, ...] = ()  # what its files begin with


_UNPUBLISHED = (
    _Unpublished(
        "a spreadsheet",
        "save the sheet as CSV with the header of `warpspace import --template AXIS`",
        (".xlsx", ".xls", ".ods"),
        (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"),
    ),
    _Unpublished(
        "a PDF", "export the numbers as CSV from the program that wrote it", (".pdf",), (b"%PDF",)
    ),
    _Unpublished(
        "a capture of a laser interferometer whose structure is not published",
        "export the deviations as .rtl or as CSV",
        (".rtx", ".rtf", ".dyn", ".pos"),
    ),
    _Unpublished(
        "a SINUMERIK VCS file, whose structure is not published",
        "export the calibration in the Etalon exchange format (variant Vendor) or as CSV",
        (".vcs", ".vcs2"),
    ),
    _Unpublished(
        "a FANUC file of three-dimensional error compensation, whose structure is not published",
        "list its points in the table that docs/compensation.md shows under fanuc-3d",
        (".3de",),
    ),
    _Unpublished(
        "a HEIDENHAIN kinematics table",
        "export its .COM and .CMA files",
        (".tab", ".kinematics", ".knc"),
    ),
    _Unpublished(
        "an error map of a coordinate measuring machine, whose structure is not published",
        "export its error curves as CSV",
        (".vec", ".cmp", ".map"),
    ),
)


def refuse_unknown(name: str, content: bytes) -> None:
    """Refuse a file of a structure that nobody has published."""
    lower = name.lower()
    for kind in _UNPUBLISHED:
        if any(content.startswith(start) for start in kind.starts) or lower.endswith(kind.endings):
            raise SceneError(name, [f"is {kind.what}; expected another file: {kind.instead}"])


def open_files(paths: Sequence[Path]) -> list[Source]:
    """Open the files of an import."""
    if len(paths) > MOST_FILES:
        raise OptionError(f"{len(paths)} files; expected at most {MOST_FILES} an import")
    sources: list[Source] = []
    for path in paths:
        check_file(path, MAX_BYTES, str(path))
        with path.open("rb") as file:
            refuse_unknown(str(path), file.read(HEAD_BYTES))
        sources.append(read_source(path))
    return sources


def open_upload(name: str, content: bytes) -> Source:
    """Open what a browser has sent, see `open_files`."""
    refuse_unknown(name, content[:HEAD_BYTES])
    return source_of_bytes(content, name)


def read_errors(sources: Sequence[Source], options: ReadOptions, format_name: str = "") -> Reading:
    """Read the errors that files hold."""
    kind = find_format(format_name) if format_name else recognise(sources)
    if options.variant not in ("", *kind.variants) and not kind.names_variants:
        known = ", ".join(kind.variants) or "none"
        raise OptionError(f"--variant {options.variant!r} of {kind.name}; expected one of: {known}")
    if options.sign and kind.tables is None:
        raise OptionError(f"--sign: {kind.name} holds errors, no table of a controller")
    return Reading(kind.errors(sources, options), kind, not format_name)
