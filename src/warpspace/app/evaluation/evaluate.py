"""From a state to everything a picture of it is drawn from: numpy only, no browser.

Grids and first-order responses are kept, since they change only with the scene, the density, the
rotary positions and the loop; a slider move is then one matrix-vector product.
"""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.statistics import Statistics, statistics
from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.colouring import choose_scale, shown_values
from warpspace.app.evaluation.compare import Compared, compare_pictures
from warpspace.app.evaluation.slices import SliceMap, SliceSource
from warpspace.app.evaluation.topology import Topology, topology
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import default_held
from warpspace.field.basis import ErrorBasis, ErrorField
from warpspace.field.evaluate import View, build_basis
from warpspace.field.grid import Grid, build_grid
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.deform import auto_exaggeration, deform
from warpspace.geometry.traces import TraceGroup, build_traces
from warpspace.scene.pipeline import grid_basis
from warpspace.units import Array

KEPT_BYTES = 400_000_000
TRACE_SAMPLES = 73
"""Points along a trace: every five degrees of a turn."""


@dataclass(frozen=True, slots=True)
class LivePicture:
    """One picture in numbers, mm and µm in R.

    Attributes
    ----------
    state : AppState
    grid : Grid
    field : ErrorField
        Over all nodes of the grid.
    statistics : Statistics
    exaggeration : float
        The display factor in force.
    scale : ColourScale
    values : ndarray, [nx, ny, nz]
        What is coloured, in the unit of the scale.
    drawn_mm : ndarray, [nx, ny, nz, 3], mm
        Displaced nodes.
    topology : Topology
    traces : tuple of TraceLines
    slices : tuple of SliceMap
        Drawn in place of the surface where slices are chosen.
    subject : AppState or None
        What is drawn, where that is another state than the one steered; else None.
    compared : Compared or None
        The comparison it belongs to.
    """

    state: AppState
    grid: Grid
    field: ErrorField
    statistics: Statistics
    exaggeration: float
    scale: ColourScale
    values: Array
    drawn_mm: Array
    topology: Topology
    traces: "tuple[TraceLines, ...]"
    slices: tuple[SliceMap, ...] = ()
    subject: AppState | None = None
    compared: Compared | None = None


@dataclass(frozen=True, slots=True)
class TraceLines:
    """Traces of one branch, nominal and displaced, [T, n, 3], mm."""

    group: TraceGroup
    nominal_mm: Array
    actual_mm: Array


@dataclass(frozen=True, slots=True)
class Response:
    """Grid, traces and their first-order responses for one place of the rotary axes."""

    grid: Grid
    basis: ErrorBasis
    groups: tuple[TraceGroup, ...]
    trace_bases: tuple[ErrorBasis, ...]

    @property
    def size(self) -> int:
        """Bytes it holds, about."""
        bases = (self.basis, *self.trace_bases)
        return sum(basis.position.nbytes + basis.orientation.nbytes for basis in bases)


class LiveModel:
    """Turns states into frames; one for all sessions, usable from any thread."""

    def __init__(self) -> None:
        self._cache: Cache[Response] = Cache(KEPT_BYTES)
        self._slices = SliceSource()

    def response(self, state: AppState) -> Response:
        """Give grid and responses of a state, kept from an earlier one where possible."""
        key = (
            Identity(state.scene),
            state.nodes,
            tuple(state.positions.items()),
            state.loop,
            state.rotary,
        )
        return self._cache.get(key, lambda: _build(state), lambda response: response.size)

    def evaluate(self, state: AppState) -> LivePicture:
        """Evaluate a state.

        Parameters
        ----------
        state : AppState

        Returns
        -------
        LivePicture
            Where two states are compared, of the one that is drawn.
        """
        if state.comparison.b is not None:
            return compare_pictures(self._single, state)
        return self._single(state)

    def _single(self, state: AppState) -> LivePicture:
        """Evaluate a state without what it is compared with."""
        response = self.response(state)
        grid = response.grid
        amplitudes = np.fromiter(state.active.values(), float, len(state.amplitudes))
        field = response.basis.evaluate(amplitudes, orientation=state.look.tilts)
        found = statistics(field)
        factor = state.exaggeration or auto_exaggeration(found.max_um, grid.longest_edge_mm)
        values = shown_values(state, field)
        return LivePicture(
            state,
            grid,
            field,
            found,
            factor,
            choose_scale(state, values, response.basis, field),
            values,
            deform(field.nominal_mm, field.error_um, factor),
            topology(grid.shape, cut=state.look.surface == "cut"),
            tuple(
                TraceLines(
                    group,
                    group.nominal_mm,
                    deform(
                        basis.nominal_mm,
                        basis.evaluate(amplitudes, orientation=False).error_um,
                        factor,
                    ),
                )
                for group, basis in zip(response.groups, response.trace_bases, strict=True)
            ),
            self._slices.maps(state, amplitudes, factor),
        )


def _build(state: AppState) -> Response:
    """Lay grid and traces and compute their responses."""
    scene = state.scene
    grid = build_grid(scene.model, scene.workspace.moved(state.positions), state.nodes)
    positions = {**scene.workspace.positions, **state.positions}
    groups = build_traces(
        scene.model,
        state.rotary.points_mm(scene),
        positions,
        TRACE_SAMPLES,
        default_held(scene, state.rotary, positions),
    )
    keys = scene.parameter_keys
    trace_bases = tuple(
        build_basis(
            scene.model,
            scene.errors,
            keys,
            group.coordinates,
            View(loop=group.loop, reference=scene.reference),
            group.nominal_mm,
        )
        for group in groups
    )
    return Response(grid, grid_basis(scene, grid, scene.view(state.loop)), groups, trace_bases)
