"""The picture of a state: what the app draws, with the comparison it belongs to."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from warpspace.analysis.statistics import Statistics
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.state.app_state import AppState
from warpspace.picture.model import Picture
from warpspace.picture.size import picture_size_mm
from warpspace.picture.traces import TraceLines
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Compared:
    """What is known of a comparison beside the picture drawn.

    Attributes
    ----------
    shown : str
        What is drawn: "a", "b" or "difference".
    titles : tuple of str, (2,)
        Names of the two sides.
    sides : tuple of AppState, (2,)
        What they are, looked at as now.
    a, b : Statistics
    difference : Statistics or None
        Of the length of the change at each node, |E_B − E_A|; None where there is no difference.
    other_mm : ndarray, [nx, ny, nz, 3], mm, or None
        Displaced nodes of the side that is not drawn; None for the difference.
    refused : str
        Why there is no difference; empty where there is one.
    """

    shown: str
    titles: tuple[str, str]
    sides: tuple[AppState, AppState]
    a: Statistics
    b: Statistics
    difference: Statistics | None
    other_mm: Array | None
    refused: str = ""

    @property
    def title(self) -> str:
        """Name of what is drawn."""
        a, b = self.titles
        return {"a": f"A: {a}", "b": f"B: {b}", "difference": f"B − A: {b} − {a}"}[self.shown]


@dataclass(frozen=True, kw_only=True)
class LivePicture(Picture):
    """The picture of a state.

    Attributes
    ----------
    state : AppState
        What is steered.
    traces : tuple of TraceLines
    subject : AppState or None
        What is drawn, where that is another state than the one steered; else None.
    compared : Compared or None
        The comparison it belongs to.
    bench : BenchPicture, str or None
        The standard test that is run, or why it cannot be; None where none is.
    """

    state: AppState
    traces: tuple[TraceLines, ...]
    subject: AppState | None = None
    compared: Compared | None = None
    bench: BenchPicture | str | None = None

    @cached_property
    def size_mm(self) -> float:
        """Length that marks are sized by, mm, for a single point too."""
        return picture_size_mm(self.state.scene, self.grid)

    @property
    def drawn_state(self) -> AppState:
        """The state that is drawn: the one steered, or a side of a comparison."""
        return self.subject or self.state

    @property
    def title(self) -> str:
        """Name of what is drawn: the scene, or a side of a comparison, or the difference."""
        return self.state.scene.title if self.compared is None else self.compared.title

    @property
    def is_difference(self) -> bool:
        """Whether a difference of two states is drawn."""
        return self.compared is not None and self.compared.shown == "difference"

    @property
    def is_steered(self) -> bool:
        """Whether what is drawn is what the sliders move, not what that is compared with."""
        chosen = self.state.comparison
        side = {"a": chosen.a, "b": chosen.b}.get(self.compared.shown) if self.compared else None
        return self.compared is None or (side is not None and side.state is None)

    def both_words(self, word: Callable[[AppState], str]) -> str:
        """Say something of what is drawn; of a difference for both sides where they are not alike.

        Parameters
        ----------
        word : callable
            Says it of a state.
        """
        if self.compared is None or not self.is_difference:
            return word(self.drawn_state)
        a, b = (word(side) for side in self.compared.sides)
        return a if a == b else f"{b} − {a}"
