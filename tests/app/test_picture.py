"""The picture of the view carries title, factor and the colours of its bar."""

from io import BytesIO

import numpy as np
from PIL import Image

from warpspace.app.documents.view_image import BAND_PX, HEAD_PX, view_png
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.scene.library import load_scene


def test_the_view_is_framed_by_heading_and_colour_bar() -> None:
    picture = LiveModel().evaluate(start_state(load_scene("dvf5000_first"), nodes=5))
    pixels = np.zeros((300, 400, 4), np.uint8)
    drawn = Image.open(BytesIO(view_png(pixels, picture)))
    assert drawn.size == (400 + BAND_PX, 300 + HEAD_PX)
    assert "1" in drawn.info["Description"]
    column = np.asarray(drawn)[:, 400 + 30]
    ends = picture.scale.colours(np.array([picture.scale.high, picture.scale.low]))
    for colour in ends:
        assert (column == colour).all(axis=-1).any()
    assert (np.asarray(drawn)[:HEAD_PX] < 128).any()
