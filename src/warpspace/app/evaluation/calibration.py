"""Calibrations of what a state shows: readings that were taken in, the question, the answer."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from warpspace.analysis.options import options_of
from warpspace.app.evaluation.cache import Identity, taken_turn
from warpspace.app.evaluation.compare import plain_state, scene_side, with_before
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import Side
from warpspace.calibration.calibrate import Calibrate
from warpspace.calibration.readings import bundled_data, find_data, parse_readings, parse_table
from warpspace.calibration.registry import KINDS
from warpspace.calibration.results import Calibration
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.limits import MAX_CSV_BYTES
from warpspace.scene.files import read_text
from warpspace.scene.model import Scene

BEFORE, AFTER = "before calibration", "after calibration"
MOST_FILES, MOST_READINGS = 6, 5_000
"""Files of a page, and readings in all of them: what a fit needs of memory goes with it."""
MOST_NEXT = 3
LONGEST_KEYS = 500
Tell = Callable[[str], None]  # takes what is being done, in words


class StoppedError(WarpspaceError):
    """A fit that nobody waits for any more."""


@dataclass(frozen=True, slots=True)
class Measured:
    """A file of readings."""

    name: str  # unlike those of the other files of the page; never a path
    text: str = field(repr=False)
    kind: str | None  # as chosen; None for what its columns tell
    told: str  # the kind it was read as
    count: int  # readings


@dataclass(frozen=True, slots=True)
class Question:
    """All that an answer depends on; equal questions have equal answers."""

    scene: Identity  # scene with machine and curves
    # µm or µrad; all errors, excluded or not: what a saved scene has
    amplitudes: tuple[tuple[str, float], ...]
    positions: tuple[tuple[str, float], ...]  # degrees
    files: tuple[Measured, ...]
    keys: str  # parameters to find, as typed
    robust: bool
    start: Scene = field(compare=False, repr=False)  # what all this amounts to


@dataclass(frozen=True, slots=True)
class Answer:
    """A calibration with all that a reader is told of it."""

    question: Question
    found: Calibration


def take(
    scene: Scene, text: str, name: str, kind: str | None, others: Sequence[Measured]
) -> Measured:
    """Take in the text of a file beside those that are there."""
    if len(others) >= MOST_FILES:
        raise OptionError(f"{name}: expected at most {MOST_FILES} files; remove one first")
    unlike = name
    while any(one.name == unlike for one in others):
        number = 2 if unlike == name else int(unlike.rpartition(" ")[2]) + 1
        unlike = f"{name} {number}"
    lines = text.count("\n")
    if kind is None or kind in KINDS:
        lines = len(parse_table(text, unlike))
    room = MOST_READINGS - sum(one.count for one in others)
    if lines > room:
        raise OptionError(
            f"{name} has {lines:,} readings; expected at most {MOST_READINGS:,} in all files"
        )
    readings = parse_readings(text, unlike, scene, kind)
    return Measured(unlike, text, kind, readings.kind, len(readings))


def bundled(name: str) -> str:
    """Read a file of readings that comes with warpspace; only those of `bundled_data`."""
    if name not in bundled_data():
        raise OptionError(f"{name[:60]}: expected one of {', '.join(bundled_data())}")
    return read_text(find_data(name), MAX_CSV_BYTES)


def ask(state: AppState, files: Sequence[Measured], keys: str, *, robust: bool) -> Question:
    """Ask for the errors of what a state shows."""
    return Question(
        Identity(state.scene),
        tuple(state.amplitudes.items()),
        tuple(state.positions.items()),
        tuple(files),
        keys.strip(),
        robust,
        scene_of(state),
    )


def answer(question: Question, cancelled: threading.Event, tell: Tell) -> Answer:
    """Calibrate."""

    def watch() -> None:
        if cancelled.is_set():
            raise StoppedError("cancelled")

    if len(question.keys) > LONGEST_KEYS:
        raise OptionError(f"parameters to find: expected at most {LONGEST_KEYS} characters")
    scene, typed = question.start, question.keys
    (fit,) = (one for one in options_of(Calibrate) if one.name == "fit")
    keys = fit.read(typed, scene) if typed else None
    request = Calibrate(fit=keys, robust=question.robust, next_count=MOST_NEXT)
    tell("Waiting for another fit …")
    with taken_turn(watch):
        tell("Fitting …")
        sets = [parse_readings(one.text, one.name, scene, one.kind) for one in question.files]
        return Answer(question, request.find(scene, sets, (), watch))


def is_applied(state: AppState, given: Answer) -> bool:
    """Tell whether a state is the calibrated scene, as it was applied."""
    return state.scene is given.found.scene and not state.changed_keys


def with_calibrated_beside(state: AppState, given: Answer) -> AppState:
    """Compare what is steered (A) with the calibrated scene (B), which is drawn."""
    after = replace(scene_side(given.found.scene), title=AFTER)
    comparison = replace(state.comparison, a=Side(), b=after, shown="b")
    return replace(state, comparison=comparison)


def calibrated_state(state: AppState, given: Answer) -> AppState:
    """Show the calibrated scene as what is steered; the state before it is the other side."""
    opened = replace(state.with_scene(given.found.scene), loop=state.loop, placed=state.placed)
    return with_before(opened, Side(BEFORE, plain_state(state)))
