"""Which two states are compared, and which of them is drawn."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warpspace.app.state.app_state import AppState

SHOWN = {"a": "A", "b": "B", "difference": "A − B"}
NOW, NOBODY = "now", "nothing"
"""Names of what is steered, and of no other side."""


@dataclass(frozen=True, slots=True)
class Side:
    """One side of a comparison.

    Attributes
    ----------
    title : str
        What it is called on the page.
    state : AppState or None
        What it is; None for what is steered now.
    is_scene : bool
        Whether it is a scene as opened, which is looked at as now (rotary positions, loop), rather
        than a snapshot, which keeps its own.
    """

    title: str = NOW
    state: "AppState | None" = None
    is_scene: bool = False


@dataclass(frozen=True, slots=True)
class Comparison:
    """What is compared.

    Attributes
    ----------
    a : Side
    b : Side or None
        None while nothing is compared.
    shown : str
        What is drawn: a key of `SHOWN`.
    ghost : bool
        Whether the other one is drawn as a wireframe.
    pinned : Side or None
        The snapshot that was taken last.
    """

    a: Side = Side()
    b: Side | None = None
    shown: str = "a"
    ghost: bool = True
    pinned: Side | None = None

    def with_shown(self, shown: str) -> "Comparison":
        """Choose what is drawn; an unknown word changes nothing."""
        return replace(self, shown=shown) if shown in SHOWN else self

    def off(self) -> "Comparison":
        """End it; the snapshot stays."""
        return Comparison(pinned=self.pinned, ghost=self.ghost)
