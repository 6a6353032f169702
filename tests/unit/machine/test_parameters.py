"""The one table of parameters, and which of them a machine has."""

import pytest

from warpspace.exceptions import UnknownNameError
from warpspace.machine.axes import DIRECTIONS, is_axis_name
from warpspace.machine.parameters import (
    PARAMETERS,
    ErrorKind,
    default_keys,
    parameter,
)

DVF5000 = default_keys("XYZBC")
SEVEN = {"EC0Y", "EA0Z", "EB0Z", "EA0B", "EC0B", "EA0C", "EB0C"}
FOUR_LEFT_OUT = {"EX0B", "EZ0B", "EX0C", "EY0C"}


def test_reference_machine_has_37_parameters_and_the_4_that_table_4_2_leaves_out() -> None:
    assert len(DVF5000) == len(set(DVF5000)) == 41
    component = {key for key in DVF5000 if not parameter(key).is_constant}
    assert component == {f"E{letter}{axis}" for axis in "XYZBC" for letter in DIRECTIONS}
    assert set(DVF5000) - component == SEVEN | FOUR_LEFT_OUT


def test_table_has_twelve_parameters_for_each_axis_there_can_be() -> None:
    assert len(PARAMETERS) == len({*PARAMETERS}) == 12 * 9 * 11
    for key, row in PARAMETERS.items():
        assert row.key == key
        assert is_axis_name(row.axis)
        assert key.endswith(row.axis)
        assert row.is_constant == (key[2] == "0")


def test_axes_with_a_digit_have_parameters_of_their_own() -> None:
    assert parameter("EXC1").label == "EXC1 · δ_xC1 · radial error of C1 in x [µm]"
    assert parameter("EA0C1").kind is ErrorKind.ORIENTATION
    assert parameter("EBW").name == "yaw of W"
    assert parameter("EA0Z2").name == "squareness of Z2 to Y"


def test_parallel_axes_have_the_two_angles_between_them() -> None:
    keys = default_keys(["Z", "X", "W", "Y"])
    assert [key for key in keys if key[2] == "0"] == ["EC0Y", "EA0Z", "EB0Z", "EA0W", "EB0W"]
    assert [key for key in default_keys(["X", "X2"]) if key[2] == "0"] == ["EB0X2", "EC0X2"]


def test_keys_symbols_and_labels_are_unique() -> None:
    for field in ("key", "symbol", "label", "name"):
        assert len({getattr(row, field) for row in PARAMETERS.values()}) == len(PARAMETERS)


@pytest.mark.parametrize(
    ("key", "symbol", "name", "kind", "unit", "direction"),
    [
        ("EAX", "ε_xX", "roll of X", ErrorKind.ROTATION, "µrad", 0),
        ("EBX", "ε_yX", "pitch of X", ErrorKind.ROTATION, "µrad", 1),
        ("ECY", "ε_zY", "yaw of Y", ErrorKind.ROTATION, "µrad", 2),
        ("EXX", "δ_xX", "positioning of X", ErrorKind.TRANSLATION, "µm", 0),
        ("EZY", "δ_zY", "straightness of Y in z", ErrorKind.TRANSLATION, "µm", 2),
        ("EYB", "δ_yB", "axial error of B", ErrorKind.TRANSLATION, "µm", 1),
        ("EXC", "δ_xC", "radial error of C in x", ErrorKind.TRANSLATION, "µm", 0),
        ("ECC", "ε_zC", "angular positioning of C", ErrorKind.ROTATION, "µrad", 2),
        ("EC0Y", "γ_XY", "squareness of Y to X", ErrorKind.SQUARENESS, "µrad", 2),
        ("EA0Z", "α_YZ", "squareness of Z to Y", ErrorKind.SQUARENESS, "µrad", 0),
        ("EB0Z", "β_XZ", "squareness of Z to X", ErrorKind.SQUARENESS, "µrad", 1),
        ("EA0C", "α_YC", "orientation of C about x", ErrorKind.ORIENTATION, "µrad", 0),
        ("EX0B", "δx_YB", "location of B in x", ErrorKind.LOCATION, "µm", 0),
    ],
)
def test_row_says_what_the_parameter_is(key, symbol, name, kind, unit, direction) -> None:
    row = parameter(key)
    assert (row.symbol, row.name, row.kind) == (symbol, name, kind)
    assert (row.unit, row.direction) == (unit, direction)
    assert row.label == f"{key} · {symbol} · {name} [{unit}]"


@pytest.mark.parametrize(
    ("key", "tolerance_class"),
    [("EXX", "translation"), ("EX0B", "translation"), ("EAX", "rotation"), ("EA0C", "squareness")],
)
def test_tolerance_classes_follow_table_4_6(key: str, tolerance_class: str) -> None:
    assert parameter(key).tolerance_class == tolerance_class


def test_constants_of_other_machines_leave_out_what_the_reference_absorbs() -> None:
    def constants(axes: str) -> set[str]:
        return {key for key in default_keys(axes) if parameter(key).is_constant}

    assert constants("X") == set()
    assert constants("XY") == {"EC0Y"}
    assert constants("XZ") == {"EB0Z"}
    assert constants("YZ") == {"EA0Z"}
    assert constants("ZYX") == {"EC0Y", "EA0Z", "EB0Z"}
    assert constants("A") == {"EB0A", "EC0A", "EY0A", "EZ0A"}


def test_order_of_the_axes_given_does_not_matter() -> None:
    assert default_keys("CBZYX") == DVF5000


def test_unknown_parameter_names_the_near_miss() -> None:
    with pytest.raises(UnknownNameError, match="unknown error parameter 'EC0Q': did you mean"):
        parameter("EC0Q")
