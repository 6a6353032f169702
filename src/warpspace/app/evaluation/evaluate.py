"""From a state to the picture of it: numpy only, no browser.

Grids and first-order responses are kept, since they change only with the scene, the density, the
rotary positions and the loop; a slider move is then one matrix-vector product.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.compare import compare_pictures
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import default_held, slice_positions
from warpspace.field.evaluate import ErrorBasis, ErrorField, build_basis
from warpspace.field.grid import Grid, build_grid, build_slice
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.traces import TraceGroup, build_traces
from warpspace.picture.model import (
    Slice,
    choose_exaggeration,
    choose_scale,
    coloured_error,
    coloured_values,
    picture_size_mm,
)
from warpspace.picture.traces import TraceLines
from warpspace.scene.model import grid_basis
from warpspace.units import Array

CACHE_BYTES = 400_000_000
KEPT = 0.27  # place of the colour of what keeps the limit, on the scale of signed values
TRACE_SAMPLES = 73  # points along a trace: every five degrees of a turn


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
    """Turns states into pictures; one for all sessions, usable from any thread."""

    def __init__(self) -> None:
        self._kept: Cache[Any] = Cache(CACHE_BYTES)

    def response(self, state: AppState) -> Response:
        """Give grid and responses of a state, kept from an earlier one where possible."""
        key = (
            Identity(state.scene),
            state.nodes,
            tuple(state.positions.items()),
            state.seen,
            state.rotary.off,
            state.rotary.own_mm,
            tuple(state.rotary.held.items()),
        )
        return self._kept.get(key, lambda: _build(state), lambda response: response.size)

    def evaluate(self, state: AppState) -> LivePicture:
        """Evaluate a state."""
        if state.comparison.b is not None:
            return compare_pictures(self._single, state)
        return self._single(state)

    def _single(self, state: AppState) -> LivePicture:
        response = self.response(state)
        amplitudes = np.fromiter(state.active.values(), float, len(state.amplitudes))
        field = self._field(state, response.grid, response.basis, amplitudes)
        size = picture_size_mm(state.scene, response.grid)
        factor = choose_exaggeration(state.exaggeration, None, float(field.norm_um.max()), size)
        groups = zip(response.groups, response.trace_bases, strict=True)
        common: dict[str, Any] = {
            "view": state.view(),
            "exaggeration": factor,
            "component": state.component,
            "quantity": state.look.quantity,
            "colours": _chosen_colours(state, field, response.basis),
        }
        return LivePicture(
            **common,
            grid=response.grid,
            field=field,
            cut=state.look.surface == "cut",
            slices=tuple(
                Slice(**common, grid=grid, axis=axis, position_mm=at,
                      field=self._field(state, grid, basis, amplitudes))
                for axis, at, grid, basis in self._slices(state)
            ),
            state=state,
            traces=tuple(
                TraceLines(group, basis.nominal_mm,
                           self._field(state, group, basis, amplitudes).error_um, factor)
                for group, basis in groups
            ),
        )  # fmt: skip

    def _field(
        self, state: AppState, of: Grid | TraceGroup, basis: ErrorBasis, amplitudes: Array
    ) -> ErrorField:
        """Evaluate a grid or traces: to first order, or what a table of compensation leaves.

        What does not depend on the errors (what the controller adds, where the axes stand then) is
        kept; a slider move is then one evaluation of the exact chain.
        """
        controller, scene = state.controller, state.scene
        on_trace = isinstance(of, TraceGroup)
        if controller is None:
            return basis.evaluate(amplitudes, orientation=state.look.tilts and not on_trace)
        loop, point_mm = (of.loop, of.nominal_mm) if on_trace else (state.loop, None)
        held = tuple((scene.reference or {}).items()), tuple(state.positions.items())
        key = Identity(controller), Identity(of), Identity(scene.model), held, loop, state.seen
        now = state.active_scene()
        kept = self._kept.get(
            key,
            lambda: controller.at(of.coordinates, of.nominal_mm, now, loop, point_mm),
            lambda found: found.nbytes,
        )
        return kept.field(now.errors)

    def _slices(self, state: AppState) -> Iterator[tuple[str, float, Grid, ErrorBasis]]:
        """Give grids and responses of slices, kept while they stay in place."""
        scene = state.scene
        workspace = scene.workspace.moved(state.positions)

        def build(axis: str, at: float) -> tuple[Grid, ErrorBasis]:
            grid = build_slice(scene.model, workspace, axis, at, state.nodes)
            return grid, grid_basis(scene, grid, state.view())

        if state.look.surface == "slices":
            for axis, at in slice_positions(scene, state.look, state.machine).items():
                place = axis, at, *state.positions.items()
                key = Identity(scene), state.nodes, place, state.seen
                yield (
                    axis,
                    at,
                    *self._kept.get(
                        key, partial(build, axis, at), lambda held: 2 * held[1].position.nbytes
                    ),
                )


@dataclass(frozen=True)
class PassFail(ColourScale):
    """Two colours: what keeps a limit, and what does not."""

    limit: float = 0.0

    @classmethod
    def of(cls, scale: ColourScale, limit: float) -> "PassFail":
        """Tell apart what a limit tells apart, within the ends of a scale."""
        top = max(scale.high, limit)
        return cls(0.0, top, diverging=True, label=scale.label, unit=scale.unit, limit=limit)

    def fraction(self, values: Array) -> Array:
        """Place values on the scale: near its low end, or near its high one."""
        return np.where(np.asarray(values) > self.limit, 1.0 - KEPT, KEPT)

    @property
    def ticks(self) -> tuple[float, ...]:
        """The limit: where its isoline runs."""
        return (self.low, self.limit, self.high)


def _chosen_colours(state: AppState, field: ErrorField, basis: ErrorBasis) -> ColourScale | None:
    """Give the colours that a user has chosen: fixed, or shared; None for round ends."""
    quantity, component = state.look.quantity, state.component
    values = coloured_values(field, component, quantity)
    if state.look.pass_fail and quantity == "position" and component == "norm":
        limit = state.specification.limit_um
        return PassFail.of(choose_scale([values], component), limit)
    if state.look.range_mode == "fixed":
        return choose_scale([values], component, quantity, end=state.look.range_top)
    if state.look.range_mode == "shared":
        opened = basis.evaluate(np.array([state.start[key] for key in basis.keys]))
        both = (coloured_error(field, quantity), coloured_error(opened, quantity))
        lengths = [np.linalg.norm(error, axis=-1) for error in both]
        return choose_scale(lengths, component, quantity)
    return choose_scale([values], component, quantity)


def _build(state: AppState) -> Response:
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
            state.view(group.loop),
            group.nominal_mm,
        )
        for group in groups
    )
    return Response(grid, grid_basis(scene, grid, state.view()), groups, trace_bases)
