"""The two guides of a gantry: their errors, which the axis has as mean and rotation."""

from dataclasses import replace

import numpy as np

from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.machine.curves.curve import OWN, ErrorFunction
from warpspace.machine.gantry import Gantry

SAMPLES = 65
ALIKE = 1e-9
"""By how much two curves of amplitude 1 may differ that count as one."""


def guide_errors(state: AppState, axis: str) -> tuple[float, float] | None:
    """Give the positioning errors of both guides of a gantry.

    Parameters
    ----------
    state : AppState
    axis : str

    Returns
    -------
    tuple of float, (2,), µm, or None
        The amplitude of each guide; None where the axis has no guides, or where the errors of the
        pair have different curves, so that one number does not tell that of a guide.
    """
    gantry = state.scene.machine.gantries.get(axis)
    if gantry is None or not _one_curve(state, gantry):
        return None
    mean = state.amplitudes[gantry.positioning_key]
    half = 0.5 * state.amplitudes[gantry.rotation_key] / gantry.rotation_weight
    return mean - half, mean + half


def with_guide_error(state: AppState, axis: str, index: int, value_um: float) -> AppState:
    """Set the positioning error of one guide; the other one stays.

    Parameters
    ----------
    state : AppState
    axis : str
    index : int
        0 for the first guide, 1 for the second.
    value_um : float, µm
        Clamped with the errors that follow from it.

    Returns
    -------
    AppState
        With another mean and rotation; unchanged but for a note where that cannot be.
    """
    present = guide_errors(state, axis)
    if present is None or index not in (0, 1):
        note = f"guides of {axis}: their errors have different curves; use the sliders"
        return replace(state, notes=(*state.notes, note))
    gantry = state.scene.machine.gantries[axis]
    first, second = (value_um, present[1]) if index == 0 else (present[0], value_um)
    mean, rotation = (first + second) / 2.0, (second - first) * gantry.rotation_weight
    shape = _shape(state, gantry)
    for key, amplitude in ((gantry.positioning_key, mean), (gantry.rotation_key, rotation)):
        if edits.curve_of(state, key).amplitude == 0.0:  # it takes the curve of the other one
            state = edits.with_curve(state, key, shape)
        state = edits.with_typed_amplitude(state, key, amplitude)
    return state


def with_same_guides(before: AppState, state: AppState, axis: str) -> AppState:
    """Keep the errors of both guides where the distance between them has been changed.

    Parameters
    ----------
    before, state : AppState
        With the gantry as it was and as it is.
    axis : str

    Returns
    -------
    AppState
        The rotation that follows from them grows as they come nearer to each other.
    """
    was, now = (one.scene.machine.gantries.get(axis) for one in (before, state))
    if was is None or now is None or was.rotation_key != now.rotation_key:
        return state
    turned = state.amplitudes[now.rotation_key] * now.rotation_weight / was.rotation_weight
    return edits.with_typed_amplitude(state, now.rotation_key, turned)


def _shape(state: AppState, gantry: Gantry) -> ErrorFunction:
    """Give the curve that both errors of a pair have: that of the one that is not zero."""
    curves = [edits.curve_of(state, key) for key in (gantry.positioning_key, gantry.rotation_key)]
    return next((curve for curve in curves if curve.amplitude != 0.0), curves[0])


def _one_curve(state: AppState, gantry: Gantry) -> bool:
    """Tell whether both errors of a pair run alike along the axis, or one of them is zero."""
    curves = [edits.curve_of(state, key) for key in (gantry.positioning_key, gantry.rotation_key)]
    if any(curve.amplitude == 0.0 for curve in curves):
        return True
    if any(curve.has_directions or {*curve.arguments} - {OWN} for curve in curves):
        first, second = (curve.with_amplitude(1.0) for curve in curves)
        return first == second
    at = np.linspace(*edits.axis_span(state, gantry.positioning_key), SAMPLES)
    one, other = (curve.evaluate(at) / curve.amplitude for curve in curves)
    return bool(np.abs(one - other).max() <= ALIKE)
