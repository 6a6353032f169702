"""Bodies of a machine, placed and displaced by its errors."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from warpspace.bodies.frame import generate_bodies
from warpspace.bodies.mesh import Body
from warpspace.bodies.mesh_files import check_meshes, machine_meshes
from warpspace.bodies.schematic import BODY_FILE, build_layout, read_bodies
from warpspace.bodies.shading import ShadedSurface, shade_bodies
from warpspace.field.evaluate import View, find_placement, placement_effect
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import BASE, BodyMotion, body_motions, branch_pose
from warpspace.kinematics.model import Coordinates, Loop, Model, complete_coordinates
from warpspace.machine.axes import parameter
from warpspace.machine.definition import Machine
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, RAD_PER_URAD, Array

OUTSIDE_MM = 1.0  # distance of an adjuster from the box around its body that is accepted


def load_bodies(machine: Machine) -> tuple[Body, ...]:
    frames = {BASE, "S", "t", "w", *machine.axes}
    schematic = read_bodies(Path(machine.body_dir) / BODY_FILE) if machine.body_dir else ()
    meshes = machine_meshes(machine)
    bodies = [body for body in schematic or generate_bodies(machine) if body.frame not in meshes]
    return tuple(body for body in (*bodies, *meshes.values()) if body.frame in frames)


def check_bodies(model: Model) -> tuple[str, ...]:
    """List problems of the meshes of a machine, and of the adjusters between them."""
    return (*check_meshes(model.machine), *check_adjusters(model))


def check_adjusters(model: Model) -> tuple[str, ...]:
    """List adjusters outside the box around the meshes that they lie between; axes at 0."""
    machine = model.machine
    motions = body_motions(
        model, {}, complete_coordinates(machine, dict.fromkeys(machine.axes, 0.0))
    )
    has_file = machine.body_dir and (Path(machine.body_dir) / BODY_FILE).is_file()
    bodies = load_bodies(machine) if has_file else machine_meshes(machine).values()
    problems: list[str] = []
    for adjuster in machine.adjusters:
        frames = {BASE}
        for branch in (machine.chain.tool, machine.chain.workpiece):
            if adjuster.body in branch:
                frames = {(BASE, *branch)[branch.index(adjuster.body)], adjuster.body}
        parts = [
            place_points(motions[body.frame], body.vertices_mm, 0.0)
            for body in bodies
            if body.frame in frames
        ]
        if adjuster.at_mm is None or not parts:
            continue
        points, at = np.concatenate(parts), np.array(adjuster.at_mm)
        low, high = points.min(axis=0), points.max(axis=0)
        if np.any(at < low - OUTSIDE_MM) or np.any(at > high + OUTSIDE_MM):
            box = " ".join(f"{a:g}…{b:g}" for a, b in zip(low.round(1), high.round(1), strict=True))
            problems.append(
                f"adjuster {adjuster.name}: at_mm = {list(adjuster.at_mm)} is outside its body;"
                f" expected within x y z {box} mm"
            )
    return tuple(problems)


def turning_frames(machine: Machine) -> tuple[str, ...]:
    """List the rotary axes next to the workpiece, or to the tool, and the frame behind them."""
    for side, end in (("workpiece", "w"), ("tool", "t")):
        rotary = [axis.name for axis in machine.branch(side) if not axis.is_linear]
        if rotary:
            return (*rotary, end)
    return ()


def _error_values(
    errors: ErrorSet, amplitudes: Mapping[str, float], coordinates: Coordinates, direction: str
) -> dict[str, float]:
    return {
        key: amplitude * float(errors.shape_at(key, coordinates, direction))
        for key, amplitude in amplitudes.items()
        if parameter(key).axis in coordinates and amplitude != 0.0
    }


def scene_motions(
    scene: Scene,
    view: View,
    amplitudes: Mapping[str, float] | None = None,
    positions: Mapping[str, float] | None = None,
) -> dict[str, BodyMotion]:
    """Compute the motions of bodies in a view, consistent with its deformed grid."""
    model, errors = scene.model, scene.errors
    if amplitudes is None:
        amplitudes = {key: errors.amplitude(key) for key in errors}
    stands = {**scene.workspace.positions, **(positions or {})}
    positions = {name: stands.get(name, 0.0) for name in scene.machine.axes}
    coordinates = complete_coordinates(model.machine, positions)
    values = _error_values(errors, amplitudes, coordinates, model.direction)
    motions = body_motions(model, values, coordinates)
    turn, shift = np.zeros(3), np.zeros(3)
    if view.loop is Loop.RELATIVE:
        turn, shift = motions["w"].rotation_rad, motions["w"].displacement_mm
    if view.placed_over is not None:
        for key, amplitude in amplitudes.items():
            errors = errors.with_amplitude(key, amplitude, (0.0, 1.0))
        placement = find_placement(model, errors, view)
        if placement is not None:
            pose = branch_pose(model, "workpiece", coordinates)
            at_zero = placement_effect(model, placement, coordinates, np.zeros(3))[0]
            turn = turn + pose[:3, :3] @ placement[3:] * RAD_PER_URAD
            shift = shift + at_zero * MM_PER_UM
    if view.reference is not None:
        reference = complete_coordinates(model.machine, {**positions, **view.reference})
        values = _error_values(errors, amplitudes, reference, model.direction)
        reference_motions = body_motions(model, values, reference)
        shift = shift + _held_displacement(model, reference_motions, view.loop)
    return {
        name: BodyMotion(m.nominal, m.rotation_rad - turn, m.displacement_mm - shift)
        for name, m in motions.items()
    }


def _held_displacement(model: Model, motions: Mapping[str, BodyMotion], loop: Loop) -> Array:
    point = transforms.apply(motions["t"].nominal, model.tool_point_mm)

    def moved(frame: str) -> Array:
        motion = motions[frame]
        return motion.displacement_mm + np.cross(motion.rotation_rad, point)

    if loop is Loop.WORKPIECE:
        return moved("w")
    return moved("t") - (moved("w") if loop is Loop.RELATIVE else 0.0)


def place_points(motion: BodyMotion, points_mm: Array, exaggeration: float) -> Array:
    """Return the drawn places of points of a body in R."""
    pose = motion.drawn(exaggeration)
    return points_mm @ pose[:3, :3].T + pose[:3, 3]


@dataclass(frozen=True)
class PlacedBody:
    """One body of a machine."""

    body: Body  # mesh in its frame
    motion: BodyMotion  # nominal place of that frame, and its small motion
    exaggeration: float  # display factor of the small motion
    surface: ShadedSurface

    @property
    def label(self) -> str:
        frame, _, what = self.body.name.partition("_")
        name = what if frame in ("R", "S", "t") else f"{frame} {what}"
        return name.replace("_", " ")

    @property
    def pose(self) -> Array:
        """Drawn map from its frame to R, [4, 4]."""
        return self.motion.drawn(self.exaggeration)

    @cached_property
    def vertices_mm(self) -> Array:
        """Drawn vertices, [V, 3], mm in R."""
        return place_points(self.motion, self.body.vertices_mm, self.exaggeration)

    @cached_property
    def nominal_mm(self) -> Array:
        """Nominal vertices, [V, 3], mm in R."""
        return place_points(self.motion, self.body.vertices_mm, 0.0)

    @cached_property
    def edges_mm(self) -> Array:
        """Drawn edges, [E, 2, 3], mm in R."""
        return place_points(self.motion, self.body.edges_mm, self.exaggeration)


def place_bodies(
    scene: Scene,
    view: View,
    exaggeration: float,
    only: Collection[str] | None = None,
    *,
    amplitudes: Mapping[str, float] | None = None,
    positions: Mapping[str, float] | None = None,
) -> tuple[PlacedBody, ...]:
    """Place the bodies of a scene, or of some of its frames, displaced by its errors or others."""
    motions = scene_motions(scene, view, amplitudes, positions)
    bodies, at_home = load_bodies(scene.machine), build_layout(scene.machine).poses
    surfaces = shade_bodies(bodies, tuple(at_home[body.frame].tobytes() for body in bodies))
    return tuple(
        PlacedBody(body, motions[body.frame], exaggeration, surface)
        for body, surface in zip(bodies, surfaces, strict=True)
        if only is None or body.frame in only
    )
