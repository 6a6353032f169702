"""What stands in the box, part and path: responses are kept, a slider move is a product."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.cache import Cache
from warpspace.app.state.app_state import AppState
from warpspace.app.state.forms import option_values, read_form
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.parts.control import read_program
from warpspace.parts.part import Made, PartMesh, make_points, place_part, point_basis
from warpspace.parts.program import Program, ToolPath, trace_program
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

AT_LINE = "program.at_line"  # the form that names a line of the program
MOST_POINTS = 300_000  # of a part, or of the path of a program, that the app draws
PIECE = 20_000  # points that are worked on at once: what lies between needs memory, too
Floats: TypeAlias = NDArray[Any]
"""Of 4 bytes: half the memory, and enough to be drawn."""
T = TypeVar("T", PartMesh, ToolPath)
_KEPT: Cache[Any] = Cache(400_000_000)


@dataclass(frozen=True, eq=False)
class InBox(Generic[T]):
    """A part, at its vertices, or the path of a program, at its samples; as drawn, in R."""

    of: T  # in the workpiece frame
    made: Made  # its points there
    pose: Array  # [4, 4]; of that frame
    at: NDArray[Any]  # points of the corners of a part, [W], or of both ends of pieces of path
    nominal_mm: Floats  # [n, 3]
    response: Floats  # [K, n * 3], µm per µm or µrad
    error_um: Floats  # [n, 3]; of the tool against the workpiece

    def drawn_mm(self, exaggeration: float) -> Floats:
        """Give where the points are, [n, 3], exaggerated."""
        return self.nominal_mm + np.float32(exaggeration * MM_PER_UM) * self.error_um

    def with_errors(self, state: AppState) -> "InBox[T]":
        """Evaluate it to first order, or what a table of compensation leaves."""
        controller, scene, at = state.controller, state.active_scene(), self.made.coordinates
        if controller is None:
            amplitudes = np.fromiter(state.active.values(), np.float32, len(state.amplitudes))
            return replace(self, error_um=(amplitudes @ self.response).reshape(-1, 3))
        here = branch_pose(scene.model, "workpiece", at)
        point = transforms.apply(here, self.made.point_mm)
        kept = _KEPT.get(
            (Identity(controller), Identity(self)),
            lambda: controller.at(at, point, scene, Loop.RELATIVE, point),
            lambda found: found.nbytes,
        )
        turn = self.pose[:3, :3] @ np.swapaxes(here[..., :3, :3], -1, -2)
        error = transforms.rotate(turn, kept.field(scene.errors).error_um)
        return replace(self, error_um=error.astype(np.float32))


def normal_um(part: InBox[PartMesh]) -> Array:
    """Give the deviation along the normal of each corner, [W]."""
    turned = part.of.corners.normals @ part.pose[:3, :3].T
    return np.einsum("ij,ij->i", part.error_um[part.at], turned)


def clamped_scene(state: AppState) -> Scene:
    """Give the scene that the part is clamped in: with the rotary axes where they stand."""
    workspace = state.scene.workspace.moved(state.positions)
    return replace(state.scene, workspace=workspace, placed=state.placed)


def part_in_box(state: AppState) -> InBox[PartMesh] | None:
    """Give the part as it is cut; None where there is none, or it cannot be clamped."""
    mesh, wanted = state.part.mesh, state.part.place
    if mesh is None or not state.part.shown:
        return None

    def clamp(scene: Scene) -> InBox[PartMesh]:
        part = place_part(mesh, scene, wanted)
        made = make_points(scene, part.vertices_mm)
        return _respond(scene, part, made, part.corners.corner_of)

    return _with_errors(state, (Identity(mesh), wanted), clamp)


def path_in_box(state: AppState) -> InBox[ToolPath] | None:
    """Give the path of the program; None where there is none, or it cannot be followed."""
    text, told = state.part.program, option_values(state, Program.name) | {"at_line": ""}
    if text is None:
        return None

    def trace(scene: Scene) -> InBox[ToolPath]:
        asked = read_form(Program, Program.options(), told, scene)
        read = read_program(scene, text.splitlines(), asked, state.part.program_name)
        path = trace_program(scene, read)
        made = Made(path.tip_mm, path.coordinates, path.error_um, path.outside)
        ends = np.flatnonzero(path.step_mm.any(axis=1))
        return _respond(scene, path, made, np.stack([ends - 1, ends], axis=1))

    return _with_errors(state, (text, *sorted(told.items())), trace)


def _with_errors(
    state: AppState, own: tuple[Hashable, ...], build: Callable[[Scene], InBox[T]]
) -> InBox[T] | None:
    key = Identity(state.scene), tuple(state.positions.items()), state.placed, own
    try:
        found: InBox[T] = _KEPT.get(
            key, lambda: build(clamped_scene(state)), lambda found: found.response.nbytes
        )
        return found.with_errors(state)
    except WarpspaceError:  # its section says it
        return None


def _respond(scene: Scene, of: T, made: Made, at: NDArray[Any]) -> InBox[T]:
    """Work out what does not depend on errors."""
    count, keys = len(made.point_mm), scene.parameter_keys
    if count > MOST_POINTS:
        raise OptionError(f"{count:,} points; expected at most {MOST_POINTS:,} in the app")
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    pose = np.asarray(branch_pose(scene.model, "workpiece", stand))
    response = np.empty((len(keys), count, 3), np.float32)
    for start in range(0, count, PIECE):
        rows = slice(start, start + PIECE)
        response[:, rows] = point_basis(scene, made, rows=rows).position @ pose[:3, :3].T
    nominal = transforms.apply(pose, made.point_mm).astype(np.float32)
    flat = response.reshape(len(keys), -1)
    return InBox(of, made, pose, at, nominal, flat, nominal)


# --- Where it is clamped --------------------------------------------------------------------------


def middle_mm(part: InBox[PartMesh]) -> Array:
    """Give the middle of the box around a part, [3], in the workpiece frame."""
    return (part.made.point_mm.min(axis=0) + part.made.point_mm.max(axis=0)) / 2.0


def moved_place(part: InBox[PartMesh], stand: Array) -> tuple[float, ...]:
    """Give the place of a part whose middle is moved and turned in the workpiece frame, [4, 4]."""
    own = transforms.placed(part.of.place[:3], part.of.place[3:])
    pose = stand @ transforms.translation(-middle_mm(part)) @ own
    angles = transforms.roll_pitch_yaw_deg(pose[:3, :3])
    return tuple((np.round([*pose[:3, 3], *angles], 3) + 0.0).tolist())
