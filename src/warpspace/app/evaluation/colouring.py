"""From a field to what is coloured: position error or tilt, and the range of its colours."""

import numpy as np

from warpspace.app.state.app_state import AppState
from warpspace.field.basis import ErrorBasis, ErrorField
from warpspace.geometry.colour import SYMBOLS, ColourScale, build_scale, component_values
from warpspace.units import Array


def shown_error(state: AppState, field: ErrorField) -> Array:
    """Give the vectors that are coloured, [..., 3], µm or µrad."""
    return field.orientation_urad if state.look.tilts else field.error_um


def shown_values(state: AppState, field: ErrorField) -> Array:
    """Give the values that are coloured, [...], µm or µrad."""
    if state.component == "norm" and not state.look.tilts:
        return field.norm_um
    return component_values(shown_error(state, field), state.component)


def choose_scale(
    state: AppState, values: Array, basis: ErrorBasis, field: ErrorField
) -> ColourScale:
    """Choose the colours' range for a state.

    Parameters
    ----------
    state : AppState
    values : ndarray, [...], µm or µrad
        What is coloured over the volume.
    basis : ErrorBasis
        Response of the volume, for what a shared range also has to hold.
    field : ErrorField
        Over the volume.

    Returns
    -------
    ColourScale
        With round ends, except a fixed one, which ends where the user has said.
    """
    symbol, unit = SYMBOLS[state.look.quantity]
    mode = state.look.range_mode
    largest = float(np.abs(values).max())
    if mode == "shared":
        largest = _shared_largest(state, basis, field)
    end = state.look.range_top if mode == "fixed" else None
    return build_scale(largest, state.component, quantity=symbol, unit=unit, end=end)


def _shared_largest(state: AppState, basis: ErrorBasis, field: ErrorField) -> float:
    """Largest length now and of the scene as it was opened, µm or µrad."""
    opened = basis.evaluate(np.array([state.start[key] for key in basis.keys]))
    both = (shown_error(state, field), shown_error(state, opened))
    return max(float(np.linalg.norm(error, axis=-1).max()) for error in both)
