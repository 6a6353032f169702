"""The state of one tab, or of all tabs of a shared review, and the history of each tab.

Updates are applied to the present state under a lock, so that no tab overwrites a change of another
one with an older state.
"""

import gc
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from warpspace.app.state.app_state import KEPT_FIELDS, AppState, Comparison
from warpspace.app.state.leaf import default_of, description, lowered, name_of
from warpspace.app.state.look import PageLook
from warpspace.app.state.tree import leaves, stored
from warpspace.exceptions import OptionError

# --- Differences of two states --------------------------------------------------------------------

_COMPARED = [entry for entry in fields(AppState) if entry.compare]
VIEW = ("exaggeration", "component", "nodes", "shown", "look", "machine", "rotary", "picked",
        "lever")  # fmt: skip
"""How the machine is looked at: a change of these alone is no step of the history."""


def changes(old: AppState, new: AppState) -> dict[str, str]:
    """List the differences of two states, labels by path; page and forms are not compared."""
    labels: dict[str, str] = {}
    for entry in _COMPARED:
        if _equal(getattr(old, entry.name), getattr(new, entry.name)):
            continue
        leaf = description(entry)
        # differences within a scene, for instance, have no labels of their own
        inner = {} if leaf and not leaf.kind else dict(_leaf_changes(old, new, entry.name))
        labels |= inner or {entry.name: lowered(leaf.label) if leaf else entry.name}
    before, after = old.scene, new.scene
    if before.name == after.name and not (
        _equal(before.machine, after.machine) and _equal(before.workspace, after.workspace)
    ):
        return {"scene": "machine"}
    # a table ends the comparison
    return {"controller": labels["controller"]} if "controller" in labels else labels


def _leaf_changes(old: AppState, new: AppState, group: str) -> Iterator[tuple[str, str]]:
    was, now, described = getattr(old, group), getattr(new, group), leaves(new)
    if isinstance(now, Mapping):  # most of many entries are unchanged
        keys = [key for key, value in now.items() if was.get(key) is not value]
        paths = [f"{group}.{key}" for key in (*keys, *(was.keys() - now.keys()))]
    else:
        paths = [path for path in described if path.partition(".")[0] == group]
    for path in paths:
        leaf = described.get(path)
        if leaf is None:
            continue
        before, after = stored(old, path), stored(new, path)
        if isinstance(before, frozenset) and isinstance(after, frozenset):
            for name in sorted(before ^ after):
                sign = "+" if name in after else "-"
                yield f"{path}.{sign}{name}", lowered(leaf.item_label.format(name_of(name)))
        elif not _equal(before, after):
            yield path, lowered(leaf.label)


def _equal(old: object, new: object) -> bool:
    if isinstance(old, Comparison) and isinstance(new, Comparison):
        old, new = old.sides, new.sides
    try:
        return old is new or bool(old == new)
    except ValueError:  # arrays
        return False


# --- Merging a change into another state ----------------------------------------------------------

_MERGED = tuple(type(start) for start in map(default_of, _COMPARED) if is_dataclass(start))
"""Merged field by field; all other objects, such as a scene, and a comparison as a whole."""
_MISSING = object()


def merged(old: AppState, new: AppState, present: AppState) -> AppState:
    """Apply the change from an old state to a new one to the present state; its page stays.

    Of the view, what has been changed since stays, unless the machine is another one. Raises
    `OptionError` where another tab has changed the same value.
    """
    if present is old:
        return replace(new, page=old.page, forms=old.forms)
    states, values = (old, new, present), dict[str, Any]()
    is_same_machine = all(
        _equal(getattr(old.scene, name), getattr(new.scene, name))
        for name in ("machine", "workspace")
    )
    for name in [entry.name for entry in _COMPARED if entry.name != "review"]:
        is_view, sides = name in VIEW, [getattr(state, name) for state in states]
        if is_view and not is_same_machine and name not in KEPT_FIELDS:
            values[name] = sides[1]
            continue
        try:
            values[name] = _merge(*sides)
        except OptionError:
            if not is_view:
                raise
    notes = _merge(*({note.id: note for note in state.review} for state in states))
    return replace(present, **values, review=tuple(notes.values()))


def _merge(old: Any, new: Any, present: Any) -> Any:
    if _equal(old, new) or _equal(new, present):
        return present
    if _equal(old, present):
        return new
    kinds = {type(old), type(new), type(present)}
    if kinds == {frozenset}:
        return (present - (old - new)) | (new - old)
    if all(issubclass(kind, Mapping) for kind in kinds):
        # amplitudes stay in the order of the present machine
        keys = {**present, **new} if old.keys() == new.keys() else {**new, **present}
        entries = {
            key: _merge(*(side.get(key, _MISSING) for side in (old, new, present))) for key in keys
        }
        return {key: entry for key, entry in entries.items() if entry is not _MISSING}
    if len(kinds) > 1 or not isinstance(old, _MERGED) or isinstance(old, Comparison):
        raise OptionError("somebody else has changed it since; it is left unchanged")
    names = [entry.name for entry in fields(old)]
    values = {
        name: _merge(*(getattr(side, name) for side in (old, new, present))) for name in names
    }
    return replace(present, **values)


# --- Undo and redo --------------------------------------------------------------------------------
# The changes of a slider drag form one step. The steps of a tab are limited in number and in the
# memory that only they hold.

STEPS = 100  # steps that can be undone
STEPS_BYTES = 128 * 2**20  # held by the steps of a tab; the latest step stays
SAME_STEP_S = 0.8  # longest time between two changes of one step
_LARGE = ("scene", "loaded", "part", "comparison", "controller")
_COMMON = (type, ModuleType, FunctionType)


def _sizes(state: AppState) -> dict[int, int]:
    """Return the sizes of all objects that a state refers to, by their ids."""
    sizes, waiting = dict[int, int](), list[object]([state])
    while waiting:
        latest = waiting.pop()
        if id(latest) not in sizes and not isinstance(latest, _COMMON):
            is_array = isinstance(latest, np.ndarray)
            sizes[id(latest)] = latest.nbytes if is_array else sys.getsizeof(latest)
            waiting += gc.get_referents(latest)
    return sizes


def _size_bytes(before: AppState, after: AppState) -> int:
    """Return the memory that only one of two states holds; of both the larger number."""
    if all(getattr(before, name) is getattr(after, name) for name in _LARGE):
        return 0
    old, new = _sizes(before), _sizes(after)
    return max(sum(a[key] for key in a.keys() - b.keys()) for a, b in ((old, new), (new, old)))


@dataclass(frozen=True, slots=True)
class UndoStep:
    before: AppState
    after: AppState
    changed: Mapping[str, str]
    size_bytes: int

    @property
    def label(self) -> str:
        labels = list(dict.fromkeys(self.changed.values()))
        if "scene" in self.changed:  # its curves change with an error
            errors = {text for path, text in self.changed.items() if path.startswith("amplitudes.")}
            labels = list(errors) if len(errors) == 1 else [self.changed["scene"]]
        return labels[0] if len(labels) == 1 else f"{labels[0]} and {len(labels) - 1} more"


Update: TypeAlias = Callable[[AppState], AppState]
Listener: TypeAlias = Callable[[], None]


@dataclass(slots=True)
class _Document:
    """The state, as all tabs of a shared review share it."""

    state: AppState  # shown, or about to be
    listeners: set[Listener] = field(default_factory=set[Listener])
    is_edited: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)


class Checkpoint(NamedTuple):
    """A state with history and page of a tab, which `StateStore.restore` goes back to."""

    state: AppState
    past: tuple[UndoStep, ...]
    future: tuple[UndoStep, ...]
    page: PageLook


class StateStore:
    """A state with the history of one tab; tabs of a shared review share the state."""

    def __init__(self, state: AppState, document: _Document | None = None) -> None:
        self._document = document or _Document(state)
        self.past: list[UndoStep] = []  # latest last
        self.future: list[UndoStep] = []
        self._changed_at = float("-inf")

    @property
    def state(self) -> AppState:
        return self._document.state

    @property
    def is_edited(self) -> bool:
        return self._document.is_edited

    @property
    def size_bytes(self) -> int:
        return sum(step.size_bytes for step in (*self.past, *self.future))

    @property
    def undoes(self) -> str:
        """Label of the step that undo would revert; empty where there is none."""
        return self.past[-1].label if self.past else ""

    @property
    def redoes(self) -> str:
        return self.future[-1].label if self.future else ""

    def apply(
        self, update: Update, by: Listener | None = None, at: float | None = None
    ) -> tuple[str, ...]:
        """Apply a pure update to the present state; return its notes on values it clamped."""
        with self._document.lock:
            before, updated = self.state, update(self.state)
            self._push(updated.without_notes(), time.monotonic() if at is None else at)
            is_changed = self.state is not before
        if is_changed:
            self._notify(by)
        return updated.notes

    def _push(self, state: AppState, at: float) -> None:
        document, before = self._document, self.state
        view = {name: getattr(state, name) for name in ("page", "forms", *VIEW)}
        if _equal(before.comparison, state.comparison):  # perhaps with another side drawn
            view["comparison"] = state.comparison
        changed = changes(replace(before, **view), state)
        if not changed:
            if any(getattr(before, name) != value for name, value in view.items()):
                document.state = replace(before, **view)
            return
        past = self.past
        is_same = past and not self.future and past[-1].changed == changed
        if is_same and at - self._changed_at < SAME_STEP_S and not {"scene", "review"} & {*changed}:
            with suppress(OptionError):  # with the changes of other tabs since
                before = merged(past[-1].after, past[-1].before, before)
                past.pop()
        past.append(UndoStep(before, state, changed, _size_bytes(before, state)))
        del past[:-STEPS]
        while len(past) > 1 and sum(step.size_bytes for step in past) > STEPS_BYTES:
            del past[0]
        self.future, self._changed_at = [], at
        document.state, document.is_edited = state, True

    def undo(self, *, redo: bool = False) -> str:
        """Revert the latest change of this tab, or the latest undo; return its label.

        Where another tab has changed the same value since, the step is dropped with an
        `OptionError`.
        """
        source, target = (self.future, self.past) if redo else (self.past, self.future)
        with self._document.lock:
            self._changed_at = float("-inf")
            if not source:
                return ""
            step = source.pop()
            sides = (step.before, step.after) if redo else (step.after, step.before)
            try:
                self._document.state = merged(*sides, self.state)
            except OptionError as error:
                raise OptionError(f"{step.label}: {error}") from None
            target.append(step)
        self._notify(None)
        return step.label

    def redo(self) -> str:
        return self.undo(redo=True)

    def checkpoint(self, page: PageLook) -> Checkpoint:
        return Checkpoint(self.state, tuple(self.past), tuple(self.future), page)

    def restore(self, checkpoint: Checkpoint, failed: AppState) -> bool:
        """Replace a state that cannot be evaluated; False where it is not the present one."""
        with self._document.lock:
            if self.state is not failed or failed is checkpoint.state:
                return False
            self._document.state = checkpoint.state
            self.past, self.future = [*checkpoint.past], [*checkpoint.future]
            self._changed_at = float("-inf")
        self._notify(None)
        return True

    def copy(self) -> "StateStore":
        store = StateStore(self.state)
        store.past, store.future = [*self.past], [*self.future]
        return store

    def joined(self) -> "StateStore":
        """Return a store of the same state for another tab, with a history of its own."""
        return StateStore(self.state, self._document)

    def subscribe(self, listener: Listener) -> None:
        """Call a listener, which must return at once, after every change, from any thread."""
        self._document.listeners.add(listener)

    def unsubscribe(self, listener: Listener) -> None:
        self._document.listeners.discard(listener)

    def _notify(self, by: Listener | None) -> None:
        for listener in tuple(self._document.listeners):
            if listener != by:
                listener()
