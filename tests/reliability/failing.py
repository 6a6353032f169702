"""States that cannot be evaluated: an exception at each stage, in a review of two tabs."""

import random
import time
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

from app.wire import Wire, dial, end_work
from reliability.outcome import Outcome
from warpspace.app.browser import actions as do
from warpspace.app.drawing.box import BoxLayer
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.evaluation import live_picture
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels.error_list import ErrorsPanel
from warpspace.app.panels.overlay import HeadPanel, LegendPanel, OrderPanel
from warpspace.app.panels.page_panels import TopPanel
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import OptionError
from warpspace.scene.library import load_scene

SCENE = "part_on_dvf5000"
PATIENCE_S = 20.0
BAD = 13.25
"""Value of EXX that makes a state fail."""
STAGES: dict[str, tuple[object, str]] = {
    "field": (LiveModel, "evaluate"),
    "part": (live_picture, "part_overlay"),
    "program": (live_picture, "path_overlay"),
    "map": (BoxLayer, "show"),
    "around the map": (MovingLayer, "show"),
    "at rest": (BoxLayer, "synchronise"),
    "heading": (HeadPanel, "render"),
    "legend": (LegendPanel, "render"),
    "conditions": (OrderPanel, "render"),
    "panel": (ErrorsPanel, "render"),
    "bar at the top": (TopPanel, "render"),
}
ERRORS: tuple[Callable[[], Exception], ...] = (
    lambda: OverflowError("int too large to convert to float"),
    lambda: OptionError("x: expected y"),
    MemoryError,
    RecursionError,
    lambda: KeyError("EXX"),
    lambda: ZeroDivisionError("division by zero"),
)
WAYS = ("edit", "undo", "redo")


@contextmanager
def failing(stage: str, raised: Callable[[], Exception]) -> Generator[None]:
    """Have a stage fail for each state with the bad value, and count nothing else."""
    owner, name = STAGES[stage]
    original: Callable[..., Any] = getattr(owner, name)

    def fail(*args: Any, **how: Any) -> Any:
        states = (one if isinstance(one, AppState) else getattr(one, "state", None) for one in args)
        if any(isinstance(one, AppState) and one.amplitudes["EXX"] == BAD for one in states):
            raise raised()
        return original(*args, **how)

    with patch.object(owner, name, fail):
        yield


@dataclass
class Review:
    """Two tabs of a shared review."""

    wires: tuple[Wire, Wire]
    sessions: tuple[Session, ...]
    edits: int = 0

    def set(self, key: str, value: float, tab: int = 0) -> bool:
        """Set an error from one tab; tell whether both show it."""
        self.wires[tab].say(do.SetError(key, f"{value:g}"))
        return self.shown(key, value)

    def shown(self, key: str, value: float) -> bool:
        text = f'data-text="{value:g}"'
        return self.until(lambda wire: text in wire.pieces.get(f"error.{key}", ""))

    def until(self, fine: Callable[[Wire], bool]) -> bool:
        """Read both tabs in turn, so that neither is held up, until something holds of them."""
        end = time.monotonic() + PATIENCE_S
        while not all(map(fine, self.wires)):
            if time.monotonic() > end:
                return False
            for wire in self.wires:
                wire.read_until(lambda wire=wire: fine(wire), 0.0)
        return True

    def fail(
        self, stage: str, raised: Callable[[], Exception], way: str, value: float
    ) -> list[str]:
        """Make a state fail; list what does not go on as it should."""
        first, faults = self.wires[0], list[str]()
        if not self.set("EXX", value):
            return ["the tabs do not follow"]
        if way != "edit":  # the state that fails later is made while nothing fails yet
            # between two changes of one slider others stand, so that each is a step
            self.set("EZX", value)
            self.set("EXX", BAD)
            self.set("EZX", value + 1.0)
        if way == "undo":
            value = round(value + 1.0, 2)  # as it is typed
            self.set("EXX", value)
        elif way == "redo":
            first.say(do.Signal.UNDO)
            first.say(do.Signal.UNDO)
            if not self.shown("EXX", value):
                return [f"{stage}: the steps are not undone"]
        for wire in self.wires:
            wire.toasts.clear()
        if not self.until(
            lambda _: all(one.display.scheduler.due_in_s is None for one in self.sessions)
        ):
            faults.append("the tabs do not come to rest")
        time.sleep(0.05)  # the last part may still be written
        with failing(stage, raised):
            first.say(do.SetError("EXX", f"{BAD:g}") if way == "edit" else do.Signal(way))
            if not self.until(has_message):
                faults.append("a tab has no message")
            if not self.shown("EXX", value) or self.sessions[0].state.amplitudes["EXX"] != value:
                faults.append("the state is not reverted")
            for tab, key in enumerate(("EYX", "EBX")):
                self.edits += 1
                if not self.set(key, self.edits % 90 + 0.5, tab):
                    faults.append(f"edits of tab {tab + 1} have no effect")
        return [f"{stage}, {way}, {type(raised()).__name__}: {fault}" for fault in faults]


def has_message(wire: Wire) -> bool:
    return any(title == "The change was reverted" for _, title, _ in wire.toasts)


@contextmanager
def reviewed() -> Generator[Review]:
    """Open two tabs of a shared review of their own."""
    with Viewer(load_scene(SCENE), shared=True) as viewer, ExitStack() as stack:
        wires = [Wire(stack.enter_context(dial(viewer))) for _ in range(2)]
        for wire in wires:
            assert wire.read_until(lambda wire=wire: wire.is_open, 60.0)
        yield Review((wires[0], wires[1]), viewer.sessions)
        end_work(viewer)


def run(count: int) -> Outcome:
    chance, faults, tried = random.Random(35), list[str](), Counter[str]()
    with reviewed() as review:
        for number in range(count):
            stage = [*STAGES][number % len(STAGES)]
            way = chance.choice(WAYS)
            # none of the values is set twice within 300 states: what is set already is no step
            value = round(1.0 + 0.01 * (37 * number % 800), 2)
            faults += review.fail(stage, chance.choice(ERRORS), way, value)
            tried[stage] += 1
    return Outcome(
        count,
        f"{len(tried)} stages, {len(ERRORS)} kinds of exceptions, by an edit, undo and redo: each"
        " state reverted, with a message in both tabs, whose next edits had their effect",
        faults,
    )
