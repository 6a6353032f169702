"""Undo and redo of any frozen state, as one frozen value itself.

What a slider drag sends in quick succession becomes one step. The number of steps kept is bounded.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Generic, TypeVar, cast

S = TypeVar("S")

STEPS = 100
"""Steps that can be undone; the oldest are forgotten."""
SAME_STEP_S = 0.8
"""Changes of one thing that follow each other faster than this are one step."""


@dataclass(frozen=True, slots=True)
class Step(Generic[S]):
    """A state that can be gone back to, and what was changed after it.

    Attributes
    ----------
    state : S
    what : str
        The change between this state and the next one, for instance "amplitudes.EAX".
    """

    state: S
    what: str


@dataclass(frozen=True, slots=True)
class History(Generic[S]):
    """A present state with its past and, after undoing, its future.

    Attributes
    ----------
    present : S
    past, future : tuple of Step
        Latest last.
    changed_at : float
        When the present was last changed, s.
    limit : int
        Steps of the past that are kept.
    """

    present: S
    past: tuple[Step[S], ...] = ()
    future: tuple[Step[S], ...] = ()
    changed_at: float = float("-inf")
    limit: int = STEPS

    def push(self, state: S, at: float) -> "History[S]":
        """Take in a new present state.

        Parameters
        ----------
        state : S
        at : float
            Time of the change on any clock that does not run backwards, s.

        Returns
        -------
        History
            The same one where nothing was changed. Following changes of one thing within
            `SAME_STEP_S` of each other are one step.
        """
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
    """Name the fields in which two values differ.

    Parameters
    ----------
    old, new : object
        Frozen dataclasses of one type; nested ones, mappings and sets are looked into. Fields that
        count in no comparison (`compare=False`) are left out; what is equal to itself alone
        (`eq=False`) is one thing.

    Returns
    -------
    str
        Dotted names with commas between, for instance "amplitudes.EAX", or
        "exclusions.excluded.+EAX" for what has come into a set; empty where they are equal. On and
        off are thus two things, and two steps however fast they follow each other.
    """
    return ", ".join(_differences(old, new))


def _differences(old: object, new: object) -> list[str]:
    """List the dotted names of the parts that differ; "" for the values themselves."""
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
        for rest in _differences(before, after)
    ]


def _equal(old: object, new: object) -> bool:
    """Compare two plain values; what cannot be compared (arrays, say) counts as different."""
    try:
        return bool(old == new)
    except ValueError:
        return False
