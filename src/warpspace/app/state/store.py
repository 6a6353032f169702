"""The state that one tab, or all tabs of a shared review, look at and steer; with its history.

Sessions read their widgets and apply what has changed to the present state, under a lock: nobody
overwrites what somebody else has just done with an older state of the whole.
"""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import TypeAlias

from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import description, lowered, name_of
from warpspace.app.state.tree import leaves, stored

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
                yield f"{path}.{sign}{name}", lowered(leaf.one.format(name_of(name)))
        elif not _equal(before, after):
            yield path, lowered(leaf.label)


def _equal(old: object, new: object) -> bool:
    try:
        return old is new or bool(old == new)
    except ValueError:  # arrays
        return False


# --- Undo and redo --------------------------------------------------------------------------------
# What a slider drag sends in quick succession becomes one step. The number of steps kept is
# bounded.

STEPS = 100  # steps that can be undone; the oldest are forgotten
SAME_STEP_S = 0.8  # changes of one thing that follow each other faster than this are one step


@dataclass(frozen=True, slots=True)
class UndoStep:
    state: AppState
    what: Mapping[str, str]

    @property
    def words(self) -> str:
        found = list(dict.fromkeys(self.what.values()))
        if "scene" in self.what:  # its curves change with an error
            errors = {said for path, said in self.what.items() if path.startswith("amplitudes.")}
            found = list(errors) if len(errors) == 1 else [self.what["scene"]]
        return found[0] if len(found) == 1 else f"{found[0]} and {len(found) - 1} more"


Steps: TypeAlias = tuple[UndoStep, ...]


def _on_page(state: AppState, other: AppState) -> AppState:
    if (state.page, state.forms) == (other.page, other.forms):
        return state
    return replace(state, page=other.page, forms=other.forms)


Update: TypeAlias = Callable[[AppState], AppState]
Listener: TypeAlias = Callable[[], None]


class StateStore:
    """A state with its past and its future, that any number of sessions share."""

    def __init__(self, state: AppState) -> None:
        self.state = state  # what is shown, or about to be
        self.past: Steps = ()  # latest last
        self.future: Steps = ()
        self._changed_at = float("-inf")
        self._listeners: list[Listener] = []
        self._lock = threading.Lock()

    @property
    def undoes(self) -> str:
        """What undo would take back, in words; empty where there is nothing."""
        return self.past[-1].words if self.past else ""

    @property
    def redoes(self) -> str:
        return self.future[-1].words if self.future else ""

    def apply(
        self, update: Update, by: Listener | None = None, at: float | None = None
    ) -> tuple[str, ...]:
        """Apply a pure update to the present state; give what it had to clamp."""
        with self._lock:
            before, found = self.state, update(self.state)
            self._push(found.without_notes(), time.monotonic() if at is None else at)
            changed = self.state is not before
        if changed:
            self._notify(by)
        return found.notes

    def _push(self, state: AppState, at: float) -> None:
        what = changes(self.state, state)
        if not what:
            self.state = _on_page(self.state, state)
            return
        alone = {"scene", "review"} & what.keys()
        same = self.past and not self.future and self.past[-1].what == what and not alone
        if not same or at - self._changed_at >= SAME_STEP_S:
            self.past = (*self.past, UndoStep(self.state, what))[-STEPS:]
        self.state, self.future, self._changed_at = state, (), at

    def undo(self) -> str:
        """Take the latest change back; give what it was."""
        with self._lock:
            self.past, self.future, what = self._travel(self.past, self.future)
        return self._told(what)

    def redo(self) -> str:
        """Do again what was undone; give what it was."""
        with self._lock:
            self.future, self.past, what = self._travel(self.future, self.past)
        return self._told(what)

    def _travel(self, steps: Steps, others: Steps) -> tuple[Steps, Steps, str]:
        self._changed_at = float("-inf")
        if not steps:
            return steps, others, ""
        *rest, step = steps
        others = (*others, UndoStep(self.state, step.what))
        self.state = _on_page(step.state, self.state)
        return tuple(rest), others, step.words

    def _told(self, what: str) -> str:
        if what:
            self._notify(None)
        return what

    def copy(self) -> "StateStore":
        """Give a store of its own with the same state and history."""
        store = StateStore(self.state)
        store.past, store.future = self.past, self.future
        return store

    def subscribe(self, listener: Listener) -> None:
        """Have a callable called (from any thread; it must return at once) after every change."""
        with self._lock:
            self._listeners.append(listener)

    def unsubscribe(self, listener: Listener) -> None:
        with self._lock:
            self._listeners = [known for known in self._listeners if known != listener]

    def _notify(self, by: Listener | None) -> None:
        with self._lock:
            listeners = [listener for listener in self._listeners if listener != by]
        for listener in listeners:
            listener()
