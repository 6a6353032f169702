"""Chains and machines of any order and side."""

import pytest

from warpspace.exceptions import ChainError, UnknownNameError
from warpspace.machine.description import Chain, build_machine, default_travel, parse_chain


@pytest.mark.parametrize(
    "text",
    ["wCBFXYZt", "(w)CBFXYZ(t)", "[w C' B' b X Y Z t]", "w-C-B-b-X-Y-Z-t", "W C’ B′ F XYZ T"],
)
def test_spellings_of_the_reference_machine_are_the_same_chain(text: str) -> None:
    assert parse_chain(text) == Chain(workpiece=("B", "C"), tool=("X", "Y", "Z"))


@pytest.mark.parametrize(
    ("text", "workpiece", "tool", "axes"),
    [
        ("wXYFZt", "YX", "Z", "XYZ"),
        ("wFXYZACt", "", "XYZAC", "XYZAC"),
        ("wCAYXFZt", "XYAC", "Z", "XYZAC"),
        ("wBFt", "B", "", "B"),
        ("wbBt", "", "B", "B"),
        ("wBbt", "B", "", "B"),
        ("wABCFZYXt", "CBA", "ZYX", "XYZABC"),
    ],
)
def test_branches_run_from_the_frame_outwards(text, workpiece, tool, axes) -> None:
    chain = parse_chain(text)
    assert chain.workpiece == tuple(workpiece)
    assert chain.tool == tuple(tool)
    assert chain.axes == tuple(axes)


def test_names_may_carry_a_digit_and_letters_may_be_repeated() -> None:
    chain = parse_chain("w C2' X' F Z W C1 t")
    assert chain.workpiece == ("X", "C2")
    assert chain.tool == ("Z", "W", "C1")
    assert chain.axes == ("X", "Z", "W", "C1", "C2")
    assert str(chain) == "wC2XFZWC1t"
    machine = build_machine(chain)
    assert machine.axis("W").is_linear
    assert machine.axis("W").index == 2
    assert machine.axis("C1").travel == (0.0, 360.0)
    assert {"EXC1", "EA0C2", "EB0W", "EA0W"} <= {*machine.parameter_keys}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "cannot be read"),
        ("CBFXYZ", "cannot be read"),
        ("wCBXYZt", "cannot be read"),
        ("tZYXFBCw", "cannot be read"),
        ("wcbfxyzt", "cannot be read"),
        ("wFt", "has no axis"),
        ("wXFXt", "axis X twice"),
        ("wXYFYXt", "axis X, Y twice"),
        ("wC1FC1t", r"axis C1 twice.*C1, C2"),
        ("wC12FXt", "unknown axis C12"),
        ("wABCUVWFXYZt", "9 axes; expected one to eight"),
        ("wFXYQt", "unknown axis Q"),
        ("wXFYFZt", "unknown axis F"),
    ],
)
def test_impossible_chain_is_refused_with_the_text_and_the_reason(text: str, reason: str) -> None:
    with pytest.raises(ChainError, match=reason) as caught:
        parse_chain(text)
    assert repr(text) in str(caught.value)


def test_machine_fills_in_what_is_not_given() -> None:
    machine = build_machine("wCFXt", offset_mm={"C": (1.0, 2.0, 3.0), "t": (0.0, 0.0, -50.0)})
    assert list(machine.axes) == ["X", "C"]
    assert machine.axis("X").offset_mm == (0.0, 0.0, 0.0)
    assert machine.axis("X").travel == default_travel("X")
    assert machine.axis("C").offset_mm == (1.0, 2.0, 3.0)
    assert machine.axis("C").direction == 1
    still = (0.0, 0.0, 0.0)
    assert machine.end_frames("tool") == (("S", still, still), ("t", (0.0, 0.0, -50.0), still))
    assert machine.end_frames("workpiece") == (("w", still, still),)
    assert machine.title == machine.name


def test_axis_knows_its_kind_direction_and_unit() -> None:
    machine = build_machine("wAFYt")
    assert (machine.axis("Y").is_linear, machine.axis("Y").index, machine.axis("Y").unit) == (
        True,
        1,
        "mm",
    )
    assert (machine.axis("A").is_linear, machine.axis("A").index, machine.axis("A").unit) == (
        False,
        0,
        "°",
    )


def test_unknown_axis_names_the_axes_there_are() -> None:
    with pytest.raises(UnknownNameError, match="'B'; expected one of X, C"):
        build_machine("wCFXt").axis("B")


def test_allowed_keys_are_all_twelve_of_every_axis_and_contain_the_default_ones() -> None:
    machine = build_machine("wCFXYt")
    assert len(machine.allowed_keys) == 36
    assert set(machine.parameter_keys) < set(machine.allowed_keys)
