"""Which two states are compared, and which of them is drawn."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

from warpspace.app.state.leaf import described

State = TypeVar("State")
"""What a side holds: the state of the app, which in turn holds a comparison."""

SHOWN = {"a": "A", "b": "B", "difference": "B − A"}
"""What can be drawn; the difference is the change from A to B."""
PRESENT, NOBODY = "present errors", "nothing"
"""Names of what is steered, and of no other side."""
BEFORE, AFTER = "before", "after"
"""What was pinned, and what is steered beside it."""


@dataclass(frozen=True)
class Side(Generic[State]):
    """One side of a comparison."""

    title: str = PRESENT  # what it is called on the page
    state: State | None = None  # what it is; None for what is steered
    # whether it is a scene as opened, which is looked at as what is steered (rotary positions,
    # loop), rather than what was pinned, which keeps its own
    is_scene: bool = False


@dataclass(frozen=True)
class Comparison(Generic[State]):
    """What is compared."""

    a: Side[State] = field(default_factory=Side[State])
    b: Side[State] | None = None  # none while nothing is compared
    shown: str = described("a", "Side that is drawn", choices=SHOWN, linked="")
    ghost: bool = described(
        True, "Other side as a wireframe", hint="The other one is drawn beside it.", linked=""
    )
    pinned: Side[State] | None = None  # what was pinned last: the state before

    def off(self) -> "Comparison[State]":
        """End it; what was pinned stays."""
        return Comparison(pinned=self.pinned, ghost=self.ghost)
