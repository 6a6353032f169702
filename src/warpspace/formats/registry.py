"""The formats there are, by name."""

from collections.abc import Sequence

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.formats.kind import Format
from warpspace.formats.kinds import (
    csv_own,
    fanuc_3d,
    heidenhain,
    isg_csv,
    iso_text,
    klipper,
    linuxcnc_comp,
    linuxcnc_matrix,
    marlin,
    rtl,
    sinumerik_cec,
    sinumerik_enc,
)
from warpspace.formats.source import Source
from warpspace.plugins import load_plugins

_FORMATS: dict[str, Format] = {
    one.name: one
    for one in (
        csv_own.FORMAT,
        iso_text.FORMAT,
        isg_csv.FORMAT,
        rtl.FORMAT,
        sinumerik_enc.FORMAT,
        sinumerik_cec.FORMAT,
        heidenhain.FORMAT,
        fanuc_3d.FORMAT,
        linuxcnc_comp.FORMAT,
        linuxcnc_matrix.FORMAT,
        klipper.FORMAT,
        marlin.FORMAT,
    )
}


def formats() -> tuple[Format, ...]:
    """List all formats."""
    load_plugins()
    return tuple(_FORMATS.values())


def find_format(name: str) -> Format:
    """Find a format by its name.

    Raises
    ------
    UnknownNameError
    """
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
    """Find the format of files that belong together.

    Parameters
    ----------
    sources : sequence of Source

    Returns
    -------
    Format

    Raises
    ------
    UnsaidError
        If a file is of no format that is known.
    SceneError
        If they are of several.
    """
    found: dict[str, Format] = {}
    for source in sources:
        kind = next((one for one in formats() if one.recognise(source.head, source.name)), None)
        if kind is None:
            names = ", ".join(one.name for one in formats())
            first = next((line for line in source.lines if line.strip()), "")
            number = source.lines.index(first) + 1 if first else None
            raise source.unsaid(
                f"{source.shown(number) if number else 'nothing'} is of no format that is known;"
                f" expected one of {names} (--format NAME says which; `warpspace formats` lists"
                " what each holds)",
                number,
            )
        found[kind.name] = kind
        if len(found) > 1:
            names = " and ".join(found)
            source.refuse(f"files of {names} at once; expected one format an import")
    return next(iter(found.values()))
