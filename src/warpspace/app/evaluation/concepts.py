"""Machines side by side: what is asked, and its answer, computed beside the session."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.state.app_state import AppState
from warpspace.app.state.concept_choice import ConceptChoice
from warpspace.geometry.colour import ColourScale
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.scene.concepts import Concept, ConceptPlan

POLL_S = 0.1
NODES = 21
"""Nodes per axis that colours are chosen from; the pictures have the same."""
_TURN = threading.Lock()
"""One comparison at a time for all tabs together, so that sliders stay quick."""


@dataclass(frozen=True, slots=True)
class Question:
    """All that a comparison depends on.

    Attributes
    ----------
    scenes : tuple of Scene
    limit_um : float, µm
    own_tolerances : bool
    over, loop : str
    """

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

    def plan(self) -> "ConceptPlan":
        """Say how machines are sampled: as the command does it, on one thread."""
        from warpspace.scene.concepts import ConceptPlan

        return ConceptPlan(self.limit_um, self.own_tolerances, over=self.over, workers=1)


def _alike(ones: Sequence[Scene], others: Sequence[Scene]) -> bool:
    """Tell whether scenes are compared alike."""
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
    """Machines side by side.

    Attributes
    ----------
    question : Question
    concepts : tuple of Concept
    scale : ColourScale
        The colours that their pictures share.
    """

    question: Question
    concepts: "tuple[Concept, ...]"
    scale: ColourScale


def ask(state: AppState, choice: ConceptChoice) -> Question:
    """Ask how the chosen machines compare; what is steered takes part as it stands."""
    scenes = tuple(
        scene_of(state) if chosen.scene is None else chosen.scene for chosen in choice.machines
    )
    return Question(scenes, choice.limit_um, choice.own_tolerances, choice.over, choice.loop)


def answer(
    question: Question, cancelled: threading.Event, progress: Callable[[float], object]
) -> Answer | None:
    """Compare machines.

    Parameters
    ----------
    question : Question
    cancelled : threading.Event
        Ends the work when set.
    progress : callable
        Called with the share that is done, 0 … 1.

    Returns
    -------
    Answer or None
        None where it was cancelled.

    Raises
    ------
    SceneError, OptionError
        If tolerances are missing, or machines cannot be sampled.
    """
    # scipy's distributions take half a second to import: not before the first picture
    from warpspace.picture.concepts import picture_concept
    from warpspace.picture.model import choose_scale
    from warpspace.scene.concepts import compare_concepts

    plan, done = question.plan(), 0
    total = plan.samples * len(question.scenes)

    def report(machines: int) -> None:
        nonlocal done
        if cancelled.is_set():
            raise _CancelledError
        done += machines
        progress(done / total)

    while not _TURN.acquire(timeout=POLL_S):
        if cancelled.is_set():
            return None
    try:
        found = compare_concepts(question.scenes, plan, loop=question.loop, progress=report)
        values = [picture_concept(concept, NODES).values for concept in found]
    except _CancelledError:
        return None
    finally:
        _TURN.release()
    return Answer(question, found, choose_scale(values, "norm"))


class _CancelledError(Exception):
    """Ends a comparison that nobody waits for any more."""
