"""Expected information of checks against numerical integration over their readings."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from warpspace.calibration.readings import Readings
from warpspace.diagnosis import information
from warpspace.diagnosis.causes import Cause
from warpspace.diagnosis.evidence import (
    FACTORS,
    PRIOR_ONE,
    PRIOR_WITHIN,
    WITHIN,
    Diagnostics,
    Observations,
)
from warpspace.diagnosis.information import rank_tests


def reading(gain):
    """One reading with a gain in standard uncertainties per half-width."""
    none = np.zeros((1, 0))
    return Observations(np.array([[gain]]), none, np.zeros(1), ("a",), np.ones(1))


def candidate(name, kind="circular:plane=XY:radius=150"):
    nothing = np.zeros((1, 3))
    readings = Readings(kind, {}, nothing, nothing, None, ("",), (1,), "", plan=SimpleNamespace())
    return SimpleNamespace(name=f"{name}: 1 readings of one component; unknown: zero",
                           readings=readings)  # fmt: skip


def integrated_bits(gain):
    """Mutual information of a cause, out of tolerance or not, and a reading without set-up."""
    y = np.linspace(-400.0, 400.0, 400_001)
    prior = np.array([PRIOR_ONE, PRIOR_WITHIN]) / (PRIOR_ONE + PRIOR_WITHIN)
    outside = np.mean([norm.pdf(y, scale=np.hypot(1.0, gain * f)) for f in FACTORS], axis=0)
    density = np.stack([outside, norm.pdf(y, scale=np.hypot(1.0, gain * WITHIN))])
    joint = prior[:, None] * density
    logs = np.log2(np.maximum(density, 1e-300) / np.maximum(joint.sum(axis=0), 1e-300))
    return float(np.trapezoid((joint * logs).sum(axis=0), y))


@pytest.mark.parametrize("gain", [0.5, 2.0, 10.0])
def test_information_of_a_reading_is_that_of_the_integral(gain, monkeypatch):
    monkeypatch.setattr(information, "DRAWS", 40_000)
    monkeypatch.setattr(information, "MIN_BITS", 0.0)
    diagnostics = Diagnostics([Cause("cause a", [0], np.ones(1), np.eye(1))], reading(0.0))
    posterior = diagnostics.infer()
    (test,) = rank_tests(diagnostics, posterior, [(candidate("x"), reading(gain))], lambda _: None)
    assert test.information_bits == pytest.approx(integrated_bits(gain), abs=0.01)
    # one cause or none: the question whether it is this one is the same
    assert test.bits_by_causes[(0,)] == pytest.approx(test.information_bits, abs=1e-12)


def test_the_cheaper_of_two_like_tests_comes_first_and_a_useless_one_not_at_all():
    diagnostics = Diagnostics([Cause("cause a", [0], np.ones(1), np.eye(1))], reading(0.0))
    laser = candidate("laser", "positioning:axis=X")
    planned = [(laser, reading(10.0)), (candidate("ball bar"), reading(10.0)),
               (candidate("nothing"), reading(0.0))]  # fmt: skip
    tests = rank_tests(diagnostics, diagnostics.infer(), planned, lambda _: None)
    assert [test.test for test in tests] == ["ball bar", "laser"]
    assert tests[0].minutes < tests[1].minutes
    assert tests[0].options == {"kind": "circular", "plane": "XY", "radius": "150"}
