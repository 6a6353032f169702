"""What a frame of a machine looks like where a description says so: a mesh of a user, or a tool."""

from dataclasses import dataclass

Vector = tuple[float, float, float]
BODY_FRAMES = ("R", "S", "t", "w")
"""Frames beside the axes that a body can ride on."""
MESH_ENDINGS = (".stl", ".obj", ".ply", ".glb")
MESH_UNITS = ("mm", "cm", "m", "in")
TOOL_SHAPES = ("cutter", "probe", "nozzle", "wheel", "gripper")
"""What a tool can be drawn as."""


@dataclass(frozen=True, slots=True)
class BodySource:
    """Where the body of a frame comes from.

    Attributes
    ----------
    file : str
        Mesh, as its name stands in the file of the scene or machine; empty for a shape.
    path : str
        Where that file is; empty where the description has no folder (an upload).
    unit : str
        Unit of its numbers; empty for the one of its format.
    offset_mm : tuple of float, (3,), mm
        Origin of the mesh in its frame.
    rotation_deg : tuple of float, (3,), degrees
        Its rotation there, about the fixed x, y and z axes in that order.
    shape : str
        Of the tool, one of `TOOL_SHAPES`; empty for a mesh.
    """

    file: str = ""
    path: str = ""
    unit: str = ""
    offset_mm: Vector = (0.0, 0.0, 0.0)
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    shape: str = ""
