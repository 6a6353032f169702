"""Error motions against bodies that were moved by hand."""

import numpy as np
import pytest

from warpspace.analysis.axis_motion import LEVER_MM, axis_motion, fit_circle, times_a_turn

ANGLE = np.linspace(0.0, 360.0, 73)
THETA = np.deg2rad(ANGLE)
CIRCLE = np.stack([200.0 * np.cos(THETA), 200.0 * np.sin(THETA), np.full_like(THETA, 50.0)], -1)
OUT = CIRCLE * [1.0, 1.0, 0.0] / 200.0


def taken_apart(shift_um, rotation_urad=(0.0, 0.0, 0.0)):
    shift_um = np.broadcast_to(shift_um, (73, 3))
    above = shift_um + np.cross(rotation_urad, [0.0, 0.0, LEVER_MM]) * 1e-3
    return axis_motion(CIRCLE, ANGLE, shift_um, above, closed=True)


def test_shift_of_the_axis_is_runout_once_a_turn_that_the_average_line_takes_out():
    found = taken_apart([3.0, 4.0, 0.0])
    assert found.radius_mm == pytest.approx(200.0)
    assert found.radial.values == pytest.approx(3.0 * np.cos(THETA) + 4.0 * np.sin(THETA))
    assert found.radial.peak_to_valley == pytest.approx(10.0, rel=2e-3)  # twice hypot(3, 4)
    assert found.radial.motion_value == pytest.approx(0.0, abs=1e-9)
    assert (found.radial.once_a_turn, found.axial.once_a_turn) == pytest.approx((5.0, 0.0))
    assert found.radial.times_a_turn == 1
    assert (found.axial.peak_to_valley, found.tilt.peak_to_valley) == pytest.approx((0.0, 0.0))
    assert found.axial.times_a_turn is None


def test_radius_that_swings_twice_a_turn_is_the_radial_error_motion():
    found = taken_apart(2.0 * np.cos(2.0 * THETA)[:, None] * OUT)
    assert found.radial.peak_to_valley == pytest.approx(4.0)
    assert found.radial.motion_value == pytest.approx(4.0)
    assert found.radial.times_a_turn == 2


def test_axial_motion_keeps_its_part_once_a_turn():
    found = taken_apart(np.outer(5.0 + 3.0 * np.sin(THETA), [0.0, 0.0, 1.0]))
    assert found.axial.motion_value == pytest.approx(6.0)
    assert found.axial.about_line == pytest.approx(3.0 * np.sin(THETA))
    assert found.axial.times_a_turn == 1
    assert times_a_turn(np.cos(5.0 * THETA) + 0.4 * np.cos(THETA)) == 5


def test_tilt_is_positive_where_the_axis_leans_towards_the_point():
    # a rotation of 10 µrad about y leans z towards +x, where the point is at 0°
    found = taken_apart(np.zeros(3), [0.0, 10.0, 0.0])
    assert found.tilt.values == pytest.approx(10.0 * np.cos(THETA))
    assert (found.tilt.iso, found.tilt.unit) == ("tilt error motion", "µrad")
    # the face error motion of the point: its own axial error
    face = np.cross([0.0, 10.0, 0.0], CIRCLE - [0.0, 0.0, 50.0])[:, 2] * 1e-3
    assert found.axial.values - 0.2 * found.tilt.values == pytest.approx(face)


def test_arc_has_no_times_a_turn():
    shift, none = np.tile([1.0, 0.0, 0.0], (30, 1)), np.zeros((30, 3))
    found = axis_motion(CIRCLE[:30], ANGLE[:30], shift, none, closed=False)
    assert found.radial.times_a_turn is None
    assert found.radial.values == pytest.approx(np.cos(THETA[:30]))


def test_arc_in_a_tilted_plane_is_fitted():
    arc = np.stack([np.cos(THETA[:30]), np.zeros(30), -np.sin(THETA[:30])], -1) * 300.0
    centre, radius, normal = fit_circle(arc + np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(centre, [1.0, 2.0, 3.0], atol=1e-9)
    assert radius == pytest.approx(300.0)
    np.testing.assert_allclose(normal, [0.0, 1.0, 0.0], atol=1e-12)
