"""What stands in the box, part and path: responses are kept, a slider move is a product."""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.cache import Cache
from warpspace.app.state.app_state import AppState
from warpspace.app.state.forms import option_values, read_form
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.field.evaluate import build_basis
from warpspace.geometry.colour import component_values
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.parts.control import read_program
from warpspace.parts.part import PartMesh, find_place, make_points, place_part
from warpspace.parts.program import Program, trace_program
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

AT_LINE = "program.at_line"  # the form that names a line of the program
NORMAL = "normal"  # beside the components of a map: the deviation along the normal of a part
MOST_POINTS = 300_000  # of a part, or of the path of a program, that the app draws
PIECE = 20_000  # points that are worked on at once: what lies between needs memory, too
Floats: TypeAlias = NDArray[Any]
"""Of 4 bytes: half the memory, and enough to be drawn."""
_KEPT: Cache[Any] = Cache(400_000_000)


@dataclass(frozen=True, eq=False)
class Points:
    """Points of the workpiece as they are drawn, in R, and what errors do to them."""

    nominal_mm: Floats  # [n, 3]
    response: Floats  # [K, n * 3], µm per µm or µrad
    coordinates: Mapping[str, Array]  # [n] each: where the axes stand
    own_mm: Array  # [n, 3]; in the workpiece frame
    pose: Array  # [4, 4]; of the workpiece frame as drawn
    outside: NDArray[np.bool_]  # [n]; beyond the travel

    def error_um(self, state: AppState) -> Floats:
        """Evaluate them to first order, or what a table of compensation leaves, [n, 3]."""
        controller, scene, at = state.controller, state.active_scene(), self.coordinates
        if controller is None:
            amplitudes = np.fromiter(state.active.values(), np.float32, len(state.amplitudes))
            return (amplitudes @ self.response).reshape(-1, 3)
        here = branch_pose(scene.model, "workpiece", at)
        point = transforms.apply(here, self.own_mm)
        kept = _KEPT.get(
            (Identity(controller), Identity(self)),
            lambda: controller.at(at, point, scene, Loop.RELATIVE, point),
            lambda found: found.nbytes,
        )
        turn = self.pose[:3, :3] @ np.swapaxes(here[..., :3, :3], -1, -2)
        return transforms.rotate(turn, kept.field(scene.errors).error_um).astype(np.float32)


def respond(
    scene: Scene, own_mm: Array, coordinates: Mapping[str, Array], outside: NDArray[np.bool_]
) -> Points:
    """Work out what does not depend on errors, of points of the workpiece frame, [n, 3]."""
    count, keys = len(own_mm), scene.parameter_keys
    if count > MOST_POINTS:
        raise OptionError(f"{count:,} points; expected at most {MOST_POINTS:,} in the app")
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    pose = np.asarray(branch_pose(scene.model, "workpiece", stand))
    at = {name: np.broadcast_to(values, count) for name, values in coordinates.items()}
    response = np.empty((len(keys), count, 3), np.float32)
    view = scene.view(Loop.RELATIVE, "workpiece")
    for start in range(0, count, PIECE):
        rows = slice(start, start + PIECE)
        here = {name: values[rows] for name, values in at.items()}
        point = transforms.apply(branch_pose(scene.model, "workpiece", here), own_mm[rows])
        basis = build_basis(scene.model, scene.errors, keys, here, view, point)
        response[:, rows] = basis.position @ pose[:3, :3].T
    nominal = transforms.apply(pose, own_mm).astype(np.float32)
    return Points(nominal, response.reshape(len(keys), -1), at, own_mm, pose, outside)


@dataclass(frozen=True, eq=False)
class Moved:
    """Points with the errors of a state."""

    points: Points
    error_um: Floats  # [n, 3]; of the tool against the workpiece, in R as drawn

    @cached_property
    def norm_um(self) -> Floats:
        return component_values(self.error_um, "norm")

    def values_um(self, component: str) -> Floats:
        """Give what is coloured of them."""
        return self.norm_um if component == "norm" else component_values(self.error_um, component)

    def drawn_mm(self, exaggeration: float) -> Floats:
        """Give where they are, [n, 3], exaggerated."""
        return self.points.nominal_mm + np.float32(exaggeration * MM_PER_UM) * self.error_um


@dataclass(frozen=True, eq=False)
class PartPicture(Moved):
    """A part where it is clamped, at its vertices; it is coloured at its corners, [W]."""

    mesh: PartMesh  # in the workpiece frame
    middle_mm: Array  # [3]; of the box of the part, in its own frame
    pose: Array  # [4, 4]; takes the part's own frame to where it is drawn

    @cached_property
    def normal_um(self) -> Floats:
        """Deviation along the normal of each corner, [W]."""
        corners, turn = self.mesh.corners, self.points.pose[:3, :3]
        error = self.error_um[corners.corner_of]
        return np.einsum("ij,ij->i", error, (corners.normals @ turn.T).astype(np.float32))

    def values_um(self, component: str) -> Floats:
        if component == NORMAL:
            return self.normal_um
        return super().values_um(component)[self.mesh.corners.corner_of]


@dataclass(frozen=True, eq=False)
class PathPicture(Moved):
    """The path of a program with the errors of a state, at its samples."""

    line: NDArray[np.int64]  # [n]; of the program
    ends: NDArray[np.intp]  # [S]; samples that a piece of the path leads to from the one before


M = TypeVar("M", bound=Moved)


def clamped_scene(state: AppState) -> Scene:
    """Give the scene that the part is clamped in: with the rotary axes where they stand."""
    workspace = state.scene.workspace.moved(state.positions)
    return replace(state.scene, workspace=workspace, placed=state.placed)


def moved(state: AppState, find: Callable[[AppState], M | None]) -> M | None:
    """Give points with the errors of a state; None where there are none, or they cannot be."""
    try:
        found = find(state)
        return found and replace(found, error_um=found.points.error_um(state))
    except WarpspaceError:  # its section says it
        return None


def _keep(state: AppState, own: tuple[Hashable, ...], build: Callable[[Scene], M]) -> M:
    key = Identity(state.scene), tuple(state.positions.items()), state.placed, own
    return _KEPT.get(
        key, lambda: build(clamped_scene(state)), lambda found: found.points.response.nbytes
    )


def clamped_part(state: AppState) -> PartPicture | None:
    """Give the part of a state where it is clamped, without errors."""
    mesh, place = state.part.mesh, state.part.place

    def clamp(scene: Scene) -> PartPicture:
        assert mesh is not None  # noqa: S101 - as below
        at = find_place(mesh, scene, place)
        part = place_part(mesh, scene, at)
        made = make_points(scene, part.vertices_mm)
        points = respond(scene, made.point_mm, made.coordinates, made.outside)
        middle = (mesh.vertices_mm.min(axis=0) + mesh.vertices_mm.max(axis=0)) / 2.0
        pose = points.pose @ transforms.placed(at[:3], at[3:])
        return PartPicture(points, points.nominal_mm, part, middle, pose)

    is_drawn = mesh is not None and state.part.shown
    return _keep(state, (Identity(mesh), place), clamp) if is_drawn else None


def program_defaults(state: AppState) -> Mapping[str, str]:
    """Give what the scene says of options of its program."""
    tcp = state.scene.part.tcp
    return {"tcp": tcp} if tcp else {}


def traced_path(state: AppState) -> PathPicture | None:
    """Give the path of the program of a state, without errors."""
    held = state.part.program
    told = {**program_defaults(state), **option_values(state, Program.name), "at_line": ""}

    def trace(scene: Scene) -> PathPicture:
        name, text = held or ("", "")
        options = [one for one in Program.options() if one.name in told]
        asked = read_form(Program, options, told, scene)
        read = read_program(scene, text.splitlines(), asked, name)
        path = trace_program(scene, read, chord_mm=asked.chord_mm)
        points = respond(scene, path.tip_mm, path.coordinates, path.outside)
        ends = np.flatnonzero(path.step_mm.any(axis=1))
        return PathPicture(points, points.nominal_mm, path.line, ends)

    return _keep(state, (Identity(held), *sorted(told.items())), trace) if held else None


# --- Where it is clamped --------------------------------------------------------------------------


def place_of(part: PartPicture, drawn: Array) -> tuple[float, ...]:
    """Give the place of a part, mm and degrees, for the pose that it is drawn in, [4, 4]."""
    pose = transforms.inverse(part.points.pose) @ drawn
    angles = transforms.roll_pitch_yaw_deg(pose[:3, :3])
    return tuple((np.round([*pose[:3, 3], *angles], 3) + 0.0).tolist())


def turned_place(part: PartPicture, axis: str, angle_deg: float) -> tuple[float, ...]:
    """Turn a part about its middle and an axis of the workpiece frame."""
    middle = transforms.apply(part.pose, part.middle_mm)
    about = part.points.pose[:3, "xyz".index(axis)]
    turn = transforms.vector_rotation(np.deg2rad(angle_deg) * about)
    own = transforms.translation(-middle) @ part.pose
    return place_of(part, transforms.rigid(turn, middle) @ own)
