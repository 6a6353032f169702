"""Options of every analysis that draws machines from the tolerances of a scene."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from warpspace.analysis.description import Analysis
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, Grammar, option
from warpspace.analysis.sampling.cases import (
    DEFAULT_NODES,
    DEFAULT_SAMPLES,
    Case,
    Cylinder,
    Reduction,
    SamplingPlan,
)
from warpspace.analysis.sampling.distribution import Distribution, Draws, build_draws
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import LOCAL_WORKERS, SAMPLES
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_number


def read_cylinder(text: str, _scene: Scene | None = None) -> Cylinder:
    first, _, second = text.lower().replace("×", "x").partition("x")
    try:
        return Cylinder(parse_number(first), parse_number(second))
    except ValueError:
        raise ValueError("expected diameter x height in mm, as in 550x450") from None


def scene_draws(scene: Scene, loop: Loop, distribution: Distribution | str, *, clip: bool) -> Draws:
    keys = loop_keys(scene.model, loop, scene.parameter_keys)
    return build_draws(scene.tolerances, keys, distribution, clip=clip, source=scene.name)


@dataclass(frozen=True, kw_only=True)
class Sampled(Analysis):
    """An analysis of machines within tolerance."""

    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    distribution: Distribution | None = option(
        None,
        "uniform over the tolerance, or normal with 3σ = half width",
        unset="uniform",
    )
    clip: bool = option(
        False,
        "Whether the normal distribution ends at the tolerance limits",
        flag="--clip/--no-clip",
        label="Ends at the limits",
    )
    cylinder: Annotated[Cylinder | None, Grammar("DIAMETERxHEIGHT", read_cylinder)] = option(
        None,
        "Workpiece loop: largest workpiece in mm, over whose volume the points are spread",
        unset="the one whose top rim the scene's workpiece point lies on: 550x450 on the DVF5000",
    )
    seed: int = option(
        0, "Seed of the random numbers; the same seed gives the same numbers", low=0, high=2**63 - 1
    )

    @property
    def drawn(self) -> Distribution:
        return self.distribution or Distribution.UNIFORM

    def draws(self, scene: Scene) -> Draws:
        return scene_draws(scene, scene.view(self.loop).loop, self.drawn, clip=self.clip)

    def case(self, scene: Scene, plan: SamplingPlan) -> Case:
        return Case(scene.model, self.draws(scene), scene.workspace, scene.view(self.loop), plan)


@dataclass(frozen=True, kw_only=True)
class SampledMachines(Sampled):
    """An analysis of a sample of machines within tolerance."""

    samples: int = option(
        DEFAULT_SAMPLES,
        "Number of machines drawn from the tolerances",
        low=SAMPLES[0],
        high=SAMPLES[1],
    )

    def plan(
        self, reduction: Reduction, limit_um: float | None, nodes: int = DEFAULT_NODES
    ) -> SamplingPlan:
        return SamplingPlan(self.samples, self.seed, reduction, nodes, limit_um, self.cylinder)


@dataclass(frozen=True, kw_only=True)
class KeptLimit(SampledMachines):
    """An analysis of the share of machines within a limit."""

    over: Literal["max", "sampled"] = option(
        "max",
        "|E| of a machine: the largest in the volume (max), so that a limit is kept everywhere, or"
        " at one random point (sampled)",
    )
    workers: int | None = option(
        None,
        "Threads; the result does not depend on it",
        low=LOCAL_WORKERS[0],
        high=LOCAL_WORKERS[1],
        unset="one per core",
    )

    @property
    def where(self) -> str:
        return "everywhere" if self.over == "max" else "at a random point"

    def plan_of(self, limit_um: float | None) -> SamplingPlan:
        return replace(self.plan(Reduction(self.over), limit_um), workers=self.workers)
