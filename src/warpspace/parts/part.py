"""A part as this machine cuts it: how far it deviates, its features, and its mesh as a file.

Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from pathlib import Path

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import ProgressCallback, Result
from warpspace.analysis.options import File, option
from warpspace.analysis.statistics import Numbers, Statistics, statistics
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, plus_minus, u95_lines
from warpspace.bodies.gltf import to_gltf
from warpspace.bodies.own_meshes import FORMATS, MM_PER_M, UNITS_MM
from warpspace.field.evaluate import ErrorField
from warpspace.kinematics import transforms
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES, MAX_SCENE_BYTES
from warpspace.parts.inspection import FeatureResult, features_table, inspect
from warpspace.parts.workpiece import (
    Made,
    OfPart,
    PartMesh,
    fit_out,
    made_doubt,
    make_points,
    place_part,
)
from warpspace.scene.model import Scene, second_order
from warpspace.scene.text_files import read_text
from warpspace.units import MM_PER_UM, Array

LOOKED_AT, SEEN_UM = 500, 0.5  # longest edges; errors amid them that are said
TRIANGLES_AT_ONCE = 200_000  # what lies between needs memory, too


@dataclass(frozen=True, kw_only=True)
class Off:
    """How far the vertices of a part are from where they should be."""

    deviation: Statistics
    normal: Numbers  # min_um and max_um along normals of triangles, at their corners, and U95


@dataclass(frozen=True, kw_only=True)
class Part(OfPart):
    """Show a part, a mesh, as the machine of SCENE cuts it.

    The part stands where it is clamped; rotary axes stand as they do in the scene, linear axes
    bring the tool to each vertex. Errors are those of the tool against the workpiece, in the
    workpiece frame, actual − nominal: as they are, and placed, after the best rigid fit of all
    vertices, as an inspector makes it. Planes, cylinders, cones and spheres are found and measured.
    Geometry only: no forces, heat, wear or servo.
    """

    name = "part"
    task = "measure"
    has_table = True
    file_help = "Part as cut: .stl, .obj, .ply or .glb."
    file_endings = tuple(FORMATS)
    features: File = option(
        None, "Names and tolerances of its features, .toml", unset="all that are found"
    )
    predistorted: bool = option(
        False, "Write with -o the part to be asked for, so that the nominal one is cut"
    )
    tolerances: tuple[str, str] | None = None  # name and text of features that are read already

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "PartResult":
        mesh = self.find_mesh(scene)
        is_own = not (self.mesh or self.file)
        features = self.features or (scene.part.path("features") if is_own else None)
        tolerances = self.tolerances
        if features and not tolerances:
            tolerances = features, read_text(Path(features), MAX_SCENE_BYTES)
        watch(0.2)
        part = place_part(mesh, scene, self.place)
        made = make_points(scene, part.vertices_mm)
        watch(0.5)
        is_large = len(mesh.triangles) > MAX_FEATURE_TRIANGLES
        between = 0.0 if is_large else _between(scene, part, made)
        unseen = between if between > SEEN_UM else 0.0
        fit = partial(fit_out, made.point_mm)
        sure = None if is_large else made_doubt(scene, made)
        both = (made.error_um, sure), (fit(made.error_um), sure and sure.transform(fit))
        cut, placed = _off(part, made, *both)
        return PartResult(
            vertices=len(mesh.vertices_mm),
            outside=int(made.outside.sum()),
            **vars(cut),
            placed=placed,
            features=() if is_large else inspect(scene, mesh, made, tolerances, sure, unseen),
            uncertainty=sure and sure.errors,
            unseen_um=unseen,
            part=part,
            made=made,
            scene=scene,
            asked=self,
            second_order=second_order(scene, Loop.RELATIVE),
        )


def _between(scene: Scene, part: PartMesh, made: Made) -> float:
    """Give how far the errors amid the longest edges are from those of their ends, at most, µm."""
    corner = np.take(part.vertices_mm, part.triangles, axis=0)
    length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).reshape(-1)
    longest = np.argsort(-length)[:LOOKED_AT]
    ends = np.stack([part.triangles, np.roll(part.triangles, -1, axis=1)], -1).reshape(-1, 2)[
        longest
    ]
    amid = make_points(scene, part.vertices_mm[ends].mean(axis=1)).error_um
    off = amid - made.error_um[ends].mean(axis=1)
    return float(np.linalg.norm(off, axis=1).max())


def _off(
    part: PartMesh, made: Made, *found: tuple[Array, FieldUncertainty | None]
) -> Iterator[Off]:
    from trimesh import triangles

    # lowest and highest so far: how far, at which vertex, along which normal
    spans = [[(end, 0, np.zeros(3)) for end in (np.inf, -np.inf)] for _ in found]
    for first in range(0, len(part.triangles), TRIANGLES_AT_ONCE):
        some = part.triangles[first : first + TRIANGLES_AT_ONCE]
        normals, is_valid = triangles.normals(np.take(part.vertices_mm, some, axis=0))
        corners = some[is_valid]
        for span, (error, _) in zip(spans, found, strict=True):
            away = np.einsum("tcx,tx->tc", np.take(error, corners, axis=0), normals)
            for index, (choose, better) in enumerate(((np.argmin, min), (np.argmax, max))):
                if away.size:
                    at = int(choose(away))
                    new = away.item(at), corners.item(at), normals[at // 3]
                    span[index] = better(span[index], new, key=itemgetter(0))
    for span, (error, sure) in zip(spans, found, strict=True):
        field = ErrorField(made.point_mm, error, np.broadcast_to(np.nan, error.shape))
        deviation = statistics(field, made.coordinates)
        normal: dict[str, float | None] = {}
        for name, (value, vertex, way) in zip(("min_um", "max_um"), span, strict=True):
            normal[name] = value
            if sure is not None:
                normal[f"u95_{name}"] = sure.u95_along(vertex, way)
        yield Off(
            deviation=sure.with_expanded_uncertainty(deviation) if sure else deviation,
            normal=normal,
        )


@dataclass(frozen=True, kw_only=True)
class PartResult(Off, Result):
    """A part as it is cut."""

    json_keys = ("vertices", "outside", "deviation", "normal", "placed", "features")
    vertices: int
    outside: int  # vertices beyond the travel
    placed: Off
    features: Sequence[FeatureResult]
    part: PartMesh  # nominal, in the workpiece frame
    made: Made  # its vertices
    scene: Scene
    asked: Part
    unseen_um: float  # how far errors between vertices are off, at most; 0 where that is little

    def caveats(self) -> Iterator[str]:
        yield from self.part.warnings
        if self.outside:
            far = f"{self.outside:,} of {self.vertices:,} vertices"
            yield f"{far} are beyond the travel; their errors are continued"
        if self.unseen_um:
            off = f"errors are off by up to {self.unseen_um:.1f} µm more"
            yield f"between its vertices {off}: expected a finer mesh"
        if (count := len(self.part.triangles)) > MAX_FEATURE_TRIANGLES:
            most = f"up to {MAX_FEATURE_TRIANGLES:,}"
            yield f"{count:,} triangles: features, U95 and errors amid edges: in {most}"

    def blocks(self) -> Iterator[Block]:
        x, y, z = self.deviation.max_at_mm
        at = ", ".join(f"{value:.6g}" for value in self.part.place)
        yield f"{self.scene.title} · {self.part.name}, {self.vertices:,} vertices"
        yield f"  clamped at {at} mm and degrees"
        yield f"  largest |E| {self.deviation.max_um:.2f} µm at x {x:.3f}, y {y:.3f}, z {z:.3f} mm"
        yield "  Geometry only: no forces, heat, wear or servo"
        both = ("as cut", self), ("placed", self.placed)
        ends = "min_um", "max_um"
        rows = [
            (word, *one.deviation.four, *(one.normal[end] for end in ends)) for word, one in both
        ]
        heads = ("mean", "RMS", "P95", "max", "normal, min", "max")
        yield Table((Column("error", leads=True), *number_columns(heads, ".2f", "µm")), rows)
        yield from u95_lines(self.uncertainty, {word: one.deviation for word, one in both})
        for word, one in both if self.uncertainty else ():
            low, high = (plus_minus(one.normal[f"u95_{end}"]) for end in ends)
            yield f"  U95 along the normal, {word}: min {low}, max {high} µm"
        yield features_table(self.features)

    def output_files(self, ending: str = ".stl", /) -> Mapping[str, bytes | str]:
        """Spell the part in its own frame and unit: as it is cut, or so that it is cut nominal."""
        nominal, moved = self.made.point_mm, self.made.error_um * MM_PER_UM
        for _ in range(2 * self.asked.predistorted):
            moved = -make_points(self.scene, nominal + moved).error_um * MM_PER_UM
        place, (unit, up) = self.part.place, FORMATS[ending]
        own = transforms.inverse(transforms.placed(place[:3], place[3:]))
        point = transforms.apply(own, nominal + moved)
        if up == "y":
            point = to_gltf(point) * MM_PER_M
        cut = replace(self.part, vertices_mm=point / UNITS_MM[self.part.unit or unit])
        return {"": cut.surface.export(file_type=ending[1:])}
