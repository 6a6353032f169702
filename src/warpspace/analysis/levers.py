"""Levers taken apart: the motions and offsets between an error and the functional point."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.parameters import parameter
from warpspace.units import Array

Part = tuple[str, tuple[float, float, float]]
"""Name and vector in R, mm."""


def lever_parts(model: Model, loop: Loop, key: str, at: Mapping[str, float]) -> tuple[Part, ...]:
    """Take a lever apart into the motions and offsets it is made of.

    Parameters
    ----------
    model : Model
    loop : Loop
    key : str
    at : mapping of str to float, mm or degrees

    Returns
    -------
    tuple of (str, tuple of float, (3,)), mm
        Name and vector in R: "Z motion", "X offset", "S", "t", "w", "point"; they add up to the
        lever. Empty for a workpiece-side parameter in the relative loop.
    """
    row = parameter(key)
    on_tool = row.axis in model.machine.chain.tool
    if loop is Loop.RELATIVE and not on_tool:
        return ()
    side = "tool" if on_tool else "workpiece"
    coordinates = complete_coordinates(model.machine, at)
    stops: list[tuple[str, Array]] = []
    started, last = False, np.eye(4)
    for frames in branch_frames(model, side, coordinates):
        name = frames.axis.name
        if started:
            stops.append((f"{name} offset", frames.before[:3, 3]))
        if name == row.axis:
            started = True
            # Where the error acts behind the motion, the motion is no part of its lever: zero.
            stops.append(("", model.convention(name).frame(frames, row)[:3, 3]))
        if started:
            stops.append((f"{name} motion", frames.after[:3, 3]))
        last = frames.after
    stops += _end_stops(model, side, last)
    pairs = pairwise(stops)
    vectors = [(name, vector(end - start)) for (_, start), (name, end) in pairs]
    return tuple((name, vector) for name, vector in vectors if any(vector))


def _end_stops(model: Model, side: str, last: Array) -> list[tuple[str, Array]]:
    """Positions in R of the fixed frames behind the last axis and of the functional point."""
    pose = last
    stops: list[tuple[str, Array]] = []
    for name, offset, rotation in model.machine.end_frames(side):
        pose = pose @ transforms.placed(offset, rotation)
        stops.append((name, pose[:3, 3]))
    point = model.tool_point_mm if side == "tool" else model.workpiece_point_mm
    stops.append(("point", transforms.apply(pose, point)))
    return stops


def vector(values: Array) -> tuple[float, float, float]:
    """Give the three floats of an array, free of rounding errors and negative zeros."""
    x, y, z = (round(float(value), 9) + 0.0 for value in values)
    return x, y, z
