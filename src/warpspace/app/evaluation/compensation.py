"""Compensations of what a state shows: the question, the answer, and the box drawn with it."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.compare import pinned_side, with_before
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.compensation_choice import CompensationChoice
from warpspace.app.state.table import without_table
from warpspace.exceptions import WarpspaceError
from warpspace.formats.compensation.compensate import Compensation, compensate
from warpspace.formats.compensation.controller import Controller
from warpspace.scene.model import Scene

POLL_S = 0.1
MACHINE, BOTH, LEFT = "the machine", "before and after", "what is left"
BOXES = (MACHINE, BOTH, LEFT)
"""What the box can show."""
_TURN = threading.Lock()
"""One compensation at a time for all tabs together, so that sliders stay quick."""


class StoppedError(WarpspaceError):
    """A compensation that nobody waits for any more."""


@dataclass(frozen=True, slots=True)
class Question:
    """All that an answer depends on; equal questions have equal answers.

    Attributes
    ----------
    scene : Identity
        Scene with machine and curves.
    amplitudes : tuple of (str, float), µm or µrad
        Errors that take part.
    positions : tuple of (str, float), degrees
    choice : CompensationChoice
    start : Scene
        What all this amounts to.
    """

    scene: Identity
    amplitudes: tuple[tuple[str, float], ...]
    positions: tuple[tuple[str, float], ...]
    choice: CompensationChoice
    start: Scene = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Answer:
    """A compensation, and what it is the answer to."""

    question: Question
    found: Compensation


def ask(state: AppState, choice: CompensationChoice) -> Question:
    """Ask what a table leaves of the errors that take part."""
    return Question(
        Identity(state.scene),
        tuple(state.active.items()),
        tuple(state.positions.items()),
        choice,
        active_scene(state),
    )


def answer(question: Question, cancelled: threading.Event, tell: Callable[[str], None]) -> Answer:
    """Compensate.

    Parameters
    ----------
    question : Question
    cancelled : threading.Event
        Ends the work when set.
    tell : callable
        Gets what is being done, in words.

    Returns
    -------
    Answer

    Raises
    ------
    WarpspaceError
        If it cannot be done; `StoppedError` where it was cancelled.
    """

    def watch() -> None:
        if cancelled.is_set():
            raise StoppedError("cancelled")

    plan = question.choice.plan()
    tell("Waiting for another compensation …")
    while not _TURN.acquire(timeout=POLL_S):
        watch()
    try:
        tell("Writing the table and reading it back …")
        return Answer(question, compensate(question.start, plan, watch=watch))
    finally:
        _TURN.release()


def with_box(state: AppState, box: str, controller: Controller) -> AppState:
    """Choose what the box shows: a word of `BOXES`; nonsense changes nothing.

    Parameters
    ----------
    state : AppState
    box : str
    controller : Controller
        Of the latest compensation. Its table corrects the machine as it is now, in the loop that
        it corrects.
    """
    same = box == box_of(state) and state.controller in (None, controller)
    if box not in BOXES or same:
        return state
    bare = without_table(state)
    if box == MACHINE:
        return bare
    bare = replace(bare, loop=controller.loop)
    corrected = replace(bare, controller=controller)
    if box == BOTH:
        return with_before(corrected, pinned_side(bare))
    return replace(corrected, comparison=corrected.comparison.off())


def box_of(state: AppState) -> str:
    """Tell what the box shows."""
    if state.controller is None:
        return MACHINE
    before = state.comparison.a.state
    beside = state.comparison.b is not None and before is not None and before.controller is None
    return BOTH if beside else LEFT


def holds_for(state: AppState, controller: Controller) -> bool:
    """Tell whether a table was made for the machine that a state shows."""
    return controller.scene.machine == state.scene.machine
