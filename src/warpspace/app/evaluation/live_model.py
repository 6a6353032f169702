"""Evaluation of a state into a picture.

Grids and first-order responses are cached, since they change only with the scene, the density, the
rotary positions and the loop; a slider move is then one matrix-vector product.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, TypeAlias

import numpy as np

from warpspace.analysis.loop_parameters import loop_axes
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, field_uncertainty
from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.compare import compare_pictures
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import slice_positions
from warpspace.field.evaluate import ErrorBasis, ErrorField, build_basis
from warpspace.field.grid import Grid, build_grid, build_slice
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.surfaces import auto_exaggeration
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Constant
from warpspace.picture import model
from warpspace.picture.traces import TraceGroup, TraceLines, build_traces
from warpspace.scene.model import Scene, evaluate_grid, grid_basis
from warpspace.units import Array

WITHIN_LIMIT = 0.27  # place on the scale of signed values: colour of values within the limit
TRACE_SAMPLES = 73  # points along a trace: every five degrees of a turn
Response: TypeAlias = tuple[tuple[Any, ErrorBasis], ...]
"""A grid, and the traces of rotary axes if any, each with its first-order response."""
Start: TypeAlias = Mapping[str, float] | None
"""Errors as a drag began: residual errors are exact there, and of first order from there."""
CACHE: Cache[Any] = Cache(400_000_000)
"""Responses of the boxes of all tabs."""
_key_of = lru_cache(maxsize=64)(lambda *_inputs: object())  # a table is hashed once a scene


@dataclass(frozen=True, slots=True)
class DrawnScale:
    """Exaggeration and colours in place of those of a state; None for its own colours."""

    exaggeration: float
    colours: ColourScale | None = None
    amplitudes: Start = None


class LiveModel:
    """Evaluates states into pictures; shared by all sessions, thread-safe."""

    def evaluate(self, state: AppState, drawn: DrawnScale | None = None) -> LivePicture:
        if not state.comparison.b:
            return self._single(state, drawn)
        scaled_state = state if drawn is None else replace(state, exaggeration=drawn.exaggeration)
        picture = compare_pictures(partial(self._single, drawn=drawn), scaled_state)
        if drawn is None or drawn.colours is None:
            return replace(picture, state=state)
        slices = tuple(replace(piece, colours=drawn.colours) for piece in picture.slices)
        return replace(picture, state=state, colours=drawn.colours, slices=slices)

    def _single(self, state: AppState, drawn: DrawnScale | None = None) -> LivePicture:
        rotary, start = state.rotary, drawn and drawn.amplitudes
        key = _place(state), rotary.off, rotary.own_mm, tuple(rotary.held.items())
        response: Response = CACHE.get(key, lambda: _build(state), _size)
        (grid, basis), *traces = response
        field = self._field(state, grid, basis, start)
        errors = [self._field(state, group, own, start).error_um for group, own in traces]
        factor = model.fixed_exaggeration(drawn.exaggeration if drawn else state.exaggeration, None)
        if factor is None:
            traced_um = [np.linalg.norm(error, axis=-1) for error in errors]
            lengths_um = traced_um if state.shows_rotary else [field.norm_um]
            largest = max((float(of.max(initial=0.0)) for of in lengths_um), default=0.0)
            factor = auto_exaggeration(largest, model.picture_size_mm(state.scene, grid))
        uncertainty, quantity = self._uncertainty(state, grid, field), state.look.quantity
        is_unknown = not (uncertainty and uncertainty.errors.is_known)
        if state.shows_rotary or (quantity == "uncertainty" and is_unknown):
            quantity = "position"
        common: dict[str, Any] = {
            "view": state.view(),
            "exaggeration": factor,
            "component": state.component,
            "quantity": quantity,
            "significant": state.look.significant,
        }
        if (state.component, quantity) == ("norm", "position") and not state.shows_rotary:
            effect = "limit_um" if state.look.pass_fail else "hatch_um"
            common[effect] = state.specification.limit_um
        traced = tuple(
            TraceLines(group, own.nominal_mm, error, factor)
            for (group, own), error in zip(traces, errors, strict=True)
        )
        picture = LivePicture(
            **common, grid=grid, field=field, uncertainty=uncertainty, state=state, traces=traced,
            cut=state.look.surface == "cut",
        )  # fmt: skip
        colours = drawn and drawn.colours
        common["colours"] = colours or _chosen_colours(state, picture, basis)
        slices = tuple(self._slices(state, common, start))
        return replace(picture, colours=common["colours"], slices=slices)

    def _uncertainty(
        self, state: AppState, grid: Grid, field: ErrorField
    ) -> FieldUncertainty | None:
        scene = state.scene
        if scene.covariance is None and not scene.uncertainty:
            return None

        def build() -> FieldUncertainty | None:
            view = state.view()
            return field_uncertainty(scene, field.error_um, grid.coordinates, view, grid.point_mm)

        key = "uncertainty", Identity(grid), Identity(scene), _place(state)
        uncertainty = CACHE.get(key, build, lambda built: 3 * built.response.nbytes)
        axes, stated = loop_axes(scene.model, state.loop), uncertainty.errors.keys
        unstated = (key for key, value in state.active.items() if value and key not in stated)
        unknown = [key for key in unstated if parameter(key).axis in axes]
        errors = replace(uncertainty.errors, unknown=tuple(unknown))
        return replace(uncertainty, errors=errors, error_um=field.error_um, shares=grid.weights)

    def _slices(
        self, state: AppState, common: Mapping[str, Any], start: Start
    ) -> Iterator[model.Slice]:
        scene, workspace = state.scene, state.scene.workspace.moved(state.positions)

        def build(axis: str, at: float) -> Response:
            plane = build_slice(scene.model, workspace, axis, at, state.grid_nodes)
            return ((plane, grid_basis(scene, plane, state.view())),)

        if state.look.surface == "slices":
            for axis, at in slice_positions(scene, state.look, state.machine).items():
                key = _place(state), axis, at
                ((plane, basis),) = CACHE.get(key, partial(build, axis, at), _size)
                field = self._field(state, plane, basis, start)
                known = self._uncertainty(state, plane, field)
                drawn: dict[str, Any] = {**common, "field": field, "uncertainty": known}
                yield model.Slice(**drawn, grid=plane, axis=axis, position_mm=at)

    def _field(
        self, state: AppState, of: Grid | TraceGroup, basis: ErrorBasis, start: Start
    ) -> ErrorField:
        """Evaluate a grid or traces: to first order, or the residual error of a compensation table.

        Corrections and axis positions, which do not depend on the errors, are cached; a change is
        then one evaluation of the exact chain, and a drag the first-order response to its change.
        """
        controller, scene = state.controller, state.scene
        on_trace = isinstance(of, TraceGroup)
        if controller is None:
            amplitudes = np.fromiter(state.active.values(), float, len(state.amplitudes))
            return basis.evaluate(amplitudes, orientation=state.look.tilts and not on_trace)
        loop, point_mm = (of.loop, of.nominal_mm) if on_trace else (state.loop, None)
        positions = tuple((scene.reference or {}).items()), tuple(state.positions.items())
        identities = Identity(controller), Identity(of), Identity(scene.model)
        key = *identities, positions, loop, state.view_key
        now = state.active_scene()
        prepared = CACHE.get(
            key,
            lambda: controller.at(of.coordinates, of.nominal_mm, now, loop, point_mm),
            lambda found: found.nbytes,
        )
        if start is None or start.keys() != state.amplitudes.keys():
            return prepared.field(now.errors)
        begun = replace(state, amplitudes=start)
        change = np.subtract([*begun.active.values()], [*state.active.values()])
        exact = CACHE.get(
            (*key, Identity(state.scene), tuple(begun.active.items())),
            lambda: prepared.field(begun.active_scene().errors),
            lambda field: 3 * field.error_um.nbytes,
        )
        return exact - basis.evaluate(change, orientation=state.look.tilts and not on_trace)


def _place(state: AppState) -> tuple[object, ...]:
    inputs = _response_inputs(Identity(state.scene))
    return inputs, state.grid_nodes, tuple(state.positions.items()), state.view_key


@lru_cache(maxsize=64)
def _response_inputs(of: Identity) -> object:
    """Return the inputs of responses that come from a scene, but for its amplitudes, as one key."""
    scene: Scene = of.target
    unit = [(key, curve.with_amplitude(1.0)) for key, curve in scene.errors.functions.items()]
    shapes = tuple((key, curve) for key, curve in unit if not isinstance(curve, Constant))
    reference = scene.reference if scene.reference is None else tuple(scene.reference.items())
    volume = tuple(scene.workspace.ranges.items()), reference, scene.trace_points_mm
    return _key_of(Identity(scene.model), scene.parameter_keys, shapes, *volume)


def _size(response: Response) -> int:
    return sum(basis.position.nbytes + basis.orientation.nbytes for _, basis in response)


def _build(state: AppState) -> Response:
    scene = state.scene
    grid = build_grid(scene.model, scene.workspace.moved(state.positions), state.grid_nodes)
    positions = {**scene.workspace.positions, **state.positions}
    points = state.rotary.points_mm(scene)
    groups = build_traces(scene.model, points, positions, TRACE_SAMPLES, state.rotary.held)

    bases = [grid_basis(scene, grid, state.view())]
    for group in groups:
        at, point, view = group.coordinates, group.nominal_mm, state.view(group.loop)
        keys = scene.parameter_keys
        bases.append(build_basis(scene.model, scene.errors, keys, at, view, point))
    return tuple(zip((grid, *groups), bases, strict=True))


def evaluate_state(state: AppState) -> tuple[Grid, ErrorField]:
    """Evaluate the grid of a state that is not drawn: no response is kept for it."""
    scene = state.active_scene()
    grid = build_grid(scene.model, scene.workspace, state.nodes)
    return grid, evaluate_grid(scene, grid, scene.view(state.loop))


@dataclass(frozen=True)
class PassFail(ColourScale):
    """Two colours: within a limit, and above."""

    limit: float = 0.0

    def fraction(self, values: Array) -> Array:
        return np.where(np.asarray(values) > self.limit, 1.0 - WITHIN_LIMIT, WITHIN_LIMIT)

    @property
    def ticks(self) -> tuple[float, ...]:
        return (self.low, self.limit, self.high)


def _chosen_colours(state: AppState, volume: LivePicture, basis: ErrorBasis) -> ColourScale:
    """Return the selected colour scale: fixed, shared, or with round ends."""
    quantity, component, look = volume.quantity, state.component, state.look
    field, values = volume.field, volume.shown_values
    limit = volume.limit_um
    if limit is not None:
        scale = model.choose_scale([values], component)
        top = max(scale.high, limit)
        return PassFail(0.0, top, diverging=True, label=scale.label, unit=scale.unit, limit=limit)
    if look.range_mode == "shared" and quantity != "uncertainty" and not state.shows_rotary:
        opened = basis.evaluate(np.array([state.start[key] for key in basis.keys]))
        errors = [model.coloured_error(at, quantity) for at in (field, opened)]
        lengths = [np.linalg.norm(error, axis=-1) for error in errors]
        return model.choose_scale(lengths, component, quantity)
    end = look.range_top if look.range_mode == "fixed" else None
    return model.choose_scale([values], component, quantity, end=end)
