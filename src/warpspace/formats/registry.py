"""The file formats: their description, their registry, and reading errors from files."""

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from warpspace.exceptions import OptionError, SceneError
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.measured import ImportedErrors, merge
from warpspace.formats.source import MAX_BYTES, Source, SourceLine, source_of_bytes
from warpspace.formats.terms import Tables, errors_from_tables
from warpspace.machine.axes import is_axis_name
from warpspace.machine.definition import Machine
from warpspace.plugins import Registry
from warpspace.scene.text_files import read_bytes

ERROR, CORRECTION = "error", "correction"
"""Sign of a controller's table: the error, which it subtracts, or the correction, which it adds."""
SIGNS = (ERROR, CORRECTION)
Files = Mapping[str, str]
"""Text of each file by its suffix to the name from the user; "" is the main file."""
MAX_FILES = 64


@dataclass(frozen=True)
class ReadOptions:
    """Facts about a file that it does not state itself."""

    machine: Machine | None = None  # that has the errors; None where it is not named
    axis: str = ""  # axis of a file that does not name one
    # axis of the machine by its name in the file
    names: Mapping[str, str] = field(default_factory=dict[str, str])
    sign: str = ""  # "error" or "correction"; empty for the sign in the documentation of the format
    # published variant of the format; empty for the usual one
    variant: str = ""

    def factor(self, usual: str) -> float:
        """Return the factor from a number of a table to a correction: −1 where it is an error."""
        return -1.0 if (self.sign or usual) == ERROR else 1.0

    def sign_statement(self, usual: str) -> str:
        """Return the assumption about the sign: from the user, else from the documentation."""
        return f"sign: {self.sign}" if self.sign else usual

    def axis_named(self, name: str, at: Source | SourceLine) -> str:
        """Find the axis of the machine behind a name in a file: X1, MX1 and X mean X."""
        bare = name.strip().strip('"').upper()
        assigned = self.names.get(bare, "")
        stem = bare.removeprefix("M").rstrip("0123456789")
        names = (bare, stem) if len(stem) == 1 else (bare,)
        candidates = [assigned] if assigned else [name for name in names if is_axis_name(name)]
        matches = [axis for axis in candidates if len(axis) == 1 or assigned]
        if self.machine is not None:
            matches = [axis for axis in candidates if axis in self.machine.axes]
        if not matches:
            advice = f"{{axis}} {bare or 'NAME'}=AXIS assigns it"
            if self.machine is None:
                at.refuse(f"axis {bare!r} is unknown", f"X Y Z U V W A B C; {advice}")
            chain, axes = self.machine.chain, ", ".join(self.machine.axes)
            problem = f"the machine {chain} has no axis {bare!r}, it has {axes}"
            at.refuse(problem if assigned else f"{problem} ({advice})")
        return matches[0]

    def axis_of_file(self, source: Source, expected: str) -> str:
        """Return the axis that the user names, else that of the letter at the end of the name."""
        letter = source.stem.upper().rsplit("_", 1)[-1]
        axis = self.axis or (letter if len(letter) == 1 and is_axis_name(letter) else "")
        if not axis:
            source.refuse("does not state its axis", expected)
        return self.axis_named(axis, source)


@dataclass(frozen=True)
class Format:
    """A file format: its contents, and how it is recognised, read, written and evaluated."""

    name: str
    title: str
    source: str  # where its structure is published
    endings: tuple[str, ...]  # usual endings of its files
    holds: str  # contents, for the list of formats, like the next three
    units: str
    grid: str
    limits: str
    recognise: Callable[[str, str], bool]  # by the first lines of a file and its name
    # the errors in files; None where they follow from `tables`
    read: Callable[[Sequence[Source], ReadOptions], ImportedErrors] | None = None
    # the tables that the controller evaluates; None for formats without a controller
    tables: Callable[[Sequence[Source], ReadOptions], Tables] | None = None
    write: Callable[[RequiredCorrections], Files] | None = None  # the compensation files
    independent_files: bool = False  # each of its files is a complete table
    points: int = 21  # per axis, by default
    most_points: int = 10_000  # per axis, limit of the controller
    # it contains error parameters, from which the controller computes its corrections
    parametric: bool = False
    variants: tuple[str, ...] = ()  # published ones, the usual one first
    names_variants: bool = False  # its files name variants, such as profiles
    orientation: bool = False  # it can contain corrections of rotary axes
    # it can contain constant corrections; otherwise the placement of the workpiece cannot be
    # corrected, and is fitted out of relative errors
    offsets: bool = True
    measured: bool = False  # its runs are readings, which the scene stores

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by name: another process looks up the functions in its registry."""
        return find_format, (self.name,)

    @property
    def can_write(self) -> bool:
        return self.write is not None

    @property
    def has_grid(self) -> bool:
        return not self.grid.startswith("none")

    def errors(self, sources: Sequence[Source], options: ReadOptions) -> ImportedErrors:
        if self.read is not None:
            return self.read(sources, options)
        if self.tables is None:
            raise OptionError(f"{self.name} cannot be read; expected another format")
        parts = [[source] for source in sources] if self.independent_files else [sources]
        imports = [
            errors_from_tables(self.tables(part, options), self.name, part[0], options.machine)
            for part in parts
        ]
        return merge(imports) if len(imports) > 1 else imports[0]


@cache
def _catalogue() -> dict[str, Any]:
    return tomllib.loads((files("warpspace.formats") / "formats.toml").read_text("utf-8"))


def describe(name: str) -> dict[str, Any]:
    description = _catalogue()["formats"][name]
    return {**description, "name": name, "endings": tuple(description["endings"])}


def has_pattern(pattern: str) -> Callable[[str, str], bool]:
    """Return a predicate that matches the first lines of a file, ignoring its name."""
    expression = re.compile(pattern, re.MULTILINE)
    return lambda head, _: expression.search(head) is not None


def parse_axis_options(texts: Sequence[str]) -> tuple[str, dict[str, str]]:
    axis, names = "", {}
    for text in texts:
        name, equals, target = text.partition("=")
        axis_name = (target if equals else name).strip().upper()
        if not is_axis_name(axis_name):
            raise OptionError(f"{{axis}} {text!r}; expected an axis (X) or NAME=AXIS (AX1=X)")
        if equals:
            names[name.strip().upper()] = axis_name
        else:
            axis = axis_name
    return axis, names


_KINDS = (
    "csv_own", "volumetric", "rtl", "sinumerik", "heidenhain", "fanuc_3d", "isg_list", "linuxcnc",
    "skew",
)  # fmt: skip


@cache
def _registry() -> Registry[Format]:
    groups = (resolve_name(f"{__package__}.kinds.{module}:FORMATS") for module in _KINDS)
    return Registry("format", {kind.name: kind for group in groups for kind in group})


def formats() -> tuple[Format, ...]:
    return _registry().members()


def find_format(name: str) -> Format:
    return _registry().find(name)


def register_format(new_format: Format) -> None:
    """Register a format to be recognised, listed, read and written."""
    _registry().register(new_format)


def unregister_format(name: str) -> None:
    _registry().unregister(name)


def recognise(sources: Sequence[Source]) -> Format:
    recognised: dict[str, Format] = {}
    for source in sources:
        head, name = source.head, source.name
        kind = next((kind for kind in formats() if kind.recognise(head, name)), None)
        if kind is None:
            _refuse_unpublished(name, head=head)
            _refuse_ending(name)
            names = ", ".join(kind.name for kind in formats())
            expected = f"one of {names} ({{format}} selects it)"
            for at, _ in source.scan():
                at.refuse(f"{at.quoted} matches no known format", expected)
            source.refuse("nothing matches no known format", expected)
        recognised[kind.name] = kind
        if len(recognised) > 1:
            names = " and ".join(recognised)
            source.refuse(f"files of {names} at once", "one format per import")
    return next(iter(recognised.values()))


@dataclass(frozen=True)
class Reading:
    """Imported errors and their format."""

    imported: ImportedErrors
    format: Format
    recognised: bool  # from the files; otherwise the user stated the format


def _refuse_unpublished(name: str, content: bytes = b"", head: str = "") -> None:
    """Raise an error for a file that no format reads, by its content."""
    for kind in _catalogue()["unpublished"]:
        starts = tuple(start.encode("latin-1") for start in kind.get("starts", ()))
        pattern = kind.get("pattern", "")
        if content.startswith(starts) or (pattern and re.search(pattern, head, re.MULTILINE)):
            raise SceneError(name, [f"is {kind['what']}; {_alternative(kind)}"])


def _alternative(kind: Mapping[str, str]) -> str:
    template = "enter position and error in a CSV table, see {template}"
    return f"expected another file: {kind.get('instead', template)}"


def _refuse_ending(name: str) -> None:
    """Raise an error for a file that no format reads, by its ending."""
    for kind in _catalogue()["unpublished"]:
        ending = next((end for end in kind.get("endings", ()) if name.lower().endswith(end)), "")
        if ending:
            problem = f"matches no known format; {ending} may be {kind['what']}"
            raise SceneError(name, [f"{problem}; {_alternative(kind)}"])


def open_upload(name: str, content: bytes) -> Source:
    """Read an uploaded file; formats whose structure is not published are refused."""
    _refuse_unpublished(name, content)
    try:
        return source_of_bytes(content, name)
    except SceneError:
        _refuse_ending(name)
        raise


def open_files(paths: Sequence[Path]) -> list[Source]:
    if len(paths) > MAX_FILES:
        raise OptionError(f"{len(paths)} files; expected at most {MAX_FILES} per import")
    return [open_upload(str(path), read_bytes(path, MAX_BYTES)) for path in paths]


def read_errors(sources: Sequence[Source], options: ReadOptions, format_name: str = "") -> Reading:
    kind = find_format(format_name) if format_name else recognise(sources)
    if options.variant not in ("", *kind.variants) and not kind.names_variants:
        variants = ", ".join(kind.variants) or "none"
        raise OptionError(
            f"{{variant}} {options.variant!r} of {kind.name}; expected one of: {variants}"
        )
    if options.sign and kind.tables is None:
        raise OptionError(f"{{sign}}: {kind.name} contains errors, not a table of a controller")
    return Reading(kind.errors(sources, options), kind, not format_name)
