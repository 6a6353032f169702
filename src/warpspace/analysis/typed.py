"""Values that are typed as text: axis positions, parameters, numbers by parameter."""

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Annotated, TypeAlias

from warpspace.analysis.options import Grammar
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.machine.limits import MAX_LENGTH_MM
from warpspace.scene.files import parse_number

if TYPE_CHECKING:
    from warpspace.machine.description import Machine
    from warpspace.scene.model import Scene

ALL = "all"
LOOP_HELP = "Structural loop: tool point, workpiece point, or tool relative to workpiece"
AT_HELP = (
    "Axis positions in mm and degrees, for instance X=0,Y=-225,Z=-480; axes left out stand at their"
    " place in the scene"
)


def read_numbers(text: str, pairs: str, example: str) -> dict[str, float]:
    """Read numbers by name, ``X=0,Y=-225``; names come out in capitals."""
    found: dict[str, float] = {}
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
        if name in found:
            raise ValueError(f"{name} is given twice")
        found[name] = value
    return found


def read_place(text: str, axes: Collection[str]) -> dict[str, float]:
    """Read axis positions as they are typed, ``X=0,Y=-225,B=30``, mm or degrees."""
    found = read_numbers(text, "axis=number", "X=0,Y=-225,B=30")
    for name, value in found.items():
        if name not in axes:
            raise ValueError(f"unknown axis {name}; expected one of {', '.join(axes)}")
        if abs(value) > MAX_LENGTH_MM:
            raise ValueError(f"{value:g}; expected at most ±{MAX_LENGTH_MM:g} mm or degrees")
    return found


def _place(text: str, scene: "Scene") -> tuple[tuple[str, float], ...]:
    return tuple(read_place(text, scene.machine.axes).items())


def read_keys(text: str, _scene: "Scene") -> tuple[str, ...]:
    """Read keys of error parameters with commas between, in any case; `ALL` for every one."""
    known = {ALL: ALL, **{key.lower(): key for key in PARAMETERS}}
    given = [part.strip() for part in text.split(",")]
    keys = tuple(known.get(part.lower(), part) for part in given if part)
    if not keys:
        raise ValueError("expected keys such as EA0Z,EC0Y")
    for key in keys:
        if key != ALL:
            parameter(key)
    return keys


def read_limits(text: str, _scene: "Scene") -> tuple[tuple[str, float], ...]:
    """Read numbers above 0 by parameter; one without a key is for all, with the key `ALL`."""
    found: dict[str, float] = {}
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
        found[name.strip().upper() if equals else ALL] = value
    return tuple(found.items())


def typed_word(text: str, _scene: "Scene") -> str:
    """Take a word as it is."""
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
"""A file that is read."""
Axis: TypeAlias = Annotated[str, Grammar("AXIS", _axis)]
"""Name of an axis; empty for a choice of its own."""
Vector: TypeAlias = Annotated[tuple[float, float, float] | None, Grammar("X,Y,Z", _vector)]
"""A point in mm."""
Files: TypeAlias = Annotated[tuple[str, ...], Grammar("FILE", typed_word, each=True, is_file=True)]
"""Files that are read: paths, or names of bundled ones."""
Place: TypeAlias = Annotated[tuple[tuple[str, float], ...], Grammar("X=..,Y=..", _place)]
"""Axis positions in mm and degrees."""
Keys: TypeAlias = Annotated[tuple[str, ...], Grammar("KEY,…|all", read_keys, many=True)]
"""Keys of error parameters."""
Limits: TypeAlias = Annotated[
    tuple[tuple[str, float], ...],
    Grammar("KEY=±VALUE|±VALUE", read_limits, many=True),
]
"""Half widths by parameter, µm or µrad."""


def place_words(place: Mapping[str, float]) -> str:
    """Spell axis positions."""
    return ", ".join(f"{name} {value:g}" for name, value in place.items())


def outside_travel(machine: "Machine", place: Mapping[str, float]) -> list[str]:
    """Say which positions lie outside the travel of their axes."""
    said: list[str] = []
    for name, value in place.items():
        axis = machine.axes[name]
        low, high = axis.travel
        if not low <= value <= high:
            unit = f" {axis.unit}" if axis.is_linear else axis.unit
            said.append(
                f"{name}={value:g} is outside the travel of {name}, {low:g} to {high:g}{unit};"
                " its errors are continued beyond it"
            )
    return said


def error_words(key: str) -> str:
    """Name an error beside its bar: in words, by its symbol and by its key."""
    row = parameter(key)
    return f"{row.name}  {row.symbol}  {row.key}"
