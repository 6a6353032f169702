"""Changes of a state: curves and tolerances of its scene, what of it is seen. Pure, clamped."""

from collections.abc import Collection, Mapping
from dataclasses import replace

from warpspace.app.state.app_state import AppState
from warpspace.app.state.ranges import Span, round_up
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, Tolerance
from warpspace.machine.limits import MAX_ERROR, MAX_HALF_WIDTH, MIN_HALF_WIDTH

LEAST_HALF_WIDTH = 10.0
FINE_UP_TO = 100.0  # µm or µrad: sliders of tolerances that end below have a step of 0.01


def axis_span(state: AppState, key: str) -> tuple[float, float]:
    """Give the range over which the curve of a parameter runs, mm or degrees."""
    return state.scene.axis_span(parameter(key).axis)


def curve_of(state: AppState, key: str) -> ErrorFunction:
    """Give the curve of a parameter with its present amplitude."""
    function = state.scene.errors.functions.get(key) or Constant(axis_span(state, key))
    return function.with_amplitude(state.amplitudes[key])


def with_curve(state: AppState, key: str, function: ErrorFunction) -> AppState:
    """Give a parameter another curve and its amplitude."""
    if key not in state.amplitudes:
        return replace(state, notes=(*state.notes, f"{key}: no parameter of this machine"))
    row = parameter(key)
    if row.is_constant and not isinstance(function, Constant):
        note = f"{key} is constant along its axis; expected one number"
        return replace(state, notes=(*state.notes, note))
    if function == curve_of(state, key):
        return state
    amplitude = function.amplitude
    errors = ErrorSet({**state.scene.errors.functions, key: function})
    return replace(
        state,
        scene=replace(state.scene, errors=errors),
        loaded=state.origin,
        amplitudes={**state.amplitudes, key: amplitude},
    )


def half_width_of(state: AppState, key: str) -> float:
    """Give the half width of a parameter's tolerance, µm or µrad; 0 where it has none."""
    found = state.tolerances.get(key)
    return 0.0 if found is None else found.half_width


def half_width_span(state: AppState, key: str) -> Span:
    """Choose the range of a tolerance slider: up to about twice the scene's half width, or more.

    It holds the present half width, which an allocation may have made wider.
    """
    found = state.origin.tolerances.get(key)
    widest = max(2.0 * (found.half_width if found else 0.0), LEAST_HALF_WIDTH)
    widest = max(widest, half_width_of(state, key))
    high = min(round_up(widest), MAX_ERROR)
    # number boxes show as many decimals as the step has
    return Span(0.0, high, 0.01 if high <= FINE_UP_TO else 0.1)


def with_half_width(state: AppState, key: str, half_width: float) -> AppState:
    """Set the half width of one tolerance, µm or µrad; its centre stays."""
    if key not in state.amplitudes:
        return replace(state, notes=(*state.notes, f"{key}: no parameter of this machine"))
    present = state.tolerances.get(key) or Tolerance(0.0, 0.0)
    span = Span(0.0, max(MAX_HALF_WIDTH, half_width_span(state, key).high), 0.1)
    kept = span.clamp(half_width, present.half_width)
    kept = 0.0 if kept < MIN_HALF_WIDTH else kept
    notes = state.notes
    if kept != half_width:
        notes = (*notes, f"tolerance of {key} = {half_width:g}: clamped to ±{kept:g}")
    own = {**state.tolerances.own, key: Tolerance(present.centre, kept)}
    return replace(state, tolerances=replace(state.tolerances, own=own), notes=notes)


def with_scene_tolerances(state: AppState) -> AppState:
    """Go back to the tolerances of the scene."""
    own = state.origin.tolerances
    # an edited machine may not have all axes of the scene's
    kept = {key: own.own[key] for key in own.own if key in state.amplitudes}
    return replace(state, tolerances=replace(own, own=kept))


def with_scaled_tolerances(state: AppState, keys: Collection[str], factor: float) -> AppState:
    """Widen or narrow tolerances in the same ratio; those that are fixed stay."""
    half_widths = {
        key: min(half_width * factor, max(MAX_HALF_WIDTH, half_width))
        for key in keys
        if key not in state.specification.fixed and (half_width := half_width_of(state, key)) > 0.0
    }
    return with_half_widths(state, half_widths)


def with_half_widths(state: AppState, half_widths: Mapping[str, float]) -> AppState:
    """Set the half widths of several tolerances at once, µm or µrad; centres stay.

    Only for numbers that the program has worked out itself: they are taken as they are.
    """
    return replace(state, tolerances=state.tolerances.with_half_widths(half_widths))


def with_sight(state: AppState, *, inside: bool) -> AppState:
    """Draw grid lines in place of a closed surface, which would hide what is inside; and back."""
    before, after = ("surface", "grid") if inside else ("grid", "surface")
    if state.look.surface != before:
        return state
    return replace(state, look=state.look.with_choice(surface=after))
