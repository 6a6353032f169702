"""The state that one tab, or all tabs of a shared review, look at and steer; with its history.

Sessions read their widgets and apply what has changed to the present state, under a lock: nobody
overwrites what somebody else has just done with an older state of the whole.
"""

import threading
import time
from collections.abc import Callable, Iterable
from typing import TypeAlias

from warpspace.app.state.app_state import AppState
from warpspace.app.state.history import History

Update: TypeAlias = Callable[[AppState], AppState]
Listener: TypeAlias = Callable[[], None]


class StateStore:
    """A state with its history that any number of sessions share.

    Parameters
    ----------
    state : AppState
        What is shown first.
    """

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
        """Apply a pure update to the present state.

        Parameters
        ----------
        update : callable
        by : callable, optional
            The listener of who does it: it is not called.
        at : float, optional
            When the user did it on the monotonic clock, s; now by default. A busy server is late,
            and must not make two steps of one drag.

        Returns
        -------
        tuple of str
            What had to be clamped.
        """
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
        """Go through the history."""
        with self._lock:
            self._history, what = move(self._history)
        if what:
            self._notify(None)
        return what

    def _notify(self, by: Listener | None) -> None:
        """Call all listeners but one."""
        with self._lock:
            listeners = [listener for listener in self._listeners if listener != by]
        for listener in listeners:
            listener()


def apply_each(
    state: AppState, updates: Iterable[Update], guarded: Callable[[Callable[[], object]], None]
) -> AppState:
    """Apply updates one by one; what one of them raises keeps none of the others back.

    Parameters
    ----------
    state : AppState
    updates : iterable of callable
    guarded : callable
        Runs a callable and deals with what it raises.

    Returns
    -------
    AppState
    """
    for update in updates:
        found: list[AppState] = []
        guarded(lambda update=update, state=state, found=found: found.append(update(state)))
        state = found[0] if found else state
    return state
