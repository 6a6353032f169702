"""Tolerances of parameters: their own, or that of their class."""

from warpspace.machine.tolerances import Tolerance, ToleranceSet

SET = ToleranceSet({"translation": 10.0, "squareness": 25.0}, {"EAX": Tolerance(-8.0, 6.0)})


def test_own_tolerance_comes_before_that_of_the_class() -> None:
    assert SET.get("EAX") == Tolerance(-8.0, 6.0)
    assert SET.get("EXX") == Tolerance(0.0, 10.0)
    assert SET.get("EA0B") == Tolerance(0.0, 25.0)
    assert SET.get("EAY") is None


def test_missing_lists_what_has_no_tolerance() -> None:
    assert SET.missing(["EXX", "EAX", "EAY", "EBY", "EC0Y"]) == ("EAY", "EBY")


def test_only_an_empty_set_is_false() -> None:
    assert not ToleranceSet()
    assert ToleranceSet(own={"EAX": Tolerance(0.0, 0.0)})
    assert SET
