"""Description of a machine: its kinematic chain, frame offsets, travels, gantries and bodies."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations

import numpy as np

from warpspace.exceptions import ChainError, UnknownNameError
from warpspace.machine.adjusters import Adjuster
from warpspace.machine.axes import (
    LINEAR_LETTERS,
    MAX_AXES,
    axis_parameters,
    direction_index,
    is_axis_name,
    is_linear,
    sort_axes,
)
from warpspace.units import Array

PARALLEL = 1e-6  # sine of the angle between axes that no squareness exists for


@dataclass(frozen=True, slots=True)
class Chain:
    """Order of the axes from the workpiece through the frame to the tool."""

    workpiece: tuple[str, ...]  # axes that carry the workpiece, from the frame outwards
    tool: tuple[str, ...]  # axes that carry the tool, from the frame outwards

    @property
    def axes(self) -> tuple[str, ...]:
        """All axes of the machine in the order X Y Z U V W A B C."""
        return sort_axes({*self.workpiece, *self.tool})

    def carried_by(self, axis: str) -> tuple[str, ...]:
        """List an axis and those that it carries, which its constant errors rotate."""
        branch = self.tool if axis in self.tool else self.workpiece
        return branch[branch.index(axis) :]

    def __str__(self) -> str:
        """Write the chain in its canonical spelling, for instance ``wCBFXYZt``."""
        return f"w{''.join(reversed(self.workpiece))}F{''.join(self.tool)}t"


def parse_chain(text: str) -> Chain:
    """Parse a kinematic chain written from the workpiece over the frame to the tool."""
    bare = re.sub(r"[\s()\[\]{}'’′\-–_]", "", text)
    expected = (
        "expected w, axes (a letter of X Y Z U V W A B C and an optional digit), F (or b), axes, t;"
        " for instance wCBFXYZt or wC2XFZC1t"
    )
    matched = re.fullmatch(r"[wW]((?:[A-Z][0-9]*)*?)(b|F)((?:[A-EG-Z][0-9]*)*)[tT]", bare)
    if matched is None:
        raise ChainError(f"chain {text!r} cannot be read; {expected}")
    workpiece, tool = (tuple(re.findall(r"[A-Z][0-9]*", matched[side])) for side in (1, 3))
    axes = workpiece + tool
    if not 1 <= len(axes) <= MAX_AXES:
        count = f"{len(axes)} axes" if axes else "no axis"
        raise ChainError(f"chain {text!r} has {count}; expected one to eight")
    unknown = sorted({name for name in axes if not is_axis_name(name)})
    if unknown:
        raise ChainError(f"chain {text!r} has unknown axis {', '.join(unknown)}; {expected}")
    twice = sorted({name for name in axes if axes.count(name) > 1})
    if twice:
        raise ChainError(
            f"chain {text!r} has axis {', '.join(twice)} twice; expected each name once"
            f" (distinguish them by a digit: {twice[0][0]}1, {twice[0][0]}2)"
        )
    return Chain(tuple(reversed(workpiece)), tool)


ACROSS = "xyz"  # directions in which the guides of a gantry may lie apart
URAD_PER_UM_OVER_MM = 1000.0  # A micrometre over a millimetre is a milliradian


@dataclass(frozen=True, slots=True)
class Gantry:
    """Two guides of one axis."""

    axis: str  # name of a linear axis
    # distance between the guides: the first one lies at −span/2 of the origin of the axis's frame,
    # the second at +span/2
    span_mm: float
    # direction from the first guide to the second: "x", "y" or "z", not that of the axis
    across: str

    @property
    def positioning_key(self) -> str:
        """Key of the positioning error of the axis, the mean of both guides."""
        return f"E{'XYZ'[direction_index(self.axis)]}{self.axis}"

    @property
    def rotation_key(self) -> str:
        """Key of the rotation caused by the difference between the guides."""
        third = 3 - direction_index(self.axis) - ACROSS.index(self.across)
        return f"E{'ABC'[third]}{self.axis}"

    @property
    def rotation_weight(self) -> float:
        """Rotation for each micrometre that the second guide leads the first, µrad/µm.

        A rotation c about the third direction moves a point at p of the direction across by
        c·p·(third × across) along the axis. That is −c·p for X across y, and where the axis, the
        direction across and the third one are in cyclic order; +c·p otherwise.
        """
        cyclic = (ACROSS.index(self.across) - direction_index(self.axis)) % 3 == 1
        return (-1.0 if cyclic else 1.0) * URAD_PER_UM_OVER_MM / self.span_mm


def default_across(axis: str) -> str:
    """Return the default direction across: the other horizontal one; x for Z."""
    return "x" if direction_index(axis) else "y"


Vector = tuple[float, float, float]
BODY_FRAMES = ("R", "S", "t", "w")  # frames of bodies, besides the axes
MESH_ENDINGS = (".stl", ".obj", ".ply", ".glb")
MESH_UNITS = ("mm", "cm", "m", "in")
TOOL_SHAPES = ("cutter", "probe", "nozzle", "wheel", "gripper")  # drawn shapes of tools


@dataclass(frozen=True, slots=True)
class BodySource:
    """Source of the body of a frame."""

    # mesh, named as in the file of the scene or machine; empty for a shape
    file: str = ""
    path: str = ""  # of that file; empty where the description has no folder (an upload)
    unit: str = ""  # of its numbers; empty for that of its format
    offset_mm: Vector = (0.0, 0.0, 0.0)  # origin of the mesh in its frame
    # its rotation there, about the fixed x, y and z axes in that order
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    shape: str = ""  # of the tool, one of `TOOL_SHAPES`; empty for a mesh


Range = tuple[float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)
FIXED_FRAMES = ("S", "t", "w")
"""Frames without motion: spindle and tool at the end of the tool branch, workpiece of the other."""

_DEFAULT_TRAVEL: Mapping[str, Range] = {
    **dict.fromkeys(LINEAR_LETTERS, (-250.0, 250.0)),
    **dict.fromkeys("AB", (-90.0, 90.0)),
    "C": (0.0, 360.0),
}


def default_travel(axis: str) -> Range:
    """Return the default travel of an axis, mm or degrees."""
    return _DEFAULT_TRAVEL[axis[0]]


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of motion."""

    name: str  # X Y Z U V W (linear) or A B C (rotary, about x y z), and an optional digit
    offset_mm: Vector  # origin of its frame in the frame before it, mm
    travel: Range  # lower and upper end, mm or degrees
    direction: int = 1  # +1, or −1 for an axis that moves opposite to its name
    # fixed rotation of its frame against the frame before it, degrees, about the fixed x, y and z
    # axes in that order (roll, pitch, yaw of URDF)
    rotation_deg: Vector = ORIGIN
    # true where the description states the direction
    direction_given: bool = field(default=False, compare=False)

    @property
    def is_linear(self) -> bool:
        return is_linear(self.name)

    @property
    def index(self) -> int:
        """Index 0, 1 or 2 of the coordinate direction along or about which it moves."""
        return direction_index(self.name)

    @property
    def unit(self) -> str:
        return "mm" if self.is_linear else "°"


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine tool as a rigid-body kinematic chain."""

    chain: Chain  # order and side of the axes
    axes: Mapping[str, Axis]  # the axes by name, in the order X Y Z U V W A B C
    # origins of S (spindle) and t (tool) at the end of the tool branch, and w (workpiece) at the
    # end of the workpiece branch, each in the frame before it, mm
    fixed_mm: Mapping[str, Vector] = field(default_factory=dict[str, Vector])
    name: str = "machine"  # short name and full name
    title: str = ""
    body_dir: str = ""  # folder with the schematic bodies, empty where there are none
    # their fixed rotations, degrees, as those of axes
    fixed_deg: Mapping[str, Vector] = field(default_factory=dict[str, Vector])
    # linear axes with two guides
    gantries: Mapping[str, Gantry] = field(default_factory=dict[str, Gantry])
    # bodies of frames in the description; all others are generated
    bodies: Mapping[str, BodySource] = field(default_factory=dict[str, BodySource])
    source: str = ""  # where its structure is published
    columns: Mapping[str, str] = field(default_factory=dict[str, str])  # names of axes in data
    adjusters: tuple[Adjuster, ...] = ()

    def axis(self, name: str) -> Axis:
        try:
            return self.axes[name]
        except KeyError:
            raise UnknownNameError("axis", name, self.axes) from None

    def branch(self, side: str) -> tuple[Axis, ...]:
        """List the axes of a branch, from the frame outwards."""
        names = self.chain.tool if side == "tool" else self.chain.workpiece
        return tuple(self.axes[name] for name in names)

    def sense(self, axis: str) -> int:
        """Return the sign of the tool motion relative to the workpiece for a positive command."""
        side = 1 if axis in self.chain.tool else -1
        return side * self.axes[axis].direction

    def with_direction(self, axis: str, direction: int) -> "Machine":
        """Return the machine with another sense of motion of an axis, +1 or −1."""
        axes = {**self.axes, axis: replace(self.axes[axis], direction=direction)}
        return replace(self, axes=axes)

    def end_frames(self, side: str) -> tuple[tuple[str, Vector, Vector], ...]:
        """List the fixed frames at the end of a branch: name, offset [mm], rotation [°]."""
        names = ("S", "t") if side == "tool" else ("w",)
        return tuple(
            (name, self.fixed_mm.get(name, ORIGIN), self.fixed_deg.get(name, ORIGIN))
            for name in names
        )

    @property
    def _rotations(self) -> "Rotations":
        return tuple((name, axis.rotation_deg) for name, axis in self.axes.items())

    def squareness_key(self, first: str, second: str) -> str:
        """Return the constant that changes the angle between two linear axes; empty if parallel.

        It is a rotation of the later axis in the order X Y Z U V W, or of the other one if the
        later one carries it.
        """
        return squareness_key(self.chain, self._rotations, first, second)

    @property
    def parameter_keys(self) -> tuple[str, ...]:
        return default_keys(self.chain, self._rotations)

    @property
    def reference_keys(self) -> tuple[str, ...]:
        """Keys of the rotations of the reference axis, absorbed by the frame R by definition."""
        linear = [axis for axis in self.axes if is_linear(axis)]
        keys = (f"E{letter}0{axis}" for axis in linear[:1] for letter in "ABC")
        return tuple(key for key in keys if key not in self.parameter_keys)

    @property
    def allowed_keys(self) -> tuple[str, ...]:
        """Keys of all allowed parameters, with all constants of all axes."""
        return tuple(row.key for axis in self.axes for row in axis_parameters(axis))


Rotations = tuple[tuple[str, Vector], ...]
"""Fixed rotations of the frames of axes by name, degrees."""


@cache
def default_keys(chain: Chain, rotations: Rotations) -> tuple[str, ...]:
    """List the parameters that a machine has by default.

    Six component errors per axis; per rotary axis two orientation and two location errors; for each
    pair of linear axes the constant that changes the angle between them, or both angles between
    parallel axes.
    """
    angles: set[str] = set()
    for first, second in combinations(filter(is_linear, chain.axes), 2):
        key = squareness_key(chain, rotations, first, second)
        angles |= {key} if key else set(_angles_across(second))
    keys: list[str] = []
    for axis in chain.axes:
        keys += [row.key for row in axis_parameters(axis) if not row.is_constant]
        across = _angles_across(axis)
        if is_linear(axis):
            keys += [key for key in across if key in angles]
        else:
            locations = [f"E{letter}0{axis}" for letter in "XYZ"]
            keys += [
                *across,
                *(key for key in locations if "XYZ".index(key[1]) != direction_index(axis)),
            ]
    return tuple(keys)


def _angles_across(axis: str) -> list[str]:
    along = direction_index(axis)
    return [f"E{letter}0{axis}" for about, letter in enumerate("ABC") if about != along]


@cache
def squareness_key(chain: Chain, rotations: Rotations, first: str, second: str) -> str:
    frames = {axis: _frame(chain, dict(rotations), axis) for axis in (first, second)}
    along = [frames[axis][:, direction_index(axis)] for axis in (first, second)]
    normal = np.cross(along[0], along[1])
    if np.linalg.norm(normal) < PARALLEL:
        return ""
    turned = second if first not in chain.carried_by(second) else first
    about = int(np.argmax(np.abs(frames[turned].T @ normal)))
    return f"E{'ABC'[about]}0{turned}"


def _frame(chain: Chain, rotations: Mapping[str, Vector], axis: str) -> Array:
    """Compute the rotation of the frame of an axis in R, rotary axes at zero."""
    branch = chain.tool if axis in chain.tool else chain.workpiece
    pose = np.eye(3)
    for name in branch[: branch.index(axis) + 1]:
        a, b, c = np.deg2rad(rotations.get(name, ORIGIN))
        x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        pose = pose @ z @ y @ x
    return pose


def build_machine(
    chain: str | Chain,
    *,
    offset_mm: Mapping[str, Vector] | None = None,
    rotation_deg: Mapping[str, Vector] | None = None,
    travel: Mapping[str, Range] | None = None,
    direction: Mapping[str, int] | None = None,
    gantries: Mapping[str, Gantry] | None = None,
    name: str = "machine",
    title: str = "",
    body_dir: str = "",
    source: str = "",
) -> Machine:
    """Build a machine from its chain and the tables of its axes and frames."""
    parsed = parse_chain(chain) if isinstance(chain, str) else chain
    offsets, rotations = offset_mm or {}, rotation_deg or {}
    travels, directions = travel or {}, direction or {}
    axes = {
        axis: Axis(
            axis,
            offsets.get(axis, ORIGIN),
            travels.get(axis, default_travel(axis)),
            directions.get(axis, 1),
            rotations.get(axis, ORIGIN),
            axis in directions,
        )
        for axis in parsed.axes
    }
    fixed = {frame: offsets.get(frame, ORIGIN) for frame in FIXED_FRAMES}
    turned = {frame: rotations.get(frame, ORIGIN) for frame in FIXED_FRAMES}
    turned = {frame: angles for frame, angles in turned.items() if angles != ORIGIN}
    names = (name, title or name, body_dir)
    return Machine(parsed, axes, fixed, *names, turned, gantries or {}, source=source)
