import numpy as np
import pytest

from warpspace.picture.marks import corner_arrows, scale_bars, worst_point
from warpspace.units import MM_PER_UM


@pytest.fixture
def box():
    """Nodes of a 200 × 100 × 50 mm box about the origin."""
    axes = [np.linspace(-half, half, count) for half, count in ((100, 5), (50, 3), (25, 4))]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1)


def test_arrows_run_from_nominal_to_drawn_corner(box):
    error = np.zeros_like(box)
    error[-1, -1, -1] = (3.0, 4.0, 12.0)
    arrows = corner_arrows(box.shape[:3], box, error, 1000.0)
    assert arrows.start_mm.shape == (8, 3)
    at = int(np.argmax(arrows.norm_um))
    assert arrows.start_mm[at] == pytest.approx((100, 50, 25))
    assert arrows.end_mm[at] == pytest.approx((103, 54, 37))
    assert arrows.texts[at] == "13.0 µm"
    assert sorted(arrows.texts)[:7] == ["0.0 µm"] * 7


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_numbers_stand_outside_the_volume(box, sign):
    error = sign * box  # outwards, inwards
    arrows = corner_arrows(box.shape[:3], box, error, 100.0)
    assert (np.abs(arrows.label_mm) > np.abs(arrows.start_mm)).all()
    assert (np.abs(arrows.label_mm) > np.abs(arrows.end_mm)).all()


def test_worst_point_is_the_largest_magnitude(box):
    values = np.zeros(box.shape[:3])
    values[1, 2, 3], values[2, 0, 0] = -7.0, 6.0
    found = worst_point(values, box, box + 1.0)
    assert found.value == -7.0
    assert found.nominal_mm == pytest.approx(box[1, 2, 3])
    assert found.drawn_mm == pytest.approx(box[1, 2, 3] + 1.0)


@pytest.mark.parametrize("factor", [1.0, 37.0, 1000.0, 1e6])
def test_scale_bars_are_round_and_fit(factor):
    geometry, error = scale_bars(550.0, factor)
    assert geometry.length == geometry.drawn_mm == 100.0
    assert error.drawn_mm == pytest.approx(error.length * MM_PER_UM * factor)
    for bar in (geometry, error):
        assert float(f"{bar.length:e}".split("e")[0]) in {1.0, 2.0, 5.0}
        assert 550 / 4 / 2.5 <= bar.drawn_mm <= 550 / 4
    assert error.text == {1.0: "100 mm", 37.0: "2000 µm", 1000.0: "100 µm", 1e6: "0.1 µm"}[factor]
