"""Comparison of machine concepts with the same tolerances."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from string import ascii_uppercase
from typing import Any

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.commands.contributions import (
    ContributionsResult,
    Share,
    variance_contributions,
)
from warpspace.analysis.commands.montecarlo import sampled_second_order
from warpspace.analysis.description import ProgressCallback, Result, count_progress
from warpspace.analysis.options import option
from warpspace.analysis.sampling import machine_sampling
from warpspace.exceptions import SceneError
from warpspace.field.evaluate import build_basis
from warpspace.field.grid import Grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import TOLERANCE_CLASSES, ErrorSet, ToleranceSet
from warpspace.machine.limits import LIMIT_UM, MOST_CONCEPTS
from warpspace.scene.model import Scene
from warpspace.units import Array, spell_fixed

THREE = ("mean", "P95", "max")
NAMED = 3  # errors that are named of each machine
LETTERS = ascii_uppercase[:MOST_CONCEPTS]  # what the machines are called, in their order


@dataclass(frozen=True, slots=True)
class Concept:
    """One machine of a comparison."""

    scene: Scene  # with the tolerances that were taken, its errors absolute
    sampled: machine_sampling.SampleStatistics  # |E| of machines within tolerance
    # what each tolerance adds to the variance of E, the largest first
    shares: ContributionsResult

    @property
    def leading(self) -> tuple[Share, ...]:
        return self.shares.rows[:NAMED]

    @property
    def json_fields(self) -> dict[str, Any]:
        sampled = self.sampled
        return {
            "scene": self.scene.name,
            "title": self.scene.title,
            "chain": str(self.scene.machine.chain),
            "mean_um": sampled.mean_um,
            "p95_um": sampled.p95_um,
            "max_um": sampled.max_um,
            **dict(zip(("probability", "low", "high"), sampled.interval, strict=True)),
            "rms_um": self.shares.rms_um,
            "errors": [
                {
                    "key": row.key,
                    "name": parameter(row.key).name,
                    "half_width": row.half_width,
                    "unit": row.unit,
                    "share": row.share,
                }
                for row in self.leading
            ],
        }


@dataclass(frozen=True, kw_only=True)
class Concepts(machine_sampling.KeptLimit):
    """Compare machines before one of them is built.

    Machines of each SCENE are sampled within the same tolerances: those of the first one for
    translations, rotations and squareness. The output contains mean, P95 and largest |E|, the share
    of machines within the limit, and the three errors that contribute most to the variance of E.
    Errors are absolute; the reference point of a scene is ignored. `warpspace montecarlo` and
    `warpspace contributions` evaluate one machine in detail.
    """

    name = "concepts"
    task = "design"
    scenes = (1, MOST_CONCEPTS)
    doing = "sampling"
    has_table = True
    loop: Loop = option(
        Loop.RELATIVE,
        "Tool relative to workpiece, so that axes count on either side; or one of both alone",
    )
    limit_um: float | None = option(
        None,
        "Limit of |E|, for the share of machines within it",
        unit="µm",
        low=LIMIT_UM[0],
        high=LIMIT_UM[1],
        flag="--limit",
        unset="that of the scenes",
    )
    own_tolerances: bool = option(
        False, "Each scene with its own tolerances instead of those of the first one by class"
    )

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ConceptsResult":
        return self.run_all((scene,), watch)

    def run_all(self, scenes: Sequence[Scene], watch: ProgressCallback, /) -> "ConceptsResult":
        limit_um = machine_sampling.limit_or_that_of(scenes, self.limit_um)
        analysis = replace(self, limit_um=limit_um)
        progress = count_progress(watch, self.samples * len(scenes))
        concepts = compare_concepts(scenes, analysis, progress=progress)
        left_out = sampled_second_order(*(concept.sampled for concept in concepts))
        return ConceptsResult(analysis=analysis, concepts=concepts, second_order=left_out)


@dataclass(frozen=True, kw_only=True)
class ConceptsResult(Result):
    """Machines side by side."""

    analysis: Concepts
    concepts: tuple[Concept, ...]

    def json_fields(self) -> dict[str, Any]:
        analysis = self.analysis
        default = dict(self.concepts[0].scene.tolerances.default)
        return {
            "loop": str(analysis.loop),
            "over": analysis.over,
            "distribution": str(analysis.drawn),
            "samples": analysis.samples,
            "seed": analysis.seed,
            "limit_um": analysis.limit_um,
            "own_tolerances": analysis.own_tolerances,
            "tolerances": None if analysis.own_tolerances else default,
            "concepts": [concept.json_fields for concept in self.concepts],
        }

    def blocks(self) -> Iterator[Block]:
        analysis, first = self.analysis, self.concepts[0].scene
        default = ", ".join(f"{name} ±{v:g}" for name, v in first.tolerances.default.items())
        tolerances = f"the tolerances of {first.name}: {default} (µm, µrad)"
        if analysis.own_tolerances:
            tolerances = "each with its own tolerances"
        heading = f"{analysis.loop} loop · evaluated {analysis.where} · {analysis.drawn}"
        yield f"{heading} · {tolerances}"
        lettered = zip(LETTERS, self.concepts, strict=False)
        yield Table(self._columns(), [self._row(*pair) for pair in lettered])
        means = [concept.sampled.mean_um for concept in self.concepts]
        if len(set(means)) > 1:
            best = LETTERS[means.index(min(means))]
            yield f"  {best} has the smallest mean, {spell_fixed(min(means))} µm"

    def _columns(self) -> tuple[Column, ...]:
        limit = self.analysis.limit_um
        ranks = range(1, NAMED + 1)
        named = [name for rank in ranks for name in (f"error_{rank}", f"error_{rank}_share")]
        return (
            Column("", leads=True),
            Column("scene", leads=True, key="scene"),
            Column(key="title", shows=False),
            Column("chain", key="chain"),
            Column(key="loop", shows=False),
            *number_columns(THREE, unit="µm", keys=[f"{name.lower()}_um" for name in THREE]),
            Column(key="limit_um", shows=False),
            Column(key="probability", shows=False),
            Column(f"≤ {limit or 0.0:g} µm", ".2f", "%", shows=limit is not None),
            Column("largest contributions", unit="share of the variance", wraps=True),
            *(Column(key=name, shows=False) for name in named),
        )

    def _row(self, letter: str, concept: Concept) -> tuple[Any, ...]:
        sampled, scene, share = concept.sampled, concept.scene, concept.sampled.interval[0]
        leading = [value for row in concept.leading for value in (row.key, row.share)]
        return (
            letter,
            scene.name,
            scene.title,
            str(scene.machine.chain),
            str(sampled.case.view.loop),
            *(sampled.mean_um, sampled.p95_um, sampled.max_um),
            sampled.case.plan.spec_um,
            share,
            None if share is None else 100.0 * share,
            ", ".join(f"{row.key} {100.0 * row.share:.0f} %" for row in concept.leading),
            *leading,
            *[None] * (2 * NAMED - len(leading)),
        )


def compare_concepts(
    scenes: Sequence[Scene],
    analysis: Concepts | None = None,
    *,
    progress: machine_sampling.Progress | None = None,
) -> tuple[Concept, ...]:
    analysis = analysis or Concepts()
    concepts: list[Concept] = []
    for scene in with_equal_tolerances(scenes, own_tolerances=analysis.own_tolerances):
        case = analysis.case(scene, analysis.plan_of(analysis.limit_um))
        if not case.draws.variance.any():
            problem = (
                f"tolerances: none of the {analysis.loop} loop has a width; expected one above 0"
            )
            raise SceneError(scene.name, [problem])
        sampled = machine_sampling.montecarlo(case, progress=progress)
        concepts.append(Concept(scene, sampled, variance_contributions(case)))
    return tuple(concepts)


def with_equal_tolerances(scenes: Sequence[Scene], *, own_tolerances: bool) -> tuple[Scene, ...]:
    """Return scenes, errors absolute, with the tolerances of the first one by class."""
    absolute = [replace(scene, reference=None, placed=False) for scene in scenes]
    if own_tolerances or not scenes:
        return tuple(absolute)
    default = scenes[0].tolerances.default
    needed = {parameter(key).tolerance_class for scene in scenes for key in scene.parameter_keys}
    missing = [name for name in TOLERANCE_CLASSES if name in needed and name not in default]
    if missing:
        problem = (
            f"tolerances.default has no {', '.join(missing)}; expected a half width for each class,"
            " which all machines then have ({own_tolerances} takes those of each scene)"
        )
        raise SceneError(scenes[0].name, [problem])
    equal = ToleranceSet(dict(default))
    return tuple(replace(scene, tolerances=equal) for scene in absolute)


def expected_um(concept: Concept, grid: Grid) -> Array:
    """Compute the RMS of |E| of machines within tolerance at each node, [nx, ny, nz], µm."""
    case, draws = concept.sampled.case, concept.sampled.case.draws
    basis = build_basis(
        case.model, ErrorSet(), draws.keys, grid.coordinates, case.view, grid.point_mm
    )
    square = np.einsum("k,k...c->...", draws.variance, basis.position**2)
    middle = np.einsum("k,k...c->...c", draws.centre, basis.position)
    return np.broadcast_to(np.sqrt(square + np.sum(middle**2, axis=-1)), grid.shape)
