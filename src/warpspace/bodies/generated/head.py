"""What carries the tool beyond the last linear axis: tool, spindle, swivels, forks.

Built in the tool frame at home: the tool point is its origin, z leads to the spindle.
"""

from dataclasses import dataclass

import numpy as np

from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, block, rod
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE
from warpspace.bodies.schematic import Shape, box, cone, cylinder
from warpspace.machine.description import Axis
from warpspace.units import Array

BASE = "R"
_LIGHT_TOOLS = ("probe", "nozzle", "gripper")
_COAXIAL, _ACROSS = 0.96, 0.45
"""Cosines between axis and tool: along it above the one, across it below the other."""


@dataclass(frozen=True)
class Mount:
    """Where the head ends.

    Attributes
    ----------
    point_mm : ndarray, [3], mm
        Middle of its upper face, in R at home.
    half_mm : float
        Half width of what should carry it there, mm.
    carrier : str
        Frame that carries it: the last linear axis, or R.
    """

    point_mm: Array
    half_mm: float
    carrier: str


def head_axes(layout: Layout) -> tuple[Axis, ...]:
    """List the rotary axes behind the last linear one of the tool side, from the tool backwards."""
    found: list[Axis] = []
    for axis in reversed(layout.machine.branch("tool")):
        if axis.is_linear:
            break
        found.append(axis)
    return tuple(found)


class _Head:
    """A head while it is built."""

    def __init__(self, layout: Layout, parts: Parts, tool: str) -> None:
        self.layout, self.parts, self.tool = layout, parts, tool
        self.u = layout.unit_mm
        self.place = layout.poses["t"]
        self.turn = self.place[:3, :3]
        self.volume_top = float(np.abs(self.turn.T) @ layout.half_mm @ (0, 0, 1)) + layout.gap_mm
        self.centre = np.zeros(2)

    def add(self, frame: str, what: str, colour: tuple[int, int, int], *shapes: Shape) -> None:
        """Add shapes given in the tool frame."""
        for shape in shapes:
            shape.apply_transform(self.place)
        self.parts.add(frame, what, colour, *shapes)

    def line(self, axis: Axis) -> tuple[Array, Array]:
        """Give direction of an axis, and the point of its line nearest to the spindle line."""
        direction = self.turn.T @ self.layout.direction(axis)
        origin = self.turn.T @ (self.layout.origin(axis) - self.layout.tip_mm)
        across = direction[:2]
        size = float(across @ across)
        if size < 1e-9:
            return direction, origin
        shift = float((self.centre - origin[:2]) @ across) / size
        return direction, origin + shift * direction

    def build(self) -> Mount:
        """Build the head from the tool backwards."""
        axes = head_axes(self.layout)
        branch = self.layout.machine.branch("tool")
        inner = branch[: len(branch) - len(axes)]
        carrier = inner[-1].name if inner else BASE
        length = self._tool_length()
        self._add_tool(length)
        width, u = (0.8 if self.tool in _LIGHT_TOOLS else 1.15) * self.u, self.u
        top = length + 1.65 * u
        tilts = [axis for axis in axes if abs(self.line(axis)[0][2]) < _COAXIAL]
        if not tilts:
            steps = axes
            top = max(top, self.volume_top)
            self._add_spindle(length, top)
            for axis in steps:
                centre = (float(self.centre[0]), float(self.centre[1]))
                self.add(axis.name, "rotor", DARK, cylinder(1.25 * u, (top, top + 1.0 * u), centre))
                top += 1.0 * u
            return self._mount(top, width, carrier)
        first = True
        for place, axis in enumerate(axes):
            parent = axes[place + 1].name if place + 1 < len(axes) else carrier
            direction, point = self.line(axis)
            share = abs(float(direction[2]))
            if share > _COAXIAL:
                if first:
                    self._add_spindle(length, top)
                self.add(
                    axis.name,
                    "swivel",
                    DARK,
                    cylinder(1.45 * u, (top, top + 0.9 * u), (float(point[0]), float(point[1]))),
                )
                if not np.allclose(point[:2], self.centre, atol=0.2 * u):
                    middle, reach = (point[:2] + self.centre) / 2.0, np.abs(point[:2] - self.centre)
                    self.add(
                        axis.name,
                        "swivel",
                        DARK,
                        block([*middle, top + 0.25 * u], [*(reach / 2.0 + 1.0 * u), 0.25 * u]),
                    )
                    self.centre = point[:2].copy()
                top += 0.9 * u
            elif share < _ACROSS:
                top = self._add_fork(axis, parent, direction, point, length if first else top)
                first = False
            else:
                top = self._add_nutator(axis, parent, direction, point, length if first else top)
                first = False
        return self._mount(top, 1.3 * u, carrier)

    def _mount(self, top: float, width: float, carrier: str) -> Mount:
        """Give where the head ends, beyond the volume: a neck fills what is missing."""
        if top < self.volume_top:
            middle = [*self.centre, (top + self.volume_top) / 2.0]
            half = [0.8 * width, 0.8 * width, (self.volume_top - top) / 2.0 + 1.0]
            self.add(carrier, "neck", MIDDLE, block(middle, half))
            top = self.volume_top
        point = self.place[:3, :3] @ np.array([*self.centre, top]) + self.place[:3, 3]
        return Mount(point, width, carrier)

    def _tool_length(self) -> float:
        """Find how far the spindle nose stands from the tool point, mm."""
        given = self.layout.machine.fixed_mm.get("t", (0.0, 0.0, 0.0))
        length = -float(given[2])
        return length if length > 0.4 * self.u else 1.4 * self.u

    def _add_tool(self, length: float) -> None:
        """Add the tool between its point and the nose."""
        u = self.u
        if self.tool == "probe":
            from trimesh import creation

            ball = creation.icosphere(subdivisions=2, radius=0.12 * u)
            ball.apply_translation([0.0, 0.0, 0.12 * u])
            self.add(
                "t",
                "probe",
                DARK,
                ball,
                cylinder(0.05 * u, (0.12 * u, 0.6 * length)),
                cylinder(0.3 * u, (0.6 * length, length)),
            )
        elif self.tool == "nozzle":
            self.add(
                "t",
                "nozzle",
                DARK,
                cone(0.05 * u, 0.3 * u, (0.0, 0.35 * length)),
                block([0, 0, 0.55 * length], [0.4 * u, 0.4 * u, 0.2 * length]),
                cylinder(0.15 * u, (0.75 * length, length)),
            )
        elif self.tool == "wheel":
            radius = max(1.8 * u, 0.8 * length)
            self.add(
                "t",
                "wheel",
                DARK,
                cylinder(radius, (0.0, 0.45 * length), inner=0.72 * radius),
                cylinder(radius, (0.45 * length, 0.6 * length)),
                cylinder(0.4 * u, (0.6 * length, length)),
            )
        elif self.tool == "gripper":
            fingers = [
                block([side * 0.3 * u, 0, 0.3 * length], [0.08 * u, 0.2 * u, 0.3 * length])
                for side in (-1, 1)
            ]
            self.add(
                "t",
                "gripper",
                DARK,
                *fingers,
                block([0, 0, 0.75 * length], [0.55 * u, 0.3 * u, 0.15 * length]),
                cylinder(0.25 * u, (0.9 * length, length)),
            )
        else:
            self.add(
                "t",
                "tool",
                DARK,
                cylinder(0.09 * u, (0.0, 0.5 * length)),
                cylinder(0.22 * u, (0.5 * length, 0.8 * length)),
                cylinder(0.34 * u, (0.8 * length, length)),
            )

    def _add_spindle(self, nose: float, top: float) -> None:
        """Add the spindle between its nose and what carries it."""
        u = self.u
        cut = min(nose + 0.75 * u, (nose + top) / 2.0)
        at = (float(self.centre[0]), float(self.centre[1]))
        slim = 0.5 if self.tool in _LIGHT_TOOLS else 1.0
        nose_cone = cone(0.52 * slim * u, 0.78 * slim * u, (nose, cut))
        nose_cone.apply_translation([*at, 0.0])
        self.add("S", "spindle", METAL, nose_cone, cylinder(1.0 * slim * u, (cut, top), at))

    def _add_fork(
        self, axis: Axis, parent: str, direction: Array, point: Array, nose: float
    ) -> float:
        """Add a head that swings between the arms of a fork on the frame before it."""
        u = self.u
        k = int(np.argmax(np.abs(direction[:2])))
        m, pivot = 1 - k, max(float(point[2]), nose + 1.5 * u)
        foot = max(nose + 0.6 * u, pivot - 1.15 * u)
        self._add_spindle(nose, foot)
        low, high = foot, pivot + 0.9 * u
        half = {k: 0.95 * u, m: 0.9 * u}
        centre = [*self.centre, (low + high) / 2.0]
        hub = np.array([*self.centre, pivot])
        out = np.zeros(3)
        out[k] = 1.0
        self.add(
            axis.name,
            "head",
            MIDDLE,
            block(centre, [half[0], half[1], (high - low) / 2.0]),
            rod(hub - 1.35 * u * out, hub + 1.35 * u * out, 0.75 * u),
        )
        roof = pivot + 1.15 * u
        for side in (-1.0, 1.0):
            arm = hub + side * 1.65 * u * out
            size = np.array([0.75 * u, 0.75 * u, (roof - pivot) / 2.0])
            size[k] = 0.27 * u
            self.add(
                parent,
                "fork",
                LIGHT,
                block(arm + np.array([0, 0, (roof - pivot) / 2.0]), size),
                rod(arm - 0.27 * u * out, arm + 0.27 * u * out, 0.75 * u),
            )
        size = np.array([0.85 * u, 0.85 * u, 0.3 * u])
        size[k] = 1.92 * u
        self.add(parent, "fork", LIGHT, block([*self.centre, roof + 0.3 * u], size))
        return roof + 0.6 * u

    def _add_nutator(
        self, axis: Axis, parent: str, direction: Array, point: Array, nose: float
    ) -> float:
        """Add a head that turns about an oblique line, and its wedge on the frame before it."""
        u = self.u
        line = direction * np.sign(direction[2])
        pivot = np.array([*self.centre, max(float(point[2]), nose + 1.8 * u)])
        self._add_spindle(nose, float(pivot[2]) - 0.9 * u)
        low = np.array([*self.centre, float(pivot[2]) - 0.9 * u])
        self.add(
            axis.name,
            "head",
            MIDDLE,
            rod(low, pivot, 1.15 * u),
            rod(pivot, pivot + 1.1 * u * line, 1.15 * u, 1.5 * u),
            rod(pivot - 0.6 * u * line, pivot, 0.75 * u, 1.15 * u),
        )
        far = pivot + 2.0 * u * line
        self.add(parent, "wedge", LIGHT, rod(pivot + 1.1 * u * line, far, 1.5 * u))
        top = float(far[2]) + 1.5 * u
        middle = (far + np.array([*self.centre, far[2]])) / 2.0
        half = np.abs(far[:2] - self.centre) / 2.0 + 1.05 * u
        self.add(
            parent,
            "wedge",
            LIGHT,
            box(
                (middle[0] - half[0], middle[0] + half[0]),
                (middle[1] - half[1], middle[1] + half[1]),
                (far[2] + 0.2 * u, top),
            ),
        )
        return top


def build_head(layout: Layout, parts: Parts, tool: str) -> Mount:
    """Build tool, spindle and rotary head.

    Returns
    -------
    Mount
        Beyond the working volume: what carries the head stays clear of it.
    """
    return _Head(layout, parts, tool).build()
