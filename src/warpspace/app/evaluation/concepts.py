"""Machines side by side: what is asked, and its answer, computed beside the session."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from warpspace.app.evaluation.cache import taken_turn
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.state.app_state import AppState
from warpspace.app.state.concept_choice import ConceptChoice
from warpspace.geometry.colour import ColourScale
from warpspace.kinematics.model import Loop
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.analysis.concepts import Concept, Concepts

NODES = 21  # nodes per axis that colours are chosen from; the pictures have the same


@dataclass(frozen=True, slots=True)
class Question:
    """All that a comparison depends on."""

    scenes: tuple[Scene, ...]
    limit_um: float
    own_tolerances: bool
    over: str
    loop: str

    def covers(self, other: "Question") -> bool:
        """Tell whether the answer holds all that another question asks; errors do not matter."""
        alike = replace(self, scenes=()) == replace(other, scenes=())
        if not alike or not (self.own_tolerances or _alike(self.scenes[:1], other.scenes[:1])):
            return False
        return all(any(_alike([one], [two]) for two in self.scenes) for one in other.scenes)

    def plan(self) -> "Concepts":
        """Say how machines are sampled: as the tolerances of one are, on one thread."""
        from warpspace.analysis.allocating import SAMPLES
        from warpspace.analysis.concepts import Concepts

        return Concepts(
            limit_um=self.limit_um, own_tolerances=self.own_tolerances, samples=SAMPLES,
            over="max" if self.over == "max" else "sampled", loop=Loop(self.loop), workers=1,
        )  # fmt: skip


def _alike(ones: Sequence[Scene], others: Sequence[Scene]) -> bool:
    return len(ones) == len(others) and all(
        one is other or _matters(one) == _matters(other)
        for one, other in zip(ones, others, strict=True)
    )


def _matters(scene: Scene) -> tuple[object, ...]:
    """Give what a comparison depends on of a scene, and what it is called."""
    keys = scene.parameter_keys
    return scene.title, scene.model, scene.workspace, scene.tolerances, keys


@dataclass(frozen=True, slots=True)
class Answer:
    """Machines side by side."""

    question: Question
    concepts: "tuple[Concept, ...]"
    scale: ColourScale  # the colours that their pictures share


def ask(state: AppState, choice: ConceptChoice) -> Question:
    """Ask how the chosen machines compare; what is steered takes part as it stands."""
    scenes = tuple(
        scene_of(state) if chosen.scene is None else chosen.scene for chosen in choice.machines
    )
    return Question(scenes, choice.limit_um, choice.own_tolerances, choice.over, choice.loop)


def answer(
    question: Question, cancelled: threading.Event, progress: Callable[[float], object]
) -> Answer | None:
    """Compare machines."""
    # scipy's distributions take half a second to import: not before the first picture
    from warpspace.analysis.concepts import compare_concepts
    from warpspace.picture.model import choose_scale, picture_concept

    plan, done = question.plan(), 0
    total = plan.samples * len(question.scenes)

    def report(machines: int) -> None:
        nonlocal done
        if cancelled.is_set():
            raise _CancelledError
        done += machines
        progress(done / total)

    try:
        with taken_turn(lambda: report(0)):
            found = compare_concepts(question.scenes, plan, progress=report)
            values = [picture_concept(concept, NODES).values for concept in found]
    except _CancelledError:
        return None
    return Answer(question, found, choose_scale(values, "norm"))


class _CancelledError(Exception):
    """Ends a comparison that nobody waits for any more."""
