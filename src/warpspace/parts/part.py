"""The actual workpiece: its deviation, its features, and its mesh as a file.

Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import ProgressCallback, Result
from warpspace.analysis.options import File, Grammar, option, typed_word
from warpspace.analysis.statistics import Numbers, Statistics, statistics
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, plus_minus, u95_lines
from warpspace.bodies.gltf import to_gltf
from warpspace.bodies.mesh_files import FORMATS, MM_PER_M, UNITS_MM
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField
from warpspace.kinematics import transforms
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES, MAX_SCENE_BYTES
from warpspace.parts.inspection import SCAN_NOISE_UM, FeatureResult, features_table, inspect
from warpspace.parts.inspection_comparison import (
    PredictedHoles,
    ReportComparison,
    Seal,
    compare_report,
    predict_features,
    predict_measures,
    predict_points,
    seal_prediction,
)
from warpspace.parts.inspection_report import (
    MAX_SESSION_U,
    REPORT_ENDINGS,
    InspectionReport,
    load_report,
)
from warpspace.parts.refinement import refine
from warpspace.parts.workpiece import (
    TRIANGLES_AT_ONCE,
    ActualPoints,
    Workpiece,
    WorkpieceAnalysis,
    evaluate_points,
    place_workpiece,
    point_uncertainty,
    subtract_best_fit,
)
from warpspace.scene.model import Scene, second_order
from warpspace.scene.text_files import read_text
from warpspace.units import MM_PER_UM, Array, spell_fixed

REPORTED_UM = 0.5  # interpolation errors that are reported
MAX_NOISE_UM = 1000.0


@dataclass(frozen=True, kw_only=True)
class PartDeviation:
    """Deviation of the surface of a workpiece from nominal."""

    deviation: Statistics
    normal: Numbers  # min_um and max_um along normals of triangles, at their corners, and U95


@dataclass(frozen=True, kw_only=True)
class Part(WorkpieceAnalysis):
    """Evaluate a part, a mesh, as the machine of SCENE cuts it.

    Rotary axes are at their positions of the scene; linear axes bring the tool to each vertex of
    the clamped part. Errors are those of the tool against the workpiece, in the workpiece frame,
    actual − nominal: as cut, and placed, after the best rigid fit of its surface, as in an
    inspection. Planes, cylinders, cones and spheres are recognised and measured. An inspection
    report is compared with the prediction; without a mesh its nominal points are the part.
    Geometry only: no forces, heat, wear or servo.
    """

    name = "part"
    task = "measure"
    has_table = True
    has_chart = True
    chart_help = "measured and predicted deviations of a report"
    file_help = "Part as cut: .stl, .obj, .ply or .glb."
    file_endings = tuple(FORMATS)
    features: File = option(
        None, "Names and tolerances of its features, .toml", unset="all recognised features"
    )
    predistorted: bool = option(
        False, "Write with -o the predistorted part, from which the nominal one is cut"
    )
    noise: float = option(
        SCAN_NOISE_UM,
        "Largest standard deviation of vertices of a scan from its features, µm; 0 for none",
        low=0.0,
        high=MAX_NOISE_UM,
    )
    measured: File = option(
        None,
        "Inspection report: nominal and measured coordinates of holes, .txt, .csv or .xlsx",
        unset="a FILE that is no mesh, else none",
    )
    u95_um: float | None = option(
        None,
        "Expanded uncertainty of a measured coordinate, if the report states none",
        unit="µm",
        low=1e-3,
        high=MAX_NOISE_UM,
        unset="unknown",
    )
    session_u: float = option(
        0.0,
        "Standard uncertainty of the variation between parts: scales and squareness",
        unit="µm/m and µrad",
        low=0.0,
        high=MAX_SESSION_U,
    )
    seal: Annotated[str | None, Grammar("FILE", typed_word, is_extended=True)] = option(
        None, "Write the predicted report with a hash; verify an existing one", unset="none"
    )
    tolerances: tuple[str, str] | None = None  # name and text, instead of `features`
    report: InspectionReport | None = None  # instead of `measured`

    @property
    def is_file_report(self) -> bool:
        return bool(self.file) and Path(self.file or "").suffix.lower() in REPORT_ENDINGS

    def load_report(self) -> InspectionReport | None:
        """Read the inspection report; with a seal it may be the nominal one."""
        name = self.measured or (self.file if self.is_file_report else None)
        if self.report is None and name:
            return load_report(name, nominal_only=self.seal is not None)
        return self.report

    def compare(
        self, report: InspectionReport, holes: PredictedHoles, scene: Scene, place: Sequence[float]
    ) -> ReportComparison:
        measurands = compare_report(report, holes, self.u95_um, self.session_u)
        return ReportComparison(
            report=report,
            measured=measurands,
            scene=scene,
            place=place,
            second_order=second_order(scene, Loop.RELATIVE),
            uncertainty=holes.errors,
        )

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "PartResult | ReportComparison":
        report = self.load_report()
        has_mesh = self.mesh or self.file or scene.part.path("file")
        if report and (self.is_file_report or not has_mesh):
            watch(0.1)
            holes, placed, actual = predict_points(report, scene, self.place)
            compared = self.compare(report, holes, scene, placed.place)
            seal = self.seal and seal_prediction(self.seal, scene, placed.place, compared.measured)
            return replace(compared, outside=int(actual.outside.sum()), seal=seal or None)
        mesh = self.load_mesh(scene)
        of_scene = not (self.mesh or self.file)
        features = self.features or (scene.part.path("features") if of_scene else None)
        tolerances = self.tolerances
        if features and not tolerances:
            tolerances = features, read_text(Path(features), MAX_SCENE_BYTES)
        watch(0.2)
        fine, interpolation = refine(mesh, scene, self.place)
        surface = place_workpiece(fine, scene, self.place)
        actual, vertices = evaluate_points(scene, surface.vertices_mm), len(mesh.vertices_mm)
        watch(0.5)
        if interpolation <= REPORTED_UM:
            interpolation = 0.0
        is_large = len(mesh.triangles) > MAX_FEATURE_TRIANGLES
        uncertainty = None if is_large else point_uncertainty(scene, actual, fine.shares)
        fit = partial(subtract_best_fit, actual.point_mm, shares=fine.shares)
        placed_uncertainty = uncertainty.transform(fit) if uncertainty else None
        states = (actual.error_um, uncertainty), (fit(actual.error_um), placed_uncertainty)
        as_cut, placed = _deviations(surface, fine.shares, actual, states)
        features_of: Sequence[FeatureResult] = ()
        if not is_large:
            features_of = inspect(
                scene, fine, actual, tolerances, uncertainty, interpolation, self.noise
            )
        comparison = seal = None
        if self.seal:
            measurands = predict_measures(features_of)
            if not measurands:
                raise OptionError(f"{{seal}}: {mesh.name} has no features to predict")
            seal = seal_prediction(self.seal, scene, surface.place, measurands)
        if report:
            about = fine, surface, actual, uncertainty, self.noise
            holes = predict_features(report, *about)
            comparison = self.compare(report, holes, scene, surface.place)
        return PartResult(
            comparison=comparison,
            seal=seal,
            vertices=vertices,
            outside=int(actual.outside[:vertices].sum()),
            **vars(as_cut),
            placed=placed,
            features=features_of,
            uncertainty=uncertainty and uncertainty.errors,
            interpolation_um=interpolation,
            workpiece=surface if fine is mesh else place_workpiece(mesh, scene, self.place),
            actual=actual,
            scene=scene,
            analysis=self,
            second_order=second_order(scene, Loop.RELATIVE),
        )


SMALLEST_NORMAL = 1e-13  # mm², twice the area of a triangle that has no normal


def _deviations(
    part: Workpiece,
    shares: Array,
    actual: ActualPoints,
    states: Sequence[tuple[Array, FieldUncertainty | None]],
) -> list[PartDeviation]:
    """Summarise errors and their components along the normals of triangles."""
    x, y, z = np.ascontiguousarray(part.vertices_mm.T)
    # lowest and highest so far: deviation, vertex, normal
    spans = [[(end, 0, np.zeros(3)) for end in (np.inf, -np.inf)] for _ in states]
    for first in range(0, len(part.triangles), TRIANGLES_AT_ONCE):
        rows = part.triangles[first : first + TRIANGLES_AT_ONCE].T.astype(np.intp, order="C")
        (a, b, c), (u, v, w) = (
            [np.take(of, rows[at]) - np.take(of, rows[0]) for of in (x, y, z)] for at in (1, 2)
        )
        normals = np.stack([b * w - c * v, c * u - a * w, a * v - b * u])
        lengths = np.sqrt(np.einsum("xt,xt->t", normals, normals))
        is_valid = lengths > SMALLEST_NORMAL
        if not is_valid.all():
            rows, normals, lengths = rows[:, is_valid], normals[:, is_valid], lengths[is_valid]
        if not lengths.size:
            continue
        normals /= lengths
        for (error_um, _), span in zip(states, spans, strict=True):
            errors = (np.take(error_um, corner, axis=0) for corner in rows)
            along = np.stack([np.einsum("tx,xt->t", error, normals) for error in errors])
            for index, better in enumerate((min, max)):
                ends = along.min(axis=0) if better is min else along.max(axis=0)
                at = int(ends.argmin() if better is min else ends.argmax())
                corner = int((along[:, at] == ends[at]).argmax())
                candidate = along.item(corner, at), rows.item(corner, at), normals[:, at].copy()
                span[index] = better(span[index], candidate, key=itemgetter(0))
    deviations = zip(states, spans, strict=True)
    return [_summarise(actual, shares, *state, span) for state, span in deviations]


def _summarise(
    actual: ActualPoints,
    shares: Array,
    error_um: Array,
    uncertainty: FieldUncertainty | None,
    span: Sequence[tuple[float, int, Array]],
) -> PartDeviation:
    field = ErrorField(actual.point_mm, error_um, np.broadcast_to(np.nan, error_um.shape))
    deviation = statistics(field, actual.coordinates, shares)
    if uncertainty is not None:
        deviation = uncertainty.with_expanded_uncertainty(deviation)
    normal: dict[str, float | None] = {}
    for name, (extreme, vertex, direction) in zip(("min_um", "max_um"), span, strict=True):
        normal[name] = extreme
        if uncertainty is not None:
            normal[f"u95_{name}"] = uncertainty.u95_along(vertex, direction)
    return PartDeviation(deviation=deviation, normal=normal)


@dataclass(frozen=True, kw_only=True)
class PartResult(PartDeviation, Result):
    """The actual workpiece."""

    json_keys = ("vertices", "outside", "deviation", "normal", "placed", "features")
    vertices: int
    outside: int  # vertices beyond the travel
    placed: PartDeviation
    features: Sequence[FeatureResult]
    workpiece: Workpiece  # nominal, in the workpiece frame
    actual: ActualPoints  # its vertices, and those that refine it
    scene: Scene
    analysis: Part
    interpolation_um: float  # largest interpolation error; 0 below REPORTED_UM
    comparison: ReportComparison | None = None  # with an inspection report
    seal: Seal | None = None

    def json_fields(self) -> dict[str, Any]:
        compared = self.comparison.json_fields() if self.comparison else {}
        return super().json_fields() | compared | (self.seal.json_fields() if self.seal else {})

    def named_files(self) -> Mapping[str, str]:
        return self.seal.named_files() if self.seal else {}

    def caveats(self) -> Iterator[str]:
        yield from self.workpiece.warnings
        yield from self.comparison.report_caveats() if self.comparison else ()
        yield from self.seal.caveats() if self.seal else ()
        if self.outside:
            far = f"{self.outside:,} of {self.vertices:,} vertices"
            yield f"{far} are beyond the travel; their errors are continued"
        if self.interpolation_um:
            excess = f"up to {self.interpolation_um:.1f} µm"
            yield f"errors between evaluated points deviate by {excess} more; expected a finer mesh"
        scans = [feature.residual_um for feature in self.features if feature.residual_um]
        if scans:
            yield (
                f"{len(scans)} features of a scan: their vertices have a standard deviation of up"
                f" to {max(scans):.1f} µm, which their form errors include"
            )
        count = len(self.workpiece.triangles)
        if count > MAX_FEATURE_TRIANGLES:
            yield (
                f"{count:,} triangles; features and U95 are evaluated for up to"
                f" {MAX_FEATURE_TRIANGLES:,}"
            )

    def blocks(self) -> Iterator[Block]:
        x, y, z = self.deviation.max_at_mm
        at = ", ".join(f"{value:.6g}" for value in self.workpiece.place)
        yield f"{self.scene.title} · {self.workpiece.name}, {self.vertices:,} vertices"
        yield f"  clamped at {at} mm and degrees"
        largest = spell_fixed(self.deviation.max_um)
        yield f"  largest |E| {largest} µm at x {x:.3f}, y {y:.3f}, z {z:.3f} mm"
        yield "  Geometry only: no forces, heat, wear or servo"
        states: dict[str, PartDeviation] = {"as cut": self, "placed": self.placed}
        ends = "min_um", "max_um"
        rows = [
            (name, *state.deviation.four, *(state.normal[end] for end in ends))
            for name, state in states.items()
        ]
        heads = ("mean", "RMS", "P95", "max", "normal, min", "max")
        yield Table((Column("error", leads=True), *number_columns(heads, ".2f", "µm")), rows)
        deviations = {name: state.deviation for name, state in states.items()}
        yield from u95_lines(self.uncertainty, deviations)
        for name, state in states.items() if self.uncertainty else ():
            low, high = (plus_minus(state.normal[f"u95_{end}"]) for end in ends)
            yield f"  U95 along the normal, {name}: min {low}, max {high} µm"
        if self.seal is not None:
            yield str(self.seal)
        yield from self.comparison.comparison_blocks() if self.comparison else ()
        yield features_table(self.features)

    def output_files(self, ending: str = ".stl", /) -> Mapping[str, bytes | str]:
        """Write the part in the frame and unit of its mesh: actual, or predistorted."""
        nominal = self.workpiece.vertices_mm
        moved = self.actual.error_um[: self.vertices] * MM_PER_UM
        for _ in range(2 * self.analysis.predistorted):
            moved = -evaluate_points(self.scene, nominal + moved).error_um * MM_PER_UM
        place, (unit, up) = self.workpiece.place, FORMATS[ending]
        to_mesh = transforms.inverse(transforms.placed(place[:3], place[3:]))
        point = transforms.apply(to_mesh, nominal + moved)
        if up == "y":
            point = to_gltf(point) * MM_PER_M
        cut = replace(self.workpiece, vertices_mm=point / UNITS_MM[self.workpiece.unit or unit])
        return {"": cut.surface.export(file_type=ending[1:])}
