"""A machine of rigid bodies, simulated with plain homogeneous matrices, independently of warpspace.

It shares nothing with the kinematics of the product but the written definition of a chain (see
CONVENTIONS): from the frame outwards each axis contributes ``Trans(offset) · Rot(fixed) · E0 ·
Motion(direction·q) · E(q)``. What an instrument reads and what a controller does is defined by the
motion of the tool relative to the workpiece, in the frame of the workpiece.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

LETTERS = "XYZABC"
LINEAR = "XYZ"
STEP = 1e-3  # mm or degrees, of numerical directions
Vector = np.ndarray
Curve = Callable[[float], float]


@dataclass(frozen=True)
class Body:
    """An axis of motion with its errors."""

    name: str
    offset_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: int = 1
    constants: Mapping[str, float] = field(default_factory=dict)  # by letter, µm or µrad
    tables: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @property
    def is_linear(self) -> bool:
        return self.name[0] in LINEAR

    def motion(self, q: float) -> np.ndarray:
        pose, along = np.eye(4), np.eye(3)["XYZ".find(self.name[0])]
        if self.is_linear:
            pose[:3, 3] = self.direction * q * along
        else:
            along = np.eye(3)["ABC".index(self.name[0])]
            pose[:3, :3] = Rotation.from_rotvec(self.direction * np.deg2rad(q) * along).as_matrix()
        return pose

    def pose(self, q: float, *, errors: bool) -> np.ndarray:
        place = np.eye(4)
        place[:3, :3] = Rotation.from_euler("xyz", self.rotation_deg, degrees=True).as_matrix()
        place[:3, 3] = self.offset_mm
        if not errors:
            return place @ self.motion(q)
        component = {
            letter: float(np.interp(q, *np.transpose(rows))) for letter, rows in self.tables.items()
        }
        return place @ small(self.constants) @ self.motion(q) @ small(component)


def small(errors: Mapping[str, float]) -> np.ndarray:
    """Translate by δ, then rotate by the vector ε, µm and µrad."""
    pose = np.eye(4)
    vector = np.array([errors.get(letter, 0.0) for letter in LETTERS])
    pose[:3, 3] = vector[:3] * 1e-3
    pose[:3, :3] = Rotation.from_rotvec(vector[3:] * 1e-6).as_matrix()
    return pose


@dataclass(frozen=True)
class PhysicalMachine:
    """Bodies from the frame outwards that carry the workpiece and the tool."""

    workpiece: tuple[Body, ...]
    tool: tuple[Body, ...]
    workspace: Mapping[str, tuple[float, float]]
    tool_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def bodies(self) -> tuple[Body, ...]:
        return (*self.workpiece, *self.tool)

    @property
    def chain(self) -> str:
        carried = "".join(body.name for body in reversed(self.workpiece))
        return f"w{carried}F{''.join(body.name for body in self.tool)}t"

    @property
    def middle(self) -> dict[str, float]:
        return {name: (low + high) / 2.0 for name, (low, high) in self.workspace.items()}

    @property
    def linear(self) -> list[str]:
        return [name for name in LINEAR if any(body.name == name for body in self.bodies)]

    def side(self, bodies: Sequence[Body], q: Mapping[str, float], *, errors: bool) -> np.ndarray:
        pose = np.eye(4)
        for body in bodies:
            pose = pose @ body.pose(q[body.name], errors=errors)
        return pose

    def relative(self, q: Mapping[str, float], *, errors: bool = True) -> np.ndarray:
        """Pose of the tool point in the frame of the workpiece."""
        tool = self.side(self.tool, q, errors=errors)
        tool[:3, 3] += tool[:3, :3] @ np.array(self.tool_mm)
        return np.linalg.inv(self.side(self.workpiece, q, errors=errors)) @ tool

    def error_um(self, q: Mapping[str, float]) -> Vector:
        """Actual − nominal position of the tool on the workpiece, in its frame."""
        actual, nominal = self.relative(q), self.relative(q, errors=False)
        return (actual[:3, 3] - nominal[:3, 3]) * 1e3

    def turn_urad(self, q: Mapping[str, float]) -> Vector:
        """Rotation of the tool against the workpiece, in the frame of the workpiece."""
        actual, nominal = self.relative(q), self.relative(q, errors=False)
        return Rotation.from_matrix(actual[:3, :3] @ nominal[:3, :3].T).as_rotvec() * 1e6

    def direction(self, axis: str, q: Mapping[str, float]) -> Vector:
        """Direction on the workpiece in which a positive command moves (or turns) the tool."""
        ahead = {**q, axis: q[axis] + STEP}
        start, end = (self.relative(at, errors=False) for at in (q, ahead))
        if axis[0] in LINEAR:
            step = end[:3, 3] - start[:3, 3]
        else:
            step = Rotation.from_matrix(end[:3, :3] @ start[:3, :3].T).as_rotvec()
        return step / np.linalg.norm(step)

    # --- what instruments read --------------------------------------------------------------------

    def positioning_um(self, axis: str, targets: Sequence[float]) -> Vector:
        """Deviations of a laser along an axis, its zero at the first target."""
        return self.across_um(axis, axis, targets)

    def across_um(self, axis: str, sensed: str, targets: Sequence[float]) -> Vector:
        """Deviations along the programmed direction of an axis while another one moves."""
        along = self.direction(sensed, self.middle)
        readings = [self.error_um({**self.middle, axis: at}) @ along for at in targets]
        return np.array(readings) - readings[0]

    def angle_urad(self, axis: str, about: str, targets: Sequence[float]) -> Vector:
        """Readings of an angular instrument about the programmed direction of an axis."""
        along = self.direction(about, self.middle)
        readings = [self.turn_urad({**self.middle, axis: at}) @ along for at in targets]
        return np.array(readings) - readings[0]

    def squareness_urad(self, first: str, second: str) -> float:
        """Angle between programmed positive directions minus the nominal one; positive is wider."""
        actual, nominal = [], []
        for axis in (first, second):
            low, high = self.workspace[axis]
            ends = [{**self.middle, axis: at} for at in (low, high)]
            for errors, lines in ((True, actual), (False, nominal)):
                start, end = (self.relative(at, errors=errors)[:3, 3] for at in ends)
                lines.append((end - start) / np.linalg.norm(end - start))
        wide, square = (np.arccos(np.clip(a @ b, -1.0, 1.0)) for a, b in (actual, nominal))
        return float(wide - square) * 1e6

    def circular_um(self, plane: str, radius_mm: float, angle_deg: Vector) -> Vector:
        """Readings of a ball bar; its ball was set where the tool stands in the middle."""
        lengths = []
        for errors in (True, False):
            centre, nodes = self.relative(self.middle, errors=errors)[:3, 3], []
            for theta in np.deg2rad(angle_deg):
                q = dict(self.middle)
                q[plane[0]] += radius_mm * np.cos(theta)
                q[plane[1]] += radius_mm * np.sin(theta)
                nodes.append(self.relative(q, errors=errors)[:3, 3] - centre)
            lengths.append(np.linalg.norm(nodes, axis=1))
        return (lengths[0] - lengths[1]) * 1e3

    def diagonal_um(
        self, start: Mapping[str, float], nodes: Sequence[Mapping[str, float]]
    ) -> Vector:
        """Displacements along the line from a start through nodes, actual − nominal."""
        first, last = (self.relative(q, errors=False)[:3, 3] for q in (start, nodes[-1]))
        along = (last - first) / np.linalg.norm(last - first)
        return np.array([(self.error_um(q) - self.error_um(start)) @ along for q in nodes])

    def ball_um(self, q: Mapping[str, float]) -> Vector:
        """Reading of an R-test: tool minus the ball that it nominally stays on, in R."""
        return self.side(self.workpiece, q, errors=False)[:3, :3] @ self.error_um(q)

    # --- what controllers do ----------------------------------------------------------------------

    def nodes(self, count: int = 4) -> list[dict[str, float]]:
        places = [np.linspace(*self.workspace[axis], count) for axis in self.linear]
        mesh = np.stack(np.meshgrid(*places, indexing="ij"), -1).reshape(-1, len(places))
        return [{**self.middle, **dict(zip(self.linear, at, strict=True))} for at in mesh.tolist()]

    def corrected_um(self, q: Mapping[str, float], moves: Mapping[str, float]) -> Vector:
        """Error on the part at a commanded position to which a controller adds moves."""
        modified = {axis: at + moves.get(axis, 0.0) for axis, at in q.items()}
        actual = self.relative(modified)[:3, 3]
        return (actual - self.relative(q, errors=False)[:3, 3]) * 1e3

    # --- as a scene of the product ----------------------------------------------------------------

    def scene_text(self, *, errors: bool = True) -> str:
        rows = ['title = "simulated"', "[machine]", f'chain = "{self.chain}"']
        rows += ["[machine.offset_mm]", *(f"{b.name} = {list(b.offset_mm)}" for b in self.bodies)]
        rows += ["[machine.rotation_deg]"]
        rows += [f"{b.name} = {list(b.rotation_deg)}" for b in self.bodies]
        rows += ["[machine.direction]", *(f"{b.name} = {b.direction}" for b in self.bodies)]
        rows += ["[machine.travel]"]
        rows += [
            f"{b.name} = {[-2000.0, 2000.0] if b.is_linear else [-360.0, 360.0]}"
            for b in self.bodies
        ]
        rows += ["[workspace]"]
        rows += [
            f"{name} = {[low, high] if low < high else low}"
            for name, (low, high) in self.workspace.items()
        ]
        rows += ["[points_mm]", f"tool = {list(self.tool_mm)}"]
        if errors:
            rows += ["[convention]", 'reference_axis = "free"', "[errors]"]
            for body in self.bodies:
                rows += [f"E{a}0{body.name} = {value}" for a, value in body.constants.items()]
                rows += [
                    f"E{a}{body.name} = {{ table = {[list(row) for row in table]} }}"
                    for a, table in body.tables.items()
                ]
        return "\n".join(rows) + "\n"

    def without_errors(self) -> "PhysicalMachine":
        workpiece, tool = (
            tuple(replace(body, constants={}, tables={}) for body in bodies)
            for bodies in (self.workpiece, self.tool)
        )
        return replace(self, workpiece=workpiece, tool=tool)


def placed_um(points_mm: Vector, errors_um: Vector) -> Vector:
    """Subtract the six numbers of a rigid placement from errors, [n, 3], fitted to all of them."""
    centred = points_mm - points_mm.mean(axis=0)
    columns = [np.tile(np.eye(3)[i], (len(centred), 1)).ravel() for i in range(3)]
    columns += [np.cross(np.eye(3)[i], centred).ravel() for i in range(3)]
    design, flat = np.stack(columns, -1), errors_um.ravel()
    fitted = design @ np.linalg.lstsq(design, flat, rcond=None)[0]
    return (flat - fitted).reshape(-1, 3)


# --- random machines ------------------------------------------------------------------------------

QUARTER_TURNS = st.sampled_from((0.0, 0.0, 0.0, 90.0, -90.0, 180.0))
OFFSETS = st.tuples(*[st.integers(-600, 600).map(float)] * 3)
HALF_MM = st.sampled_from((80.0, 150.0, 275.0))
MIDDLE_MM = st.sampled_from((0.0, -280.0, 310.0, 75.5))


@st.composite
def machines(draw: st.DrawFn, *, rotary: int = 0) -> PhysicalMachine:
    """Three linear axes in any order on either side, in rotated frames, and some rotary axes."""
    names = [*draw(st.permutations("XYZ")), *draw(st.permutations("ABC"))[:rotary]]
    sides = {name: draw(st.booleans()) for name in names}
    bodies = {
        name: Body(
            name,
            draw(OFFSETS),
            draw(st.tuples(QUARTER_TURNS, QUARTER_TURNS, QUARTER_TURNS)),
            draw(st.sampled_from((1, -1))),
        )
        for name in names
    }
    workspace = {}
    for name in names:
        middle, half = draw(MIDDLE_MM), draw(HALF_MM)
        workspace[name] = (middle - half, middle + half) if name in LINEAR else (0.0, 0.0)
    workpiece, tool = (
        tuple(body for name, body in bodies.items() if sides[name] is carried)
        for carried in (True, False)
    )
    machine = PhysicalMachine(workpiece, tool, workspace, draw(OFFSETS))
    directions = [machine.direction(axis, machine.middle) for axis in machine.linear]
    from hypothesis import assume

    assume(abs(np.linalg.det(directions)) > 0.5)
    return machine


def with_errors(machine: PhysicalMachine, errors: Mapping[str, object]) -> PhysicalMachine:
    """Add errors by key: a number for a constant, rows of a table for a component error."""

    def bent(body: Body) -> Body:
        constants, tables = dict(body.constants), dict(body.tables)
        for key, value in errors.items():
            if key[2:] == f"0{body.name}":
                constants[key[1]] = value
            elif key[2:] == body.name:
                tables[key[1]] = value
        return replace(body, constants=constants, tables=tables)

    workpiece, tool = (tuple(map(bent, bodies)) for bodies in (machine.workpiece, machine.tool))
    return replace(machine, workpiece=workpiece, tool=tool)
