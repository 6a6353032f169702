"""The state as one tree of described values: what widgets, links, saved files and undo walk.

A leaf is named by its path, ``look.surface`` or ``errors.EA0Z``. `put` takes whatever a browser
sends for it; `spell` gives the text that is read back to the same value.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import Field, fields, is_dataclass, replace
from enum import StrEnum
from functools import lru_cache
from operator import attrgetter
from typing import Any, cast

from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import (
    Leaf,
    Unreadable,
    default_of,
    description,
    name_of,
    spell_numbers,
    words_of,
)
from warpspace.app.state.look import (
    linear_positions,
    linear_spans,
    parse_positions,
    slice_positions,
)
from warpspace.app.state.picked import Picked, read_trace, spell_trace
from warpspace.app.state.specification import read_costs, spell_costs
from warpspace.app.state.typed_numbers import read_typed, with_typed_point
from warpspace.machine.axes import parameter

LONGEST = 4000  # characters that are read
SHOWN = 40  # characters of a text that a note shows

# --- The leaves of a state ------------------------------------------------------------------------

DEPENDENCIES = {
    "amplitudes": ("scene.model",),
    "tolerances": ("tolerances", "origin.tolerances", "scene.model"),
}
"""What leaves of a field depend on, where they do not on what stands below."""
OTHERS_DEPEND_ON = (
    "scene.model",
    "scene.workspace",
    "scene.trace_points_mm",
    "look.quantity",
)
ALL_DEPEND_ON = tuple(dict.fromkeys((*sum(DEPENDENCIES.values(), ()), *OTHERS_DEPEND_ON)))
READ = {name: attrgetter(name) for name in ALL_DEPEND_ON}


class _Known:
    """A state as a key: equal as long as the parts that leaves depend on are the same objects."""

    def __init__(self, state: AppState, names: tuple[str, ...]) -> None:
        self.state = state
        self.parts = tuple([READ[name](state) for name in names])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and all(
            one is two or (isinstance(one, str) and one == two)
            for one, two in zip(self.parts, other.parts, strict=True)
        )

    def __hash__(self) -> int:
        return hash(tuple([part if isinstance(part, str) else id(part) for part in self.parts]))


def leaves(state: AppState) -> Mapping[str, Leaf]:
    """Give the leaves of a state by their paths; the same object until what they say changes."""
    return _leaves(_Known(state, ALL_DEPEND_ON))


@lru_cache(maxsize=32)
def _leaves(known: _Known) -> Mapping[str, Leaf]:
    found: dict[str, Leaf] = {}
    for entry in fields(AppState):
        names = DEPENDENCIES.get(entry.name, OTHERS_DEPEND_ON)
        found |= _group(_Known(known.state, names), entry.name)
    return found


@lru_cache(maxsize=512)
def _group(known: _Known, name: str) -> Mapping[str, Leaf]:
    entry = next(entry for entry in fields(AppState) if entry.name == name)
    found = _described(known.state, entry, "")
    if name == "picked":
        found = _picked_leaves(known.state)
    return {leaf.path: leaf for leaf in found}


def _described(state: AppState, entry: "Field[Any]", prefix: str) -> Iterator[Leaf]:
    words, start = description(entry), default_of(entry)
    path = prefix + (words.leaf.path if words and words.leaf.path else entry.name)
    if words is None or not words.leaf.kind:
        if is_dataclass(start) and not isinstance(start, type):
            for inner in fields(start):
                yield from _described(state, inner, f"{path}.")
    elif words.each is None:
        choices = words.leaf.choices if words.choices is None else words.choices(state)
        linked = words.leaf.linked.format(path=path)
        yield replace(words.leaf, path=path, choices=choices, linked=linked)
    else:
        for key, span in words.each(state).items():
            at = f"{path}.{key}"
            yield replace(
                words.leaf,
                path=at,
                label=words.one.format(name_of(key)),
                span=edits.half_width_span(state, key) if path == "tolerances" else span,
                unit=_unit(state, key),
                linked=words.leaf.linked.format(path=at, key=key),
            )


def _unit(state: AppState, key: str) -> str:
    axis = state.scene.machine.axes.get(key)
    return parameter(key).unit if axis is None else axis.unit


def _picked_leaves(state: AppState) -> Iterator[Leaf]:
    hint = "Positions of the axes, for instance X 275 Y -225 Z -480; empty for no point."
    yield Leaf("picked", "Point", "text", hint=hint)
    yield Leaf("picked.trace", "Trace of the point", "text", linked="why.trace")
    for axis, span in {**linear_spans(state.scene), **state.position_spans}.items():
        linked, unit = f"why.{axis}", _unit(state, axis)
        yield Leaf(
            f"picked.at.{axis}", f"{axis} of the point", "number", {}, span, unit, linked=linked
        )


# --- Values, and how they are spelt ---------------------------------------------------------------


def value(state: AppState, path: str) -> Any:
    """Give the value of a leaf; of an entry that was not set the one that counts in its place."""
    group, _, key = path.rpartition(".")
    if group == "look.slices_mm":
        return slice_positions(state.scene, state.look, state.machine)[key]
    if group == "machine.linear_mm":
        return linear_positions(state.scene, state.machine)[key]
    return stored(state, path)


def stored(state: AppState, path: str) -> Any:
    """Give what a state holds at a path; None for an entry that was not set."""
    group, _, key = path.rpartition(".")
    if group == "errors":
        return state.amplitudes.get(key)
    if group == "tolerances":
        return edits.half_width_of(state, key)
    if path == "picked.trace":
        picked = state.picked
        return None if picked is None or picked.point_mm is None else spell_trace(picked)
    found: Any = state
    for name in path.split("."):
        if isinstance(found, tuple):  # pairs
            return dict(cast("Any", found)).get(name, ())
        found = found.get(name) if isinstance(found, Mapping) else getattr(found, name, None)
    return found


def spell(state: AppState, path: str) -> str:
    """Spell the value of a leaf so that `put` reads it back."""
    return spell_value(leaves(state)[path], value(state, path))


def spell_value(leaf: Leaf, found: Any) -> str:
    """Spell a value; numbers to the last bit."""
    if isinstance(found, Picked):
        return " ".join(f"{axis} {at!r}" for axis, at in found.at.items())
    if found is None:
        return next(iter(leaf.choices), "")
    if isinstance(found, bool):
        return "1" if found else "0"
    if isinstance(found, frozenset):
        return ",".join(sorted(map(str, cast("frozenset[Any]", found))))
    if isinstance(found, tuple):
        return spell_numbers(cast("tuple[float, ...]", found))
    return repr(found) if isinstance(found, float) else str(found)


# --- What a browser sends -------------------------------------------------------------------------


def put(state: AppState, path: str, text: str) -> AppState:
    """Set a leaf to what somebody has typed, clicked or sent; notes say what was not taken."""
    leaf = leaves(state).get(path)
    if leaf is None:
        return _noted(state, f"{path[:SHOWN]!r}: nothing on this page goes by this name")
    try:
        state = set_leaf(state, leaf, text)
    except Unreadable as problem:
        said = f"{words_of(leaf)} = {text[:SHOWN]!r}; {problem}, it stays as it was"
        return _noted(state, said)
    after = AFTER.get(path) or AFTER.get(path.rpartition(".")[0])
    return state if after is None else after(state)


def toggled(state: AppState, path: str, word: str) -> AppState:
    """Put a word into the set that a leaf is, or take it out again."""
    return put(state, path, f"{'-' if word in value(state, path) else '+'}{word}")


AFTER: Mapping[str, Callable[[AppState], AppState]] = {
    "look.range_top": lambda s: replace(s, look=replace(s.look, range_mode="fixed")),
    "look.slices_mm": lambda s: replace(s, look=replace(s.look, follow=False)),
}
"""What follows where somebody sets a leaf; not where a link or a file does."""


def set_leaf(state: AppState, leaf: Leaf, text: str) -> AppState:
    """Set a leaf to what a text says and to nothing else; raises `Unreadable`."""
    text = text[:LONGEST].encode("utf-8", "replace").decode()
    group, _, key = leaf.path.rpartition(".")
    own = OWN.get(leaf.path) or OWN.get(group)
    if own is not None:
        return own(state, leaf, key, text)
    found, note = read_value(leaf, text, stored(state, leaf.path))
    state = _with(state, leaf.path.split("."), found)
    return _noted(state, note) if note else state


def _with(thing: Any, names: Sequence[str], found: Any) -> Any:
    name, *rest = names
    if isinstance(thing, Mapping):
        return {**thing, name: found}
    return replace(thing, **{name: _with(getattr(thing, name), rest, found) if rest else found})


# --- Leaves that are set in a way of their own ----------------------------------------------------


def _with_points_off(state: AppState, leaf: Leaf, _key: str, text: str) -> AppState:
    kept, note = read_keys(leaf, text, frozenset(map(str, state.rotary.off)))
    state = replace(state, rotary=replace(state.rotary, off=frozenset(map(int, kept))))
    return _noted(state, note) if note else state


def _with_held(state: AppState, leaf: Leaf, axis: str, text: str) -> AppState:
    found, note = parse_positions(text, state.position_spans[axis])
    state = replace(state, rotary=state.rotary.with_held(axis, found))
    return _noted(state, f"{leaf.label}: {note}") if note else state


def _with_costs(state: AppState, _leaf: Leaf, _key: str, text: str) -> AppState:
    costs = spell_costs(read_costs(text, state.amplitudes.keys()))
    return replace(state, specification=replace(state.specification, costs=costs))


def _with_asked(state: AppState, leaf: Leaf, axis: str, text: str) -> AppState:
    """Ask about a point, one axis position at a time, mm or degrees."""
    picked = state.picked or Picked({})
    if axis in state.positions and picked.point_mm is None:
        raise Unreadable("expected a point of a trace")
    at, note = clamped(leaf, number_of(leaf, text))
    state = replace(state, picked=replace(picked, at={**picked.at, axis: at}))
    return _noted(state, note) if note else state


OWN: Mapping[str, Callable[[AppState, Leaf, str, str], AppState]] = {
    "errors": lambda s, leaf, key, text: s.with_amplitude(key, number_of(leaf, text)),
    "positions": lambda s, leaf, key, text: s.with_position(key, number_of(leaf, text)),
    "tolerances": lambda s, leaf, key, text: edits.with_half_width(s, key, number_of(leaf, text)),
    "rotary.off": _with_points_off,
    "rotary.held": _with_held,
    "specification.costs": _with_costs,
    "picked": lambda s, _leaf, _key, text: with_typed_point(s, text),
    "picked.trace": lambda s, _leaf, _key, text: replace(s, picked=read_trace(text)),
    "picked.at": _with_asked,
}


def _noted(state: AppState, note: str) -> AppState:
    return replace(state, notes=(*state.notes, note))


# --- One text that somebody typed or sent into the value of a leaf --------------------------------

MOST_NAMES = 100
LONGEST_NAME = 80
LONGEST_NOTE = 200
SWITCHES = {"0": False, "1": True}


def read_value(leaf: Leaf, text: str, old: Any) -> tuple[Any, str]:
    """Read a value, and what had to be said about it; raises `Unreadable`."""
    if leaf.kind == "number":
        if text.strip() in leaf.choices:
            return None, ""
        given = number_of(leaf, text)
        kept, note = clamped(leaf, given)
        if isinstance(old, int) and leaf.span is not None:
            low, step = leaf.span.low, leaf.span.step
            return int(low + step * math.floor((kept - low) / step + 0.5)), note
        return kept, note
    if leaf.kind == "point":
        return _read_point(leaf, text)
    if leaf.kind == "switch":
        if text.strip() not in SWITCHES:
            raise Unreadable("expected 0 or 1")
        return SWITCHES[text.strip()], ""
    if leaf.kind == "choice":
        check_choice(leaf, text)
        return (type(old)(text) if isinstance(old, StrEnum) else text), ""
    if leaf.kind in {"keys", "names"}:
        return read_keys(leaf, text, old)
    return text[: leaf.longest], ""


def number_of(leaf: Leaf, text: str) -> float:
    """Read a number, with or without its unit."""
    found = read_typed(text.strip().removeprefix("×"), leaf.unit)
    if found is None:
        raise Unreadable("expected a number")
    return found


def clamped(leaf: Leaf, given: float) -> tuple[float, str]:
    """Bring a number into the range of its leaf, and say so."""
    if leaf.span is None:
        return given, ""
    kept = leaf.span.clamp(given, given)
    note = "" if kept == given else leaf.span.clamped_words(given, kept, words_of(leaf), leaf.unit)
    return kept, note


def _read_point(leaf: Leaf, text: str) -> tuple[Any, str]:
    if not text.strip():
        return None, ""
    parts = text.replace(";", " ").split()
    parts = parts if len(parts) == 3 else text.split(",")
    if len(parts) != 3:
        raise Unreadable("expected three numbers")
    found = [clamped(leaf, number_of(leaf, part.strip().rstrip(","))) for part in parts]
    return tuple(kept for kept, _ in found), "; ".join(filter(None, (note for _, note in found)))


def check_choice(leaf: Leaf, text: str) -> None:
    """Refuse what is none of the choices."""
    if text not in leaf.choices:
        raise Unreadable(f"expected one of {', '.join(filter(None, leaf.choices))}"[:LONGEST_NOTE])


def read_keys(leaf: Leaf, text: str, old: frozenset[str]) -> tuple[frozenset[str], str]:
    """Read a list of words in place of a set, or words with + or - that come to it or leave it."""
    words = [word.strip()[:LONGEST_NAME] for word in text.split(",") if word.strip()]
    unknown: list[str] = []
    changes = bool(words) and all(word[0] in "+-" for word in words)
    found = set(old) if changes else set[str]()
    for word in words:
        name = word[1:] if changes else word
        if leaf.kind == "keys" and name not in leaf.choices:
            unknown.append(name)
        elif changes and word[0] == "-":
            found.discard(name)
        else:
            found.add(name)
    kept = frozenset(sorted(found)[:MOST_NAMES] if leaf.kind == "names" else found)
    note = f"{words_of(leaf)}: {', '.join(unknown[:4])} left out, which mean nothing here"
    return kept, note if unknown else ""
