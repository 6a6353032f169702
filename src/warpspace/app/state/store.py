"""The state that one tab, or all tabs of a shared review, look at and steer; a history per tab.

Sessions read their widgets and apply what has changed to the present state, under a lock: nobody
overwrites what somebody else has just done with an older state of the whole.
"""

import gc
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from warpspace.app.state.app_state import (
    AppState,
    DisplayOptions,
    Exclusions,
    PartLook,
    Specification,
)
from warpspace.app.state.leaf import description, lowered, name_of
from warpspace.app.state.look import Look, MachineLook, RotaryLook
from warpspace.app.state.tree import leaves, stored
from warpspace.exceptions import OptionError
from warpspace.machine.errors import ToleranceSet

# --- What differs between two states --------------------------------------------------------------


_COMPARED = [entry for entry in fields(AppState) if entry.compare]


def changes(old: AppState, new: AppState) -> dict[str, str]:
    """Say in words what differs between two states, each by its path; page and forms do not."""
    found: dict[str, str] = {}
    for entry in _COMPARED:
        before, after = getattr(old, entry.name), getattr(new, entry.name)
        if before is after or _equal(before, after):
            continue
        own = description(entry)
        # what differs within a scene, say, has no name
        inner = {} if own and not own.kind else dict(_leaf_changes(old, new, entry.name))
        found |= inner or {entry.name: lowered(own.label) if own else entry.name}
    one, other = old.scene, new.scene
    if one.name == other.name and not (
        _equal(one.machine, other.machine) and _equal(one.workspace, other.workspace)
    ):
        return {"scene": "machine"}
    # what it is compared with has changed with it
    return {"controller": found["controller"]} if "controller" in found else found


def _leaf_changes(old: AppState, new: AppState, group: str) -> Iterator[tuple[str, str]]:
    was, now, known = getattr(old, group), getattr(new, group), leaves(new)
    if isinstance(now, Mapping):  # of many entries, most of which stay
        keys = [key for key, value in now.items() if was.get(key) is not value]
        paths = [f"{group}.{key}" for key in (*keys, *(was.keys() - now.keys()))]
    else:
        paths = [path for path in known if path.partition(".")[0] == group]
    for path in paths:
        if (leaf := known.get(path)) is None:
            continue
        before, after = stored(old, path), stored(new, path)
        if isinstance(before, frozenset) and isinstance(after, frozenset):
            for name in sorted(before ^ after):
                sign = "+" if name in after else "-"
                yield f"{path}.{sign}{name}", lowered(leaf.entry_label.format(name_of(name)))
        elif not _equal(before, after):
            yield path, lowered(leaf.label)


def _equal(old: object, new: object) -> bool:
    try:
        return old is new or bool(old == new)
    except ValueError:  # arrays
        return False


# --- A change of one state applied to another -----------------------------------------------------

_MERGED = (
    Exclusions,
    Look,
    MachineLook,
    PartLook,
    RotaryLook,
    DisplayOptions,
    Specification,
    ToleranceSet,
)
"""What two users may change at once, field by field; a scene is changed as a whole."""
_MISSING = object()


def carried(old: AppState, new: AppState, present: AppState) -> AppState:
    """Apply the change from an old state to a new one to the present state; its page stays.

    Raises `OptionError` where somebody else has changed the same.
    """
    names = [entry.name for entry in _COMPARED if entry.name != "review"]
    values = {name: _carried(*(getattr(s, name) for s in (old, new, present))) for name in names}
    notes = _carried(*({note.id: note for note in s.review} for s in (old, new, present)))
    return replace(present, **values, review=tuple(notes.values()))


def _carried(old: Any, new: Any, present: Any) -> Any:
    if _equal(old, new):
        return present
    if _equal(old, present):
        return new
    if _equal(new, present):
        return present
    states = old, new, present
    if all(isinstance(one, frozenset) for one in states):
        return (present - (old - new)) | (new - old)
    if all(isinstance(one, Mapping) for one in states):
        order = {**present, **new} if old.keys() == new.keys() else {**new, **present}
        entries = {key: _carried(*(one.get(key, _MISSING) for one in states)) for key in order}
        return {key: entry for key, entry in entries.items() if entry is not _MISSING}
    if not isinstance(old, _MERGED) or not type(old) is type(new) is type(present):
        raise OptionError("somebody else has changed the same since; it stays as it is")
    names = [entry.name for entry in fields(old)]
    values = {name: _carried(*(getattr(one, name) for one in states)) for name in names}
    return replace(present, **values)


# --- Undo and redo --------------------------------------------------------------------------------
# What a slider drag sends in quick succession becomes one step. The steps of a tab are bounded in
# number and in the memory that only they hold.

STEPS = 100  # steps that can be undone; the oldest are forgotten
STEPS_BYTES = 128 * 2**20  # held by the steps of a tab; the latest step stays
SAME_STEP_S = 0.8  # changes of one thing that follow each other faster than this are one step
_LARGE = ("scene", "loaded", "part", "comparison", "controller")
_COMMON = (type, ModuleType, FunctionType)


def _held_bytes(thing: object, known: set[int]) -> int:
    """Return the memory that an object holds beside those that are known."""
    total, waiting = 0, [thing]
    while waiting:
        latest = waiting.pop()
        if id(latest) not in known and not isinstance(latest, _COMMON):
            known.add(id(latest))
            total += latest.nbytes if isinstance(latest, np.ndarray) else sys.getsizeof(latest)
            waiting += gc.get_referents(latest)
    return total


def _size_bytes(before: AppState, after: AppState) -> int:
    """Return the memory that either of two states holds and the other does not."""
    if all(getattr(before, name) is getattr(after, name) for name in _LARGE):
        return 0
    sizes: list[int] = []
    for state, other in ((before, after), (after, before)):
        known = set[int]()
        _held_bytes(other, known)
        sizes.append(_held_bytes(state, known))
    return max(sizes)


@dataclass(frozen=True, slots=True)
class UndoStep:
    before: AppState
    after: AppState
    changed: Mapping[str, str]
    size_bytes: int

    @property
    def label(self) -> str:
        found = list(dict.fromkeys(self.changed.values()))
        if "scene" in self.changed:  # its curves change with an error
            errors = {said for path, said in self.changed.items() if path.startswith("amplitudes.")}
            found = list(errors) if len(errors) == 1 else [self.changed["scene"]]
        return found[0] if len(found) == 1 else f"{found[0]} and {len(found) - 1} more"


Steps: TypeAlias = tuple[UndoStep, ...]


def _bounded(steps: Steps) -> Steps:
    steps = steps[-STEPS:]
    while len(steps) > 1 and sum(step.size_bytes for step in steps) > STEPS_BYTES:
        steps = steps[1:]
    return steps


def _on_page(state: AppState, other: AppState) -> AppState:
    if (state.page, state.forms) == (other.page, other.forms):
        return state
    return replace(state, page=other.page, forms=other.forms)


Update: TypeAlias = Callable[[AppState], AppState]
Listener: TypeAlias = Callable[[], None]


@dataclass(slots=True)
class _Document:
    """What all tabs of a shared review look at."""

    state: AppState  # what is shown, or about to be
    listeners: tuple[Listener, ...] = ()
    is_edited: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)


class Mark(NamedTuple):
    """A state with the history of a tab, to go back to."""

    state: AppState
    past: Steps
    future: Steps


class StateStore:
    """A state with the past and the future of one tab; tabs of a shared review share the state."""

    def __init__(self, state: AppState, document: _Document | None = None) -> None:
        self._document = document or _Document(state)
        self.past: Steps = ()  # latest last
        self.future: Steps = ()
        self._changed_at = float("-inf")

    @property
    def state(self) -> AppState:
        return self._document.state

    @property
    def is_edited(self) -> bool:
        """Whether anybody has changed the state."""
        return self._document.is_edited

    @property
    def size_bytes(self) -> int:
        """Memory that its history holds."""
        return sum(step.size_bytes for step in (*self.past, *self.future))

    @property
    def undoes(self) -> str:
        """What undo would take back, in words; empty where there is nothing."""
        return self.past[-1].label if self.past else ""

    @property
    def redoes(self) -> str:
        return self.future[-1].label if self.future else ""

    def apply(
        self, update: Update, by: Listener | None = None, at: float | None = None
    ) -> tuple[str, ...]:
        """Apply a pure update to the present state; give what it had to clamp."""
        with self._document.lock:
            before, found = self.state, update(self.state)
            self._push(found.without_notes(), time.monotonic() if at is None else at)
            changed = self.state is not before
        if changed:
            self._notify(by)
        return found.notes

    def _push(self, state: AppState, at: float) -> None:
        document, before = self._document, self.state
        what = changes(before, state)
        if not what:
            document.state = _on_page(before, state)
            return
        steps, alone = self.past, {"scene", "review"} & what.keys()
        same = steps and not self.future and steps[-1].changed == what and not alone
        if same and at - self._changed_at < SAME_STEP_S:
            with suppress(OptionError):  # with what others have changed meanwhile
                before, steps = carried(steps[-1].after, steps[-1].before, before), steps[:-1]
        step = UndoStep(before, state, what, _size_bytes(before, state))
        self.past, self.future, self._changed_at = _bounded((*steps, step)), (), at
        document.state, document.is_edited = state, True

    def undo(self) -> str:
        """Take the latest change of this tab back; give what it was.

        Where somebody else has changed the same since, the step is forgotten with an `OptionError`.
        """
        return self._travel(back=True)

    def redo(self) -> str:
        """Do again what was undone; give what it was; raises as `undo`."""
        return self._travel(back=False)

    def _travel(self, *, back: bool) -> str:
        with self._document.lock:
            self._changed_at = float("-inf")
            steps = self.past if back else self.future
            if not steps:
                return ""
            step, left = steps[-1], steps[:-1]
            sides = (step.after, step.before) if back else (step.before, step.after)
            self.past, self.future = (left, self.future) if back else (self.past, left)
            try:
                self._document.state = carried(*sides, self.state)
            except OptionError as error:
                raise OptionError(f"{step.label}: {error}") from None
            if back:
                self.future = (*self.future, step)
            else:
                self.past = (*self.past, step)
        self._notify(None)
        return step.label

    def mark(self) -> Mark:
        """Return what `back_to` goes back to."""
        return Mark(self.state, self.past, self.future)

    def back_to(self, mark: Mark, failed: AppState) -> bool:
        """Replace a state that cannot be evaluated; False where it is not the present one."""
        with self._document.lock:
            if self.state is not failed or failed is mark.state:
                return False
            self._document.state, self.past, self.future = mark
            self._changed_at = float("-inf")
        self._notify(None)
        return True

    def copy(self) -> "StateStore":
        """Give a store of its own with the same state and history."""
        store = StateStore(self.state)
        store.past, store.future = self.past, self.future
        return store

    def joined(self) -> "StateStore":
        """Return a store of the same state for another tab, with a history of its own."""
        return StateStore(self.state, self._document)

    def subscribe(self, listener: Listener) -> None:
        """Have a callable called (from any thread; it must return at once) after every change."""
        with self._document.lock:
            self._document.listeners += (listener,)

    def unsubscribe(self, listener: Listener) -> None:
        with self._document.lock:
            left = tuple(known for known in self._document.listeners if known != listener)
            self._document.listeners = left

    def _notify(self, by: Listener | None) -> None:
        for listener in self._document.listeners:
            if listener != by:
                listener()
