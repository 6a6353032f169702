"""Description of a machine: its kinematic chain, frame offsets, travels and directions."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpspace.exceptions import UnknownNameError
from warpspace.machine.axes import (
    LINEAR_LETTERS,
    direction_index,
    is_linear,
)
from warpspace.machine.body_source import BodySource
from warpspace.machine.chain import Chain, parse_chain
from warpspace.machine.gantry import Gantry, default_across
from warpspace.machine.parameters import axis_parameters, default_keys

Vector = tuple[float, float, float]
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
    """Give the travel of an axis that none is given for, mm or degrees."""
    return _DEFAULT_TRAVEL[axis[0]]


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of motion.

    Attributes
    ----------
    name : str
        X Y Z U V W (linear) or A B C (rotary, about x y z), and an optional digit.
    offset_mm : tuple of float, (3,)
        Origin of its frame in the frame before it, mm.
    travel : tuple of float, (2,)
        Lower and upper end, mm or degrees.
    direction : int
        +1, or −1 for an axis that moves against its name.
    rotation_deg : tuple of float, (3,)
        Fixed rotation of its frame against the frame before it, degrees, about the fixed x, y and z
        axes in that order (roll, pitch, yaw of URDF).
    """

    name: str
    offset_mm: Vector
    travel: Range
    direction: int = 1
    rotation_deg: Vector = ORIGIN

    @property
    def is_linear(self) -> bool:
        """Whether it translates."""
        return is_linear(self.name)

    @property
    def index(self) -> int:
        """Index 0, 1 or 2 of the coordinate direction along or about which it moves."""
        return direction_index(self.name)

    @property
    def unit(self) -> str:
        """Unit of its position in files and on screen."""
        return "mm" if self.is_linear else "°"


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine tool as a rigid-body kinematic chain.

    Attributes
    ----------
    chain : Chain
        Order and side of the axes.
    axes : mapping of str to Axis
        The axes by name, in the order X Y Z U V W A B C.
    fixed_mm : mapping of str to tuple of float, (3,)
        Origins of S (spindle) and t (tool) at the end of the tool branch, and w (workpiece) at the
        end of the workpiece branch, each in the frame before it, mm.
    fixed_deg : mapping of str to tuple of float, (3,)
        Their fixed rotations, degrees, as those of axes.
    bodies : mapping of str to BodySource
        Bodies of frames that the description gives; all others are generated.
    source : str
        Where its structure is published.
    name, title : str
        Short name and full name.
    body_dir : str
        Folder with the schematic bodies, empty where there are none.
    gantries : mapping of str to Gantry
        Linear axes that stand on two guides.
    """

    chain: Chain
    axes: Mapping[str, Axis]
    fixed_mm: Mapping[str, Vector] = field(default_factory=dict[str, Vector])
    name: str = "machine"
    title: str = ""
    body_dir: str = ""
    fixed_deg: Mapping[str, Vector] = field(default_factory=dict[str, Vector])
    gantries: Mapping[str, Gantry] = field(default_factory=dict[str, Gantry])
    bodies: Mapping[str, BodySource] = field(default_factory=dict[str, BodySource])
    source: str = ""

    def axis(self, name: str) -> Axis:
        """Look up an axis by its name.

        Raises
        ------
        UnknownNameError
            If the machine has no such axis.
        """
        try:
            return self.axes[name]
        except KeyError:
            raise UnknownNameError("axis", name, self.axes) from None

    def branch(self, side: str) -> tuple[Axis, ...]:
        """List the axes of a branch, from the frame outwards.

        Parameters
        ----------
        side : str
            "tool" or "workpiece".
        """
        names = self.chain.tool if side == "tool" else self.chain.workpiece
        return tuple(self.axes[name] for name in names)

    def end_frames(self, side: str) -> tuple[tuple[str, Vector, Vector], ...]:
        """List the fixed frames behind the last axis of a branch: name, offset [mm], turn [°].

        Parameters
        ----------
        side : str
            "tool" or "workpiece".
        """
        names = ("S", "t") if side == "tool" else ("w",)
        return tuple(
            (name, self.fixed_mm.get(name, ORIGIN), self.fixed_deg.get(name, ORIGIN))
            for name in names
        )

    @property
    def parameter_keys(self) -> tuple[str, ...]:
        """Keys of the error parameters the machine has by default."""
        return default_keys(self.chain.axes)

    @property
    def reference_keys(self) -> tuple[str, ...]:
        """Keys of the rotations of the reference axis, which the frame R absorbs by definition.

        The reference axis is the first linear one in the order X Y Z U V W.
        """
        linear = [axis for axis in self.axes if is_linear(axis)]
        return tuple(f"E{letter}0{axis}" for axis in linear[:1] for letter in "ABC")

    @property
    def allowed_keys(self) -> tuple[str, ...]:
        """Keys of all parameters that may be given, every constant of every axis included."""
        return tuple(row.key for axis in self.axes for row in axis_parameters(axis))


def build_machine(
    chain: str | Chain,
    *,
    offset_mm: Mapping[str, Vector] | None = None,
    rotation_deg: Mapping[str, Vector] | None = None,
    travel: Mapping[str, Range] | None = None,
    direction: Mapping[str, int] | None = None,
    gantry: Mapping[str, tuple[float, str | None]] | None = None,
    name: str = "machine",
    title: str = "",
    body_dir: str = "",
    source: str = "",
) -> Machine:
    """Put a machine together from its chain and the tables that go with it.

    Parameters
    ----------
    chain : str or Chain
        Order of the axes, for instance ``wCBFXYZt``.
    offset_mm : mapping of str to tuple of float, (3,), optional
        Origin of each frame (axes, S, t, w) in the frame before it, mm. Absent is zero.
    rotation_deg : mapping of str to tuple of float, (3,), optional
        Fixed rotation of each frame after its offset, degrees, about the fixed x, y and z axes in
        that order. Absent is zero.
    travel : mapping of str to tuple of float, (2,), optional
        Lower and upper end of each axis, mm or degrees.
    direction : mapping of str to int, optional
        +1 or −1; absent is +1.
    gantry : mapping of str to (float, str or None), optional
        Linear axes on two guides: distance of the guides in mm, and the direction "x", "y" or "z"
        in which they lie apart (None for the other horizontal one).
    name, title, body_dir, source : str, optional
        Short name, full name, folder of the schematic bodies, where its structure is published.

    Returns
    -------
    Machine

    Raises
    ------
    ChainError
        If the chain cannot be read.
    """
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
        )
        for axis in parsed.axes
    }
    fixed = {frame: offsets.get(frame, ORIGIN) for frame in FIXED_FRAMES}
    turned = {frame: rotations.get(frame, ORIGIN) for frame in FIXED_FRAMES}
    turned = {frame: angles for frame, angles in turned.items() if angles != ORIGIN}
    gantries = {
        axis: Gantry(axis, span_mm, across or default_across(axis))
        for axis, (span_mm, across) in (gantry or {}).items()
    }
    names = (name, title or name, body_dir)
    return Machine(parsed, axes, fixed, *names, turned, gantries, source=source)
