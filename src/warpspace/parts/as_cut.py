"""A part as this machine cuts it: how far it deviates, its features, and its mesh as a file.

Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, Result, Watch
from warpspace.analysis.options import File, option
from warpspace.bodies.gltf import to_gltf
from warpspace.bodies.own_meshes import FORMATS, MM_PER_M, UNITS_MM
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES, MAX_SCENE_BYTES
from warpspace.parts.inspection import FeatureResult, features_table, inspect
from warpspace.parts.part import (
    PLACE_HELP,
    PLACE_UNSET,
    Deviation,
    Made,
    PartMesh,
    Place,
    deviation_of,
    find_place,
    fit_out,
    load_part,
    make_points,
    place_part,
)
from warpspace.scene.files import read_text
from warpspace.scene.model import Scene, second_order
from warpspace.units import MM_PER_UM, Array


@dataclass(frozen=True)
class Off:
    """How far the vertices of a part are from where they should be."""

    deviation: Deviation
    normal: Mapping[str, float]  # min_um and max_um along normals of triangles, at their corners


@dataclass(frozen=True, kw_only=True)
class Part(Analysis):
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
    file: File = option(
        None, "Mesh, .stl, .obj, .ply or .glb", positional=True, unset="that of the scene"
    )
    place: Place = option(None, PLACE_HELP, unset=PLACE_UNSET)
    unit: Literal["mm", "cm", "m", "in"] | None = option(
        None, "Unit of its numbers", unset="mm, of .glb m"
    )
    features: File = option(
        None, "Names and tolerances of its features, .toml", unset="all that are found"
    )
    mesh: PartMesh | None = None  # one that is read already
    tolerances: tuple[str, str] | None = None  # name and text of features that are read already

    def run(self, scene: Scene, watch: Watch, /) -> "PartResult":
        own = scene.part
        if self.mesh is None and self.file is None:
            if (path := own.path("file")) is None:
                raise OptionError(
                    "{file} is missing; expected a mesh, or a scene whose [part] has one"
                )
            beside = self.features or own.path("features")
            unit: Any = self.unit or own.unit or None
            return replace(self, file=path, features=beside, unit=unit).run(scene, watch)
        mesh = self.mesh or load_part(str(self.file), self.unit)
        tolerances = self.tolerances
        if self.features and not tolerances:
            tolerances = self.features, read_text(Path(self.features), MAX_SCENE_BYTES)
        watch(0.2)
        place = find_place(mesh, scene, self.place)
        part = place_part(mesh, scene, place)
        made = make_points(scene, part.vertices_mm)
        watch(0.5)
        is_large = len(mesh.triangles) > MAX_FEATURE_TRIANGLES
        found = () if is_large else inspect(scene, mesh, made, tolerances)
        cut, placed = _off(part, made.error_um, fit_out(made.point_mm, made.error_um))
        return PartResult(
            vertices=len(mesh.vertices_mm),
            outside=int(made.outside.sum()),
            deviation=cut.deviation,
            normal=cut.normal,
            placed=placed,
            features=found,
            title=scene.title,
            place=place,
            unit=self.unit,
            part=part,
            made=made,
            second_order=second_order(scene, Loop.RELATIVE),
        )


def _off(part: PartMesh, *errors_um: Array) -> list[Off]:
    """Sum errors of the vertices up, [V, 3] each."""
    spans = np.array([[np.inf, -np.inf]] * len(errors_um))
    for some in part.pieces():
        for span, error in zip(spans, errors_um, strict=True):
            away = np.einsum("tcx,tx->tc", error[some.triangles], some.normals)
            span[:] = min(span[0], away.min()), max(span[1], away.max())
    both = zip(errors_um, spans.tolist(), strict=True)
    return [
        Off(deviation_of(part.vertices_mm, error), {"min_um": low, "max_um": high})
        for error, (low, high) in both
    ]


@dataclass(frozen=True, kw_only=True)
class PartResult(Result):
    """A part as it is cut."""

    keys = ("vertices", "outside", "deviation", "normal", "placed", "features")
    vertices: int
    outside: int  # vertices beyond the travel
    deviation: Deviation
    normal: Mapping[str, float]
    placed: Off
    features: Sequence[FeatureResult]
    title: str
    place: tuple[float, ...]  # (6,), mm and degrees
    unit: str | None  # of the numbers in its file; None for that of the format
    part: PartMesh  # nominal, in the workpiece frame
    made: Made  # its vertices

    def doubts(self) -> Iterator[str]:
        yield from self.part.warnings
        if self.outside:
            yield (
                f"{self.outside:,} of {self.vertices:,} vertices are beyond the travel; their"
                " errors are continued"
            )
        if len(self.part.triangles) > MAX_FEATURE_TRIANGLES:
            yield (
                f"{len(self.part.triangles):,} triangles: features are looked for in up to"
                f" {MAX_FEATURE_TRIANGLES:,}"
            )

    def blocks(self) -> Iterator[Block]:
        x, y, z = self.deviation.max_at_mm
        yield f"{self.title} · {self.part.name}, {self.vertices:,} vertices"
        yield f"  clamped at {', '.join(f'{value:.6g}' for value in self.place)} mm and degrees"
        yield f"  largest |E| {self.deviation.max_um:.2f} µm at x {x:.3f}, y {y:.3f}, z {z:.3f} mm"
        yield "  Geometry only: no forces, heat, wear or servo"
        both = ("as cut", Off(self.deviation, self.normal)), ("placed", self.placed)
        rows = [(word, *astuple(one.deviation)[:4], *one.normal.values()) for word, one in both]
        heads = ("mean", "RMS", "P95", "max", "normal, min", "max")
        yield Table((Column("error", leads=True), *number_columns(heads, ".2f", "µm")), rows)
        yield features_table(self.features)


def bent_file(scene: Scene, found: PartResult, ending: str, *, predistorted: bool = False) -> bytes:
    """Spell a part as it is cut, in its own frame and unit, as a file of this ending.

    Predistorted it is the part to be asked for, so that the nominal one is cut.
    """
    import trimesh

    nominal, moved = found.made.point_mm, found.made.error_um * MM_PER_UM
    if predistorted:
        for _ in range(2):
            moved = -make_points(scene, nominal + moved).error_um * MM_PER_UM
    own = transforms.inverse(transforms.placed(found.place[:3], found.place[3:]))
    point = transforms.apply(own, nominal + moved)
    unit, up = FORMATS[ending]
    if up == "y":
        point = to_gltf(point) * MM_PER_M
    mesh = trimesh.Trimesh(
        point / UNITS_MM[found.unit or unit], found.part.triangles, process=False
    )
    spelled: Any = mesh.export(file_type=ending[1:])
    return spelled.encode() if isinstance(spelled, str) else spelled
