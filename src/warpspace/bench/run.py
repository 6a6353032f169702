"""Running a test: on the model, and on measured readings beside it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import read_table, unit_notes
from warpspace.bench.outcome import Chart
from warpspace.bench.readings import simulate
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class BenchResult:
    """A test that was run.

    Attributes
    ----------
    test : BenchTest
    scene : Scene
    runs : tuple of Run
        The model; behind it what was measured, if anything.
    notes : tuple of str
        What a reader should doubt.
    """

    test: BenchTest
    scene: Scene
    runs: tuple[Run, ...]
    notes: tuple[str, ...] = ()

    @property
    def model(self) -> Run:
        """What the model gives."""
        return self.runs[0]

    @property
    def measured(self) -> Run | None:
        """What was measured."""
        return self.runs[1] if len(self.runs) > 1 else None

    @property
    def rms_difference(self) -> float | None:
        """RMS of measured − model, once the unknowns of the set-up are fitted, µm or µrad.

        None where nothing was measured.
        """
        if self.measured is None:
            return None
        difference = self.measured.readings - self.model.readings
        if self.model.plan.setup:
            design = np.stack(list(self.model.plan.setup.values()), -1)
            difference = difference - design @ np.linalg.lstsq(design, difference, rcond=None)[0]
        return float(np.sqrt(np.mean(difference**2)))

    @property
    def charts(self) -> tuple[Chart, ...]:
        """The customary figure."""
        return self.test.charts(self.runs)


def run_test(
    scene: Scene, test: BenchTest, data: str | Path | None = None, *, exact: bool = True
) -> BenchResult:
    """Run a test on the model of a scene, and evaluate measured readings beside it.

    Parameters
    ----------
    scene : Scene
    test : BenchTest
    data : str or Path, optional
        CSV file with the columns of the test. The model is then run through the same poses.
    exact : bool, optional
        The exact chain; else the first order.

    Returns
    -------
    BenchResult

    Raises
    ------
    OptionError, UnknownNameError
        If the test cannot be run on the machine.
    SceneError
        If the file cannot be used.

    Examples
    --------
    >>> import warpspace
    >>> from warpspace.bench.kinds.sphere import Sphere
    >>> scene = warpspace.load_scene("dvf5000_first")
    >>> result = warpspace.run_test(scene, Sphere(axis="C", ball=(100.0, 0.0, 60.0)))
    >>> round(result.model.outcome["z_um"], 1)
    21.5
    """
    if data is None:
        plan = test.plan(scene)
        readings = simulate(scene, plan, exact=exact)
        return BenchResult(
            test, scene, (Run("model", plan, readings, test.evaluate(plan, readings)),)
        )
    table = read_table(data, test.data_columns(scene))
    plan, measured = test.plan_data(scene, table)
    readings = simulate(scene, plan, exact=exact)
    angular = any(name.endswith("_urad") for name in table.columns)
    return BenchResult(
        test,
        scene,
        (
            Run("model", plan, readings, test.evaluate(plan, readings)),
            Run("measured", plan, measured, test.evaluate(plan, measured)),
        ),
        unit_notes(measured, readings, "µrad" if angular else "µm"),
    )
