"""Several sets of readings as one problem: predictions and derivatives, weighted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.calibration.kinds.registry import find_kind
from warpspace.calibration.readings import Readings
from warpspace.calibration.terms import Terms
from warpspace.scene.model import Scene
from warpspace.units import Array

Watch = Callable[[], object]


def unwatched() -> None:
    """Let the work go on."""


@dataclass(frozen=True, slots=True)
class Stack:
    """Readings of one or more files.

    Attributes
    ----------
    scene : Scene
    sets : tuple of Readings
    unknowns : tuple of str, (m,)
        What the set-ups leave unknown; files that name the same session share it.
    watch : callable
        Called before each evaluation of the model; what it raises ends the work.
    """

    scene: Scene
    sets: tuple[Readings, ...]
    unknowns: tuple[str, ...]
    watch: Watch = unwatched

    @classmethod
    def of(cls, scene: Scene, sets: Sequence[Readings], watch: Watch = unwatched) -> "Stack":
        """Put sets together."""
        names = (name for one in sets for name in find_kind(one.kind).unknowns(one))
        return cls(scene, tuple(sets), tuple(dict.fromkeys(names)), watch)

    def start(self) -> Array:
        """Give values of the unknowns to begin with, [m], mm."""
        values: dict[str, float] = {}
        for one in self.sets:
            kind = find_kind(one.kind)
            own = kind.unknowns(one)
            for name, value in zip(own, kind.start(one, own), strict=True):
                values.setdefault(name, float(value))
        return np.array([values[name] for name in self.unknowns])

    def residuals(self, terms: Terms, amplitudes: Array, unknown: Array) -> list[Array]:
        """Give observed − predicted of each set with the exact model, [n, d] each, mm."""
        self.watch()
        errors = terms.errors_with(amplitudes)
        return [
            one.observed_mm
            - find_kind(one.kind).observe(self.scene, one, errors, self.unknowns, unknown)
            for one in self.sets
        ]

    def derivatives(
        self, terms: Terms, amplitudes: Array, unknown: Array
    ) -> tuple[list[Array], list[Array]]:
        """Give the change of each prediction, [n·d, K] per µm or µrad and [n·d, m] per mm.

        Errors act to first order here; the residuals are those of the exact model.
        """
        self.watch()
        errors = terms.errors_with(amplitudes)
        by_parameter: list[Array] = []
        by_unknown: list[Array] = []
        for one in self.sets:
            gains, own = find_kind(one.kind).slopes(
                self.scene, one, errors, terms.keys, self.unknowns, unknown
            )
            by_parameter.append(gains.reshape(one.observed_mm.size, len(terms.keys)))
            by_unknown.append(own.reshape(one.observed_mm.size, len(self.unknowns)))
        return by_parameter, by_unknown

    def weights(self) -> list[Array]:
        """Give the weight of each component of each reading, [n·d], 1/mm; 1 where none is known."""
        return [
            np.ones(one.observed_mm.size)
            if one.sigma_mm is None
            else np.repeat(1.0 / one.sigma_mm, one.observed_mm.shape[1])
            for one in self.sets
        ]

    @property
    def has_uncertainties(self) -> bool:
        """Whether every set says how well it was read."""
        return all(one.sigma_mm is not None for one in self.sets)

    @property
    def size(self) -> int:
        """Number of components of all readings."""
        return sum(one.observed_mm.size for one in self.sets)


def rms_mm(residuals: Sequence[Array]) -> float:
    """Root mean square of the lengths of residual vectors, mm."""
    lengths = np.concatenate([np.linalg.norm(one, axis=-1) for one in residuals])
    return float(np.sqrt(np.mean(lengths**2)))


def named(unknowns: Sequence[str], values: Array) -> Mapping[str, float]:
    """Give the unknowns by name, mm."""
    return {name: float(value) for name, value in zip(unknowns, values, strict=True)}
