"""A standard test on a state: its path and responses are kept, a slider move is a product."""

from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.blocks import Lines
from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.state.app_state import AppState
from warpspace.bench.base import BenchTest, Run, find_test
from warpspace.bench.plan import Plan, respond_sites, sense
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.field.grid import Workspace, seen_from_workpiece
from warpspace.units import MM_PER_UM, Array

CACHE_BYTES = 60_000_000
MOST_SITES = 20_000  # responses of so many places are held


@dataclass(frozen=True, slots=True)
class Prepared:
    """A test laid on a machine."""

    test: BenchTest
    plan: Plan
    nominal_mm: Array  # [n, 3]; sites as they are drawn: as the workpiece sees them
    # [K, n, 3]; error of the tool against the workpiece at each site, per unit of each amplitude
    response: Array

    @property
    def size(self) -> int:
        """Bytes it holds, about."""
        return self.response.nbytes + 4 * self.nominal_mm.nbytes


@dataclass(frozen=True, slots=True)
class BenchPicture:
    """A test that was run on a state."""

    prepared: Prepared
    error_um: Array  # [n, 3]; at its sites
    readings: Array  # [m], µm or µrad

    @property
    def run(self) -> Run:
        """Its readings and what they come to by the standard."""
        prepared = self.prepared
        outcome = prepared.test.evaluate(prepared.plan, self.readings)
        return Run("model", prepared.plan, self.readings, outcome)

    @property
    def charts(self) -> tuple[Lines, ...]:
        """The customary figure."""
        return self.prepared.test.charts([self.run])

    def lines_mm(self, exaggeration: float) -> list[tuple[Array, Array]]:
        """Give each stretch of the path, nominal and actual, [n, 3], mm."""
        nominal = self.prepared.nominal_mm
        actual = nominal + exaggeration * MM_PER_UM * self.error_um
        return [(nominal[rows], actual[rows]) for rows in self.prepared.plan.path]

    @property
    def largest_um(self) -> float:
        """Largest error along the path, µm."""
        rows = np.concatenate(self.prepared.plan.path)
        return float(np.linalg.norm(self.error_um[rows], axis=-1).max())


class BenchSource:
    """Runs tests on states; one for all sessions, usable from any thread."""

    def __init__(self) -> None:
        self._kept: Cache[Prepared] = Cache(CACHE_BYTES)

    def picture(self, state: AppState, amplitudes: Array) -> BenchPicture | str | None:
        """Run the test that a state has chosen."""
        look = state.bench
        if not look.name:
            return None
        key = (
            Identity(state.scene),
            tuple(state.positions.items()),
            look.name,
            tuple(sorted(look.options.items())),
        )
        try:
            prepared = self._kept.get(key, lambda: prepare(state), lambda found: found.size)
        except OptionError as error:
            labels = {one.name: one.label for one in find_test(look.name).settings()}
            return error.said(lambda name: labels.get(name, name))
        except WarpspaceError as error:
            return str(error)
        error_um = np.tensordot(amplitudes, prepared.response, axes=1)
        return BenchPicture(prepared, error_um, sense(prepared.plan, error_um))


def prepare(state: AppState) -> Prepared:
    """Lay the test of a state on its machine."""
    scene = replace(state.scene, workspace=standing(state))
    kind = find_test(state.bench.name)
    typed = state.bench.options
    named = (one for one in kind.settings() if typed.get(one.name, "").strip())
    test = kind(**{one.name: one.read(typed[one.name], scene) for one in named})
    plan = test.plan(scene)
    if len(plan.point_mm) > MOST_SITES:
        raise OptionError(
            f"{len(plan.point_mm):,} places; expected at most {MOST_SITES:,} in the app"
        )
    nominal = seen_from_workpiece(scene.model, plan.coordinates, scene.workspace, plan.point_mm)
    response = respond_sites(scene, plan, tuple(state.amplitudes))
    return Prepared(test, plan, nominal, response)


def standing(state: AppState) -> Workspace:
    """Give the working volume with its rotary axes where they stand."""
    workspace = state.scene.workspace
    moved = {
        axis: value
        for axis, value in state.positions.items()
        if workspace.ranges[axis][0] == workspace.ranges[axis][1]
    }
    return workspace.moved(moved)
