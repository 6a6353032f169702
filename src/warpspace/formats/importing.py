"""From files to the errors in them: recognised, read, checked against a machine."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from warpspace.exceptions import OptionError
from warpspace.formats.kind import Format, ReadOptions
from warpspace.formats.measured import Imported
from warpspace.formats.refused import refuse_unknown
from warpspace.formats.registry import find_format, recognise
from warpspace.formats.source import MAX_BYTES, Source, read_source, source_of_bytes
from warpspace.scene.files import check_file

MOST_FILES = 64
HEAD_BYTES = 16


@dataclass(frozen=True)
class Reading:
    """What was read, and as what.

    Attributes
    ----------
    found : Imported
    format : Format
    recognised : bool
        Whether the format was found in the files; if not, the user said it.
    """

    found: Imported
    format: Format
    recognised: bool


def open_files(paths: Sequence[Path]) -> list[Source]:
    """Open the files of an import.

    Raises
    ------
    SceneError
        If one cannot be read, or is of a structure that nobody has published.
    """
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
    """Read the errors that files hold.

    Parameters
    ----------
    sources : sequence of Source
    options : ReadOptions
    format_name : str, optional
        The format, where it is not to be recognised.

    Returns
    -------
    Reading

    Raises
    ------
    SceneError
        With file, line and what was expected.
    OptionError, UnknownNameError
        If an option does not fit the format.
    """
    kind = find_format(format_name) if format_name else recognise(sources)
    if options.variant and options.variant not in kind.variants:
        known = ", ".join(kind.variants) or "none"
        raise OptionError(f"--variant {options.variant!r} of {kind.name}; expected one of: {known}")
    if options.sign and kind.tables is None:
        raise OptionError(f"--sign: {kind.name} holds errors, no table of a controller")
    return Reading(kind.read(sources, options), kind, not format_name)
