"""The state that one tab, or all tabs of a shared review, look at and steer; with its history.

Sessions read their widgets and apply what has changed to the present state, under a lock: nobody
overwrites what somebody else has just done with an older state of the whole.
"""

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Generic, TypeAlias, TypeVar, cast

from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Description, default_of, description, lowered, name_of

# --- Undo and redo of any frozen state, as one frozen value itself --------------------------------
# What a slider drag sends in quick succession becomes one step. The number of steps kept is
# bounded.

S = TypeVar("S")

STEPS = 100  # steps that can be undone; the oldest are forgotten
SAME_STEP_S = 0.8  # changes of one thing that follow each other faster than this are one step


@dataclass(frozen=True, slots=True)
class Step(Generic[S]):
    """A state that can be gone back to, and what was changed after it."""

    state: S
    what: str  # the change between this state and the next one, for instance "amplitudes.EAX"


@dataclass(frozen=True, slots=True)
class History(Generic[S]):
    """A present state with its past and, after undoing, its future."""

    present: S
    past: tuple[Step[S], ...] = ()  # latest last
    future: tuple[Step[S], ...] = ()
    changed_at: float = float("-inf")  # when the present was last changed, s
    limit: int = STEPS  # steps of the past that are kept

    def push(self, state: S, at: float) -> "History[S]":
        """Take in a new present state."""
        what = describe_change(self.present, state)
        if not what:
            kept = _with_choices(self.present, state)
            return self if kept is self.present else replace(self, present=kept)
        same = (
            bool(self.past)
            and not self.future
            and self.past[-1].what == what
            and at - self.changed_at < SAME_STEP_S
        )
        past = self.past if same else (*self.past, Step(self.present, what))[-self.limit :]
        return replace(self, present=state, past=past, future=(), changed_at=at)

    def undo(self) -> "History[S]":
        """Go back one step; the same one where there is none."""
        if not self.past:
            return self
        *past, last = self.past
        future = (*self.future, Step(self.present, last.what))
        state = _with_choices(last.state, self.present)
        return History(state, tuple(past), future, limit=self.limit)

    def redo(self) -> "History[S]":
        """Go forward again one step; the same one where there is none."""
        if not self.future:
            return self
        *future, coming = self.future
        past = (*self.past, Step(self.present, coming.what))
        state = _with_choices(coming.state, self.present)
        return History(state, past, tuple(future), limit=self.limit)

    @property
    def undoes(self) -> str:
        """What undo would take back; empty where there is nothing."""
        return self.past[-1].what if self.past else ""

    @property
    def redoes(self) -> str:
        """What redo would do again; empty where there is nothing."""
        return self.future[-1].what if self.future else ""


def _with_choices(state: S, other: S) -> S:
    """Give a state those fields of another one that count in no comparison; undo leaves them."""
    if not is_dataclass(state) or isinstance(state, type) or type(state) is not type(other):
        return state
    names = [field.name for field in fields(state) if not field.compare]
    changes = {n: getattr(other, n) for n in names if getattr(other, n) != getattr(state, n)}
    return cast("S", replace(state, **changes)) if changes else state


def describe_change(old: object, new: object) -> str:
    """Name the fields in which two values differ."""
    return ", ".join(_differences(old, new))


def _differences(old: object, new: object) -> list[str]:
    if old is new:
        return []
    if is_dataclass(old) and type(old) is type(new) and type(old).__eq__ is not object.__eq__:
        parts: list[tuple[str, Any, Any]] = [
            (field.name, getattr(old, field.name), getattr(new, field.name))
            for field in fields(old)
            if field.compare
        ]
    elif isinstance(old, Mapping) and isinstance(new, Mapping):
        before, after = cast("Mapping[str, Any]", old), cast("Mapping[str, Any]", new)
        keys = dict.fromkeys((*before, *after))
        parts = [(str(key), before.get(key), after.get(key)) for key in keys]
    elif isinstance(old, frozenset) and isinstance(new, frozenset):
        gone, come = cast("frozenset[Any]", old - new), cast("frozenset[Any]", new - old)
        return [*sorted(f"-{item}" for item in gone), *sorted(f"+{item}" for item in come)]
    else:
        return [] if _equal(old, new) else [""]
    return [
        f"{name}.{rest}" if rest else name
        for name, before, after in parts
        if before is not after
        for rest in _differences(before, after)
    ]


def _equal(old: object, new: object) -> bool:
    try:
        return bool(old == new)
    except ValueError:
        return False


PARTS_OF_MACHINE = ("scene.model.machine", "scene.workspace")


def change_words(what: str) -> str:
    """Say in words what `describe_change` has found."""
    paths = what.split(", ")
    if "scene.name" not in paths and any(path.startswith(PARTS_OF_MACHINE) for path in paths):
        return "machine"
    if "controller" in paths:  # what it is compared with has changed with it
        paths = ["controller"]
    found = {path: _change(path.split(".")) for path in paths}
    unique = list(dict.fromkeys(found.values()))
    if "scene" in unique:
        errors = {words for path, words in found.items() if path.startswith("amplitudes.")}
        unique = list(errors) if len(errors) == 1 else ["scene"]
    return unique[0] if len(unique) == 1 else f"{unique[0]} and {len(unique) - 1} more"


def _change(parts: list[str]) -> str:
    """Say which field has changed, by the words of the innermost that has any."""
    kind: type | None = AppState
    words: Description | None = None
    inner = parts
    for depth, part in enumerate(parts, start=1):
        entry = next((e for e in fields(kind) if e.name == part), None) if kind else None
        if entry is None:
            break
        start, own = default_of(entry), description(entry)
        if own is not None:
            words, inner = own, parts[depth:]
        kind = type(start) if is_dataclass(start) and not (own and own.leaf.kind) else None
    names = [part.lstrip("+-") for part in inner]
    error = next((name_of(name) for name in names if name_of(name) != name), "")
    if words is None:
        return error or names[-1].replace("_", " ")
    if names and (words.each is not None or words.one != "{}"):
        return lowered(words.one.format(error or names[-1]))
    return lowered(words.leaf.label)


Update: TypeAlias = Callable[[AppState], AppState]
Listener: TypeAlias = Callable[[], None]


class StateStore:
    """A state with its history that any number of sessions share."""

    def __init__(self, state: AppState) -> None:
        self._history = History(state)
        self._listeners: list[Listener] = []
        self._lock = threading.Lock()

    @property
    def history(self) -> History[AppState]:
        """The present state, its past and its future."""
        return self._history

    @property
    def state(self) -> AppState:
        """What is shown, or about to be."""
        return self._history.present

    def apply(
        self, update: Update, by: Listener | None = None, at: float | None = None
    ) -> tuple[str, ...]:
        """Apply a pure update to the present state."""
        with self._lock:
            before = self._history
            state = update(before.present)
            notes = state.notes
            self._history = before.push(
                state.without_notes(), time.monotonic() if at is None else at
            )
            changed = self._history is not before
        if changed:
            self._notify(by)
        return notes

    def undo(self) -> str:
        """Take the latest change back; give what it was."""
        return self._travel(lambda history: (history.undo(), history.undoes))

    def redo(self) -> str:
        """Do again what was undone; give what it was."""
        return self._travel(lambda history: (history.redo(), history.redoes))

    def copy(self) -> "StateStore":
        """Give a store of its own with the same state and history."""
        store = StateStore(self.state)
        store._history = self._history
        return store

    def subscribe(self, listener: Listener) -> None:
        """Have a callable called (from any thread; it must return at once) after every change."""
        with self._lock:
            self._listeners.append(listener)

    def unsubscribe(self, listener: Listener) -> None:
        """Call a callable no more."""
        with self._lock:
            self._listeners = [known for known in self._listeners if known != listener]

    def _travel(self, move: Callable[[History[AppState]], tuple[History[AppState], str]]) -> str:
        with self._lock:
            self._history, what = move(self._history)
        if what:
            self._notify(None)
        return what

    def _notify(self, by: Listener | None) -> None:
        with self._lock:
            listeners = [listener for listener in self._listeners if listener != by]
        for listener in listeners:
            listener()


def apply_each(
    state: AppState, updates: Iterable[Update], guarded: Callable[[Callable[[], object]], None]
) -> AppState:
    """Apply updates one by one; what one of them raises keeps none of the others back."""
    for update in updates:
        found: list[AppState] = []
        guarded(lambda update=update, state=state, found=found: found.append(update(state)))
        state = found[0] if found else state
    return state
