"""Ranges of sliders, and edits of curves, tolerances and surface of a state."""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

from warpspace.analysis.sampling.distribution import round_width
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Span
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, Tolerance
from warpspace.machine.limits import MAX_ERROR, MAX_HALF_WIDTH, MIN_HALF_WIDTH

LEAST_TRANSLATION_UM = 20.0
LEAST_ROTATION_URAD = 50.0
LEAST_HALF_WIDTH = 10.0
FINE_STEP, FINE = 0.1, (5.0, 500.0)  # step of sliders with an end in this range


def _span(low: float, reach: float) -> Span:
    """Return the range of a slider up to a value, with a round end: 1, 2 or 5 × 10ⁿ."""
    high = min(round_width(reach * (1.0 - 1e-9)), MAX_ERROR)
    fine = FINE[0] <= high <= FINE[1]
    return Span(low * high, high, FINE_STEP if fine else 10.0 ** (math.ceil(math.log10(high)) - 3))


def amplitude_span(key: str, value: float, tolerance: Tolerance | None) -> Span:
    least = LEAST_ROTATION_URAD if parameter(key).is_rotation else LEAST_TRANSLATION_UM
    if tolerance is not None:
        reach = abs(tolerance.centre) + tolerance.half_width
        least = reach if reach >= MIN_HALF_WIDTH else least
    return _span(-1.0, max(least, 2.0 * abs(value)))


def with_curve(state: AppState, key: str, function: ErrorFunction) -> AppState:
    if key not in state.amplitudes:
        return state.noted(f"{key} is not a parameter of this machine")
    if parameter(key).is_constant and not isinstance(function, Constant):
        return state.noted(f"{key} is constant along its axis; expected one number")
    if function == state.curve(key):
        return state
    errors = ErrorSet({**state.scene.errors.functions, key: function})
    changed = replace(state, scene=replace(state.scene, errors=errors), loaded=state.origin)
    return changed.with_amplitude(key, function.amplitude)


def half_width_of(state: AppState, key: str) -> float:
    """Return the half-width of a parameter's tolerance, µm or µrad; 0 where it has none."""
    tolerance = state.tolerances.get(key)
    return 0.0 if tolerance is None else tolerance.half_width


def half_width_span(state: AppState, key: str) -> Span:
    """Return the range of a tolerance slider: about twice the scene's half-width.

    It includes the present half-width, which an allocation may have widened.
    """
    tolerance = state.origin.tolerances.get(key)
    widest = max(2.0 * (tolerance.half_width if tolerance else 0.0), LEAST_HALF_WIDTH)
    return _span(0.0, max(widest, half_width_of(state, key)))


def with_scene_tolerances(state: AppState) -> AppState:
    original = state.origin.tolerances
    # an edited machine may lack axes of the scene
    tolerances = {key: at for key, at in original.individual.items() if key in state.amplitudes}
    return replace(state, tolerances=replace(original, individual=tolerances))


def with_scaled_tolerances(state: AppState, keys: Collection[str], factor: float) -> AppState:
    present = {key: half_width_of(state, key) for key in keys}
    scaled = {
        key: min(half_width * factor, max(MAX_HALF_WIDTH, half_width))
        for key, half_width in present.items()
        if key not in state.specification.fixed and half_width > 0.0
    }
    return with_half_widths(state, scaled)


def with_half_widths(state: AppState, half_widths: Mapping[str, float]) -> AppState:
    """Set computed half-widths, µm or µrad; the centres stay."""
    return replace(state, tolerances=state.tolerances.with_half_widths(half_widths))


def with_sight(state: AppState, *, inside: bool) -> AppState:
    """Switch between grid lines, which show the inside of the box, and a closed surface."""
    before, after = ("surface", "grid") if inside else ("grid", "surface")
    if state.look.surface != before:
        return state
    return replace(state, look=replace(state.look, surface=after))
