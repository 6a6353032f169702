"""One point is spelt alike everywhere: as the drawing's axes have it, beside where axes stand."""

import numpy as np
import pytest

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.sensitivities import rank_picture
from warpspace.app.readouts.gains import spell_ranking
from warpspace.app.readouts.summary import summary
from warpspace.app.state.app_state import start_state
from warpspace.picture.coordinates import spell_coordinate
from warpspace.scene.library import load_scene


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (-0.04, "0"), (-50.96, "−51"), (2.5, "2.5"), (1e4, "10000")]
)
def test_numbers_are_spelt_to_a_tenth_with_a_proper_minus(value: float, text: str) -> None:
    assert spell_coordinate(value) == text


def test_result_and_gains_name_the_worst_point_alike() -> None:
    picture = LiveModel().evaluate(start_state(load_scene("dvf5000_first")))
    ranking = rank_picture(picture)
    # Z of the drawing counts from the table, that of the axis from its upper end
    place = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"
    copied = 'data-copy="X=275,Y=-225,Z=-480,B=0,C=0"'
    for value, text in (("gain at", spell_ranking(ranking)), ("max at", summary(picture))):
        assert f'data-value="{value}">{place} <' in text
        assert copied in text
    assert np.isclose(picture.statistics.max_at_mm[2], -51.0)
