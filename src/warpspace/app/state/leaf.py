"""What a field of the state says of itself where it stands: words, kind, choices, range, link name.

`warpspace.app.state.tree` makes leaves of it: for widgets, links, saved files and undo alike.
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


class Unreadable(ValueError):  # noqa: N818 - it is handled where text is read
    """A text that means nothing; it says what was expected."""


class Identity:
    """An object as part of a key, compared by identity (and held, so that its id stays its own)."""

    def __init__(self, target: Any) -> None:
        self.target = target

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
        """Bring a number that may be anything into the range; what is no number falls back."""
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
    """One value of a state that somebody may set, or one entry of a mapping of them."""

    path: str  # "look.surface", "amplitudes.EA0Z"; of a field that describes itself empty
    label: str  # what a user reads, also beside a step that is undone
    # "switch", "choice", "number", "text", "keys" (some of its choices), "names" (a set of any
    # words), "point" (three numbers or none), "numbers", "lines" (of text); empty where only
    # changes have a name
    kind: str = ""
    # values with their words; of a number the one that stands in place of it, "auto"
    choices: Choices = field(default_factory=dict[str, str])
    span: Span | None = None
    unit: str = ""
    hint: str = ""
    linked: str = ""  # name in links and files; empty where it stands in none
    entry_label: str = "{}"  # label of one entry or member; ``{}`` is its name
    # of a field whose choices, or whose entries with their ranges, depend on the state
    choose: Callable[[Any], Choices] | None = None
    each: Callable[[Any], Mapping[str, Span | None]] | None = None


def leaf_metadata(
    label: str, *, choices: Choices | Callable[[Any], Choices] | None = None, **attributes: Any
) -> dict[str, Leaf]:
    """Give the metadata of a field; in `linked`, ``{path}`` and ``{key}`` (of an entry) are put."""
    attributes = {"linked": "{path}", **attributes}
    if choices is not None:
        attributes["choose" if callable(choices) else "choices"] = choices
    return {DESCRIBED: Leaf("", label, **attributes)}


def described(default: T, label: str, **attributes: Any) -> T:
    """Give a field with a default; its kind follows from that where none is said."""
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
    return field(default_factory=lambda: default, metadata=leaf_metadata(label, **attributes))


def description(entry: "Field[Any]") -> Leaf | None:
    return entry.metadata.get(DESCRIBED)


def default_of(entry: "Field[Any]") -> Any:
    if entry.default_factory is not MISSING:
        return entry.default_factory()
    return None if entry.default is MISSING else entry.default


def error_names(state: Any) -> dict[str, str]:
    return {key: parameter(key).name for key in state.amplitudes}


def name_of(key: str) -> str:
    """Give the plain name of an error; anything else as it is."""
    row = PARAMETERS.get(key)
    return key if row is None else row.name


def lowered(label: str) -> str:
    return label[0].lower() + label[1:] if label[1:2].islower() else label
