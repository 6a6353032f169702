"""The part in the box: responses of its vertices are kept, a slider move is a product."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.cache import Cache
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.formats.compensation.controller import Corrected
from warpspace.geometry.colour import component_values
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.parts.part import PartMesh, find_place, make_points, place_part, point_basis
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

CACHE_BYTES = 300_000_000
MOST_VERTICES = 300_000  # of a part that the app draws
PIECE = 20_000  # vertices that are worked on at once: what lies between needs memory, too
MOST_EDGES = 60_000  # of the creases of a part: those of a rough scan are left out
STEEP = 1e-9  # cosine of a turn about y below which those about x and z are one
Floats: TypeAlias = NDArray[Any]
"""Of 4 bytes: half the memory, and enough to be drawn."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A part where it is clamped, and what a unit of each amplitude does to it; as drawn, in R."""

    mesh: PartMesh  # in the workpiece frame
    middle_mm: Array  # [3]; of the box of the part, in its own frame
    pose: Array  # [4, 4]; takes the part's own frame to where it is drawn
    workpiece: Array  # [4, 4]; likewise the workpiece frame
    nominal_mm: Floats  # [V, 3]
    normals: Floats  # [W, 3], of the corners
    response: Floats  # [K, V * 3], µm per µm or µrad
    coordinates: dict[str, Array]  # [V] each: where the axes stand
    outside: NDArray[np.bool_]  # [V]

    @cached_property
    def edges(self) -> NDArray[np.int32]:
        """Creases and rims as pairs of corners, [S, 2]; none where there are too many."""
        found = self.mesh.corners
        pairs = np.stack([found.triangles, np.roll(found.triangles, -1, axis=1)], -1).reshape(-1, 2)
        ends = np.sort(pairs, axis=1).astype(np.int64) @ [len(found.corner_of), 1]
        _, first, count = np.unique(ends, return_index=True, return_counts=True)
        rims = pairs[first[count == 1]]  # of two smooth faces that meet, one each
        ends = np.sort(found.corner_of[rims], axis=1).astype(np.int64) @ [len(self.nominal_mm), 1]
        rims = rims[np.unique(ends, return_index=True)[1]]
        return rims[: len(rims) * (len(rims) <= MOST_EDGES)]


@dataclass(frozen=True, eq=False)
class PartPicture:
    """A part with the errors of a state."""

    placed: Placed
    error_um: Floats  # [V, 3]; of the tool against the workpiece, in R as drawn

    @cached_property
    def norm_um(self) -> Floats:
        return component_values(self.error_um, "norm").astype(np.float32)

    @cached_property
    def normal_um(self) -> Floats:
        """Deviation along the normal of each corner, [W]."""
        at = self.placed.mesh.corners.corner_of
        return np.einsum("ij,ij->i", self.error_um[at], self.placed.normals)

    def values(self, component: str, *, normal: bool) -> Array:
        """Give what is coloured at each corner, [W], µm."""
        if normal:
            return self.normal_um
        norm = component == "norm"
        found = self.norm_um if norm else component_values(self.error_um, component)
        return found[self.placed.mesh.corners.corner_of]

    def drawn_mm(self, exaggeration: float) -> Floats:
        """Give the corners of the part as cut, [W, 3], exaggerated."""
        drawn = self.placed.nominal_mm + np.float32(exaggeration * MM_PER_UM) * self.error_um
        return drawn[self.placed.mesh.corners.corner_of]


_KEPT: Cache[Placed] = Cache(CACHE_BYTES)
_CORRECTED: Cache[Corrected] = Cache(CACHE_BYTES // 2)


def clamped_scene(state: AppState) -> Scene:
    """Give the scene that the part is clamped in: with the rotary axes where they stand."""
    workspace = state.scene.workspace.moved(state.positions)
    return replace(state.scene, workspace=workspace, placed=state.placed)


def placed_part(state: AppState) -> Placed | None:
    """Give the part that a state holds, where it is clamped; None where it holds none.

    Raises
    ------
    WarpspaceError
        If the machine cannot follow it, or it is too large to be drawn.
    """
    mesh, place = state.part.mesh, state.part.place
    if mesh is None:
        return None
    key = (Identity(state.scene), tuple(state.positions.items()), state.placed, Identity(mesh),
           place)  # fmt: skip
    return _KEPT.get(
        key,
        lambda: _place(clamped_scene(state), mesh, place),
        lambda found: found.response.nbytes,
    )


def _place(scene: Scene, mesh: PartMesh, place: Sequence[float] | None) -> Placed:
    count = len(mesh.vertices_mm)
    if count > MOST_VERTICES:
        raise OptionError(
            f"{mesh.name} has {count:,} vertices; expected at most {MOST_VERTICES:,} in the app"
        )
    at = find_place(mesh, scene, place)
    part = place_part(mesh, scene, at)
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    workpiece = np.asarray(branch_pose(scene.model, "workpiece", stand))
    turn = workpiece[:3, :3]
    response = np.empty((len(scene.parameter_keys), count, 3), np.float32)
    made = make_points(scene, part.vertices_mm)
    for start in range(0, count, PIECE):
        rows = slice(start, start + PIECE)
        piece = replace(
            made,
            point_mm=made.point_mm[rows],
            coordinates={k: np.broadcast_to(q, count)[rows] for k, q in made.coordinates.items()},
        )
        response[:, rows] = point_basis(scene, piece).position @ turn.T
    return Placed(
        part,
        (mesh.vertices_mm.min(axis=0) + mesh.vertices_mm.max(axis=0)) / 2.0,
        workpiece @ transforms.placed(at[:3], at[3:]),
        workpiece,
        transforms.apply(workpiece, part.vertices_mm).astype(np.float32),
        (part.corners.normals @ turn.T).astype(np.float32),
        response.reshape(len(response), -1),
        made.coordinates,
        made.outside,
    )


def part_picture(state: AppState) -> PartPicture | None:
    """Give the part with the errors of a state; None where none is drawn, or it cannot be."""
    if not state.part.is_drawn:
        return None
    try:
        placed = placed_part(state)
        return None if placed is None else PartPicture(placed, _error(state, placed))
    except WarpspaceError:  # its section says it
        return None


def _error(state: AppState, placed: Placed) -> Floats:
    amplitudes = np.fromiter(state.active.values(), np.float32, len(state.amplitudes))
    if state.controller is None:
        return (amplitudes @ placed.response).reshape(-1, 3)
    controller, scene, at = state.controller, state.active_scene(), placed.coordinates
    key = Identity(controller), Identity(placed), Identity(state.scene.model)
    kept = _CORRECTED.get(
        key,
        lambda: controller.at(at, nominal_point(scene.model, Loop.TOOL, at), scene, Loop.RELATIVE),
        lambda found: found.nbytes,
    )
    here = branch_pose(scene.model, "workpiece", at)[..., :3, :3]
    turn = placed.workpiece[:3, :3] @ np.swapaxes(here, -1, -2)
    return transforms.rotate(turn, kept.field(scene.errors).error_um).astype(np.float32)


def part_change(a: PartPicture | None, b: PartPicture | None) -> PartPicture | None:
    """Give the change of a part from one machine to another; None where there is none."""
    if a is None or b is None or a.error_um.shape != b.error_um.shape:
        return None
    return PartPicture(b.placed, b.error_um - a.error_um)


# --- Where it is clamped --------------------------------------------------------------------------


def place_of(pose: Array) -> tuple[float, ...]:
    """Give the place of a part, mm and degrees, for the pose of its frame in w, [4, 4]."""
    turn = pose[:3, :3]
    flat = float(np.hypot(turn[2, 1], turn[2, 2]))
    if flat > STEEP:
        about_x = np.arctan2(turn[2, 1], turn[2, 2])
        about_z = np.arctan2(turn[1, 0], turn[0, 0])
    else:
        about_x, about_z = np.arctan2(-turn[1, 2], turn[1, 1]), 0.0
    angles = np.rad2deg([about_x, np.arctan2(-turn[2, 0], flat), about_z])
    return tuple((np.round([*pose[:3, 3], *angles], 3) + 0.0).tolist())


def turned_place(placed: Placed, axis: str, angle_deg: float) -> tuple[float, ...]:
    """Turn a part about its middle and an axis of the workpiece frame."""
    own = transforms.inverse(placed.workpiece) @ placed.pose
    middle = transforms.apply(own, placed.middle_mm)
    turn = transforms.rigid(
        transforms.axis_rotation("xyz".index(axis), np.deg2rad(angle_deg)), np.zeros(3)
    )
    return place_of(transforms.translation(middle) @ turn @ transforms.translation(-middle) @ own)
