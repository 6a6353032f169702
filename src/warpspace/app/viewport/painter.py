"""Drafts in a process of their own, so that a busy server has a second core to work on.

Python runs one thread at a time. With many tabs dragging at once the model, the meshes and the text
are therefore worked out elsewhere, and this process only takes in and sends. The other one is
started when a server is busy for the first time; where it fails, everything is done here.
"""

import logging
import pickle
import signal
import threading
from collections import OrderedDict
from dataclasses import fields, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.drafts import Draft, build_draft
from warpspace.app.viewport.turns import Turns

logger = logging.getLogger(__name__)
STATES = 64
"""States that are known on both sides, but for their amplitudes; the oldest are forgotten."""
TIMEOUT_S = 10.0
FAILURES = (OSError, EOFError, pickle.PickleError, TypeError, AttributeError)
"""What a broken pipe, a process that has ended, or a state that cannot travel raises."""


class Painter:
    """Works out drafts, first come, first served; usable from any thread."""

    def __init__(self) -> None:
        self._sending, self._receiving = Turns(), Turns()
        self._pipe: Connection | None = None
        self._process: Any = None
        self._state = "idle"
        self._known: OrderedDict[tuple[int, ...], tuple[int, AppState]] = OrderedDict()
        self._count = 0

    def paint(self, state: AppState) -> Draft | None:
        """Work out the draft of a state.

        Parameters
        ----------
        state : AppState

        Returns
        -------
        Draft or None
            None while the other process starts, and where it cannot.
        """
        with self._sending:
            if self._state == "idle":
                self._state = "starting"
                threading.Thread(target=self._start, name="warpspace-painter", daemon=True).start()
            pipe = self._pipe
            if self._state != "ready" or pipe is None:
                return None
            try:
                self._send(pipe, state)
            except FAILURES as error:
                return self._fail(error)
            turn = self._receiving.ask()  # answers come in the order of the questions
        turn.acquire()
        try:
            return _receive(pipe)
        except FAILURES as error:
            with self._sending:
                return self._fail(error)
        finally:
            self._receiving.hand_on()

    def close(self) -> None:
        """End the other process."""
        with self._sending:
            self._end("idle")

    def _fail(self, error: Exception) -> None:
        """Go on without the other process."""
        if self._state == "ready":
            logger.error("the painter has failed; the app goes on without it: %s", error)
        self._end("failed")

    def _send(self, pipe: Connection, state: AppState) -> None:
        """Send a state, or what has changed of one that is known."""
        key = tuple(id(getattr(state, f.name)) for f in fields(state) if f.name != "amplitudes")
        known = self._known.get(key)
        if known is None:
            self._count += 1
            # the state is held, so that the ids in the key stay its own
            known = self._known[key] = (self._count, state)
            if len(self._known) > STATES:
                self._known.popitem(last=False)
            pipe.send((self._count, state))
        pipe.send((known[0], tuple(state.amplitudes.values())))

    def _start(self) -> None:
        """Start the other process and wait until it can work."""
        context = get_context("spawn")
        ours, theirs = context.Pipe()
        try:
            process: Any = context.Process(
                target=_work, args=(theirs,), name="warpspace-painter", daemon=True
            )
            process.start()
            theirs.close()
            ready = ours.poll(60.0) and ours.recv() == "ready"
        except (OSError, EOFError, RuntimeError):
            logger.exception("the painter could not be started; the app goes on without it")
            ready, process = False, None
        with self._sending:
            self._pipe, self._process = ours, process
            if self._state == "starting" and ready:
                self._state = "ready"
            else:
                self._end("failed")

    def _end(self, state: str) -> None:
        """Let the other process go."""
        self._state = state
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            self._process.terminate()
        self._pipe = self._process = None
        self._known.clear()


PAINTER = Painter()
"""Works out drafts for all tabs of this process."""


def _receive(pipe: Connection) -> Draft | None:
    """Wait for the next draft; None for one that has failed."""
    if not pipe.poll(TIMEOUT_S):
        raise TimeoutError(f"no draft within {TIMEOUT_S:g} s")
    found = pipe.recv()
    if isinstance(found, str):
        logger.error("a draft has failed: %s", found)
        return None
    return found


def _work(pipe: Connection) -> None:
    """Work out one draft after the other until nobody asks any more; runs in the other process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server
    live = LiveModel()
    states: OrderedDict[int, AppState] = OrderedDict()
    pipe.send("ready")
    while True:
        try:
            number, content = pipe.recv()
        except (EOFError, OSError):
            return
        if isinstance(content, AppState):
            states[number] = content
            if len(states) > STATES:
                states.popitem(last=False)
            continue
        known = states[number]
        values = dict(zip(known.amplitudes, content, strict=True))
        try:
            answer: Draft | str = build_draft(live.evaluate(replace(known, amplitudes=values)))
        except Exception as error:  # noqa: BLE001 - told to the one who asked, who logs it
            answer = f"{type(error).__name__}: {error}"
        pipe.send(answer)
