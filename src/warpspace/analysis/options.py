"""Options of an analysis: fields of its dataclass, and the parsers of their values."""

import math
import types
from collections.abc import Callable, Collection, Mapping
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from enum import StrEnum
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Concatenate,
    Literal,
    ParamSpec,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_LENGTH_MM
from warpspace.scene.text_files import parse_number

if TYPE_CHECKING:
    from warpspace.machine.definition import Machine
    from warpspace.scene.model import Scene

T = TypeVar("T")
P = ParamSpec("P")
UNIT_ENDINGS = ("_mm", "_um", "_urad", "_deg")


@dataclass(frozen=True, slots=True)
class Grammar:
    """Syntax of a value that is no number, string or choice: ``Annotated[T, Grammar(…)]``."""

    metavar: str  # what stands in its place in a help text
    # takes what was typed and the scene, gives the value, which is hashable; raises `ValueError`
    # with what was expected
    read: Callable[[str, Any], Any]
    # whether it may be typed in several parts, with commas between or one by one
    many: bool = False
    each: bool = False  # whether it may be given several times, each value read by itself
    is_file: bool = False  # whether it names a file that is read
    is_extended: bool = False  # whether it names a file that is read, if any, or written


@dataclass(frozen=True, slots=True)
class Option:
    """One option of an analysis; see `option`."""

    about: str
    _: KW_ONLY
    unit: str = ""
    low: float | None = None
    high: float | None = None
    unset: str = ""  # meaning of None or of an empty value
    needs: str = ""  # name of the switch it belongs to
    flag: str = ""  # on the command line; by default the name without its unit
    label: str = ""  # on a page; likewise
    choice_labels: Mapping[str, str] = field(default_factory=dict[str, str])  # on a page
    required: bool = False  # on the command line
    positional: bool = False  # whether the command line takes it as an argument after the scene
    # from the field and its annotation, by `options_of`
    name: str = ""
    default: Any = None
    kind: Any = None  # bool, int, float, str, or None with a grammar
    choices: tuple[str, ...] = ()
    grammar: Grammar | None = None
    enum: type[StrEnum] | None = None

    @property
    def help(self) -> str:
        """Help text with unit, limits and default."""
        parts = [self.about]
        if self.unit and self.grammar is None:
            parts.append(f", {self.unit}")
        if self.low is not None and self.high is not None:
            parts.append(f"; {_spell(self.low)} to {_spell(self.high)}")
        parts.append(".")
        if self.needs:
            parts.append(f" Belongs to --{self.needs.replace('_', '-')}.")
        if self.default_words:
            parts.append(f"  [{self.default_words}]")
        return "".join(parts)

    @property
    def default_words(self) -> str:
        if self.unset:
            return self.unset
        if self.kind is bool or self.default is None or self.default in ("", ()):
            return ""
        return f"{self.default:g}" if isinstance(self.default, float) else str(self.default)

    def coerce(self, value: Any) -> Any:
        """Convert a value to the type of the field: a string to a member, a mapping to pairs."""
        if isinstance(value, Mapping):
            return tuple(value.items())
        if self.enum is None or value is None:
            return tuple(value) if isinstance(value, list) else value
        if value not in self.choices:
            expected = ", ".join(self.choices)
            raise OptionError(f"{{{self.name}}} {str(value)!r}; expected one of {expected}")
        return self.enum(value)

    def check(self, value: Any) -> None:
        if self.kind not in (int, float) or value is None:
            return
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        if not (math.isfinite(value) and low <= value <= high):
            unit, span = f" {self.unit}" if self.unit else "", _span(self.low, self.high)
            raise OptionError(f"{{{self.name}}} {_spell(value)}{unit}; expected {span}{unit}")

    def read(self, text: str, scene: "Scene | None") -> Any:
        word = text.strip()
        try:
            if self.grammar is not None:
                return self.grammar.read(word, scene)
        except ValueError as error:
            joint = ";" if str(error).startswith("expected") else ":"
            raise OptionError(f"{{{self.name}}} {text!r}{joint} {error}") from None
        if self.enum is not None:
            return self.coerce(word)
        if self.choices and word not in self.choices:
            expected = ", ".join(self.choices)
            raise OptionError(f"{{{self.name}}} {text!r}; expected one of {expected}")
        try:
            return self.kind(word) if self.kind in (int, float) and "_" not in word else word
        except ValueError:
            what = "a whole number" if self.kind is int else "a number"
            raise OptionError(f"{{{self.name}}} {text!r}; expected {what}") from None


def _span(low: float | None, high: float | None) -> str:
    if low is None:
        return "a finite number" if high is None else f"at most {_spell(high)}"
    return f"at least {_spell(low)}" if high is None else f"{_spell(low)} to {_spell(high)}"


def _spell(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}"


def _field_of(record: Callable[P, Option]) -> Callable[Concatenate[T, P], T]:
    def option(default: T, *about: P.args, **traits: P.kwargs) -> T:
        """Return a field of an analysis that a user may set.

        The type and the choices come from its annotation. See `Option` for the parameters.
        """
        described = record(*about, **traits)
        return field(default_factory=lambda: default, metadata={"option": described})

    return option


option = _field_of(Option)


@cache
def options_of(kind: type) -> tuple[Option, ...]:
    hints = get_type_hints(kind, include_extras=True)
    return tuple(
        _complete(entry.metadata["option"], entry.name, entry.default_factory(), hints[entry.name])
        for entry in fields(kind)
        if "option" in entry.metadata and callable(entry.default_factory)
    )


def _complete(described: Option, name: str, default: Any, hint: Any) -> Option:
    base, grammar = _resolve(hint)
    enum = base if isinstance(base, type) and issubclass(base, StrEnum) else None
    choices = tuple(map(str, get_args(base) if get_origin(base) is Literal else enum or ()))
    stem = name
    for ending in UNIT_ENDINGS:
        stem = stem.removesuffix(ending)
    return replace(
        described,
        name=name,
        default=default,
        kind=base if base in (bool, int, float, str) else None,
        choices=choices,
        grammar=grammar,
        enum=enum,
        flag=described.flag or "--" + stem.replace("_", "-"),
        label=described.label or stem.replace("_", " ").capitalize(),
    )


def _resolve(hint: Any) -> tuple[Any, Grammar | None]:
    if get_origin(hint) is Annotated:
        base, *extras = get_args(hint)
        grammar = next((argument for argument in extras if isinstance(argument, Grammar)), None)
        return _resolve(base)[0], grammar
    if get_origin(hint) in (Union, types.UnionType):
        kinds = [argument for argument in get_args(hint) if argument is not type(None)]
        if len(kinds) == 1:
            return _resolve(kinds[0])
    return hint, None


ALL = "all"
LOOP_HELP = "Structural loop: tool point, workpiece point, or tool relative to workpiece"
LOOP_UNSET = "tool; relative with a placement or an axis under the workpiece"
PLACED_HELP = (
    "Fit out the placement of the workpiece: three shifts and three small rotations of it that"
    " minimise the RMS over the working volume. Evaluates the relative loop"
)
AT_HELP = (
    "Axis positions in mm and degrees, for instance X=0,Y=-225,Z=-480; omitted axes stay at their"
    " position in the scene"
)


def read_numbers(text: str, pairs: str, example: str) -> dict[str, float]:
    """Parse numbers by name, ``X=0,Y=-225``; names are converted to capitals."""
    numbers: dict[str, float] = {}
    for part in text.replace(";", ",").split(","):
        name, equals, number = part.partition("=")
        name = name.strip().upper()
        try:
            value = parse_number(number)
        except ValueError:
            value = math.nan
        if not (name and equals and math.isfinite(value)):
            raise ValueError(
                f"{part.strip()!r} cannot be read; expected {pairs} pairs with commas between, for"
                f" instance {example}"
            )
        if name in numbers:
            raise ValueError(f"{name} is given twice")
        numbers[name] = value
    return numbers


def read_place(text: str, axes: Collection[str]) -> dict[str, float]:
    """Parse axis positions, ``X=0,Y=-225,B=30``, mm or degrees."""
    place = read_numbers(text, "axis=number", "X=0,Y=-225,B=30")
    for name, value in place.items():
        if name not in axes:
            raise ValueError(f"unknown axis {name}; expected one of {', '.join(axes)}")
        if abs(value) > MAX_LENGTH_MM:
            raise ValueError(f"{value:g}; expected at most ±{MAX_LENGTH_MM:g} mm or degrees")
    return place


def _place(text: str, scene: "Scene") -> tuple[tuple[str, float], ...]:
    return tuple(read_place(text, scene.machine.axes).items())


def read_keys(text: str, _scene: "Scene") -> tuple[str, ...]:
    """Parse keys of error parameters separated by commas, in any case; `ALL` stands for all."""
    from warpspace.machine.axes import PARAMETERS, parameter

    spelling = {ALL: ALL, **{key.lower(): key for key in PARAMETERS}}
    names = [part.strip() for part in text.split(",")]
    keys = tuple(spelling.get(part.lower(), part) for part in names if part)
    if not keys:
        raise ValueError("expected keys such as EA0Z,EC0Y")
    for key in keys:
        if key != ALL:
            parameter(key)
    return keys


def read_limits(text: str, _scene: "Scene") -> tuple[tuple[str, float], ...]:
    """Parse positive numbers by parameter; one without a key is for all, under the key `ALL`."""
    limits: dict[str, float] = {}
    for part in (part.strip() for part in text.split(",")):
        name, equals, number = part.rpartition("=")
        try:
            value = parse_number(number.strip().lstrip("±"))
        except ValueError:
            value = math.nan
        if not math.inf > value > 0.0:
            raise ValueError(
                ("" if part == text.strip() else f"{part!r}: ")
                + "expected KEY=VALUE or one VALUE for all errors, in µm or µrad and above 0"
            )
        limits[name.strip().upper() if equals else ALL] = value
    return tuple(limits.items())


def typed_word(text: str, _scene: "Scene") -> str:
    return text


def _axis(text: str, _scene: "Scene") -> str:
    return text.strip().upper()


def _vector(text: str, _scene: "Scene") -> tuple[float, float, float]:
    try:
        x, y, z = (parse_number(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(abs(value) <= MAX_LENGTH_MM for value in (x, y, z)):
        raise ValueError("expected three numbers in mm, for instance 100,0,50")
    return x, y, z


File: TypeAlias = Annotated[str | None, Grammar("FILE", typed_word, is_file=True)]
Axis: TypeAlias = Annotated[str, Grammar("AXIS", _axis)]
"""Name of an axis; empty for a choice of its own."""
Vector: TypeAlias = Annotated[tuple[float, float, float] | None, Grammar("X,Y,Z", _vector)]
"""A point in mm."""
Files: TypeAlias = Annotated[tuple[str, ...], Grammar("FILE", typed_word, each=True, is_file=True)]
Kinds: TypeAlias = Annotated[tuple[str, ...], Grammar("KIND", typed_word, each=True)]
PLACE = Grammar("X=..,Y=..", _place)
Place: TypeAlias = Annotated[tuple[tuple[str, float], ...], PLACE]
"""Axis positions in mm and degrees."""
Keys: TypeAlias = Annotated[tuple[str, ...], Grammar("KEY,…|all", read_keys, many=True)]
Limits: TypeAlias = Annotated[
    tuple[tuple[str, float], ...], Grammar("KEY=±VALUE|±VALUE", read_limits, many=True)
]
"""Half widths by parameter, µm or µrad."""


def place_words(place: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in place.items())


def outside_travel(machine: "Machine", place: Mapping[str, float]) -> list[str]:
    warnings: list[str] = []
    for name, value in place.items():
        axis = machine.axes[name]
        low, high = axis.travel
        if not low <= value <= high:
            unit = f" {axis.unit}" if axis.is_linear else axis.unit
            warnings.append(
                f"{name}={value:g} is outside the travel of {name}, {low:g} to {high:g}{unit};"
                " its errors are continued beyond it"
            )
    return warnings


def error_words(key: str) -> str:
    from warpspace.machine.axes import parameter

    row = parameter(key)
    return f"{row.name}  {row.symbol}  {row.key}"
