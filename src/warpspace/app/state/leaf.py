"""What a field of the state says of itself where it stands: words, kind, choices, range, link name.

`warpspace.app.state.tree` makes leaves of it: for widgets, links, saved files and undo alike.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from warpspace.exceptions import UnknownNameError
from warpspace.machine.axes import parameter

if TYPE_CHECKING:
    from warpspace.app.state.ranges import Span

T = TypeVar("T")
MOST_TYPED = 200  # characters of a text
Choices: TypeAlias = Mapping[str, str]
DESCRIBED = "described"


class Unreadable(ValueError):  # noqa: N818 - it is handled where text is read
    """A text that means nothing; it says what was expected."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """One value of a state that somebody may set, or one entry of a mapping of them."""

    path: str  # "look.surface", "errors.EA0Z"
    label: str  # what a user reads, also beside a step that is undone
    # "switch", "choice", "number", "text", "keys" (some of its choices), "names" (a set of any
    # words), "point" (three numbers or none), "numbers"
    kind: str
    # values with their words; of a number the one that stands in place of it, "auto"
    choices: Choices = field(default_factory=dict[str, str])
    span: "Span | None" = None
    unit: str = ""
    hint: str = ""
    linked: str = ""  # name in links and files; empty where it stands in none
    longest: int = MOST_TYPED  # characters of a text


@dataclass(frozen=True, slots=True)
class Description:
    """What a field says; what depends on a state is a function of it."""

    # with the path where that is not the name of the field; kind is empty where only changes of the
    # field have a name
    leaf: Leaf
    one: str  # label of one entry or member; ``{}`` is its name
    choices: Callable[[Any], Choices] | None
    each: Callable[[Any], Mapping[str, "Span | None"]] | None  # entries of a mapping


def said(
    label: str,
    *,
    kind: str = "",
    one: str = "{}",
    choices: Choices | Callable[[Any], Choices] | None = None,
    each: Callable[[Any], Mapping[str, "Span | None"]] | None = None,
    linked: str = "{path}",
    path: str = "",
    **words: Any,
) -> dict[str, Description]:
    """Give the metadata of a field; in `linked`, ``{key}`` is the key of an entry. See `Leaf`."""
    plain = {} if choices is None or callable(choices) else choices
    leaf = Leaf(path, label, kind, plain, linked=linked, **words)
    return {DESCRIBED: Description(leaf, one, choices if callable(choices) else None, each)}


def described(default: T, label: str, **words: Any) -> T:
    """Give a field with a default; its kind follows from that where none is said."""
    kind = words.pop("kind", None) or _kind(default, bool(words.get("choices")))
    return field(default_factory=lambda: default, metadata=said(label, kind=kind, **words))


def spell_numbers(numbers: Iterable[float]) -> str:
    """Spell numbers with commas between, to the last bit."""
    return ",".join(repr(float(number)) for number in numbers)


def error_names(state: Any) -> dict[str, str]:
    """Give the plain names of the errors of a state, by key."""
    return {key: parameter(key).name for key in state.amplitudes}


@lru_cache(maxsize=512)
def name_of(key: str) -> str:
    """Give the plain name of an error; anything else as it is."""
    try:
        return parameter(key).name
    except UnknownNameError:
        return key


def _kind(default: object, has_choices: bool) -> str:
    if isinstance(default, bool):
        return "switch"
    if isinstance(default, frozenset):
        return "keys" if has_choices else "names"
    if has_choices:
        return "choice"
    return "text" if isinstance(default, str) else "number"


def description(entry: "Field[Any]") -> Description | None:
    """Give what a field says of itself."""
    return entry.metadata.get(DESCRIBED)


def default_of(entry: "Field[Any]") -> Any:
    """Give the default of a field; None where it has none."""
    if entry.default_factory is not MISSING:
        return entry.default_factory()
    return None if entry.default is MISSING else entry.default


def words_of(leaf: Leaf) -> str:
    """Name a leaf within a sentence: an error by its key."""
    group, _, key = leaf.path.rpartition(".")
    return key if group in {"errors", "tolerances"} else lowered(leaf.label)


def lowered(label: str) -> str:
    """Spell a label within a sentence."""
    return label[0].lower() + label[1:] if label[1:2].islower() else label
