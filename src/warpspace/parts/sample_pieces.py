"""Test pieces: a mesh, its features with tolerances, and a finishing program.

The origin of the frame of a piece is in the middle of its lower side; its program is written in
this frame, for a tool radius of zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from warpspace.scene.scene_writer import spell_section
from warpspace.units import Array

ON_RING = 144  # points: a multiple of 8, so that the corners of squares are among them
HALF_APEX_DEG = 15.0  # of the cone
ABOVE_MM = 10.0  # over the piece, where the tool moves across
SQUARE, CIRCLE, DIAMOND = np.inf, 2, 1  # orders of the norms that are constant on an outline


@dataclass(frozen=True)
class Outline:
    """A level outline of a piece; one with a name is cut."""

    half_mm: float  # from its middle along x: of a diamond to a corner
    level_mm: float
    shape: float = SQUARE
    name: str = ""
    middle_mm: tuple[float, float] = (0.0, 0.0)

    @property
    def ring_mm(self) -> Array:
        """Points around it, counter-clockwise from above, [ON_RING, 3]."""
        angle = np.arange(ON_RING) * (2.0 * np.pi / ON_RING)
        ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        ring *= self.half_mm / np.linalg.norm(ring, self.shape, axis=1, keepdims=True)
        ring += [*self.middle_mm, self.level_mm]
        return np.round(ring, 9) + 0.0

    def blocks(self) -> list[str]:
        """Write the blocks that cut along the outline."""
        first = ON_RING // 8 if self.shape == SQUARE else 0
        start, *corners = (f"X{x:.4f} Y{y:.4f}" for x, y, _ in self.ring_mm[first :: ON_RING // 4])
        cuts = [f"G1 {word}" for word in (*corners, start)]
        if self.shape == CIRCLE:
            cuts = [f"G3 {start} I{-self.half_mm:.4f} J0"]
        return [f"({self.name})", f"G0 {start}", f"G1 Z{self.level_mm:.4f} F600", *cuts]


PieceGeometry: TypeAlias = tuple[list[list[Outline]], list[dict[str, Any]]]
"""Solids, each by the outlines of its surface in turn, and features."""


def build_piece(name: str, size_mm: float | None = None) -> Mapping[str, Any]:
    """Build the files of a piece by their endings; its size is an edge length or a diameter, mm."""
    from trimesh import Trimesh

    title, standard, build = PIECES[name]
    size = size_mm or standard
    solids, features = build(size / 2.0)
    walls = np.concatenate([
        np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1)
        for solid in solids
        for low, high in pairwise(line.ring_mm for line in solid)
    ])  # fmt: skip
    _, which, times = np.unique(
        walls.mean(axis=1).round(6), axis=0, return_inverse=True, return_counts=True
    )
    walls = walls[times[which.reshape(-1)] == 1]  # solids that touch there are one
    mesh = Trimesh(walls.reshape(-1, 3), np.arange(4 * len(walls)).reshape(-1, 4))
    mesh.update_faces(mesh.nondegenerate_faces())
    above = f"G0 Z{walls[..., 2].max() + ABOVE_MM:.4f}"
    cut = [line.blocks() for solid in solids for line in reversed(solid) if line.name]
    blocks = [line for lines in cut for line in (*lines, above)]
    head = ["%", f"({title}, {size:g} mm; tool radius 0)", "G21 G17 G90 G40 G94 G54", above]
    return {
        ".stl": mesh.export(file_type="stl_ascii"),
        ".ngc": "\n".join([*head, *blocks, "M30", "%", ""]),
        ".toml": "\n".join(spell_section("[features]", feature) for feature in features),
    }


def _feature(name: str, kind: str, near: list[float], measure: str, **kw: Any) -> dict[str, Any]:
    return {"name": name, "is": kind, "near": near, "measure": measure, **kw}


def _cube(half: float) -> PieceGeometry:
    high = 2.0 * half
    low = Outline(half, 0.0, name="square")
    return [[Outline(0.0, 0.0), low, Outline(half, high), Outline(0.0, high)]], [
        _feature("top", "plane", [0.0, 0.0, high], "flatness", tolerance_um=10),
        _feature("side", "plane", [half, 0.0, half], "squareness", tolerance_urad=100, to=["top"]),
        _feature("back", "plane", [0.0, half, half], "squareness", tolerance_urad=100, to=["side"]),
    ]


def _cone(half: float) -> PieceGeometry:
    slope = np.tan(np.deg2rad(HALF_APEX_DEG))
    rings = [
        Outline(half - slope * level, level, CIRCLE, f"circle at {level:g} mm")
        for level in (half * np.linspace(0.0, 1.0, 5)).tolist()
    ]
    near = [rings[2].half_mm, 0.0, rings[2].level_mm]
    return [[Outline(0.0, 0.0), *rings, Outline(0.0, half)]], [
        _feature("cone", "cone", near, "conicity", tolerance_um=20)
    ]


def _contour(half: float) -> PieceGeometry:
    base, middle, top, reach = 0.5 * half, 0.625 * half, 0.75 * half, 0.7 * half * np.sqrt(2.0)
    square = Outline(half, 0.0, name="square")
    solid = [
        square, Outline(half, base),
        Outline(reach, base, DIAMOND, "diamond"), Outline(reach, middle, DIAMOND),
        Outline(0.65 * half, middle, CIRCLE, "circle"), Outline(0.65 * half, top, CIRCLE),
        Outline(0.2 * half, top, CIRCLE), Outline(0.2 * half, 0.0, CIRCLE, "bore"),
        replace(square, name=""),
    ]  # fmt: skip
    turned, side, rear = (middle + top) / 2.0, [half, 0.0, base / 2.0], [0.0, half, base / 2.0]
    return [solid], [
        _feature("circle", "cylinder", [0.0, 0.0, turned], "cylindricity", tolerance_um=15),
        _feature("bore", "cylinder", [0.0, 0.0, top / 2.0], "diameter", tolerance_um=20),
        _feature("side", "plane", side, "flatness", tolerance_um=10),
        _feature("back", "plane", rear, "squareness", tolerance_urad=100, to=["side"]),
    ]


def _plate(half: float) -> PieceGeometry:
    pitch, high = 2.0 * half / 3.0, half / 6.0
    solids, features = list[list[Outline]](), list[dict[str, Any]]()
    for at in range(9):
        middle = pitch * (at % 3 - 1.0), pitch * (at // 3 - 1.0)
        low, top = (Outline(pitch / 2.0, z, middle_mm=middle) for z in (0.0, high))
        upper = Outline(half / 10.0, high, CIRCLE, middle_mm=middle)
        hole = replace(upper, level_mm=0.0, name=f"hole {at + 1}")
        solids.append([low, top, upper, hole, low])
        near = [*middle, high / 2.0]
        features.append(_feature(hole.name, "cylinder", near, "position", tolerance_um=20))
    return solids, features


PIECES = {
    "contour": ("contour piece: circle on diamond on square, after ISO 10791-7", 160.0, _contour),
    "cone": ("cone frustum, after NAS 979", 100.0, _cone),
    "plate": ("plate of nine holes", 240.0, _plate),
    "cube": ("cube", 100.0, _cube),
}
"""Titles, standard sizes, mm, and builders of the pieces."""
