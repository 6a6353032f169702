"""Comparison of an inspection report with the prediction for a machine, and its seal.

All measurands are linear in the deviations of the holes: their coordinates after the best-fit
placement of the report, and the shape of the part with placement free (`PartShape`). The same
functions are applied to measured and to predicted deviations, and to the response of the latter to
uncertain errors. E_n = (measured − predicted) / √(U² measured + U² predicted), ISO/IEC 17043.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table
from warpspace.analysis.description import Result
from warpspace.analysis.uncertainty.propagation import (
    ErrorUncertainty,
    FieldUncertainty,
    plus_minus,
)
from warpspace.exceptions import SceneError
from warpspace.kinematics import transforms
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.parts.inspection import KINDS, FeatureResult, find_features
from warpspace.parts.inspection_report import InspectionReport
from warpspace.parts.part_shape import PartShape, align
from warpspace.parts.workpiece import (
    ActualPoints,
    Workpiece,
    evaluate_points,
    place_workpiece,
    point_uncertainty,
)
from warpspace.scene.model import Scene
from warpspace.scene.text_files import read_text
from warpspace.units import MM_PER_UM, UM_PER_MM, Array

ROUND = KINDS["diameter"].features
NEAR_MM = 0.1  # distance of a nominal hole from the feature that it is, at most
SEALED = "measurand", "unit", "predicted", "u95_predicted"
DIGITS = 4  # of sealed numbers, µm and µrad
MOST_ROWS = 30  # measurands in text; a file has all


@dataclass(frozen=True)
class ComparedMeasurand:
    """A number of a report beside its prediction; in µm, of the shape in µm/m or µrad."""

    name: str  # of the hole, or part
    measure: str
    unit: str
    predicted_um: float
    u95_predicted_um: float | None
    measured_um: float | None = None
    u95_measured_um: float | None = None
    en: float | None = None  # where an uncertainty is unknown


@dataclass(frozen=True, eq=False)
class PredictedHoles:
    """Predicted deviations of the holes of a report, in its frame: x, y, z and diameter."""

    deviation_um: Array  # [n, 4]
    response: Array | None  # [K, n, 4], to uncertain errors; None where not stated
    errors: ErrorUncertainty | None
    has_diameters: bool


def predict_points(
    report: InspectionReport, scene: Scene, place: Sequence[float] | None
) -> tuple[PredictedHoles, Workpiece, ActualPoints]:
    """Predict the holes of a report by the tool at their nominal points."""
    points = Workpiece(report.file, report.nominal_mm, np.zeros((0, 3), np.int32))
    placed = place_workpiece(points, scene, place)
    actual = evaluate_points(scene, placed.vertices_mm)
    turn = transforms.placed(placed.place[:3], placed.place[3:])[:3, :3]
    uncertainty = point_uncertainty(scene, actual)
    response = None if uncertainty is None else _four(uncertainty.response @ turn)
    errors = uncertainty.errors if uncertainty else None
    return PredictedHoles(_four(actual.error_um @ turn), response, errors, False), placed, actual


def _four(vectors: Array) -> Array:
    """Append zeros to vectors, [..., d], up to four numbers of a hole."""
    return np.pad(vectors, [*[(0, 0)] * (vectors.ndim - 1), (0, 4 - vectors.shape[-1])])


def predict_features(
    report: InspectionReport,
    fine: Workpiece,
    placed: Workpiece,
    actual: ActualPoints,
    uncertainty: FieldUncertainty | None,
    noise_um: float,
) -> PredictedHoles:
    """Predict the holes of a report by the cylinders and spheres of a mesh at their centres."""
    features = [x for x in find_features(fine, noise_um).values() if x.shape.kind in ROUND]
    shapes, size, matches = [feature.shape for feature in features], report.dimension, list[int]()
    for row, point in enumerate(report.nominal_mm):
        gaps = [((shape.centre_mm - point) @ shape.across)[:size] for shape in shapes]
        away = [float(np.linalg.norm(gap)) for gap in gaps]
        nearest = min(away, default=np.inf)
        if nearest > NEAR_MM:
            at = ", ".join(f"{value:.6g}" for value in point[:size])
            problem = f"line {report.lines[row]}: {report.names[row]} at {at} mm is no feature"
            expected = f"expected a cylinder or sphere of {fine.name} within {NEAR_MM:g} mm"
            raise SceneError(report.source, [f"{problem} (features outside the part); {expected}"])
        matches.append(away.index(nearest))
    turn = transforms.placed(placed.place[:3], placed.place[3:])[:3, :3]

    def follow(move_um: Array) -> Array:
        motions = {at: features[at].follow(move_um) for at in {*matches}}
        rows = [
            np.column_stack([motions[at].shift_mm, 2.0 * motions[at].radius_mm]) for at in matches
        ]
        return np.stack(rows, axis=1) * UM_PER_MM

    nominal = follow(np.zeros((1, *actual.error_um.shape)))
    deviation = follow(actual.error_um[None] @ turn) - nominal
    response = follow(uncertainty.response @ turn) - nominal if uncertainty else None
    return PredictedHoles(deviation[0], response, uncertainty and uncertainty.errors, True)


def compare_report(
    report: InspectionReport,
    holes: PredictedHoles,
    u95_um: float | None = None,
    session_u: float = 0.0,
) -> list[ComparedMeasurand]:
    """Compare the measurands of a report with their prediction.

    `u95_um` is the expanded uncertainty of a measured coordinate or diameter where the report
    states none; `session_u` the standard uncertainty of the variation between parts.
    """
    size, count = report.dimension, len(report.names)
    shape = PartShape(report.nominal_mm, size)
    present = np.flatnonzero(shape.is_estimable)
    has_diameters = holes.has_diameters and report.diameter_mm is not None

    def measure(vectors: Array) -> Array:
        flat = vectors[..., :size].reshape(*vectors.shape[:-2], -1)
        parts = [shape.place(flat), (flat @ shape.inverses[1].T)[..., present]]
        return np.concatenate([*parts, *[vectors[..., 3]] * has_diameters], axis=-1)

    names = [(name, letter, "µm") for name in report.names for letter in "xyz"[:size]]
    names += [("part", shape.names[at], shape.units[at]) for at in present]
    names += [(name, "diameter", "µm") for name in report.names] * has_diameters
    predicted = measure(holes.deviation_um)
    measured, u95_predicted, u95_measured, en = np.full((4, len(predicted)), np.nan)
    if holes.response is not None and holes.errors is not None and holes.errors.is_known:
        response = measure(holes.response)
        expanded = np.einsum("km,kl,lm->m", response, holes.errors.expanded, response)
        variation = measure(_four(shape.columns[1].T.reshape(-1, count, size)))
        between = np.sum((2.0 * session_u * variation) ** 2, axis=0)
        u95_predicted = np.sqrt(np.maximum(expanded, 0.0) + between)
    if report.deviation_mm is not None:
        read_um = _four(align(report)[0]) * UM_PER_MM
        if report.diameter_mm is not None:
            read_um[:, 3] = report.diameter_mm[:, 1] * UM_PER_MM
        measured = measure(read_um)
        u_um = np.full(count, np.nan if u95_um is None else u95_um / 2.0)
        each = np.repeat((u_um if report.u_um is None else report.u_um) ** 2, size)
        variances = [shape.placed_variance(each), (shape.inverses[1] ** 2 @ each)[present]]
        variances += [each[::size]] * has_diameters
        u95_measured = 2.0 * np.sqrt(np.maximum(np.concatenate(variances), 0.0))
    u95 = np.hypot(u95_predicted, u95_measured)
    np.divide(measured - predicted, u95, out=en, where=u95 > 0.0)
    numbers = np.stack([predicted, u95_predicted, measured, u95_measured, en], axis=1).tolist()
    return [
        ComparedMeasurand(
            *name, row[0], *(None if np.isnan(number) else number for number in row[1:])
        )
        for name, row in zip(names, numbers, strict=True)
    ]


def predict_measures(features: Sequence[FeatureResult]) -> list[ComparedMeasurand]:
    """List the predicted deviations of the measures of features, after best-fit placement."""
    rows: list[ComparedMeasurand] = []
    for feature in features:
        for measure, numbers in feature.measures.items():
            name, unit = ("um", "µm") if "placed_difference_um" in numbers else ("urad", "µrad")
            key = f"placed_difference_{name}"
            predicted = numbers[key], numbers.get(f"u95_{key}")
            rows.append(ComparedMeasurand(feature.name, measure, unit, *predicted))
    return rows


@dataclass(frozen=True)
class Seal:
    """A predicted report with its hash: what is written before a part is cut."""

    file: str
    state: str  # to be written, verified, altered or different
    sha256: str
    problems: tuple[str, ...] = ()
    content: str = ""  # to be written

    def __str__(self) -> str:
        states = {"written": "predicted report sealed", "verified": "seal verified"}
        state = states.get(self.state, f"seal {self.state}")
        return f"  {state}: {self.file}, SHA-256 {self.sha256[:16]}…"

    def json_fields(self) -> dict[str, Any]:
        return {"seal": {key: value for key, value in vars(self).items() if key != "content"}}

    def named_files(self) -> dict[str, str]:
        return {self.file: self.content} if self.content else {}

    def caveats(self) -> Iterator[str]:
        yield from (f"seal {self.file}: {problem}" for problem in self.problems)


def _hash(document: dict[str, Any]) -> str:
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def seal_prediction(
    path: str, scene: Scene, place: Sequence[float], measurands: Sequence[ComparedMeasurand]
) -> Seal:
    """Build the seal of a prediction, or verify that of an existing file, which is kept."""

    def rounded(value: float | None) -> float | None:
        return None if value is None else round(value, DIGITS) + 0.0

    rows = [
        [f"{row.name} {row.measure}", row.unit, rounded(row.predicted_um),
         rounded(row.u95_predicted_um)]
        for row in measurands
    ]  # fmt: skip
    stated = {"scene": scene.title, "place": [rounded(value) for value in place]}
    document: dict[str, Any] = {**stated, "columns": SEALED, "predicted": rows}
    if not Path(path).exists():
        sha256 = _hash(document)
        content = json.dumps(document | {"sha256": sha256}, indent=1, ensure_ascii=False)
        return Seal(path, "written", sha256, content=f"{content}\n")
    try:
        sealed = json.loads(read_text(Path(path), MAX_SCENE_BYTES))
        sha256 = str(sealed.pop("sha256"))
        lines = [[name, unit, value, u95] for name, unit, value, u95 in sealed["predicted"]]
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
        raise SceneError(path, ["is no sealed prediction; expected another name"]) from None
    if _hash(sealed) != sha256:
        problem = "its content does not have the SHA-256 that it states: it was altered"
        return Seal(path, "altered", sha256, (problem,))
    problems = [
        f"{key}: {sealed.get(key)} is sealed, now {value}"
        for key, value in stated.items()
        if sealed.get(key) != value
    ]
    differing = [(old, new) for old, new in zip(lines, rows, strict=False) if old != new]
    if differing or len(lines) != len(rows):
        count = len(differing) + abs(len(lines) - len(rows))
        first = [f"; first {old[0]}: {old[2]} is sealed, now {new[2]}" for old, new in differing]
        problems.append(f"{count} of {len(lines)} predictions differ{first[0] if first else ''}")
    return Seal(path, "different" if problems else "verified", sha256, tuple(problems))


@dataclass(frozen=True, kw_only=True)
class ReportComparison(Result):
    """A report beside its prediction."""

    report: InspectionReport
    measured: list[ComparedMeasurand]
    scene: Scene
    place: Sequence[float]
    outside: int = 0  # holes beyond the travel
    seal: Seal | None = None

    def json_fields(self) -> dict[str, Any]:
        compared = [abs(row.en) <= 1.0 for row in self.measured if row.en is not None]
        document: dict[str, Any] = {
            "measured": [vars(row) for row in self.measured],
            "compared": len(compared), "agreeing": sum(compared),
        }  # fmt: skip
        return document | (self.seal.json_fields() if self.seal else {})

    def named_files(self) -> dict[str, str]:
        return self.seal.named_files() if self.seal else {}

    def caveats(self) -> Iterator[str]:
        yield from super().caveats()
        yield from self.report_caveats()

    def report_caveats(self) -> Iterator[str]:
        yield from self.report.notes
        if self.outside:
            yield f"{self.outside:,} holes are beyond the travel; their errors are continued"
        yield from self.seal.caveats() if self.seal else ()

    def blocks(self) -> Iterator[Block]:
        at = ", ".join(f"{value:.6g}" for value in self.place)
        yield f"{self.scene.title} · {self.report.file}, {len(self.report.names):,} holes"
        yield f"  clamped at {at} mm and degrees; compared after best-fit placement"
        yield "  Geometry only: no forces, heat, wear or servo"
        yield from self.comparison_blocks()

    def comparison_blocks(self) -> Iterator[Block]:
        if self.seal is not None:
            yield str(self.seal)
        compared = [abs(row.en) for row in self.measured if row.en is not None]
        if compared:
            agreeing = sum(en <= 1.0 for en in compared)
            yield f"  |E_n| ≤ 1 for {agreeing:,} of {len(compared):,} measurands (ISO/IEC 17043)"
        elif self.report.deviation_mm is not None:
            yield "  no E_n: an uncertainty is unknown (± ?), of the errors or of the measurement"
        columns = (
            Column("measurand", key="measurand", leads=True, wraps=True),
            Column("unit", key="unit"),
            Column("predicted", "+.1f", key="predicted"),
            Column("U95", key="u95_predicted", joins=True),
            Column("measured", "+.1f", key="measured"),
            Column("U95", key="u95_measured", joins=True),
            Column("E_n", "+.2f", key="en"),
        )
        rows = [
            (f"{row.name} {row.measure}", row.unit, row.predicted_um, row.u95_predicted_um,
             row.measured_um, row.u95_measured_um, row.en)
            for row in sorted(self.measured, key=_importance)
        ]  # fmt: skip
        shown = [
            (*row[:3], plus_minus(row[3]), row[4], plus_minus(row[5]), row[6])
            for row in rows[:MOST_ROWS]
        ]
        title = "" if len(rows) == len(shown) else f"The first {len(shown)} of {len(rows)}:"
        yield Table(columns, shown, title, file_rows=rows)
        yield self._vectors()

    def _vectors(self) -> Lines:
        """Draw deviations of the holes in the plane x–y, magnified."""
        size, count = self.report.dimension, len(self.report.names)
        rows = self.measured[: size * count]
        nominal = self.report.nominal_mm[:, :2]
        kinds = [("predicted", np.array([row.predicted_um for row in rows], float))]
        if self.report.deviation_mm is not None:
            kinds.append(("measured", np.array([row.measured_um for row in rows], float)))
        vectors = [(name, values.reshape(count, size)[:, :2]) for name, values in kinds]
        largest = max(float(np.abs(vector).max()) for _, vector in vectors)
        factor = 0.1 * float(np.ptp(nominal, axis=0).max()) * UM_PER_MM / (largest or 1.0)
        factor = 10.0 ** np.floor(np.log10(factor))
        curves = [Curve("nominal", *nominal.T, style="dots", colour=2)]
        for colour, (name, vector) in enumerate(vectors):
            end = nominal + factor * vector * MM_PER_UM
            x, y = np.stack([nominal, end, np.full_like(end, np.nan)], axis=1).reshape(-1, 2).T
            curves.append(Curve(name, x, y, colour))
        note = f"Deviations after best-fit placement, {factor:,.0f} times."
        return Lines(
            "plane", f"Holes of {self.report.file}", "x [mm]", "y [mm]", tuple(curves), (), note
        )


def _importance(row: ComparedMeasurand) -> tuple[bool, float]:
    """Order by |E_n|, then the shape of the part and the largest differences."""
    if row.en is not None:
        return False, -abs(row.en)
    difference = row.predicted_um - (row.measured_um or 0.0)
    return row.name != "part", -abs(difference)
