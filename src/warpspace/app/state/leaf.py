"""Descriptions of state fields: label, kind, choices, range, name in links.

`warpspace.app.state.tree` turns them into leaves for widgets, links, files and undo.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field
from typing import Any, TypeAlias, TypeVar

from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.machine.limits import MIN_NUMBER

T = TypeVar("T")
MOST_TYPED = 200  # characters of a text
Choices: TypeAlias = Mapping[str, str]
DESCRIBED = "described"


class Unreadable(ValueError):  # noqa: N818 - handled where texts are parsed
    """An invalid text; the message states what was expected."""


@dataclass(frozen=True, eq=False)
class Identity:
    """An object as part of a key, compared by identity; referenced, so that its id stays unique."""

    target: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identity) and other.target is self.target

    def __hash__(self) -> int:
        return id(self.target)


@dataclass(frozen=True, slots=True)
class Span:
    low: float  # ends, in the unit of the control
    high: float
    step: float  # distance between two positions of a slider

    def clamp(self, value: float, fallback: float) -> float:
        """Clamp any number to the range; NaN gives the fallback."""
        if math.isnan(value):
            return fallback
        clamped = min(max(value, self.low), self.high)
        return 0.0 if 0.0 < abs(clamped) < MIN_NUMBER else clamped

    def clamped_words(self, value: float, clamped: float, name: str, unit: str) -> str:
        allowed = f"{self.low:g} to {self.high:g} {unit}".rstrip()
        text = f"{clamped:g} {unit}".rstrip()
        return f"{name} = {value:g} is outside {allowed}; clamped to {text}"


@dataclass(frozen=True, slots=True)
class Leaf:
    """A value of the state that users may set, or an entry of a mapping of such values."""

    path: str  # "look.surface", "amplitudes.EA0Z"; empty in the metadata of a field
    label: str  # on the page, also of undo steps
    # "switch", "choice", "number", "text", "keys" (some of its choices), "names" (a set of any
    # names), "point" (three numbers or none), "numbers", "lines" (of text); empty for fields that
    # have a label only
    kind: str = ""
    # labels by value; of a number its alternative, "auto"
    choices: Choices = field(default_factory=dict[str, str])
    span: Span | None = None
    unit: str = ""
    hint: str = ""
    linked: str = ""  # name in links and files; empty where it is not stored
    item_label: str = "{}"  # of an entry or a member; ``{}`` is its name
    # for choices, or entries with ranges, that depend on the state
    choose: Callable[[Any], Choices] | None = None
    each: Callable[[Any], Mapping[str, Span | None]] | None = None


def describe(
    label: str, *, choices: Choices | Callable[[Any], Choices] | None = None, **attributes: Any
) -> dict[str, Leaf]:
    """Build the metadata of a field; `linked` may contain ``{path}`` and ``{key}``."""
    attributes = {"linked": "{path}", **attributes}
    if choices is not None:
        attributes["choose" if callable(choices) else "choices"] = choices
    return {DESCRIBED: Leaf("", label, **attributes)}


def described(default: T, label: str, **attributes: Any) -> T:
    """Build a field with a default, which determines the kind unless given."""
    has_choices = bool(attributes.get("choices"))
    if isinstance(default, bool):
        kind = "switch"
    elif isinstance(default, frozenset):
        kind = "keys" if has_choices else "names"
    elif has_choices:
        kind = "choice"
    else:
        kind = "text" if isinstance(default, str) else "number"
    attributes = {"kind": kind, **attributes}
    return field(default_factory=lambda: default, metadata=describe(label, **attributes))


def description(entry: "Field[Any]") -> Leaf | None:
    return entry.metadata.get(DESCRIBED)


def default_of(entry: "Field[Any]") -> Any:
    if entry.default_factory is not MISSING:
        return entry.default_factory()
    return None if entry.default is MISSING else entry.default


def error_names(state: Any) -> dict[str, str]:
    return {key: parameter(key).name for key in state.amplitudes}


def name_of(key: str) -> str:
    """Return the descriptive name of an error; other names unchanged."""
    row = PARAMETERS.get(key)
    return key if row is None else row.name


def lowered(label: str) -> str:
    return label[0].lower() + label[1:] if label[1:2].islower() else label
