"""Axes and error parameters that act in a structural loop."""

from collections.abc import Sequence

from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.axes import parameter


def loop_axes(model: Model, loop: Loop) -> set[str]:
    sides = ("tool", "workpiece") if loop is Loop.RELATIVE else (str(loop),)
    return {axis.name for side in sides for axis in model.machine.branch(side)}


def loop_keys(model: Model, loop: Loop, keys: Sequence[str]) -> tuple[str, ...]:
    axes = loop_axes(model, loop)
    if not axes:
        raise OptionError(f"loop {loop}: the machine {model.machine.chain} has no axis in it")
    return tuple(key for key in keys if parameter(key).axis in axes)
