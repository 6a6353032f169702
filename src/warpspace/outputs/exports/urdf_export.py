"""A machine as URDF: its links, joints, limits and the meshes of its bodies."""

import re
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from warpspace.bodies.placed import load_bodies
from warpspace.kinematics.transforms import placed
from warpspace.machine.axes import direction_index
from warpspace.machine.definition import Axis, Machine
from warpspace.outputs.file_output import mesh_files, write_with_meshes
from warpspace.picture.model import ScenePicture
from warpspace.scene.urdf import not_installed
from warpspace.units import Array

try:
    from yourdfpy import URDF, urdf
except ImportError:
    raise not_installed() from None

ROOT, LINKS = "frame", {"S": "spindle", "t": "tool", "w": "workpiece"}
MM_PER_M = 1000.0
EFFORT, VELOCITY = 1000.0, 1.0  # of every joint: required by URDF, not part of a machine


def write_urdf(picture: ScenePicture, path: str | Path, *, overwrite: bool = True) -> None:
    """Write the nominal machine of a scene, with one mesh file for each frame with bodies."""
    target, machine = Path(path), picture.scene.machine
    parts: dict[str, list[Any]] = {}
    for body in load_bodies(machine):
        mesh = trimesh.Trimesh(body.vertices_mm, body.triangles, process=False)
        parts.setdefault(body.frame, []).append(mesh)
    meshes = {frame: trimesh.util.concatenate(bodies) for frame, bodies in parts.items()}
    read = [Path(source.path) for source in machine.bodies.values() if source.path]
    files = mesh_files(target, meshes, overwrite=overwrite, inputs=read)
    robot = build_robot(machine, {frame: file.name for frame, file in files.items()})
    model = URDF(robot, build_scene_graph=False, filename_handler=lambda name: name)
    text = BytesIO()
    model.write_xml_file(text)
    write_with_meshes(target, text.getvalue(), files, meshes, overwrite=overwrite)


def build_robot(machine: Machine, meshes: dict[str, str]) -> Any:
    links = [_link(ROOT, "R", meshes)]
    joints: list[Any] = []
    for side in ("tool", "workpiece"):
        parent = ROOT
        for axis in machine.branch(side):
            child = f"link_{axis.name}"
            links.append(_link(child, axis.name, meshes))
            joints.append(_moving(axis, parent, child))
            parent = child
        for frame, offset, turn in machine.end_frames(side):
            child = LINKS[frame]
            links.append(_link(child, frame, meshes))
            origin = _in_metres(placed(offset, turn))
            joints.append(urdf.Joint(f"{child}_fixed", "fixed", parent, child, origin))
            parent = child
    name = re.sub(r"[^\w.-]+", "_", machine.name) or "machine"
    return urdf.Robot(name, links=links, joints=joints)


def _link(name: str, frame: str, meshes: dict[str, str]) -> Any:
    visuals: list[Any] = []
    if frame in meshes:
        scale = np.full(3, 1.0 / MM_PER_M)
        geometry = urdf.Geometry(mesh=urdf.Mesh(meshes[frame], scale))
        visuals.append(urdf.Visual(name, np.eye(4), geometry))
    return urdf.Link(name, visuals=visuals)


def _moving(axis: Axis, parent: str, child: str) -> Any:
    direction = np.zeros(3)
    direction[direction_index(axis.name)] = float(axis.direction)
    low, high = axis.travel if axis.is_linear else np.deg2rad(axis.travel).tolist()
    if axis.is_linear:
        low, high = low / MM_PER_M, high / MM_PER_M
    return urdf.Joint(
        axis.name,
        "prismatic" if axis.is_linear else "revolute",
        parent,
        child,
        _in_metres(placed(axis.offset_mm, axis.rotation_deg)),
        direction,
        limit=urdf.Limit(EFFORT, VELOCITY, float(low), float(high)),
    )


def _in_metres(pose: Array) -> Array:
    scaled = np.array(pose, dtype=float)
    scaled[:3, 3] /= MM_PER_M
    return scaled
