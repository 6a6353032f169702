"""What every test is: a frozen set of options with a path, an evaluation and a figure."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from warpspace.bench.data import DataColumn, Table
from warpspace.bench.options import option
from warpspace.bench.outcome import Chart, Outcome
from warpspace.bench.plan import Plan
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Run:
    """Readings of a test and what they come to.

    Attributes
    ----------
    who : str
        "model" or "measured".
    plan : Plan
    readings : ndarray, [m], µm or µrad
    outcome : Outcome
    """

    who: str
    plan: Plan
    readings: Array
    outcome: Outcome

    @property
    def is_measured(self) -> bool:
        """Whether somebody measured them."""
        return self.who == "measured"

    def named(self, words: str) -> str:
        """Name a curve; the model has the plain words."""
        return f"{words}, measured" if self.is_measured else words


@dataclass(frozen=True, kw_only=True)
class BenchTest(ABC):
    """A test with its options. A subclass is a kind of test, its fields are its options.

    Attributes
    ----------
    name : str
        As it is asked for.
    title : str
        What it is.
    standard : str
        Where its formulas come from.
    words : str
        What is done and what comes out, a few sentences.
    columns : tuple of DataColumn
        Of a file of readings.
    at : mapping of str to float, mm or degrees
    tool_extension_mm : float, mm
    """

    name: ClassVar[str]
    title: ClassVar[str]
    standard: ClassVar[str]
    words: ClassVar[str]
    columns: ClassVar[tuple[DataColumn, ...]]
    at: Mapping[str, float] = option(
        None,
        "point",
        "Where axes stand that the test does not move; what the scene says for others.",
    )
    tool_extension_mm: float = option(
        0.0, "number", "How much longer than the scene's the tool or probe is.", unit="mm"
    )

    @abstractmethod
    def plan(self, scene: Scene) -> Plan:
        """Lay the path of the test on a machine.

        Raises
        ------
        OptionError, UnknownNameError
            If it cannot be run on the machine.
        """

    @abstractmethod
    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Lay the path along which readings were taken.

        Parameters
        ----------
        scene : Scene
        table : Table
            With `columns`.

        Returns
        -------
        plan : Plan
        readings : ndarray, [m], µm or µrad
            As measured, in the order of the plan.

        Raises
        ------
        SceneError
            If readings are missing: names what was expected.
        """

    @abstractmethod
    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Evaluate readings by the formulas of the standard.

        Parameters
        ----------
        plan : Plan
        readings : ndarray, [m], µm or µrad

        Returns
        -------
        Outcome
        """

    @abstractmethod
    def charts(self, runs: Sequence[Run]) -> tuple[Chart, ...]:
        """Lay out the customary figure of runs, the model first."""

    def data_columns(self, scene: Scene) -> tuple[DataColumn, ...]:  # noqa: ARG002 - for others
        """Give the columns of a file of readings."""
        return self.columns

    def stand(self, scene: Scene) -> dict[str, Array]:
        """Give where all axes stand before the test moves any, scalars, mm or degrees."""
        positions = scene.workspace.positions
        return complete_coordinates(scene.machine, {**positions, **self.at}, positions)

    def model(self, scene: Scene) -> Model:
        """Give the model with the tool that the test has."""
        if not -1e4 < self.tool_extension_mm < 1e4:
            raise OptionError(
                f"--tool-extension {self.tool_extension_mm:g} mm; expected within ±10000 mm"
            )
        if not self.tool_extension_mm:
            return scene.model
        x, y, z = scene.model.tool_point_mm
        return replace(scene.model, tool_point_mm=(x, y, z - self.tool_extension_mm))

    def place_words(self, scene: Scene, moving: Sequence[str]) -> str:
        """Say where the axes stand that do not move."""
        stand = self.stand(scene)
        still = [f"{name} {float(stand[name]):g}" for name in stand if name not in moving]
        tool = f"tool {self.tool_extension_mm:+g} mm" if self.tool_extension_mm else ""
        return " · ".join(part for part in (", ".join(still), tool) if part)
