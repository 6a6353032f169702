"""From a state to everything a picture of it is drawn from: numpy only, no browser.

Grids and first-order responses are kept, since they change only with the scene, the density, the
rotary positions and the loop; a slider move is then one matrix-vector product.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import Generic, TypeVar

import numpy as np

from warpspace.analysis.statistics import Statistics, statistics
from warpspace.app.state import AppState
from warpspace.field.evaluate import ErrorBasis, ErrorField, View, build_basis
from warpspace.field.grid import Grid, build_grid
from warpspace.geometry import surfaces
from warpspace.geometry.colour import ColourScale, build_scale, component_values
from warpspace.geometry.deform import auto_exaggeration, deform
from warpspace.geometry.traces import TraceGroup, build_traces
from warpspace.scene.pipeline import grid_basis
from warpspace.units import Array

KEPT_BYTES = 400_000_000
TRACE_SAMPLES = 73
"""Points along a trace: every five degrees of a turn."""
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Topology:
    """Indices of what is drawn of a grid; they do not change when it is bent.

    Attributes
    ----------
    surface : Surface
    grid_segments, edge_segments : ndarray, [S, 2]
        Flat node indices of the ends of each piece of line.
    outwards : ndarray, [N, 3]
        Per node, the sum of the outward directions of the faces it lies on.
    """

    surface: surfaces.Surface
    grid_segments: surfaces.Index
    edge_segments: surfaces.Index
    outwards: Array


@dataclass(frozen=True, slots=True)
class Frame:
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


@dataclass(frozen=True, slots=True)
class TraceLines:
    """Traces of one branch, nominal and displaced, [T, n, 3], mm."""

    group: TraceGroup
    nominal_mm: Array
    actual_mm: Array


@lru_cache(maxsize=16)
def topology(shape: surfaces.Shape) -> Topology:
    """Work out what is drawn of a grid of a shape."""
    nx, ny, nz = map(surfaces.line_spacing, shape)
    ends = [np.where(np.arange(n) == n - 1, 1.0, 0.0) - (np.arange(n) == 0) for n in shape]
    outwards = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
    return Topology(
        surfaces.outer_surface(shape),
        surfaces.segments(surfaces.grid_lines(shape, (nx, ny, nz))),
        surfaces.segments(surfaces.box_edges(shape)),
        outwards,
    )


class Kept(Generic[T]):
    """The latest results of slow functions, up to a number of bytes, for all sessions together."""

    def __init__(self, limit_bytes: int) -> None:
        self._limit = limit_bytes
        self._items: OrderedDict[Hashable, tuple[T, int]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable, build: Callable[[], T], size: Callable[[T], int]) -> T:
        """Give what belongs to a key, built when it is not there."""
        with self._lock:
            found = self._items.get(key)
            if found is not None:
                self._items.move_to_end(key)
                return found[0]
        value = build()
        with self._lock:
            self._items[key] = (value, size(value))
            while len(self._items) > 1 and sum(n for _, n in self._items.values()) > self._limit:
                self._items.popitem(last=False)
        return value


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
        self._kept: Kept[Response] = Kept(KEPT_BYTES)

    def response(self, state: AppState) -> Response:
        """Give grid and responses of a state, kept from an earlier one where possible."""
        key = (Same(state.scene), state.nodes, tuple(state.positions.items()), state.loop)
        return self._kept.get(key, lambda: _build(state), lambda response: response.size)

    def frame(self, state: AppState) -> Frame:
        """Evaluate a state.

        Parameters
        ----------
        state : AppState

        Returns
        -------
        Frame
        """
        response = self.response(state)
        grid = response.grid
        amplitudes = np.fromiter(state.heard.values(), float, len(state.amplitudes))
        field = response.basis.evaluate(amplitudes)
        found = statistics(field)
        factor = state.exaggeration or auto_exaggeration(found.max_um, grid.longest_edge_mm)
        values = component_values(field.error_um, state.component)
        largest = float(np.abs(values).max())
        return Frame(
            state,
            grid,
            field,
            found,
            factor,
            build_scale(largest, state.component),
            values,
            deform(field.nominal_mm, field.error_um, factor),
            topology(grid.shape),
            tuple(
                TraceLines(
                    group,
                    group.nominal_mm,
                    deform(basis.nominal_mm, basis.evaluate(amplitudes).error_um, factor),
                )
                for group, basis in zip(response.groups, response.trace_bases, strict=True)
            ),
        )


class Same:
    """An object as part of a key, compared by identity (and held, so that its id stays its own)."""

    def __init__(self, thing: object) -> None:
        self.thing = thing

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other.thing is self.thing

    def __hash__(self) -> int:
        return id(self.thing)


def _build(state: AppState) -> Response:
    """Lay grid and traces and compute their responses."""
    scene = state.scene
    grid = build_grid(scene.model, scene.workspace.moved(state.positions), state.nodes)
    positions = {**scene.workspace.positions, **state.positions}
    groups = build_traces(scene.model, scene.trace_points_mm, positions, TRACE_SAMPLES)
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
