"""Tolerances allocated for what a state shows: beside the session, one at a time."""

import threading
from dataclasses import replace

import numpy as np

from warpspace.analysis.allocation import Allocation, Ensemble, Progress, Wish, allocate
from warpspace.analysis.draws import Distribution, Draws
from warpspace.analysis.montecarlo import Plan
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.specification import read_costs
from warpspace.machine.tolerances import Tolerance

POLL_S = 0.1
_TURN = threading.Lock()
"""One allocation at a time for all tabs together, so that sliders stay quick."""


def allocate_tolerances(
    state: AppState, ensemble: Ensemble, cancelled: threading.Event, progress: Progress
) -> Allocation | None:
    """Allocate the tolerances of a state for its specification.

    Parameters
    ----------
    state : AppState
    ensemble : Ensemble
        The machines that the probability on the page is estimated from.
    cancelled : threading.Event
        Ends the work when set.
    progress : callable
        Called with the share of the work that was done since the last call.

    Returns
    -------
    Allocation or None
        None where it was cancelled.

    Raises
    ------
    OptionError
        If nothing is free, or what is fixed does not keep the limit.
    """

    def report(share: float) -> None:
        if cancelled.is_set():
            raise _CancelledError
        progress(share)

    while not _TURN.acquire(timeout=POLL_S):
        if cancelled.is_set():
            return None
    try:
        return allocate(
            state.scene.model,
            _draws(state, ensemble),
            state.scene.workspace.moved(state.positions),
            _wish(state),
            state.scene.view(state.loop),
            # one thread: the others are for who moves sliders meanwhile
            Plan(over=ensemble.over, workers=1),
            ensemble,
            report,
        )
    except _CancelledError:
        return None
    finally:
        _TURN.release()


class _CancelledError(Exception):
    """Ends an allocation that nobody waits for any more."""


def with_allocated(state: AppState, asked: AppState, found: Allocation) -> AppState:
    """Give a state the tolerances that were allocated for an earlier one.

    Parameters
    ----------
    state : AppState
        What is shown now.
    asked : AppState
        What the tolerances were allocated for.
    found : Allocation

    Returns
    -------
    AppState
        Unchanged but for a note where what they depend on has changed meanwhile.
    """
    same = (
        state.origin is asked.origin
        and state.amplitudes.keys() == asked.amplitudes.keys()
        and state.loop == asked.loop
        and state.tolerances == asked.tolerances
        and state.specification == asked.specification
    )
    if not same:
        note = "tolerances or limit were changed while tolerances were allocated: allocate again"
        return replace(state, notes=(*state.notes, note))
    return edits.with_half_widths(state, found.tolerances)


def _draws(state: AppState, ensemble: Ensemble) -> Draws:
    """Collect the present tolerances; a parameter without one is held at zero."""
    none = Tolerance(0.0, 0.0)
    own = [state.tolerances.get(key) or none for key in ensemble.keys]
    return Draws(
        ensemble.keys,
        np.array([tolerance.centre for tolerance in own]),
        np.array([tolerance.half_width for tolerance in own]),
        Distribution(state.specification.distribution),
    )


def _wish(state: AppState) -> Wish:
    """Say what is to be kept; fixed keys and costs of another machine are left out."""
    wanted, known = state.specification, state.amplitudes.keys()
    fixed = wanted.fixed & known
    every = read_costs(wanted.costs, {*known, *_keys_of(wanted.costs)})
    costs = {key: cost for key, cost in every.items() if key in known and key not in fixed}
    return Wish(wanted.limit_um, wanted.percent / 100.0, costs, frozenset(fixed))


def _keys_of(costs: str) -> set[str]:
    """List the keys of a spelt list of costs."""
    return {pair.partition("=")[0] for pair in costs.split(",") if pair}
