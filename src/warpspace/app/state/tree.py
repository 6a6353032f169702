"""The state as a tree of described values, for widgets, links, files and undo.

A leaf is identified by its path, ``look.surface`` or ``amplitudes.EA0Z``. `put` sets it from any
text of a browser; `spell` returns the text that is read back to the same value.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import Field, fields, is_dataclass, replace
from enum import StrEnum
from functools import lru_cache
from typing import Any, cast

from warpspace.analysis.options import read_numbers
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, Picked, start_state
from warpspace.app.state.leaf import (
    MOST_TYPED,
    Identity,
    Leaf,
    Span,
    Unreadable,
    default_of,
    description,
    lowered,
    name_of,
)
from warpspace.app.state.look import linear_positions, linear_spans, slice_positions
from warpspace.app.state.typed_numbers import read_list, read_positions, read_typed
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import axis_order, parameter
from warpspace.machine.limits import COST, MAX_HALF_WIDTH, MIN_HALF_WIDTH

LONGEST = 4000  # characters of a text; others are ignored
MAX_QUOTED = 40  # characters of a text in a note

# --- The leaves of a state ------------------------------------------------------------------------


def leaves(state: AppState) -> Mapping[str, Leaf]:
    """Return the leaves of a state by path; the same object until they change."""
    return _leaves(Identity(state.scene), state.look.quantity)


@lru_cache(maxsize=32)
def _leaves(scene: Identity, quantity: str) -> Mapping[str, Leaf]:
    state = start_state(scene.target)
    state = replace(state, look=replace(state.look, quantity=quantity))
    described = [leaf for entry in fields(AppState) for leaf in _described(state, entry)]
    return {leaf.path: leaf for leaf in (*described, *_picked_leaves(state))}


def _described(state: AppState, entry: "Field[Any]", prefix: str = "") -> Iterator[Leaf]:
    leaf, start, path = description(entry), default_of(entry), prefix + entry.name
    if leaf is None or not leaf.kind:
        if is_dataclass(start) and not isinstance(start, type):
            for inner in fields(start):
                yield from _described(state, inner, f"{path}.")
    elif leaf.each is None:
        choices = leaf.choices if leaf.choose is None else leaf.choose(state)
        yield replace(leaf, path=path, choices=choices, linked=leaf.linked.format(path=path))
    else:
        for key, span in leaf.each(state).items():
            at = f"{path}.{key}"
            label, unit = leaf.item_label.format(name_of(key)), _unit(state, key)
            linked = leaf.linked.format(path=at, key=key)
            yield replace(leaf, path=at, label=label, span=span, unit=unit, linked=linked)


def _unit(state: AppState, key: str) -> str:
    axis = state.scene.machine.axes.get(key)
    return parameter(key).unit if axis is None else axis.unit


def _picked_leaves(state: AppState) -> Iterator[Leaf]:
    yield Leaf("picked", "Point", "text")
    yield Leaf("picked.trace", "Trace of the point", "text", linked="why.trace")
    for axis, span in {**linear_spans(state.scene), **state.position_spans}.items():
        path, label, unit = f"picked.at.{axis}", f"{axis} of the point", _unit(state, axis)
        yield Leaf(path, label, "number", span=span, unit=unit, linked=f"why.{axis}")


# --- Values and their texts -----------------------------------------------------------------------


def value(state: AppState, path: str) -> Any:
    """Return the value of a leaf; of an entry that is not set its effective value."""
    group, _, key = path.rpartition(".")
    if group == "look.slices_mm":
        return slice_positions(state.scene, state.look, state.machine)[key]
    if group == "machine.linear_mm":
        return linear_positions(state.scene, state.machine)[key]
    return stored(state, path)


def stored(state: AppState, path: str) -> Any:
    """Return the stored value at a path; None for an entry that is not set."""
    group, _, key = path.rpartition(".")
    if group == "tolerances":
        return edits.half_width_of(state, key)
    if path == "picked.trace":
        picked = state.picked
        if picked is None or picked.point_mm is None:
            return None
        return f"{picked.loop},{_spell_numbers(picked.point_mm)}"
    branch: Any = state
    for name in path.split("."):
        branch = branch.get(name) if isinstance(branch, Mapping) else getattr(branch, name, None)
    return branch


def spell(state: AppState, path: str) -> str:
    return spell_value(leaves(state)[path], value(state, path))


def spell_value(leaf: Leaf, setting: Any) -> str:
    """Format a value; numbers to the last bit."""
    if isinstance(setting, Picked):
        return " ".join(f"{axis} {at!r}" for axis, at in setting.at.items())
    if setting is None:
        return next(iter(leaf.choices), "")
    if isinstance(setting, bool):
        return "1" if setting else "0"
    if isinstance(setting, frozenset):
        return ",".join(sorted(cast("frozenset[str]", setting)))
    if isinstance(setting, tuple):
        return _spell_numbers(cast("tuple[float, ...]", setting))
    return repr(setting) if isinstance(setting, float) else str(setting)


def _spell_numbers(numbers: Sequence[float]) -> str:
    return ",".join(repr(float(number)) for number in numbers)


def words_of(leaf: Leaf) -> str:
    group, _, key = leaf.path.rpartition(".")
    return key if group == "amplitudes" else lowered(leaf.label)


# --- Settings from a browser ----------------------------------------------------------------------


def put(state: AppState, path: str, text: str) -> AppState:
    """Set a leaf from a text of the page; notes report rejected and clamped values."""
    leaf = leaves(state).get(path)
    if leaf is None:
        return state.noted(f"{path[:MAX_QUOTED]!r}: unknown setting")
    try:
        state = set_leaf(state, leaf, text)
    except Unreadable as problem:
        return state.noted(f"{words_of(leaf)} = {text[:MAX_QUOTED]!r}; {problem}; unchanged")
    after = AFTER.get(path) or AFTER.get(path.rpartition(".")[0])
    return state if after is None else after(state)


def toggled(state: AppState, path: str, word: str) -> AppState:
    return put(state, path, f"{'-' if word in value(state, path) else '+'}{word}")


AFTER: Mapping[str, Callable[[AppState], AppState]] = {
    "look.range_top": lambda s: replace(s, look=replace(s.look, range_mode="fixed")),
    "look.slices_mm": lambda s: replace(s, look=replace(s.look, follow=False)),
}
"""Consequences of setting a leaf on the page; not from a link or a file."""


def set_leaf(state: AppState, leaf: Leaf, text: str) -> AppState:
    """Set one leaf from a text; raises `Unreadable`."""
    text = text[:LONGEST].encode("utf-8", "replace").decode()
    setter = SETTERS.get(leaf.path) or SETTERS.get(leaf.path.rpartition(".")[0])
    if setter is not None:
        return setter(state, leaf, text)
    setting, note = read_value(leaf, text, stored(state, leaf.path))
    return _with(state, leaf.path.split("."), setting).noted(note)


def _with(branch: Any, names: Sequence[str], setting: Any) -> Any:
    name, *path = names
    if isinstance(branch, Mapping):
        entries = {**cast("Mapping[str, Any]", branch), name: setting}
        return {key: entry for key, entry in entries.items() if entry != ()}
    if path:
        setting = _with(getattr(branch, name), path, setting)
    return replace(branch, **{name: setting})


# --- Leaves with their own setters ----------------------------------------------------------------


def _with_half_width(state: AppState, leaf: Leaf, text: str) -> AppState:
    key = leaf.path.rpartition(".")[2]
    widest = max(MAX_HALF_WIDTH, edits.half_width_span(state, key).high)
    half_width, note = _number(replace(leaf, span=Span(0.0, widest, 0.1)), text)
    half_width = 0.0 if half_width < MIN_HALF_WIDTH else half_width
    return edits.with_half_widths(state, {key: half_width}).noted(note)


def _with_costs(state: AppState, _leaf: Leaf, text: str) -> AppState:
    try:
        costs = read_numbers(text, "error=cost", "EA0Z=4,EXX=0.5") if text.strip() else {}
    except ValueError as problem:
        raise Unreadable(str(problem)) from None
    for key, cost in costs.items():
        if key not in state.amplitudes:
            raise Unreadable(f"{key} is not a parameter of this machine")
        if not COST[0] <= cost <= COST[1]:
            raise Unreadable(f"{key}={cost:g}: expected {COST[0]:g} to {COST[1]:g}")
    normalised = ",".join(f"{key}={cost:g}" for key, cost in costs.items() if cost != 1.0)
    return replace(state, specification=replace(state.specification, costs=normalised))


FARTHEST_MM = 1e5  # of a traced point in a link
EXAMPLE = "X 275 Y -225 Z -480"


def _with_point(state: AppState, _leaf: Leaf, text: str) -> AppState:
    if not text.strip():
        return replace(state, picked=None, lever="")
    typed, spans = read_positions(text), linear_spans(state.scene)
    axes = {*spans, *state.positions}
    if typed is None or not typed.keys() <= axes:
        expected = f"expected positions of the axes {', '.join(sorted(axes, key=axis_order))}"
        raise Unreadable(f"{expected}, for instance {EXAMPLE}")
    before = {} if state.picked is None else state.picked.at
    stands = {**state.scene.workspace.positions, **before}
    state = replace(state, picked=Picked({axis: stands.get(axis, 0.0) for axis in spans}))
    for axis, position in typed.items():
        group = "picked.at" if axis in spans else "positions"
        state = set_leaf(state, leaves(state)[f"{group}.{axis}"], repr(position))
    return state


def _with_trace(state: AppState, _leaf: Leaf, text: str) -> AppState:
    loop, _, point_text = text.partition(",")
    point = [read_typed(word) for word in point_text.split(",")]
    near = [at for at in point if at is not None and abs(at) <= FARTHEST_MM]
    if loop not in [*Loop] or len(point) != 3 or len(near) != 3:
        raise Unreadable("expected a loop and a traced point")
    x, y, z = near
    return replace(state, picked=Picked({}, Loop(loop), (x, y, z)))


def _with_asked(state: AppState, leaf: Leaf, text: str) -> AppState:
    picked, axis = state.picked or Picked({}), leaf.path.rpartition(".")[2]
    if axis in state.positions and picked.point_mm is None:
        raise Unreadable("expected a point of a trace")
    at, note = _number(leaf, text)
    return replace(state, picked=replace(picked, at={**picked.at, axis: at})).noted(note)


SETTERS: Mapping[str, Callable[[AppState, Leaf, str], AppState]] = {
    "tolerances": _with_half_width,
    "specification.costs": _with_costs,
    "picked": _with_point,
    "picked.trace": _with_trace,
    "picked.at": _with_asked,
}


# --- Parsing of texts -----------------------------------------------------------------------------

MOST_NAMES = 100
LONGEST_NAME = 80
LONGEST_NOTE = 200
SWITCHES = {"0": False, "1": True}


def read_value(leaf: Leaf, text: str, old: Any) -> tuple[Any, str]:
    """Parse a value; return it with a note; raises `Unreadable`."""
    plain = text.strip()
    match leaf.kind:
        case "number" if plain in leaf.choices:
            return None, ""
        case "number":
            number, note = _number(leaf, text)
            if isinstance(old, int) and leaf.span is not None:
                low, step = leaf.span.low, leaf.span.step
                return int(low + step * math.floor((number - low) / step + 0.5)), note
            return number, note
        case "numbers" if leaf.span is not None:
            numbers, note = read_list(text, leaf.span)
            return numbers, f"{leaf.label}: {note}" if note else ""
        case "point":
            return _read_point(leaf, text) if plain else (None, "")
        case "switch":
            if plain not in SWITCHES:
                raise Unreadable("expected 0 or 1")
            return SWITCHES[plain], ""
        case "choice":
            if text not in leaf.choices:
                allowed = ", ".join(filter(None, leaf.choices))
                raise Unreadable(f"expected one of {allowed}"[:LONGEST_NOTE])
            return (type(old)(text) if isinstance(old, StrEnum) else text), ""
        case "keys" | "names":
            return _read_keys(leaf, text, old)
        case "lines":
            return text, ""
        case _:
            return text[:MOST_TYPED], ""


def _number(leaf: Leaf, text: str) -> tuple[float, str]:
    """Parse a number, with or without its unit, and clamp it to the range of its leaf."""
    typed = read_typed(text.strip().removeprefix("×"), leaf.unit)
    if typed is None:
        raise Unreadable("expected a number")
    clamped = typed if leaf.span is None else leaf.span.clamp(typed, typed)
    if leaf.span is None or clamped == typed:
        return clamped, ""
    return clamped, leaf.span.clamped_words(typed, clamped, words_of(leaf), leaf.unit)


def _read_point(leaf: Leaf, text: str) -> tuple[Any, str]:
    counts = (3, 6) if leaf.path == "part.place" else (3,)
    parts = text.replace(";", " ").split()
    parts = parts if len(parts) in counts else text.split(",")
    if len(parts) not in counts:
        raise Unreadable(f"expected three numbers{', or six with rotations' * (len(counts) > 1)}")
    numbers = [_number(leaf, part.strip().rstrip(",")) for part in parts]
    notes = filter(None, (note for _, note in numbers))
    return tuple(number for number, _ in numbers), "; ".join(notes)


def _read_keys(leaf: Leaf, text: str, old: frozenset[str]) -> tuple[frozenset[str], str]:
    """Parse a list of names that replaces a set, or names with + or - that change it."""
    entries = [word.strip()[:LONGEST_NAME] for word in text.split(",") if word.strip()]
    unknown: list[str] = []
    changes = bool(entries) and all(word[0] in "+-" for word in entries)
    names = set(old) if changes else set[str]()
    for word in entries:
        name = word[1:] if changes else word
        if leaf.kind == "keys" and name not in leaf.choices:
            unknown.append(name)
        elif changes and word[0] == "-":
            names.discard(name)
        else:
            names.add(name)
    keys = frozenset(sorted(names)[:MOST_NAMES] if leaf.kind == "names" else names)
    note = f"{words_of(leaf)}: {', '.join(unknown[:4])} ignored (unknown)"
    return keys, note if unknown else ""
