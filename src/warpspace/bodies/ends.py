"""The two ends of a machine: the head with the tool, and the stack under the workpiece."""

from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from warpspace.bodies.schematic import (
    HomeAxis,
    Parts,
    Range,
    Shape,
    about,
    block,
    cone,
    cylinder,
    mirrored_walls,
    pair,
    rod,
)
from warpspace.kinematics.chain import BASE
from warpspace.units import Array

_LIGHT_TOOLS = ("probe", "nozzle", "gripper")
_COAXIAL, _ACROSS = 0.96, 0.45
"""Cosines between axis and tool: along it above the one, across it below the other."""
# round parts of a tool: ends as shares of its length, and radii there in walls
_TOOLS = {
    "cutter": ((0.0, 0.5, 0.09, 0.09), (0.5, 0.8, 0.22, 0.22), (0.8, 1.0, 0.34, 0.34)),
    "probe": ((0.6, 1.0, 0.3, 0.3),),
    "nozzle": ((0.0, 0.35, 0.05, 0.3), (0.75, 1.0, 0.15, 0.15)),
    "wheel": ((0.6, 1.0, 0.4, 0.4),),
    "gripper": ((0.9, 1.0, 0.25, 0.25),),
}


@dataclass(frozen=True)
class Mount:
    """Mount of the head."""

    point_mm: Array  # [3]; middle of its upper face, in R at home
    half_mm: float  # half width of the carrier, mm
    inner: tuple[HomeAxis, ...]  # axes that carry it, the bed's first

    @property
    def carrier(self) -> str:
        """Frame that carries it: the last linear axis, or R."""
        return self.inner[-1].name if self.inner else BASE


class Head:
    """A head while it is built, in the tool frame at home: z leads from the tool to the spindle."""

    def __init__(self, parts: Parts, tool: str) -> None:
        layout = parts.layout
        self.layout, self.parts, self.tool = layout, parts, tool
        self.u, self.place = layout.unit_mm, layout.poses["t"]
        self.turn = self.place[:3, :3]
        self.volume_top = float(np.abs(self.turn.T) @ layout.half_mm @ (0, 0, 1)) + layout.gap_mm
        self.centre = np.zeros(2)

    def _add(self, frame: str, what: str, *shapes: Shape) -> None:
        for shape in shapes:
            shape.apply_transform(self.place)
        self.parts.add(frame, what, *shapes)

    def _line(self, axis: HomeAxis) -> tuple[Array, Array]:
        direction = self.turn.T @ axis.direction
        origin = self.turn.T @ (axis.origin_mm - self.layout.tip_mm)
        across = direction[:2]
        size = float(across @ across)
        if size < 1e-9:
            return direction, origin
        shift = float((self.centre - origin[:2]) @ across) / size
        return direction, origin + shift * direction

    def build(self) -> Mount:
        branch = self.layout.tool
        axes = list(takewhile(lambda axis: not axis.is_linear, reversed(branch)))
        inner = branch[: len(branch) - len(axes)]
        u, length = self.u, self.layout.length_mm
        if length <= 0.4 * u:
            length = 1.4 * u  # from the tool point to the spindle nose
        self.add_tool(length)
        top = length + 1.65 * u
        if all(abs(self._line(axis)[0][2]) >= _COAXIAL for axis in axes):
            top = max(top, self.volume_top)
            self._add_spindle(length, top)
            for axis in axes:
                self._add(axis.name, "rotor", cylinder(1.25 * u, (top, top + 1.0 * u), self.centre))
                top += 1.0 * u
            return self._mount(top, (0.8 if self.tool in _LIGHT_TOOLS else 1.15) * u, inner)
        nose: float | None = length  # start of the spindle, until it is built
        carriers = [*(axis.name for axis in axes[1:]), inner[-1].name if inner else BASE]
        for axis, carrier in zip(axes, carriers, strict=True):
            share = abs(float(self._line(axis)[0][2]))
            if share > _COAXIAL:
                if nose is not None:
                    self._add_spindle(nose, top)
                    nose = None
                top = self._add_swivel(axis, top)
                continue
            add = self._add_fork if share < _ACROSS else self._add_nutator
            top = add(axis, carrier, top if nose is None else nose)
            nose = None
        return self._mount(top, 1.3 * u, inner)

    def _mount(self, top: float, width: float, inner: tuple[HomeAxis, ...]) -> Mount:
        height = max(top, self.volume_top)
        point = self.turn @ np.array([*self.centre, height]) + self.place[:3, 3]
        mount = Mount(point, width, inner)
        if top < height:
            half = [0.8 * width, 0.8 * width, (height - top) / 2.0 + 1.0]
            self._add(mount.carrier, "neck", block([*self.centre, (top + height) / 2.0], half))
        return mount

    def add_tool(self, length: float) -> None:
        u, what = self.u, self.tool if self.tool != "cutter" else "tool"
        if self.tool == "probe":
            from trimesh import creation

            ball = creation.icosphere(subdivisions=2, radius=0.12 * u)
            ball.apply_translation([0.0, 0.0, 0.12 * u])
            self._add("t", what, ball, cylinder(0.05 * u, (0.12 * u, 0.6 * length)))
        elif self.tool == "nozzle":
            self._add("t", what, block([0, 0, 0.55 * length], [0.4 * u, 0.4 * u, 0.2 * length]))
        elif self.tool == "wheel":
            radius = max(1.8 * u, 0.8 * length)
            self._add("t", what, cylinder(radius, (0.0, 0.45 * length), inner=0.72 * radius))
            self._add("t", what, cylinder(radius, (0.45 * length, 0.6 * length)))
        elif self.tool == "gripper":
            for x in (-0.3 * u, 0.3 * u):
                self._add("t", what, block([x, 0, 0.3 * length], [0.08 * u, 0.2 * u, 0.3 * length]))
            self._add("t", what, block([0, 0, 0.75 * length], [0.55 * u, 0.3 * u, 0.15 * length]))
        for low, high, radius, upper in _TOOLS[self.tool]:
            self._add("t", what, cone(radius * u, upper * u, (low * length, high * length)))

    def _add_spindle(self, nose: float, top: float) -> None:
        cut = min(nose + 0.75 * self.u, (nose + top) / 2.0)
        wide = (0.5 if self.tool in _LIGHT_TOOLS else 1.0) * self.u
        nose_cone = cone(0.52 * wide, 0.78 * wide, (nose, cut))
        nose_cone.apply_translation([*self.centre, 0.0])
        self._add("S", "spindle", nose_cone, cylinder(wide, (cut, top), self.centre))

    def _add_swivel(self, axis: HomeAxis, top: float) -> float:
        u, point = self.u, self._line(axis)[1][:2]
        self._add(axis.name, "swivel", cylinder(1.45 * u, (top, top + 0.9 * u), point))
        if not np.allclose(point, self.centre, atol=0.2 * u):
            middle, reach = (point + self.centre) / 2.0, np.abs(point - self.centre) / 2.0
            half = [*(reach + 1.0 * u), 0.25 * u]
            self._add(axis.name, "swivel", block([*middle, top + 0.25 * u], half))
            self.centre = point.copy()
        return top + 0.9 * u

    def _add_fork(self, axis: HomeAxis, parent: str, nose: float) -> float:
        u, (direction, point) = self.u, self._line(axis)
        k = int(np.argmax(np.abs(direction[:2])))
        out = np.eye(3)[k]

        def half(along: float, across: float, height: float) -> Array:
            size = np.array([across, across, height])
            size[k] = along
            return size

        pivot = max(float(point[2]), nose + 1.5 * u)
        foot = max(nose + 0.6 * u, pivot - 1.15 * u)
        self._add_spindle(nose, foot)
        hub = np.array([*self.centre, pivot])
        height = (pivot + 0.9 * u - foot) / 2.0
        body = block([*self.centre, foot + height], half(0.95 * u, 0.9 * u, height))
        across = rod(hub - 1.3 * u * out, hub + 1.3 * u * out, 0.75 * u)
        self._add(axis.name, "head", body, across)
        roof, rise = pivot + 1.15 * u, 1.15 * u / 2.0
        for side in (-1.65 * u, 1.65 * u):
            arm = hub + side * out
            body = block(arm + np.array([0, 0, rise]), half(0.27 * u, 0.75 * u, rise))
            boss = (0.27 + _BOSS) * u * out
            self._add(parent, "fork", body, rod(arm - boss, arm + boss, 0.75 * u))
        body = block([*self.centre, roof + 0.3 * u], half(1.92 * u, 0.85 * u, 0.3 * u))
        self._add(parent, "fork", body)
        return roof + 0.6 * u

    def _add_nutator(self, axis: HomeAxis, parent: str, nose: float) -> float:
        u, (direction, point) = self.u, self._line(axis)
        line = direction * np.sign(direction[2])
        pivot = np.array([*self.centre, max(float(point[2]), nose + 1.8 * u)])
        low = pivot - np.array([0.0, 0.0, 0.9 * u])
        self._add_spindle(nose, float(low[2]))
        self._add(
            axis.name,
            "head",
            rod(low, pivot, 1.15 * u),
            rod(pivot, pivot + 1.1 * u * line, 1.15 * u, 1.5 * u),
            rod(pivot - 0.6 * u * line, pivot, 0.75 * u, 1.15 * u),
        )
        far = pivot + 2.0 * u * line
        self._add(parent, "wedge", rod(pivot + 1.1 * u * line, far, 1.5 * u))
        middle = [*((far[:2] + self.centre) / 2.0), far[2] + 0.85 * u]
        half = [*(np.abs(far[:2] - self.centre) / 2.0 + 1.05 * u), 0.65 * u]
        self._add(parent, "wedge", block(middle, half))
        return float(far[2]) + 1.5 * u


_SLOTS, _ABOVE_MM = 8, 0.3
_STEEP, _BOSS = 0.9, 0.04


class WorkpieceSide:
    """The stack of bodies under the workpiece, built from the top downwards."""

    def __init__(self, parts: Parts) -> None:
        layout = parts.layout
        self.layout, self.parts = layout, parts
        self.u, self.branch = layout.unit_mm, layout.workpiece[::-1]
        below = float(layout.low_mm[2]) - layout.gap_mm
        origin = float(layout.poses["w"][2, 3])
        turning = [a for a in self.branch if not a.is_linear and a.k == 2]
        middle = turning[0].origin_mm if turning else layout.tip_mm
        self.centre_mm = middle[:2].copy()  # [2]; its middle in plan view
        self.half_mm = 1.08 * layout.half_mm[:2]  # [2]; half edges of its lowest body so far
        # height of its lower side so far, mm; in the end the top of the bed
        self.bed_mm = origin if below - 4.0 * self.u < origin < below else below
        self.swept_mm = self.half_mm.copy()  # [2]; half edges of the volume swept by the stack

    def range(self, k: int, share: float = 1.0) -> Range:
        """Return its range along x or y, mm."""
        return about(self.centre_mm[k], share * float(self.half_mm[k]))

    def build(self) -> None:
        for place, axis in enumerate(self.branch):
            parent = self.branch[place + 1].name if place + 1 < len(self.branch) else BASE
            if axis.is_linear:
                self._add_slide(axis, outermost=place == 0)
            elif axis.k == 2:
                self._add_turntable(axis, outermost=place == 0)
            elif abs(axis.direction).max() < _STEEP:
                self._add_oblique_table(axis)
            elif place == 0:
                self._add_headstock(axis, parent)
            else:
                self._add_cradle(axis, parent)
        if not self.branch:
            self._add_plate(BASE, 0.5)
        for axis in (axis for axis in self.branch if axis.slides_level):
            self.swept_mm[axis.k] += axis.reach_mm
        if self.branch and self.branch[-1].slides_level:
            k = self.branch[-1].k
            self.half_mm[k] += 0.4 * self.branch[-1].reach_mm
            self._add_rails(BASE, "rails", k, half_width=0.14, height=0.2)
        self.parts.stand(self.range(0), self.range(1))

    def _lower(self, height: float) -> Range:
        """Add a body under the stack and return its vertical range, mm."""
        self.bed_mm -= height
        return (self.bed_mm, self.bed_mm + height)

    def _add_layer(self, frame: str, what: str, height: float, share: float = 1.0) -> None:
        x, y = self.range(0, share), self.range(1, share)
        self.parts.box(frame, what, x, y, self._lower(height * self.u))

    def _add_plate(self, frame: str, height: float) -> None:
        x, y, z = self.range(0), self.range(1), self.bed_mm + _ABOVE_MM
        width = (y[1] - y[0]) / 60.0
        rows = [row + s for row in np.linspace(*y, 6)[1:-1] for s in (-width, width)]
        self._add_layer(frame, "table", height)
        lines = [np.array([(end, r, z) for end in x]) for r in rows]
        self.parts.add(frame, "table", lines_mm=lines)

    def _add_rails(
        self, frame: str, what: str, k: int, *, half_width: float, height: float
    ) -> None:
        z = self._lower(height * self.u)
        apart = 0.7 * float(self.half_mm[1 - k])
        for rail in pair(self.centre_mm[1 - k], apart, half_width * self.u):
            self.parts.box(frame, what, self.range(k), rail, z, along=k)

    def _add_slide(self, axis: HomeAxis, *, outermost: bool) -> None:
        u, k, reach = self.u, axis.k, axis.reach_mm
        if outermost:
            self._add_plate(axis.name, 0.55)
            self.half_mm = 0.86 * self.half_mm
        if k == 2:
            self._add_layer(axis.name, "lift", 1.2, 0.8)
            radius, z = 0.45 * float(self.half_mm.min()), self.bed_mm
            self.parts.add(
                axis.name, "lift", cylinder(radius, (z - 2.0 * reach, z), self.centre_mm)
            )
            # clearance for the travel, and for the column to end within the bed
            self.bed_mm -= max(0.1 * u + reach, 2.0 * reach - 1.4 * u)
            self.half_mm = 0.75 * self.half_mm
            return
        if not outermost:
            self._add_layer(axis.name, "saddle", 0.6)
        what = "table" if outermost else "saddle"
        self._add_rails(axis.name, what, k, half_width=0.22, height=0.25)
        self.half_mm[k] += 0.6 * reach

    def _add_turntable(self, axis: HomeAxis, *, outermost: bool) -> None:
        u, z, at = self.u, self.bed_mm, axis.origin_mm
        if not outermost:
            radius = 0.85 * float(self.half_mm.max())
            self.parts.add(axis.name, "turntable", cylinder(radius, self._lower(0.6 * u), at))
            self.half_mm = np.full(2, radius)
            return
        radius = max(0.92 * float(self.layout.half_mm[:2].min()), 1.3 * u)
        for share, height in ((1.0, 0.45), (0.82, 0.3)):
            ring = cylinder(share * radius, self._lower(height * u), at, inner=0.12 * radius)
            self.parts.add(axis.name, "table", ring)
        slots: list[Array] = []
        for turn in np.arange(_SLOTS) * 2.0 * np.pi / _SLOTS:
            out = np.array([np.cos(turn), np.sin(turn)])
            across = np.array([-np.sin(turn), np.cos(turn)])
            for side in (-0.025, 0.025):
                ends = [at[:2] + radius * (r * out + side * across) for r in (0.2, 0.995)]
                slots.append(np.array([[*end, z + _ABOVE_MM] for end in ends]))
        self.parts.add(axis.name, "table", lines_mm=slots)
        self.half_mm, self.swept_mm = np.full(2, radius), np.full(2, radius)

    def _add_oblique_table(self, axis: HomeAxis) -> None:
        line = axis.direction * np.sign(axis.direction[2] or 1.0)
        radius = float(self.half_mm.min())
        middle = np.append(self.centre_mm, self.bed_mm - 0.75 * radius)
        self.parts.add(
            axis.name,
            "nutator",
            rod(middle - 0.3 * self.u * line, middle, radius),
            cylinder(0.5 * radius, (middle[2], self.bed_mm), middle),
        )
        self.bed_mm = float(middle[2]) - 0.8 * radius - 0.4 * self.u

    def _add_headstock(self, axis: HomeAxis, parent: str) -> None:
        layout, parts, u, k = self.layout, self.parts, self.u, axis.k
        m, line, tip, half = 1 - k, axis.origin_mm, layout.tip_mm[k], layout.half_mm[k]
        side = 1.0 if line[k] > tip + 0.5 * half else -1.0
        face = tip + side * (half + layout.gap_mm)

        def at(along: float) -> Array:
            point = line.copy()
            point[k] = face + side * along * u
            return point

        radius = 1.5 * u
        parts.add(axis.name, "chuck", rod(at(0.0), at(0.55), radius))
        parts.add(axis.name, "chuck", rod(at(0.55), at(1.0), 0.8 * radius))
        for turn in np.arange(3) * 2.0 * np.pi / 3.0 + np.pi / 2.0:
            jaw = at(-0.09)
            jaw[[m, 2]] += 0.6 * radius * np.array([np.cos(turn), np.sin(turn)])
            i, j, z = (about(jaw[n], (0.09 if n == k else 0.2) * u) for n in (k, m, 2))
            parts.box(axis.name, "chuck", i, j, z, along=k)
        low = min(float(layout.low_mm[2]) - layout.gap_mm, float(line[2]) - 2.0 * u)
        i, j = about(face + side * 2.25 * u, 1.35 * u), about(line[m], 1.8 * u)
        parts.box(parent, "headstock", i, j, (low, line[2]), along=k)
        parts.add(parent, "headstock", rod(at(0.9), at(3.6), 1.8 * u))
        near, far = face + side * 3.6 * u, face - side * 2.0 * (half + layout.gap_mm)
        self.centre_mm[k], self.centre_mm[m] = (near + far) / 2.0, line[m]
        self.half_mm[k], self.half_mm[m] = abs(near - far) / 2.0, 1.9 * u
        self.swept_mm, self.bed_mm = self.half_mm.copy(), low

    def _add_cradle(self, axis: HomeAxis, parent: str) -> None:
        layout, u, k = self.layout, self.u, axis.k
        m, z, line = 1 - k, self.bed_mm, axis.origin_mm
        middle, pivot, plate = float(self.centre_mm[k]), float(line[2]), z - 0.65 * u
        away = abs(float(layout.tip_mm[k]) - middle) + float(layout.half_mm[k]) + layout.gap_mm
        inner = max(float(self.half_mm[k]) + 0.3 * u, away)
        depth = max(0.72 * float(self.half_mm[m]), 1.0 * u)
        i, j = about(middle, inner + 0.6 * u), about(self.centre_mm[m], depth)
        self.parts.box(axis.name, "cradle", i, j, (plate, z), along=k)
        clearance = 0.4 * float(self.half_mm[m]) + 0.2 * u
        bed = min(plate, pivot - 1.2 * u) - clearance
        for frame, what, near, thick, half, ends in (
            (axis.name, "cradle", inner, 0.6 * u, 1.0 * u, (min(plate, pivot), max(pivot, z))),
            (parent, "towers", inner + 0.7 * u, 0.9 * u, 1.2 * u, (bed, pivot)),
        ):
            for wall in mirrored_walls(middle, near, thick):
                self.parts.box(frame, what, wall, about(line[m], half), ends, along=k)
                start, end = line.copy(), line.copy()
                # a boss: the bevel of an edge within the face of the wall would show through it
                start[k], end[k] = wall[0] - _BOSS * u, wall[1] + _BOSS * u
                self.parts.add(frame, what, rod(start, end, half))
        self.bed_mm = bed
        self.half_mm[k], self.half_mm[m] = inner + 1.6 * u, max(depth, 1.3 * u)
        self.swept_mm = np.maximum(self.swept_mm, self.half_mm)
