"""Pieces to start with: a mesh, its features with tolerances, and a program that finishes it.

The frame of a piece has its zero in the middle of its lower side; the words of its program are
places in this frame, unless its zero is put elsewhere. The tool has no radius there.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpspace.units import Array

ON_RING = 144  # points: a multiple of 8, so that the corners of squares are among them
HALF_APEX_DEG = 15.0  # of the cone
ABOVE_MM = 10.0  # over the piece, where the tool moves across
PIECES = {
    "contour": ("contour piece: circle on diamond on square, after ISO 10791-7", 160.0),
    "cone": ("cone frustum, after NAS 979", 100.0),
    "plate": ("plate of nine holes", 240.0),
    "cube": ("cube", 100.0),
}
"""What they are called, and their sizes where none is given, mm."""


Vector = tuple[float, float, float]
Feature = tuple[str, str, Vector, str, float, str]
"""Name, kind, a point in mm, measure, tolerance in µm, µrad of angles, and a datum or nothing."""


@dataclass(frozen=True)
class Outline:
    """A level line of a piece."""

    name: str
    half_mm: float  # radius, or from the middle to a side
    level_mm: float
    kind: str = "square"  # or circle, or diamond
    middle_mm: tuple[float, float] = (0.0, 0.0)

    @property
    def ring_mm(self) -> Array:
        """Points around it, counter-clockwise from above, [ON_RING, 3]."""
        angle = np.arange(ON_RING) * (2.0 * np.pi / ON_RING)
        x, y = np.cos(angle), np.sin(angle)
        reach = {
            "circle": np.ones(ON_RING),
            "square": 1.0 / np.maximum(np.abs(x), np.abs(y)),
            "diamond": np.sqrt(2.0) / (np.abs(x) + np.abs(y)),
        }[self.kind]
        ring = self.half_mm * reach * np.stack([x, y, np.zeros(ON_RING)])
        return np.round(ring.T + np.array([*self.middle_mm, self.level_mm]), 9) + 0.0

    def moves(self, zero_mm: Vector) -> Iterator[str]:
        """Write the blocks that cut along it, where the zero of the piece is at some words."""
        ring, quarter = self.ring_mm + zero_mm, ON_RING // 4
        corners = ring[quarter // 2 if self.kind == "square" else 0 :: quarter]
        words = [f"X{x:.4f} Y{y:.4f}" for x, y, _ in [*corners, corners[0]]]
        yield from (f"({self.name})", f"G0 {words[0]}", f"G1 Z{ring[0, 2]:.4f} F600")
        if self.kind == "circle":
            yield f"G3 {words[0]} I{-self.half_mm:.4f} J0"
        else:
            yield from (f"G1 {word}" for word in words[1:])


@dataclass(frozen=True)
class Piece:
    """A piece in its own frame."""

    words: str
    walls_mm: Array  # [m, 4, 3], quadrangles, counter-clockwise from outside
    contours: list[Outline]
    features: list[Feature]

    def texts(self, zero_mm: Vector = (0.0, 0.0, 0.0)) -> Mapping[str, str]:
        """Give its files by their endings; in the program its zero is at some words."""
        triangles = self.walls_mm[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
        is_flat = (triangles == np.roll(triangles, 1, axis=1)).all(axis=2).any(axis=1)
        facets = (
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in corners)
            + "endloop\nendfacet\n"
            for corners in triangles[~is_flat].tolist()
        )
        above = f"G0 Z{self.walls_mm[..., 2].max() + ABOVE_MM + zero_mm[2]:.4f}"
        blocks = [line for one in self.contours for line in (*one.moves(zero_mm), above)]
        head = ["%", f"({self.words}; tool radius 0)", "G21 G17 G90 G40 G94 G54", above]
        return {
            ".stl": f"solid {self.words}\n{''.join(facets)}endsolid\n",
            ".ngc": "\n".join([*head, *blocks, "M30", "%", ""]),
            ".toml": "\n".join(map(_entry, self.features)),
        }


def _entry(one: Feature) -> str:
    name, kind, near, measure, tolerance, datum = one
    unit = "urad" if measure == "squareness" else "um"
    to = f'to = ["{datum}"]\n' if datum else ""
    return (
        f'[[features]]\nname = "{name}"\nis = "{kind}"\nnear = {[*map(float, near)]}\n'
        f'measure = "{measure}"\n{to}tolerance_{unit} = {tolerance:g}\n'
    )


def build_piece(name: str, size_mm: float | None = None) -> Piece:
    """Build a piece of a length, or a diameter, across."""
    words, standard = PIECES[name]
    size = size_mm or standard
    words, half = f"{words}, {size:g} mm", size / 2.0
    build = {"contour": _contour, "cone": _cone, "plate": _plate, "cube": _cube}[name]
    return Piece(words, *build(half))


_Found = tuple[Array, list[Outline], list[Feature]]


def _cube(half: float) -> _Found:
    low, high = (Outline("square", half, level) for level in (0.0, 2.0 * half))
    walls = _walls(Outline("", 0.0, 0.0), low, high, Outline("", 0.0, 2.0 * half))
    return walls, [low], [
        ("top", "plane", (0.0, 0.0, 2.0 * half), "flatness", 10.0, ""),
        ("side", "plane", (half, 0.0, half), "squareness", 100.0, "top"),
        ("back", "plane", (0.0, half, half), "squareness", 100.0, "side"),
    ]  # fmt: skip


def _cone(half: float) -> _Found:
    slope = np.tan(np.deg2rad(HALF_APEX_DEG))
    low, *cuts, high = (
        Outline(f"circle at {level:g} mm", half - slope * level, level, "circle")
        for level in half * np.linspace(0.0, 1.0, 5)
    )
    walls = _walls(Outline("", 0.0, 0.0), low, high, Outline("", 0.0, half))
    near = (cuts[1].half_mm, 0.0, cuts[1].level_mm)
    return walls, cuts[::-1], [("cone", "cone", near, "conicity", 20.0, "")]


def _contour(half: float) -> _Found:
    base, middle, top = 0.5 * half, 0.625 * half, 0.75 * half
    square, diamond = Outline("square", half, 0.0), Outline("diamond", 0.7 * half, base, "diamond")
    circle = Outline("circle", 0.65 * half, middle, "circle")
    bore = Outline("bore", 0.2 * half, 0.0, "circle")
    walls = _walls(
        square, Outline("", half, base), diamond, Outline("", 0.7 * half, middle, "diamond"),
        circle, Outline("", 0.65 * half, top, "circle"), Outline("", 0.2 * half, top, "circle"),
        bore, square,
    )  # fmt: skip
    return walls, [bore, circle, diamond, square], [
        ("circle", "cylinder", (0.0, 0.0, (middle + top) / 2.0), "cylindricity", 15.0, ""),
        ("bore", "cylinder", (0.0, 0.0, top / 2.0), "diameter", 20.0, ""),
        ("side", "plane", (half, 0.0, base / 2.0), "flatness", 10.0, ""),
        ("back", "plane", (0.0, half, base / 2.0), "squareness", 100.0, "side"),
    ]  # fmt: skip


def _plate(half: float) -> _Found:
    pitch, high = 2.0 * half / 3.0, half / 6.0
    walls: list[Array] = []
    holes: list[Outline] = []
    for at in range(9):
        middle = pitch * (at % 3 - 1.0), pitch * (at // 3 - 1.0)
        top, low = (Outline("", pitch / 2.0, level, middle_mm=middle) for level in (high, 0.0))
        upper, hole = (
            Outline(f"hole {at + 1}", half / 10.0, level, "circle", middle) for level in (high, 0.0)
        )
        sides = _walls(low, top)
        is_outside = (np.abs(sides[..., :2]) > half - 1e-6).all(axis=1).any(axis=-1)
        walls += [_walls(top, upper, hole, low), sides[is_outside]]
        holes.append(hole)
    return np.concatenate(walls), holes, [
        (hole.name, "cylinder", (*hole.middle_mm, high / 2.0), "position", 20.0, "")
        for hole in holes
    ]  # fmt: skip


def _walls(*lines: Outline) -> Array:
    """Give the walls from each line to the next, [m, 4, 3]; they face out where they go up."""
    return np.concatenate([
        np.stack([one, np.roll(one, -1, axis=0), np.roll(other, -1, axis=0), other], axis=1)
        for one, other in pairwise(line.ring_mm for line in lines)
    ])  # fmt: skip
