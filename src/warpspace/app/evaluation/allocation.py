"""Tolerances allocated for what a state shows: beside the session, one at a time."""

import threading
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.analysis.allocate import Allocate, AllocateResult, Progress, allocate
from warpspace.analysis.allocating import SAMPLES
from warpspace.analysis.cases import Case, Plan
from warpspace.analysis.distribution import Distribution, Draws
from warpspace.app.evaluation.cache import taken_turn
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.specification import read_costs
from warpspace.machine.errors import Tolerance


def allocate_tolerances(
    state: AppState, keys: Sequence[str], cancelled: threading.Event, progress: Progress
) -> AllocateResult | None:
    """Allocate the tolerances of a state for its specification."""

    def report(share: float) -> None:
        if cancelled.is_set():
            raise _CancelledError
        progress(share)

    try:
        with taken_turn(lambda: report(0.0)):
            # one thread: the others are for who moves sliders meanwhile
            plan = Plan(SAMPLES, over=state.specification.over, workers=1)
            workspace = state.scene.workspace.moved(state.positions)
            case = Case(state.scene.model, _draws(state, keys), workspace, state.view(), plan)
            return allocate(case, _asked(state), report)
    except _CancelledError:
        return None


class _CancelledError(Exception):
    """Ends an allocation that nobody waits for any more."""


def with_allocated(state: AppState, asked: AppState, found: AllocateResult) -> AppState:
    """Give a state the tolerances that were allocated for an earlier one."""
    same = (
        state.origin is asked.origin
        and state.amplitudes.keys() == asked.amplitudes.keys()
        and state.seen == asked.seen
        and state.tolerances == asked.tolerances
        and state.specification == asked.specification
    )
    if not same:
        note = "tolerances or limit were changed while tolerances were allocated: allocate again"
        return replace(state, notes=(*state.notes, note))
    return edits.with_half_widths(state, found.tolerances)


def _draws(state: AppState, keys: Sequence[str]) -> Draws:
    none = Tolerance(0.0, 0.0)
    own = [state.tolerances.get(key) or none for key in keys]
    return Draws(
        tuple(keys),
        np.array([tolerance.centre for tolerance in own]),
        np.array([tolerance.half_width for tolerance in own]),
        Distribution(state.specification.distribution),
    )


def _asked(state: AppState) -> Allocate:
    wanted, known = state.specification, state.amplitudes.keys()
    fixed = wanted.fixed & known
    every = read_costs(wanted.costs, {*known, *_keys_of(wanted.costs)})
    costs = {key: cost for key, cost in every.items() if key in known and key not in fixed}
    return Allocate(
        limit_um=wanted.limit_um,
        probability=wanted.percent / 100.0,
        costs=tuple(costs.items()),
        fixed=tuple(fixed),
    )


def _keys_of(costs: str) -> set[str]:
    return {pair.partition("=")[0] for pair in costs.split(",") if pair}
