"""Compensations of what a state shows: the question, the answer, and the box drawn with it."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from warpspace.app.evaluation.cache import Identity, taken_turn
from warpspace.app.evaluation.compare import pinned_side, with_before
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.compensation_choice import CompensationChoice
from warpspace.app.state.table import without_table
from warpspace.exceptions import WarpspaceError
from warpspace.formats.compensation.compensate import Compensation, compensate
from warpspace.formats.compensation.controller import Controller
from warpspace.scene.model import Scene

MACHINE, BOTH, LEFT = "the machine", "before and after", "what is left"
BOXES = (MACHINE, BOTH, LEFT)  # what the box can show


class StoppedError(WarpspaceError):
    """A compensation that nobody waits for any more."""


@dataclass(frozen=True, slots=True)
class Question:
    """All that an answer depends on; equal questions have equal answers."""

    scene: Identity  # scene with machine and curves
    amplitudes: tuple[tuple[str, float], ...]  # µm or µrad; errors that take part
    positions: tuple[tuple[str, float], ...]  # degrees
    choice: CompensationChoice
    placed: bool
    start: Scene = field(compare=False, repr=False)  # what all this amounts to


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
        state.placed,
        active_scene(state),
    )


def answer(question: Question, cancelled: threading.Event, tell: Callable[[str], None]) -> Answer:
    """Compensate."""

    def watch() -> None:
        if cancelled.is_set():
            raise StoppedError("cancelled")

    plan = question.choice.plan()
    tell("Waiting for another compensation …")
    with taken_turn(watch):
        tell("Writing the table and reading it back …")
        return Answer(question, compensate(question.start, plan, watch=watch))


def with_box(state: AppState, box: str, controller: Controller) -> AppState:
    """Choose what the box shows: a word of `BOXES`; nonsense changes nothing."""
    same = box == box_of(state) and state.controller in (None, controller)
    if box not in BOXES or same:
        return state
    bare = without_table(state)
    if box == MACHINE:
        return bare
    placed = bare.placed or controller.scene.placed
    bare = replace(bare, loop=controller.loop, placed=placed)
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
