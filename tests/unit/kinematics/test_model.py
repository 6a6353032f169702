"""Completing axis positions."""

import numpy as np
import pytest

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics.model import batch_shape, complete_coordinates
from warpspace.machine.description import build_machine

MACHINE = build_machine("wCFXYt")


def test_axes_not_given_take_their_default_or_zero() -> None:
    found = complete_coordinates(MACHINE, {"X": [1.0, 2.0]}, {"Y": 5.0, "X": 9.0})
    assert list(found) == ["X", "Y", "C"]
    assert found["X"].tolist() == [1.0, 2.0]
    assert found["Y"].tolist() == 5.0
    assert found["C"].tolist() == 0.0
    assert batch_shape(found) == (2,)


def test_unknown_axis_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="'Z'; expected one of X, Y, C"):
        complete_coordinates(MACHINE, {"Z": 1.0})


@pytest.mark.parametrize("value", [np.nan, [0.0, np.inf], "far", None, [[1.0], [1.0, 2.0]]])
def test_positions_that_are_no_finite_numbers_are_refused(value: object) -> None:
    with pytest.raises(OptionError, match=r"axis Y at .*; expected finite numbers"):
        complete_coordinates(MACHINE, {"Y": value})


def test_batches_that_do_not_fit_together_are_refused() -> None:
    with pytest.raises(OptionError, match=r"X \(2,\), Y \(3,\).*one batch shape"):
        complete_coordinates(MACHINE, {"X": np.zeros(2), "Y": np.zeros(3)})
    fitting = complete_coordinates(MACHINE, {"X": np.zeros((2, 1)), "Y": np.zeros(3)})
    assert batch_shape(fitting) == (2, 3)
