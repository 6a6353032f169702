"""Worst case of tolerances, against all combinations of signs and a published bound."""

from itertools import product

import numpy as np
import pytest

from warpspace.analysis.sampling.worst_case import worst_case_um


def by_all_signs(gains, centre, half_width):
    largest = 0.0
    for signs in product((-1.0, 1.0), repeat=len(centre)):
        error = np.einsum("ckn,k->cn", gains, centre + np.array(signs) * half_width)
        largest = max(largest, np.linalg.norm(error, axis=0).max())
    return largest


@pytest.mark.parametrize("seed", range(12))
def test_it_is_the_largest_of_all_corners_of_the_tolerances(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 11))
    gains = rng.normal(size=(3, count, 4))
    gains[:, :: 1 + seed % 3] = np.round(gains[:, :: 1 + seed % 3])  # many share a plane or a line
    centre = rng.normal(size=count) * (seed % 2)
    half_width = rng.uniform(0.0, 3.0, count)
    half_width[rng.random(count) < 0.2] = 0.0
    found = worst_case_um(gains, centre, half_width)
    assert found == pytest.approx(by_all_signs(gains, centre, half_width), rel=1e-9)


def test_errors_along_the_axes_add_up_as_a_diagonal():
    gains = np.repeat(np.eye(3)[:, :, None], 2, axis=2)
    assert worst_case_um(gains, np.zeros(3), np.array([3.0, 4.0, 12.0])) == pytest.approx(13.0)
    assert worst_case_um(gains, np.array([1.0, 0.0, 0.0]), np.zeros(3)) == pytest.approx(1.0)


def test_no_error_has_no_worst_case():
    assert worst_case_um(np.zeros((3, 2, 1)), np.zeros(2), np.ones(2)) == 0.0
