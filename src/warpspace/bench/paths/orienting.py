"""Rotary axes that turn the tool axis where it is wanted on the workpiece."""

from collections.abc import Callable, Mapping

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, tool_axis
from warpspace.kinematics.model import Model
from warpspace.machine.description import Machine
from warpspace.units import Array

SEEDS = 73
"""Positions of each rotary axis at which a start is looked for."""
STEPS = 30
CLOSE = 1e-9
"""Length of what is left of the direction: a thousandth of a microradian."""
PENALTY = 0.02
"""Of a way of one radian from the position before, where several positions fit."""


def orient(
    machine: Machine, model: Model, stand: Mapping[str, Array], wanted: Array
) -> dict[str, Array]:
    """Turn two rotary axes so that the tool axis has given directions in the workpiece.

    Parameters
    ----------
    machine : Machine
    model : Model
    stand : mapping of str to ndarray, mm or degrees
        Where the other axes stand, scalars.
    wanted : ndarray, [n, 3]
        Unit vectors in the workpiece frame, along a closed way.

    Returns
    -------
    dict of str to ndarray, [n], mm or degrees

    Raises
    ------
    OptionError
        If the machine has not two rotary axes, or they cannot reach a direction.

    Notes
    -----
    Newton steps from a coarse search over the travel, then from one direction to the next, so that
    the axes go a continuous way. An axis that goes all the way round is brought back into its
    travel by whole turns.
    """
    names = [axis.name for axis in machine.axes.values() if not axis.is_linear]
    if len(names) < 2:
        raise OptionError(
            f"the machine {machine.chain} has {len(names)} rotary"
            f" {'axis' if len(names) == 1 else 'axes'}; expected two to turn the tool along"
            f" the cone"
        )
    names = names[:2]
    limits = np.array([machine.axes[name].travel for name in names])

    def direction(angles: Array) -> Array:
        at = {**stand, names[0]: angles[..., 0], names[1]: angles[..., 1]}
        pose = np.asarray(branch_pose(model, "workpiece", at))[..., :3, :3]
        return transforms.rotate(np.swapaxes(pose, -1, -2), tool_axis(model, at))

    seeds = np.stack(
        np.meshgrid(
            *(np.linspace(float(low), float(high), SEEDS) for low, high in limits), indexing="ij"
        ),
        -1,
    ).reshape(-1, 2)
    reached = direction(seeds)
    here = np.array([float(stand[name]) for name in names])
    cost = np.linalg.norm(reached - wanted[0], axis=-1)
    cost = cost + PENALTY * np.abs(np.deg2rad(seeds - here)).sum(axis=-1)
    angles = seeds[int(np.argmin(cost))]
    found = np.empty((len(wanted), 2))
    for row, target in enumerate(wanted):
        angles = _newton(direction, angles, target)
        missed = float(np.linalg.norm(direction(angles) - target))
        if missed > 1e-6:
            raise OptionError(
                f"{names[0]} and {names[1]} cannot turn the tool along the cone:"
                f" {np.rad2deg(missed):.2g}° are missing at point {row + 1}"
            )
        found[row] = angles
    for column, (low, high) in enumerate(limits):
        if high - low >= 360.0 - 1e-9:
            found[:, column] = low + np.mod(found[:, column] - low, 360.0)
    shape = (len(wanted),)
    coordinates = {name: np.broadcast_to(values, shape) for name, values in stand.items()}
    return {**coordinates, names[0]: found[:, 0], names[1]: found[:, 1]}


def _newton(direction: Callable[[Array], Array], start: Array, target: Array) -> Array:
    """Bring the direction onto its target, least squares of three equations in two angles."""
    angles = start.copy()
    step_deg = 1e-4
    for _ in range(STEPS):
        tried = angles + step_deg * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        values = direction(tried)
        gap = target - values[0]
        if np.linalg.norm(gap) < CLOSE:
            break
        slope = (values[1:] - values[0]).T / step_deg
        move = np.linalg.lstsq(slope, gap, rcond=1e-6)[0]
        angles = angles + move * min(1.0, 20.0 / max(float(np.abs(move).max()), 1e-12))
    return angles
