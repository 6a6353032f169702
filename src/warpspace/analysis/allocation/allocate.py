"""Allocation: the widest tolerances that keep a limit of |E| with a given probability."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.allocation.ensemble import Ensemble, build_ensemble, refuse_many_points
from warpspace.analysis.allocation.scaling import largest_scale, scales_within
from warpspace.analysis.allocation.search import (
    MOST_STEPS,
    Task,
    sample_scale,
    scaled,
    search_widths,
)
from warpspace.analysis.allocation.wish import Allocation, Wish
from warpspace.analysis.distribution import Probability
from warpspace.analysis.draws import Draws
from warpspace.analysis.montecarlo import Plan, montecarlo, sample_chunks
from warpspace.analysis.nodes import Over, node_gains
from warpspace.analysis.points import choose_cylinder, extreme_places, random_places
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.units import Array

DIGITS = 3
"""Significant digits of an allocated half width; it is rounded down, so that the limit is kept."""
NO_EFFECT = 1e-18
"""Mean squared gain, µm² per µm² or µrad², below which a parameter moves no point."""
SEARCHED, WIDENED, CHECKED = 0.4, 0.2, 0.4
"""Shares of the work: the search, the scale on new machines, the checks before and after."""
Progress = Callable[[float], object]


def allocate(
    model: Model,
    draws: Draws,
    workspace: Workspace,
    wish: Wish,
    view: View | None = None,
    plan: Plan | None = None,
    ensemble: Ensemble | None = None,
    progress: Progress | None = None,
) -> Allocation:
    """Find the tolerances of least cost that keep a limit with a probability.

    Parameters
    ----------
    model : Model
    draws : Draws
        The parameters of the loop with their present tolerances: centres and distribution stay; a
        half width of zero holds a parameter at its centre, and stays zero.
    workspace : Workspace
    wish : Wish
    view : View, optional
        The tool loop by default.
    plan : Plan, optional
        Samples, seed, `sampled` or `max`, cylinder and threads of scale and checks.
    ensemble : Ensemble, optional
        The machines of the search, of the same parameters and view; by default they are drawn. The
        result keeps the limit on them with the probability.
    progress : callable, optional
        Called with the share of the work that was done since the last call; what it raises ends the
        work.

    Returns
    -------
    Allocation

    Raises
    ------
    OptionError, UnknownNameError
        If a number is out of range, nothing is free, or what is fixed does not keep the limit.

    Notes
    -----
    Σ cost/w is minimised subject to P(|E| ≤ limit) ≥ probability. The proportions come from a
    search on a sample of machines (`search_widths`). All free tolerances are then scaled together,
    exactly (`largest_scale`), to what as many new machines as the plan says allow, and those of an
    ensemble that was given, and rounded down. A third, independent sample gives the probability.
    """
    view, plan = view or View(), plan or Plan()
    wish.check(model.machine.allowed_keys)
    plan = replace(plan, over=Over(plan.over), spec_um=wish.limit_um)
    plan.check()
    if plan.over is Over.MEAN:
        raise OptionError("over mean: expected sampled or max")
    if plan.over is Over.MAX:
        refuse_many_points(view.loop)
    report = progress or (lambda _: None)
    given = ensemble is not None
    ensemble = ensemble or build_ensemble(
        model,
        draws.keys,
        workspace,
        view,
        Over(plan.over),
        draws.distribution,
        clip=draws.clip,
        cylinder=plan.cylinder,
        seed=_seed(plan, 1),
    )
    task = _task(draws, wish, ensemble)
    steps: list[None] = []

    def step() -> None:
        steps.append(None)
        report(SEARCHED / MOST_STEPS)

    found = search_widths(task, step)
    report(SEARCHED * (1.0 - len(steps) / MOST_STEPS))
    scales = _new_scales(model, draws, workspace, view, plan, wish, report)

    def smaller_scale(half_width: Array, moving: NDArray[np.bool_]) -> float | None:
        found = [scales(half_width, moving)]
        if given:
            found.append(sample_scale(task, half_width, moving))
        known = [scale for scale in found if scale is not None]
        return min(known) if len(known) == len(found) else None

    found = None if found is None else scaled(task, found, smaller_scale)
    if found is None:
        raise OptionError(_why_not(task))
    half_width = np.where(task.free, round_down(found), draws.half_width)
    check = replace(plan, seed=_seed(plan, 3))

    def probability(half: Array) -> Probability:
        result = montecarlo(
            model,
            replace(draws, half_width=half),
            workspace,
            view,
            check,
            lambda count: report(CHECKED / 2.0 * count / plan.samples),
        )
        assert result.probability is not None  # noqa: S101 - the plan has a limit
        return result.probability

    return Allocation(
        wish,
        draws,
        half_width,
        task.free,
        probability(draws.half_width),
        probability(half_width),
        task.spent(draws.half_width),
        task.spent(half_width),
        check.samples,
        check.seed,
    )


def round_down(widths: Array) -> Array:
    """Round positive numbers down to `DIGITS` significant digits; what is rounded already stays."""
    found = np.zeros_like(widths)
    for index, width in enumerate(widths):
        if width > 0.0:
            places = DIGITS - 1 - math.floor(math.log10(width))
            nearest = round(float(width), places)
            step = 10.0**-places
            found[index] = nearest if nearest <= width else round(nearest - step, places)
    return found


def _seed(plan: Plan, use: int) -> int:
    """Derive the seed of an independent sample from that of the plan."""
    return int(np.random.SeedSequence((plan.seed, use)).generate_state(1)[0])


def _task(draws: Draws, wish: Wish, ensemble: Ensemble) -> Task:
    """Say what is to be minimised.

    Raises
    ------
    OptionError
        If nothing is free.
    """
    moves = ensemble.mean_square_gain > NO_EFFECT
    fixed = np.array([key in wish.fixed for key in draws.keys])
    free = moves & (draws.half_width > 0.0) & ~fixed
    if not free.any():
        raise OptionError(
            "nothing to allocate: every tolerance is fixed, zero, or without effect on the error in"
            " this loop; expected one or more that are free"
        )
    cost = np.array([wish.costs.get(key, 1.0) for key in draws.keys])
    return Task(
        ensemble,
        draws.centre,
        draws.half_width,
        free,
        cost,
        wish.limit_um,
        wish.probability,
        wish.widest,
    )


def _new_scales(
    model: Model,
    draws: Draws,
    workspace: Workspace,
    view: View,
    plan: Plan,
    wish: Wish,
    report: Progress,
) -> Callable[[Array, NDArray[np.bool_]], float | None]:
    """Give the largest scale of tolerances on new machines, chunk by chunk."""
    plan = replace(plan, seed=_seed(plan, 2))
    cylinder = choose_cylinder(model, plan.cylinder) if view.loop is Loop.WORKPIECE else None
    common = None
    if plan.over is Over.MAX:
        places = extreme_places(model, view.loop, workspace, cylinder, plan.nodes)
        common = node_gains(model, draws.keys, view, places)

    def scale(half_width: Array, moving: NDArray[np.bool_]) -> float | None:
        drawn = replace(draws, half_width=half_width)

        def chunk(rng: np.random.Generator, count: int) -> Array:
            amplitudes = drawn.draw(rng, count)
            base = np.where(moving, draws.centre, amplitudes)
            move = amplitudes - base
            if common is not None:
                return scales_within(base @ common, move @ common, wish.limit_um)
            places = random_places(model, view.loop, workspace, cylinder, rng, count)
            gains = node_gains(model, draws.keys, view, places)
            base_um = np.einsum("nk,ckn->cn", base, gains)
            return scales_within(base_um, np.einsum("nk,ckn->cn", move, gains), wish.limit_um)

        found: list[Array] = []
        for part in sample_chunks(chunk, plan):
            found.append(part)
            report(WIDENED * len(part) / plan.samples)
        return largest_scale(np.concatenate(found), wish.probability)

    return scale


def _why_not(task: Task) -> str:
    """Say why no width keeps the limit."""
    held = np.where(task.free, 0.0, task.half_width)
    norm = task.ensemble.norm_um(task.centre, held)
    share = float(np.mean(norm <= task.limit_um))
    return (
        f"no tolerance, however narrow, keeps {task.limit_um:g} µm on"
        f" {100.0 * task.probability:g} % of the machines: with all free ones at zero,"
        f" {100.0 * share:.1f} % keep it; expected a larger limit, a smaller probability, fewer"
        " fixed tolerances, or centres nearer to zero"
    )
