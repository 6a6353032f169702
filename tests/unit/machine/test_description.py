"""Chains, machines and the one table of parameters."""

import pytest

from warpspace.exceptions import ChainError, UnknownNameError
from warpspace.machine.axes import DIRECTIONS, PARAMETERS, is_axis_name, parameter
from warpspace.machine.definition import Chain, build_machine, parse_chain


@pytest.mark.parametrize(
    ("text", "workpiece", "tool", "axes"),
    [
        ("W C’ B′ F XYZ T", "BC", "XYZ", "XYZBC"),
        ("wXYFZt", "YX", "Z", "XYZ"),
        ("wFXYZACt", "", "XYZAC", "XYZAC"),
        ("wCAYXFZt", "XYAC", "Z", "XYZAC"),
        ("wBFt", "B", "", "B"),
        ("wbBt", "", "B", "B"),
        ("wBbt", "B", "", "B"),
        ("wABCFZYXt", "CBA", "ZYX", "XYZABC"),
    ],
)
def test_branches_run_from_the_frame_outwards(text, workpiece, tool, axes):
    chain = parse_chain(text)
    assert chain == Chain(tuple(workpiece), tuple(tool))
    assert chain.axes == tuple(axes)


def test_names_may_carry_a_digit_and_letters_may_be_repeated():
    chain = parse_chain("w C2' X' F Z W C1 t")
    assert chain == Chain(("X", "C2"), ("Z", "W", "C1"))
    assert chain.axes == ("X", "Z", "W", "C1", "C2")
    assert str(chain) == "wC2XFZWC1t"
    machine = build_machine(chain)
    assert (machine.axis("W").is_linear, machine.axis("W").index) == (True, 2)
    assert machine.axis("C1").travel == (0.0, 360.0)
    assert {"EXC1", "EA0C2", "EB0W", "EA0W"} <= {*machine.parameter_keys}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("tZYXFBCw", "cannot be read"),
        ("wXYFYXt", "axis X, Y twice"),
        ("wC1FC1t", r"axis C1 twice.*C1, C2"),
        ("wC12FXt", "unknown axis C12"),
        ("wABCUVWFXYZt", "9 axes; expected one to eight"),
        ("wXFYFZt", "unknown axis F"),
    ],
)
def test_impossible_chain_is_refused_with_the_text_and_the_reason(text, reason):
    with pytest.raises(ChainError, match=reason) as caught:
        parse_chain(text)
    assert repr(text) in str(caught.value)


def test_reference_machine_has_37_parameters_and_the_4_that_table_4_2_leaves_out():
    found = build_machine("wCBFXYZt").parameter_keys
    assert len(found) == len(set(found)) == 41
    component = {key for key in found if not parameter(key).is_constant}
    assert component == {f"E{letter}{axis}" for axis in "XYZBC" for letter in DIRECTIONS}
    seven = {"EC0Y", "EA0Z", "EB0Z", "EA0B", "EC0B", "EA0C", "EB0C"}
    assert set(found) - component == seven | {"EX0B", "EZ0B", "EX0C", "EY0C"}


def test_table_has_twelve_parameters_for_each_axis_there_can_be():
    assert len(PARAMETERS) == len({*PARAMETERS}) == 12 * 9 * 11
    for key, row in PARAMETERS.items():
        assert is_axis_name(row.axis)
        assert key == row.key == f"E{row.letter}{'0' * row.is_constant}{row.axis}"
    for field in ("key", "symbol", "label", "name"):
        assert len({getattr(row, field) for row in PARAMETERS.values()}) == len(PARAMETERS)


@pytest.mark.parametrize(
    ("key", "symbol", "name", "kind", "unit", "direction", "tolerance_class"),
    [
        ("EC0Y", "γ_XY", "squareness of Y to X", "squareness", "µrad", 2, "squareness"),
        ("EX0B", "δx_YB", "location of B in x", "location error", "µm", 0, "translation"),
        # kept texts of `gains` hold those of single letters
        (
            "EXC1",
            "δ_xC1",
            "radial error of C1 in x",
            "component translation",
            "µm",
            0,
            "translation",
        ),
        (
            "EA0C1",
            "α_0C1",
            "orientation of C1 about x",
            "orientation error",
            "µrad",
            0,
            "squareness",
        ),
        ("EA0Z2", "α_0Z2", "squareness of Z2 to Y", "squareness", "µrad", 0, "squareness"),
        ("EBW", "ε_yW", "yaw of W", "component rotation", "µrad", 1, "rotation"),
    ],
)
def test_row_says_what_the_parameter_is(key, symbol, name, kind, unit, direction, tolerance_class):
    row = parameter(key)
    assert (row.symbol, row.name, row.kind) == (symbol, name, kind)
    assert (row.unit, row.direction, row.tolerance_class) == (unit, direction, tolerance_class)
    assert row.label == f"{key} · {symbol} · {name} [{unit}]"


@pytest.mark.parametrize(
    ("chain", "constants"),
    [
        ("wFXt", set()),
        ("wFXYt", {"EC0Y"}),
        ("wFXZt", {"EB0Z"}),
        ("wFYZt", {"EA0Z"}),
        ("wYXFZt", {"EC0Y", "EA0Z", "EB0Z"}),
        ("wFAt", {"EB0A", "EC0A", "EY0A", "EZ0A"}),
        # the errors of an axis that carries the other one rotate both
        ("wFZYXt", {"EC0X", "EA0Y", "EB0X"}),
        ("wXYFZt", {"EC0X", "EA0Z", "EB0Z"}),
        # parallel axes have the two angles between them
        ("wFXYZWt", {"EC0Y", "EA0Z", "EB0Z", "EA0W", "EB0W"}),
        ("wX2FXt", {"EB0X2", "EC0X2"}),
    ],
)
def test_constants_are_those_that_change_the_angle_between_two_axes(chain, constants):
    keys = build_machine(chain).parameter_keys
    assert {key for key in keys if parameter(key).is_constant} == constants


def test_unknown_parameter_names_the_near_miss():
    with pytest.raises(UnknownNameError, match="unknown error parameter 'EC0Q': did you mean"):
        parameter("EC0Q")
