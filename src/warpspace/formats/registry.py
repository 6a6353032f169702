"""What a format is and can, the formats there are, and from files to the errors in them."""

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
"""What the numbers of a controller's table are: the error, which it subtracts, or what it adds."""
SIGNS = (ERROR, CORRECTION)
Files = Mapping[str, str]
"""Text of each file by what is added to the name that the user gives: "" is that file itself."""
MAX_FILES = 64


@dataclass(frozen=True)
class ReadOptions:
    """What a user says about a file that the file itself does not."""

    machine: Machine | None = None  # that its errors are for; None where none is named
    axis: str = ""  # axis of a file that names none
    # axis of the machine by its name in the file
    names: Mapping[str, str] = field(default_factory=dict[str, str])
    sign: str = ""  # "error" or "correction"; empty for what the documentation of the format says
    # which of the published variants of a format it is; empty for the usual one
    variant: str = ""

    def factor(self, usual: str) -> float:
        """Give the factor from a number of a table to a correction: −1 where it is an error."""
        return -1.0 if (self.sign or usual) == ERROR else 1.0

    def sign_statement(self, usual: str) -> str:
        """Say what the numbers are: what the user says, else the documentation of the format."""
        return f"sign: {self.sign}" if self.sign else usual

    def axis_named(self, name: str, at: Source | SourceLine) -> str:
        """Find the axis of the machine behind a name in a file: X1, MX1 and X mean X."""
        bare = name.strip().strip('"').upper()
        assigned = self.names.get(bare, "")
        candidates = [assigned] if assigned else _candidates(bare)
        matches = [axis for axis in candidates if len(axis) == 1 or assigned]
        if self.machine is not None:
            matches = [axis for axis in candidates if axis in self.machine.axes]
        if not matches:
            says = f"--axis {bare or 'NAME'}=AXIS says which one it is"
            if self.machine is None:
                at.refuse(f"axis {bare!r} is not known", f"X Y Z U V W A B C; {says}")
            chain, axes = self.machine.chain, ", ".join(self.machine.axes)
            problem = f"axis {bare!r} is none of the machine {chain}, which has {axes}"
            at.refuse(problem if assigned else f"{problem} ({says})")
        return matches[0]


@dataclass(frozen=True)
class Format:
    """A kind of file: what it holds, how it is recognised, read, written and evaluated."""

    name: str
    title: str
    source: str  # where its structure is published
    endings: tuple[str, ...]  # usual endings of its files
    holds: str  # for the list of formats, as the next three
    units: str
    grid: str
    limits: str
    recognise: Callable[[str, str], bool]  # by the first lines of a file and its name
    # the errors that files hold; None for those that `tables` correct
    read: Callable[[Sequence[Source], ReadOptions], ImportedErrors] | None = None
    # what the controller evaluates after reading them; None where it is no controller's
    tables: Callable[[Sequence[Source], ReadOptions], Tables] | None = None
    write: Callable[[RequiredCorrections], Files] | None = None  # the files that compensate
    independent_files: bool = False  # whether each of its files is a table by itself
    points: int = 21  # per axis where none are asked for
    max_points: int = 10_000  # per axis that the controller takes
    # whether it holds error parameters, from which the controller works out its corrections
    parametric: bool = False
    variants: tuple[str, ...] = ()  # published ones, the usual one first
    names_variants: bool = False  # whether its files name variants of their own, such as profiles
    orientation: bool = False  # whether corrections of rotary axes have a place in it
    # whether it can move all positions by the same; where not, a part that lies elsewhere cannot be
    # corrected, and its placement is fitted out of relative errors
    offsets: bool = True
    measured: bool = False  # whether its runs are readings, which are kept with the scene

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process by name: what reads and writes stays where it is."""
        return find_format, (self.name,)

    @property
    def can_write(self) -> bool:
        return self.write is not None

    def errors(self, sources: Sequence[Source], options: ReadOptions) -> ImportedErrors:
        if self.read is not None:
            return self.read(sources, options)
        if self.tables is None:
            raise OptionError(f"{self.name} is written only; expected another format")
        parts = [[source] for source in sources] if self.independent_files else [sources]
        imports = [
            errors_from_tables(self.tables(part, options), self.name, part[0], options.machine)
            for part in parts
        ]
        return merge(imports) if len(imports) > 1 else imports[0]


@cache
def _catalogue() -> dict[str, Any]:
    return tomllib.loads((files("warpspace.formats") / "formats.toml").read_text("utf-8"))


def format_description(name: str) -> dict[str, Any]:
    description = _catalogue()["formats"][name]
    return {**description, "name": name, "endings": tuple(description["endings"])}


def head_matcher(pattern: str) -> Callable[[str, str], bool]:
    """Tell files by a pattern in their first lines, whatever their name."""
    expression = re.compile(pattern, re.MULTILINE)
    return lambda head, _: expression.search(head) is not None


def _candidates(bare: str) -> list[str]:
    candidates = [bare] if is_axis_name(bare) else []
    stem = bare.removeprefix("M").rstrip("0123456789")
    if len(stem) == 1 and is_axis_name(stem) and stem not in candidates:
        candidates.append(stem)
    return candidates


def parse_axis_options(texts: Sequence[str]) -> tuple[str, dict[str, str]]:
    axis, names = "", {}
    for text in texts:
        name, equals, target = text.partition("=")
        axis_name = (target if equals else name).strip().upper()
        if not is_axis_name(axis_name):
            raise OptionError(f"--axis {text!r}; expected an axis (X) or NAME=AXIS (AX1=X)")
        if equals:
            names[name.strip().upper()] = axis_name
        else:
            axis = axis_name
    return axis, names


_KINDS = ["csv_own", "volumetric", "rtl", "sinumerik", "heidenhain", "fanuc_3d", "linuxcnc", "skew"]


@cache
def _registry() -> Registry[Format]:
    kinds = (resolve_name(f"{__package__}.kinds.{kind}:FORMATS") for kind in _KINDS)
    return Registry("format", {one.name: one for kind in kinds for one in kind})


def formats() -> tuple[Format, ...]:
    return _registry().every()


def find_format(name: str) -> Format:
    return _registry().find(name)


def register_format(new_format: Format) -> None:
    """Add a format; it is then recognised, listed, read and written."""
    _registry().register(new_format)


def unregister_format(name: str) -> None:
    _registry().unregister(name)


def recognise(sources: Sequence[Source]) -> Format:
    recognised: dict[str, Format] = {}
    for source in sources:
        kind = next((one for one in formats() if one.recognise(source.head, source.name)), None)
        if kind is None:
            names = ", ".join(one.name for one in formats())
            first = next((line for line in source.lines if line.strip()), "")
            number = source.lines.index(first) + 1 if first else None
            problem = (
                f"{source.at(number).quoted if number else 'nothing'} is of no format that is known"
            )
            expected = (
                f"one of {names} (--format NAME says which; `warpspace import --formats` lists"
            )
            (source.at(number) if number else source).refuse(
                problem, f"{expected} what each holds)"
            )
        recognised[kind.name] = kind
        if len(recognised) > 1:
            names = " and ".join(recognised)
            source.refuse(f"files of {names} at once", "one format an import")
    return next(iter(recognised.values()))


@dataclass(frozen=True)
class Reading:
    """What was read, and as what."""

    imported: ImportedErrors
    format: Format
    recognised: bool  # whether the format was found in the files; if not, the user said it


def open_upload(name: str, content: bytes) -> Source:
    """Take in a file; one whose structure nobody has published is refused."""
    lower = name.lower()
    for kind in _catalogue()["unpublished"]:
        starts = tuple(start.encode("latin-1") for start in kind.get("starts", ()))
        if content.startswith(starts) or lower.endswith(tuple(kind["endings"])):
            problem = f"is {kind['what']}; expected another file: {kind['instead']}"
            raise SceneError(name, [problem])
    return source_of_bytes(content, name)


def open_files(paths: Sequence[Path]) -> list[Source]:
    if len(paths) > MAX_FILES:
        raise OptionError(f"{len(paths)} files; expected at most {MAX_FILES} an import")
    return [open_upload(str(path), read_bytes(path, MAX_BYTES)) for path in paths]


def read_errors(sources: Sequence[Source], options: ReadOptions, format_name: str = "") -> Reading:
    kind = find_format(format_name) if format_name else recognise(sources)
    if options.variant not in ("", *kind.variants) and not kind.names_variants:
        variants = ", ".join(kind.variants) or "none"
        raise OptionError(
            f"--variant {options.variant!r} of {kind.name}; expected one of: {variants}"
        )
    if options.sign and kind.tables is None:
        raise OptionError(f"--sign: {kind.name} holds errors, no table of a controller")
    return Reading(kind.errors(sources, options), kind, not format_name)
