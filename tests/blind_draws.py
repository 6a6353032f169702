"""Machines with a hidden cause and their readings, simulated without the kinematics of warpspace.

The exact chain (see CONVENTIONS) is multiplied for all poses of a test at once; of the product only
the poses and sensed directions of a test are used, not its derivatives. Causes are drawn as
docs/diagnosis.md states: within tolerance a curve has a standard deviation of half a half-width, a
cause out of tolerance three or eight half-widths, and exceeds the half-width somewhere.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

KNOTS = 5
LINEAR, LETTERS = "XYZ", "XYZABC"
NOISE_MM = 1e-3


@dataclass
class HiddenMachine:
    """Bodies with errors at knots, reversals and lags of their drives, µm and µrad."""

    scene: object
    errors: dict = field(default_factory=dict)  # key: value, or values at knots
    reversal: dict = field(default_factory=dict)  # axis: forward minus backward
    lag: dict = field(default_factory=dict)  # axis: at the feed of a circle, along its motion
    bends: np.ndarray = None  # bow, twist and bow of the plate, µm

    def add(self, key, values):
        self.errors[key] = self.errors.get(key, 0.0) + np.asarray(values, float)

    def errors_um(self, at, travel):
        """Tool point minus the workpiece point that nominally coincides with it, in R, [n, 3]."""
        tool = self.scene.machine.chain.tool
        table = self.scene.machine.chain.workpiece
        tip = np.array(self.scene.model.tool_point_mm)
        for name in ("t", "S"):
            tip = tip + np.array(self.scene.machine.fixed_mm.get(name, (0.0, 0.0, 0.0)))
        point, carried = {}, {}
        for actual in (True, False):
            point[actual] = self.branch(tool, at, travel, actual) @ np.append(tip, 1.0)
            carried[actual] = self.branch(table, at, travel, actual)
        nominal = (np.linalg.inv(carried[False]) @ point[False][..., None])[..., 0]
        self.nominal_mm = nominal[:, :3]
        coincident = np.einsum("nij,nj->ni", carried[True], nominal)
        return (point[True] - coincident)[:, :3] * 1e3

    def branch(self, names, at, travel, actual):
        count = max(np.size(values) for values in at.values())
        pose = np.broadcast_to(np.eye(4), (count, 4, 4))
        for name in names:
            axis = self.scene.machine.axes[name]
            q = np.broadcast_to(at[name], (count,)).astype(float)
            place = np.eye(4)
            rotation = Rotation.from_euler("xyz", axis.rotation_deg, degrees=True)
            place[:3, :3], place[:3, 3] = rotation.as_matrix(), axis.offset_mm
            motion = np.tile(np.eye(4), (count, 1, 1))
            index = LETTERS.index(name[0]) % 3
            if name[0] in LINEAR:
                motion[:, index, 3] = axis.direction * q
            else:
                vectors = np.outer(axis.direction * np.deg2rad(q), np.eye(3)[index])
                motion[:, :3, :3] = Rotation.from_rotvec(vectors).as_matrix()
            pose = pose @ place
            if actual:
                constant = [self.errors.get(f"E{x}0{name}", 0.0) for x in LETTERS]
                component = np.stack([self.component(f"E{x}{name}", q) for x in LETTERS], -1)
                sign = np.broadcast_to(travel.get(name, 0.0), (count,))
                lag = axis.direction * self.lag.get(name, 0.0) * sign
                component[:, index + 3 * (name[0] not in LINEAR)] += (
                    self.reversal.get(name, 0.0) / 2.0 * np.sign(sign) + lag
                )
                pose = pose @ small(np.tile(constant, (count, 1))) @ motion @ small(component)
            else:
                pose = pose @ motion
        return pose

    def component(self, key, q):
        values = self.errors.get(key)
        if values is None:
            return np.zeros(len(q))
        low, high = self.scene.axis_span(key[2:])
        return np.interp(q, np.linspace(low, high, KNOTS), values)


def small(errors):
    pose = np.tile(np.eye(4), (len(errors), 1, 1))
    pose[:, :3, 3] = errors[:, :3] * 1e-3
    pose[:, :3, :3] = Rotation.from_rotvec(errors[:, 3:] * 1e-6).as_matrix()
    return pose


def measure(machine, readings, rng):
    """Readings of a set-up somewhere, with noise, [n, d] mm."""
    plan, kind = readings.plan, readings.kind.partition(":")[0]
    travel = plan.travel if plan is not None and kind == "circular" else {}
    if plan is not None and not travel:
        travel = {axis: np.sign(values) for axis, values in plan.travel.items()}
    if plan is None:
        error = machine.errors_um(readings.coordinates, {}) * 1e-3
        turn = machine.branch(
            machine.scene.machine.chain.workpiece, readings.coordinates, {}, False
        )
        error = np.einsum("nji,nj->ni", turn[:, :3, :3], error)
        shift = rng.normal(0.0, 0.1, 3)
        if kind == "tracker":
            moved = error + shift + np.cross(rng.normal(0.0, 0.1, 3), machine.nominal_mm * 1e-3)
        else:
            assert kind == "sphere-tcp"
            moved = readings.observed_mm - error + shift
        return moved + rng.normal(0.0, NOISE_MM, moved.shape)
    lag, machine.lag = machine.lag, machine.lag if kind == "circular" else {}
    error = machine.errors_um(plan.coordinates, travel) * 1e-3
    machine.lag = lag
    shift = error[plan.site]
    relative = plan.against >= 0
    shift = shift - np.where(relative[:, None], error[plan.against], 0.0)
    bar = np.isfinite(plan.length_mm)
    length = np.where(bar, plan.length_mm, 1.0)[:, None]
    stretched = np.linalg.norm(length * plan.direction + shift, axis=1) - length[:, 0]
    read = plan.gain * np.where(bar, stretched, np.sum(shift * plan.direction, axis=1))
    if kind == "ball-plate":
        count = len(read) // 3
        row, column = (plan.marks[name][:count] / 2.0 - 1.0 for name in ("row", "column"))
        read[2 * count :] += np.stack([row**2, row * column, column**2], -1) @ machine.bends * 1e-3
    read = read + sum(rng.normal(0.0, 0.03) * column for column in plan.setup.values())
    return (read + rng.normal(0.0, NOISE_MM, len(read)))[:, None]


# --- what is drawn --------------------------------------------------------------------------------


def shapes_of(key):
    """Standard shapes of a curve: a smooth process without mean; straightness without slope."""
    share = np.linspace(0.0, 1.0, KNOTS)
    covariance = np.exp(-2.0 * np.subtract.outer(share, share) ** 2)
    straight = key[1] in "XYZ" and key[2] in LINEAR and key[1] != key[2]
    trends = np.vander(share, 2 if straight else 1)
    away = np.eye(KNOTS) - trends @ np.linalg.pinv(trends)
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(KNOTS))
    shapes = away @ root
    return shapes / np.sqrt(np.mean(np.sum(shapes**2, axis=1)))


def half_width(scene, key):
    return scene.tolerances.get(key).half_width


def smallest_um(scene):
    widths = [half_width(scene, key) for key in scene.parameter_keys if key[1] in LINEAR]
    return min(filter(None, widths))


def along(axis):
    return f"E{axis[0]}{axis}"


def names_of(scene):
    axes = scene.machine.axes
    linear = [axis for axis in axes if axis[0] in LINEAR]
    names = [key for key in scene.parameter_keys if half_width(scene, key)]
    names += [f"reversal of {axis}" for axis in axes]
    names += [f"servo mismatch of {axis}" for axis in linear]
    return [*names, "bent plate", "scale temperature"]


def add_cause(machine, name, factor, rng, exactly=0.0):
    """Draw an error with a standard deviation in half-widths; out of tolerance if above one."""
    scene, axes = machine.scene, machine.scene.machine.axes
    linear = [axis for axis in axes if axis[0] in LINEAR]

    def scalar():
        while not exactly:
            value = factor * rng.standard_normal()
            if factor < 1.0 or abs(value) > 1.0:
                return value
        return exactly * rng.choice([-1.0, 1.0])

    if name.startswith("E"):
        width = half_width(scene, name)
        if name[2] == "0":
            machine.add(name, width * scalar())
            return
        shapes = shapes_of(name)
        while True:
            curve = factor * shapes @ rng.standard_normal(shapes.shape[1])
            if factor < 1.0 or np.abs(curve).max() > 1.0:
                break
        machine.add(name, width * curve)
    elif name.startswith("reversal"):
        axis = name.rpartition(" ")[2]
        key = f"E{'ABC'['ABC'.index(axis[0])]}{axis}" if axis[0] in "ABC" else along(axis)
        machine.reversal[axis] = half_width(scene, key) * scalar()
    elif name == "bent plate":
        bends = factor * rng.standard_normal(3)
        bends *= exactly / np.abs(bends).max() if exactly else 1.0
        while factor > 1.0 and np.abs(bends).max() <= 1.0:
            bends = factor * rng.standard_normal(3)
        machine.bends = smallest_um(scene) * bends
    elif name.startswith("servo"):
        axis = name.rpartition(" ")[2]
        machine.lag[axis] = half_width(scene, along(axis)) * scalar()
    else:
        spans = {axis: scene.axis_span(axis) for axis in linear}
        longest = max(high - low for low, high in spans.values()) / 2.0
        size = min(half_width(scene, along(axis)) for axis in linear) * scalar() / longest
        for axis, (low, high) in spans.items():
            grown = np.linspace(low - high, high - low, KNOTS) / 2.0
            machine.add(along(axis), axes[axis].direction * size * grown)


def draw(scene, rng, planted=None):
    """Draw a machine and the truth: names of causes, and "within", "causes" or "disturbed".

    A planted cause has a coefficient of four half-widths.
    """
    machine, names = HiddenMachine(scene), names_of(scene)
    kind = 1 if planted else rng.choice(4, p=[0.2, 0.58, 0.1, 0.12])
    count = [0, 1, 2, 0][kind]
    causes = [names[at] for at in rng.choice(len(names), count, replace=False)]
    causes = [planted] if planted else causes
    factor = rng.choice([3.0, 8.0])
    for name in names:
        add_cause(
            machine, name, factor if name in causes else 0.5, rng, exactly=4.0 * (name == planted)
        )
    return machine, frozenset(causes), ["within", "causes", "causes", "disturbed"][kind]


def disturb(sets, scene, rng):
    """Disturb readings as outliers or a disturbed instrument would; name it."""
    size = smallest_um(scene) * 1e-3
    how = rng.choice(["noise", "outliers"])
    sets = list(sets)
    if how == "noise":
        at = rng.integers(len(sets))
        scale = rng.choice([0.3, 1.0, 3.0]) * size
        moved = sets[at].observed_mm + rng.normal(0.0, scale, sets[at].observed_mm.shape)
    else:
        at = rng.integers(len(sets))
        moved = sets[at].observed_mm.copy()
        for row in rng.choice(len(moved), rng.integers(1, 4), replace=False):
            moved[row] += rng.normal(0.0, 5.0 * size)
    sets[at] = replace(sets[at], observed_mm=moved)
    return sets, how
