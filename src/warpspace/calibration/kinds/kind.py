"""What every kind of measurement is and can: columns, readings, and what the model predicts."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpspace.calibration.readings import Readings, ReadingTable
from warpspace.field.evaluate import View, build_basis, evaluate_exact
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import sort_axes
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

VIEW = View(Loop.RELATIVE, "workpiece")
"""How errors are looked at: the tool point relative to the workpiece, in its nominal frame."""


@dataclass(frozen=True, slots=True)
class Guess:
    """What readings are predicted from: errors, and what the set-ups leave unknown."""

    errors: ErrorSet
    unknowns: tuple[str, ...]  # (m,)
    values: Array  # [m], mm


class Kind(ABC):
    """A kind of measurement.

    A reading is a function of the errors of the machine and of a few numbers that nobody knows:
    where a sphere or a station stands, by how much a session is shifted.
    """

    name: ClassVar[str]  # as an option takes it
    words: ClassVar[str]  # what it is, for lists and help
    columns: ClassVar[str]  # of its file
    # whether it takes the text of the file, columns of words among them, rather than its table
    own_columns: ClassVar[bool] = False

    @abstractmethod
    def fits(self, table: ReadingTable, scene: Scene) -> bool:
        """Tell whether a file has the columns of this kind, and of no other."""

    @abstractmethod
    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        """Give the readings of a file; refuse one that lacks a column or holds what cannot be."""

    @abstractmethod
    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name what the set-up leaves unknown, each in mm, for instance ``sphere x``."""

    @abstractmethod
    def start(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Give values of the unknowns to begin with, [m], mm."""

    @abstractmethod
    def observe(self, scene: Scene, readings: Readings, guess: Guess) -> Array:
        """Give the readings that errors would lead to, with the exact model, [n, d], mm."""

    @abstractmethod
    def slopes(
        self, scene: Scene, readings: Readings, guess: Guess, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Differentiate the readings, to first order in the errors.

        Returns
        -------
        by_parameter : ndarray, [n, d, K], mm per µm or µrad
        by_unknown : ndarray, [n, d, m]
        """

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """List the parameters that are looked for where none are named, the likelier first."""
        del readings
        return scene.parameter_keys


class FromVectors(Kind):
    """A kind whose readings follow from the error vectors at its poses."""

    @abstractmethod
    def predict(self, readings: Readings, error_mm: Array, guess: Guess) -> Array:
        """Give the readings, [n, d], mm, that errors, [n, 3], mm, would lead to."""

    @abstractmethod
    def derivatives(self, readings: Readings, error_mm: Array, guess: Guess) -> tuple[Array, Array]:
        """Differentiate the prediction: by the error, [n, d, 3], and by unknowns, [n, d, m]."""

    def observe(self, scene: Scene, readings: Readings, guess: Guess) -> Array:
        """Evaluate the errors, and predict."""
        return self.predict(readings, _error_mm(scene, readings, guess), guess)

    def slopes(
        self, scene: Scene, readings: Readings, guess: Guess, keys: tuple[str, ...]
    ) -> tuple[Array, Array]:
        """Put what an error does to a reading behind what a parameter does to the error."""
        error_mm = _error_mm(scene, readings, guess)
        by_error, by_unknown = self.derivatives(readings, error_mm, guess)
        basis = build_basis(scene.model, guess.errors, keys, readings.coordinates, VIEW)
        gains = np.einsum("ndx,knx->ndk", by_error, basis.position) * MM_PER_UM
        return gains, by_unknown


def _error_mm(scene: Scene, readings: Readings, guess: Guess) -> Array:
    """Evaluate the error at the poses of readings, exactly, [n, 3], mm."""
    field = evaluate_exact(scene.model, guess.errors, readings.coordinates, VIEW)
    return field.error_um * MM_PER_UM


class Placed(FromVectors):
    """A kind whose readings are ± the error plus the place of something, one place per session."""

    place: ClassVar[str]
    sign: ClassVar[float]

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        """Name three coordinates per session."""
        return tuple(
            f"{self._head(session)} {letter}"
            for session in dict.fromkeys(readings.session)
            for letter in "xyz"
        )

    def start(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Begin with the means of the sessions."""
        member = self._members(readings, unknowns)
        total = np.einsum("ndm,nd->m", member, readings.observed_mm)
        return total / np.maximum(member.sum(axis=(0, 1)), 1.0)

    def predict(self, readings: Readings, error_mm: Array, guess: Guess) -> Array:
        """Add ± the error to the place."""
        return self.sign * error_mm + self._members(readings, guess.unknowns) @ guess.values

    def derivatives(self, readings: Readings, error_mm: Array, guess: Guess) -> tuple[Array, Array]:
        """Give ± one, and which place a reading belongs to."""
        by_error = np.broadcast_to(self.sign * np.eye(3), (*error_mm.shape, 3))
        return by_error, self._members(readings, guess.unknowns)

    def _head(self, session: str) -> str:
        return f"{self.place} {session}".strip()

    def _members(self, readings: Readings, unknowns: tuple[str, ...]) -> Array:
        """Tell which unknown each component of each reading has, [n, 3, m]."""
        member = np.zeros((len(readings), 3, len(unknowns)))
        index = {name: at for at, name in enumerate(unknowns)}
        for row, session in enumerate(readings.session):
            for component, letter in enumerate("xyz"):
                at = index.get(f"{self._head(session)} {letter}")
                if at is not None:
                    member[row, component, at] = 1.0
        return member


def head_keys(readings: Readings, scene: Scene) -> tuple[str, ...]:
    """List location, orientation and zero errors of the rotary axes that move in the readings.

    The last rotary axis on the side of the tool has the offset of the tool point as well: constant
    component translations, which turn with it. Its length comes before the zero positions, what
    leads sideways last.
    """
    moving = [
        name
        for name in sort_axes(scene.machine.axes)
        if not scene.machine.axes[name].is_linear and np.ptp(readings.coordinates[name]) > 1e-9
    ]
    constants = [f"E{letter}0{axis}" for letter in "XYZABC" for axis in moving]
    usual = [key for key in constants if key in scene.parameter_keys]
    others = [key for key in constants if key not in usual]
    last = [axis.name for axis in scene.machine.branch("tool") if axis.name in moving][-1:]
    length = [f"EZ{axis}" for axis in last]
    sideways = [f"E{letter}{axis}" for letter in "XY" for axis in last]
    return (*usual, *length, *others, *sideways)
