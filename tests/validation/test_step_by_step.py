"""Step by step: machines of unknown stiffness reach a limit in half the cycles of single acts."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from warpspace.analysis.adjuster_effects import add_effects, adjuster_effects
from warpspace.analysis.commands.adjust import Adjust
from warpspace.analysis.statistics import volume_statistics
from warpspace.field.grid import build_grid
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate_grid

MACHINES, BLOCK = 500, 10
SCENE = """
[machine]
chain = "wFXYZt"
[machine.offset_mm]
Y = [0, 0, 100]
Z = [0, 100, 200]
[machine.travel]
X = [-400, 400]
Y = [-300, 300]
Z = [-400, 0]
[uncertainty]
EC0Y = 0.5
EA0Y = 0.5
EA0Z = 0.5
EB0Z = 0.5
"""
SUPPORT = """
[[machine.adjusters]]
name = "{} {}"
body = "{}"
kind = "jack screw"
at_mm = {}
direction = {}
pitch_mm = 0.05
step = 0.05
range = [-8, 8]
"""
FEET = {
    "Z": ((-300, -200, 250), (300, -200, 250), (0, 300, 250)),
    "Y": ((-300, 0, 0), (300, 0, 0), (0, 0, 400)),
}
DIRECTIONS = {"Z": [0, 0, 1], "Y": [0, 1, 0]}
KEYS = ("EC0Y", "EA0Y", "EA0Z", "EB0Z")
LIMIT_UM, SPREAD_URAD, U_URAD, MOST_CYCLES = 12.0, 120.0, 0.5, 30
BASE = parse_scene(
    SCENE
    + "".join(
        SUPPORT.format(body, n, body, list(at), DIRECTIONS[body])
        for body, places in FEET.items()
        for n, at in enumerate(places)
    ),
    "simulated",
)


def cycles(rng, log, *, at_once):
    """Count the measurements until the largest error is within the limit."""
    factors = {a.name: rng.uniform(0.7, 1.3) for a in BASE.machine.adjusters}
    effects = adjuster_effects(BASE, factors)
    errors = ErrorSet({k: Constant((0.0, 1.0), rng.normal(0.0, SPREAD_URAD)) for k in KEYS})
    grid = build_grid(BASE.model, BASE.workspace, 3)
    log.write_text("")
    for cycle in range(MOST_CYCLES):
        actual = replace(BASE, errors=errors)
        if volume_statistics(evaluate_grid(actual, grid, BASE.view()), grid).max_um <= LIMIT_UM:
            return cycle
        noisy = {
            key: Constant((0.0, 1.0), errors.amplitude(key) + rng.normal(0.0, U_URAD))
            for key in KEYS
        }
        measured = replace(BASE, errors=ErrorSet(noisy))
        plan = Adjust(
            grid=3,
            objective="max",
            count=6 if at_once else 1,
            unconstrained=True,
            done=str(log) if at_once else None,
            log=str(log) if at_once else None,
        ).run(measured)
        for text in plan.updated_files().values():
            log.write_text(text)
        if not plan.adjustments:
            return MOST_CYCLES
        change = {act.adjuster: act.change for act in plan.adjustments[-1].acts}
        steps = [change.get(adjuster.name, 0.0) for adjuster in BASE.machine.adjusters]
        errors = add_effects(actual, effects, steps)
    return MOST_CYCLES


@cache
def count_cycles(first, last):
    """Count the cycles of simulated machines, [n, 2]: planned, and one act at a time."""
    with TemporaryDirectory() as folder:
        log = Path(folder) / "log.toml"
        return np.array(
            [
                [cycles(np.random.default_rng(seed), log, at_once=way) for way in (True, False)]
                for seed in range(first, last)
            ]
        )


def check_cycles(numbers):
    planned, single = numbers.mean(axis=0)
    print(f"{len(numbers)} machines: {planned:.2f} cycles planned, {single:.2f} one act at a time")
    assert numbers[:, 0].max() < MOST_CYCLES
    assert planned <= 0.5 * single


def test_all_acts_at_once_with_learned_stiffness_halve_the_cycles():
    check_cycles(count_cycles(0, 3))


@pytest.mark.nightly
@pytest.mark.parametrize("first", range(0, MACHINES, BLOCK))
def test_a_block_of_machines_needs_half_the_cycles(first):
    """A block of the machines of the next test, which takes longer than one test may."""
    check_cycles(count_cycles(first, first + BLOCK))


@pytest.mark.nightly
def test_five_hundred_machines_need_half_the_cycles():
    blocks = [count_cycles(first, first + BLOCK) for first in range(0, MACHINES, BLOCK)]
    check_cycles(np.concatenate(blocks))
