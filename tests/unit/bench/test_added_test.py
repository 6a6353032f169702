"""A test of a plug-in appears on the command line and in the app; its file is all there is."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from cli.conftest import warpspace
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.bench.base import BenchTest
from warpspace.bench.data import DataColumn
from warpspace.bench.options import option
from warpspace.bench.outcome import Chart, Curve, Outcome, Quantity
from warpspace.bench.plan import build_plan
from warpspace.bench.registry import bench_names, register_test, unregister_test
from warpspace.exceptions import OptionError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop
from warpspace.scene.library import load_scene

__all__ = ["warpspace"]


@dataclass(frozen=True, kw_only=True)
class Corner(BenchTest):
    """A dial gauge along x in one place."""

    name: ClassVar[str] = "corner"
    title: ClassVar[str] = "Corner"
    standard: ClassVar[str] = "our own"
    words: ClassVar[str] = "A dial gauge looks along x."
    columns: ClassVar[tuple[DataColumn, ...]] = (DataColumn("x_um"),)
    repeats: int = option(2, "count", "Readings.")

    def plan(self, scene):
        stand = self.stand(scene)
        point = nominal_point(self.model(scene), Loop.TOOL, stand)
        points = np.broadcast_to(point, (self.repeats, 3))
        return build_plan(stand, points, np.eye(3)[0], place="in the middle")

    def plan_data(self, scene, table):
        return self.plan(scene), table["x_um"]

    def evaluate(self, plan, readings):
        return Outcome((Quantity("x_um", "reading", float(readings.mean()), "µm"),))

    def charts(self, runs):
        curves = tuple(
            Curve(run.named("x"), np.arange(len(run.readings)) * 1.0, run.readings) for run in runs
        )
        return (Chart("lines", "Readings", "number", "x [µm]", curves),)


@pytest.fixture
def corner() -> Iterator[str]:
    register_test(Corner)
    yield "corner"
    unregister_test("corner")


def test_an_added_test_is_everywhere(corner: str, warpspace, tmp_path) -> None:
    assert corner in bench_names()
    with pytest.raises(OptionError, match="is there already"):
        register_test(Corner)
    assert "corner" in warpspace("test", "--list").out
    found = json.loads(warpspace("test", corner, "dvf5000_first", "--repeats", "3", "--json").out)
    plot = tmp_path / "corner.svg"
    warpspace("test", corner, "dvf5000_first", "--plot", plot)
    assert plot.stat().st_size > 1000
    state = start_state(load_scene("dvf5000_first"), nodes=3)
    object.__setattr__(state, "bench", state.bench.with_test(corner))
    picture = LiveModel().evaluate(state).bench
    assert isinstance(picture, BenchPicture)
    assert picture.run.outcome["x_um"] == pytest.approx(found["x_um"], abs=0.01)
