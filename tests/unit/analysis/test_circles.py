"""Circle deviations against circles that were displaced by hand."""

import numpy as np
import pytest

from warpspace.analysis.circles import circle_deviation, fit_circle

ANGLE = np.linspace(0.0, 2.0 * np.pi, 73)
CIRCLE = np.stack([200.0 * np.cos(ANGLE), 200.0 * np.sin(ANGLE), np.full_like(ANGLE, 50.0)], -1)


def test_displaced_and_tilted_circle_is_taken_apart():
    error = np.tile([3.0, -4.0, 7.0], (73, 1))
    error[:, 2] += 25e-6 * CIRCLE[:, 1] * 1e3  # 25 µrad about x
    found = circle_deviation(CIRCLE, error)
    assert found.radius_mm == pytest.approx(200.0)
    assert found.centre_um == pytest.approx(5.0)
    assert found.axial_offset_um == pytest.approx(7.0)
    assert found.tilt_urad == pytest.approx(25.0)
    assert found.radial_um == pytest.approx(0.0, abs=1e-9)
    assert found.axial_um == pytest.approx(0.0, abs=1e-9)


def test_runout_twice_a_turn_is_its_peak_to_valley():
    error = 2.0 * np.cos(2 * ANGLE)[:, None] * CIRCLE * [1, 1, 0] / 200.0
    found = circle_deviation(CIRCLE, error)
    assert found.radial_um == pytest.approx(4.0, rel=2e-2)
    assert found.centre_um == pytest.approx(0.0, abs=0.1)


def test_arc_in_a_tilted_plane_is_fitted():
    arc = np.stack([np.cos(ANGLE[:30]), np.zeros(30), -np.sin(ANGLE[:30])], -1) * 300.0
    centre, radius, normal = fit_circle(arc + np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(centre, [1.0, 2.0, 3.0], atol=1e-9)
    assert radius == pytest.approx(300.0)
    np.testing.assert_allclose(normal, [0.0, 1.0, 0.0], atol=1e-12)
