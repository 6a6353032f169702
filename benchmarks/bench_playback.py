"""Playback: processor time of the server for each picture, of all that the bar plays."""

import sys
import time
from dataclasses import replace
from pathlib import Path

from bench_program import program
from table import Row, Section
from timing import best

from warpspace import load_scene
from warpspace.app.browser import actions as do
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.server.session import Session
from warpspace.app.state.app_state import AppState, start_state

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
from app.wire import Wire, opened

PLAYED_S, SETTLED_S, BLOCKS = 5.0, 3.0, 500
STEPS = 5
MAX_S = 0.02


def picture_s(wire: Wire, session: Session, track: str) -> float:
    """Play a track for a while; return the processor time of the session for each picture, s."""
    wire.read_until(lambda: False, seconds=SETTLED_S)
    pictures, clock = list[int](), time.pthread_getcpuclockid(session.worker.ident or 0)
    session.context.player.followers["benchmark"] = lambda: pictures.append(1)
    wire.say(do.Input.PLAY(track))
    wire.read_until(lambda: bool(pictures))
    start, first, end = time.clock_gettime(clock), len(pictures), time.monotonic() + PLAYED_S
    wire.read_until(lambda: time.monotonic() > end)
    spent, count = time.clock_gettime(clock) - start, len(pictures) - first
    wire.say(do.Signal.STOP_PLAYBACK)
    return spent / count


def step_s(wire: Wire, session: Session) -> float:
    """Go through a story; return the processor time until a step is shown, s."""
    wire.read_until(lambda: False, seconds=SETTLED_S)
    clock, spent = time.pthread_getcpuclockid(session.worker.ident or 0), 0.0
    wire.say(do.Signal.START_STORY)
    for number in range(2, STEPS + 2):
        wire.read_until(lambda: f"{number - 1} of" in wire.pieces.get("story", ""))  # noqa: B023
        wire.read_until(lambda: False, seconds=SETTLED_S)
        start = time.clock_gettime(clock)
        wire.say(do.Signal.NEXT_STEP)
        wire.read_until(lambda: f"{number} of" in wire.pieces["story"])  # noqa: B023
        spent += time.clock_gettime(clock) - start
    return spent / STEPS


def with_program(state: AppState, text: str) -> AppState:
    """Load a program."""
    return replace(state, part=replace(state.part, program=text, program_name="a.nc"))


def measure() -> Section:
    """Measure the table, a program, the exaggeration, and the steps of a story."""
    first = load_scene("dvf5000_first")
    live, state = LiveModel(), start_state(first)
    model = best(lambda: live.evaluate(state), 20)
    times: dict[str, float] = {}
    with opened(first) as (wire, session):
        times["exaggeration playback"] = picture_s(wire, session, "exaggeration")
        wire.say(do.ShowDrawing("rotary"))
        times["table playback"] = picture_s(wire, session, "C")
        wire.say(do.ShowDrawing("volume"))
        text = program(BLOCKS)
        session.context.post(lambda now: with_program(now, text))
        wire.read_until(lambda: session.context.picture.path is not None)
        times[f"program playback, {BLOCKS} blocks"] = picture_s(wire, session, "program")
    with opened(load_scene("review_dvf5000")) as (wire, session):
        times["step of a story"] = step_s(wire, session)
    rows = [
        Row(f"{name}, a picture", seconds, "the model alone", model, max_value=MAX_S)
        for name, seconds in times.items()
    ]
    text = "Processor time of the session of a tab, with everything that is drawn and written."
    return Section("Playback", text, rows)
