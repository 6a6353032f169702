"""How much each error does in the whole volume, taken alone."""

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.scene.pipeline import grid_basis


def effects_alone(picture: LivePicture, state: AppState) -> dict[str, float]:
    """Give the effect of every error: RMS of the volume, with this error alone.

    It is the RMS that the page shows when the error's "only" is pressed. It does not depend on the
    other errors, with which the error may add up or cancel.

    Parameters
    ----------
    picture : LivePicture
        Gives grid and loop.
    state : AppState
        Gives curves and amplitudes; excluded errors have their effect, too.

    Returns
    -------
    dict of str to float, µm
    """
    basis = grid_basis(state.scene, picture.grid, picture.view)
    amplitudes = np.array([state.amplitudes[key] for key in basis.keys])
    squares = np.sum(basis.position**2, axis=-1).reshape(len(basis.keys), -1)
    rms = np.sqrt(squares @ picture.grid.weights.reshape(-1)) * np.abs(amplitudes)
    return dict(zip(basis.keys, rms.tolist(), strict=True))
