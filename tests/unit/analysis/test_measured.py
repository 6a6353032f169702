"""Measured machines: limits, marks and the shear of the volume."""

import pytest

import warpspace
from warpspace.analysis.measured import Check, check_errors, shear
from warpspace.machine.errors import Constant, ErrorSet
from warpspace.machine.tolerances import Tolerance, ToleranceSet


@pytest.mark.parametrize(
    ("value", "mark"), [(-14.0, "O"), (-2.0, "O"), (-14.01, "X"), (-1.99, "X"), (-8.0, "O")]
)
def test_limits_belong_to_the_tolerance(value: float, mark: str) -> None:
    assert Check("EAX", value, -8.0, 6.0).mark == mark


def test_no_tolerance_is_no_verdict() -> None:
    (check,) = check_errors(ErrorSet({"EAX": Constant((0, 1), 3.0)}), ToleranceSet())
    assert check.passes is None
    assert check.mark == "–"


def test_checks_come_in_the_order_of_the_table() -> None:
    errors = ErrorSet({key: Constant((0, 1), 1.0) for key in ("EC0Y", "EXX", "EAY")})
    limits = ToleranceSet({"translation": 1, "squareness": 1}, {"EAY": Tolerance(0, 0.5)})
    assert [(c.key, c.mark) for c in check_errors(errors, limits)] == [
        ("EXX", "O"),
        ("EAY", "X"),
        ("EC0Y", "O"),
    ]


def test_shear_of_pure_squareness_is_the_squareness() -> None:
    field = warpspace.evaluate(warpspace.load_scene("teach_squareness"), grid=3)
    found = shear(field)
    assert found["XY"] == pytest.approx(30.0)
    assert found["XZ"] == pytest.approx(0.0, abs=1e-9)
    assert found["YZ"] == pytest.approx(0.0, abs=1e-9)


def test_yz_is_the_plane_most_out_of_square_on_the_first_machine() -> None:
    found = warpspace.measured(warpspace.load_scene("dvf5000_first")).shear_urad
    assert max(found, key=lambda plane: abs(found[plane])) == "YZ"
