"""The path of the standard test in the box: responses are kept, a slider move is a product."""

from dataclasses import dataclass, replace

import numpy as np

from warpspace.app.evaluation.cache import Cache
from warpspace.app.state.app_state import AppState
from warpspace.app.state.forms import TEST, read_form
from warpspace.app.state.leaf import Identity
from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.bench.plan import Plan, Whole, respond_sites
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.field.grid import seen_from_workpiece
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

CACHE_BYTES = 60_000_000
MOST_SITES = 20_000  # places of one test


@dataclass(frozen=True, slots=True)
class BenchPicture:
    """The path of a test with the errors of a state."""

    title: str
    path: tuple[Whole, ...]  # sites of each stretch
    nominal_mm: Array  # [n, 3]; sites as they are drawn: as the workpiece sees them
    error_um: Array  # [n, 3]; of the tool against the workpiece

    def lines_mm(self, exaggeration: float) -> list[tuple[Array, Array]]:
        """Give each stretch of the path, nominal and actual, [n, 3], mm."""
        actual = self.nominal_mm + exaggeration * MM_PER_UM * self.error_um
        return [(self.nominal_mm[rows], actual[rows]) for rows in self.path]

    @property
    def largest_um(self) -> float:
        """Largest error along the path, µm."""
        rows = np.concatenate(self.path)
        return float(np.linalg.norm(self.error_um[rows], axis=-1).max())


def chosen_test(state: AppState) -> type[BenchTest] | None:
    """Give the standard test that a state has chosen."""
    name = state.forms.get(TEST, "")
    return find_test(name) if name in bench_names() else None


def plan_test(test: BenchTest, scene: Scene) -> Plan:
    """Lay the path of a test on a machine."""
    plan = test.plan(scene)
    if len(plan.point_mm) > MOST_SITES:
        raise OptionError(
            f"{len(plan.point_mm):,} places; expected at most {MOST_SITES:,} in the app"
        )
    return plan


_KEPT: Cache[tuple[BenchPicture, Array]] = Cache(CACHE_BYTES)
"""Paths without errors, and what a unit of each amplitude brings at each site, [K, n, 3]."""


def bench_picture(state: AppState) -> BenchPicture | None:
    """Give the path of the chosen test; None where none is drawn, or it cannot be run."""
    told = {k.removeprefix(f"{TEST}."): v for k, v in state.forms.items() if k.startswith(TEST)}
    kind = chosen_test(state)
    if kind is None or told.get("path") == "0":
        return None

    def prepare() -> tuple[BenchPicture, Array]:
        workspace = state.scene.workspace.moved(state.positions)
        scene = replace(state.scene, workspace=workspace)
        test = read_form(kind, kind.settings(), told, scene)
        plan = plan_test(test, scene)
        nominal = seen_from_workpiece(scene.model, plan.coordinates, scene.workspace, plan.point_mm)
        response = respond_sites(scene, plan, tuple(state.amplitudes))
        return BenchPicture(kind.title, plan.path, nominal, 0.0 * nominal), response

    key = (Identity(state.scene), tuple(state.positions.items()), tuple(sorted(told.items())))
    try:
        path, response = _KEPT.get(key, prepare, lambda found: found[1].nbytes)
    except WarpspaceError:  # the section of the test says it
        return None
    amplitudes = np.fromiter(state.active.values(), float, len(state.amplitudes))
    return replace(path, error_um=np.tensordot(amplitudes, response, axes=1))
