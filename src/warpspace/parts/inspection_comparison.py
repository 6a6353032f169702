"""Comparison of an inspection report with the prediction for a machine, and its seal.

All measurands are linear in the deviations of the holes: their coordinates after the best-fit
placement of the report, and the shape of the part with placement free (`PartShape`). The same
functions are applied to measured and to predicted deviations, and to the response of the latter to
uncertain errors. E_n = (measured − predicted) / √(U² measured + U² predicted), ISO/IEC 17043.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
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
from warpspace.parts.inspection import KINDS, find_features
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
class Measurand:
    """A number of a report beside its prediction; in µm, of the shape in µm/m or µrad."""

    name: str  # of the hole, or part
    measure: str
    unit: str
    predicted_um: float
    u95_predicted_um: float | None
    measured_um: float | None
    u95_measured_um: float | None
    en: float | None  # None where an uncertainty is unknown


@dataclass(frozen=True, eq=False)
class PredictedHoles:
    """Predicted deviations of the holes of a report, in its frame."""

    error_um: Array  # [n, 3]
    diameter_um: Array | None  # [n]; None without a mesh
    response: Array | None  # [K, n, 4], of these to uncertain errors; None where not stated
    errors: ErrorUncertainty | None


def predict_points(
    report: InspectionReport, scene: Scene, place: Sequence[float] | None
) -> tuple[PredictedHoles, Workpiece, ActualPoints]:
    """Predict the holes of a report by the tool at their nominal points."""
    points = Workpiece(report.file, report.nominal_mm, np.zeros((0, 3), np.int32))
    placed = place_workpiece(points, scene, place)
    actual = evaluate_points(scene, placed.vertices_mm)
    turn = transforms.placed(placed.place[:3], placed.place[3:])[:3, :3]
    uncertainty = point_uncertainty(scene, actual)
    response = None
    if uncertainty is not None:
        response = np.pad(uncertainty.response @ turn, ((0, 0), (0, 0), (0, 1)))
    errors = uncertainty.errors if uncertainty else None
    return PredictedHoles(actual.error_um @ turn, None, response, errors), placed, actual


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
    size, matches = report.dimension, list[Any]()
    for row, point in enumerate(report.nominal_mm):
        away = {
            float(
                np.linalg.norm(((feature.shape.centre_mm - point) @ feature.shape.across)[:size])
            ): feature
            for feature in features
        }
        nearest = min(away, default=np.inf)
        if nearest > NEAR_MM:
            at = ", ".join(f"{value:.6g}" for value in point[:size])
            problem = f"line {report.lines[row]}: {report.names[row]} at {at} mm is no feature"
            expected = f"expected a cylinder or sphere of {fine.name} within {NEAR_MM:g} mm"
            raise SceneError(report.source, [f"{problem} (features outside the part); {expected}"])
        matches.append(away[nearest])
    turn = transforms.placed(placed.place[:3], placed.place[3:])[:3, :3]

    def follow(move_um: Array) -> Array:
        motions = [(feature.shape, feature.follow(move_um)) for feature in matches]
        rows = [
            np.column_stack([motion.shift_mm, 2.0 * (motion.radius_mm - shape.radius_mm)])
            for shape, motion in motions
        ]
        return np.stack(rows, axis=1) * UM_PER_MM

    deviation = follow(actual.error_um[None] @ turn)[0]
    response = follow(uncertainty.response @ turn) if uncertainty else None
    errors = uncertainty.errors if uncertainty else None
    return PredictedHoles(deviation[:, :3], deviation[:, 3], response, errors)


def compare_report(
    report: InspectionReport,
    holes: PredictedHoles,
    u95_um: float | None = None,
    session_u: float = 0.0,
) -> list[Measurand]:
    """Compare the measurands of a report with their prediction.

    `u95_um` is the expanded uncertainty of a measured coordinate or diameter where the report
    states none; `session_u` the standard uncertainty of the variation between parts.
    """
    size, count = report.dimension, len(report.names)
    shape = PartShape(report.nominal_mm, size)
    present = np.flatnonzero(shape.is_estimable)

    def measure(deviations: Array) -> Array:
        return np.concatenate(
            [shape.place(deviations), (deviations @ shape.inverses[1].T)[..., present]], axis=-1
        )

    def flat(vectors: Array) -> Array:
        return vectors[..., :size].reshape(*vectors.shape[:-2], count * size)

    measured = measure(align(report)[0].ravel() * UM_PER_MM)
    predicted = measure(flat(holes.error_um))
    u_um = report.u_um if u95_um is None or report.u_um is not None else np.full(count, u95_um / 2)
    names = [(name, letter, "µm") for name in report.names for letter in "xyz"[:size]]
    names += [("part", shape.names[at], shape.units[at]) for at in present]
    response = None if holes.response is None else measure(flat(holes.response))
    own = measure(shape.columns[1].T)
    variances = None
    if u_um is not None:
        each = np.repeat(u_um**2, size)
        whole = (shape.inverses[1] ** 2 @ each)[present]
        variances = np.concatenate([shape.placed_variance(each), whole])
    if holes.diameter_um is not None and report.diameter_mm is not None:
        names += [(name, "diameter", "µm") for name in report.names]
        measured = np.append(measured, report.diameter_mm[:, 1] * UM_PER_MM)
        predicted = np.append(predicted, holes.diameter_um)
        own = np.pad(own, ((0, 0), (0, count)))
        if response is not None and holes.response is not None:
            response = np.hstack([response, holes.response[..., 3]])
        variances = None if variances is None or u_um is None else np.append(variances, u_um**2)
    u95_predicted = None
    if response is not None and holes.errors is not None and holes.errors.is_known:
        expanded = np.einsum("km,kl,lm->m", response, holes.errors.expanded, response)
        between = np.sum((2.0 * session_u * own) ** 2, axis=0)
        u95_predicted = np.sqrt(np.maximum(expanded, 0.0) + between)
    u95_measured = None if variances is None else 2.0 * np.sqrt(np.maximum(variances, 0.0))
    has_values = report.deviation_mm is not None
    measurands: list[Measurand] = []
    for at, name in enumerate(names):
        value = float(measured[at]) if has_values else None
        u_predicted, u_measured = (
            None if u95 is None else float(u95[at]) for u95 in (u95_predicted, u95_measured)
        )
        en = None
        if value is not None and u_predicted is not None and u_measured:
            en = (value - float(predicted[at])) / float(np.hypot(u_predicted, u_measured))
        row = float(predicted[at]), u_predicted, value, u_measured if has_values else None, en
        measurands.append(Measurand(*name, *row))
    return measurands


@dataclass(frozen=True)
class Seal:
    """A predicted report with its hash: what is written before a part is cut."""

    file: str
    state: str  # to be written, verified, altered or different
    sha256: str
    problems: tuple[str, ...] = ()
    content: str = ""  # to be written


def _hash(document: dict[str, Any]) -> str:
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def seal_prediction(
    path: str, scene: Scene, place: Sequence[float], measurands: Sequence[Measurand]
) -> Seal:
    """Build the seal of a prediction, or verify that of an existing file, which is kept."""

    def rounded(value: float | None) -> float | None:
        return None if value is None else round(value, DIGITS) + 0.0

    rows = [
        [
            f"{row.name} {row.measure}",
            row.unit,
            *map(rounded, (row.predicted_um, row.u95_predicted_um)),
        ]
        for row in measurands
    ]
    document: dict[str, Any] = {
        "scene": scene.title, "place": [rounded(value) for value in place],
        "columns": SEALED, "predicted": rows,
    }  # fmt: skip
    if not Path(path).exists():
        sha256 = _hash(document)
        content = json.dumps(document | {"sha256": sha256}, indent=1, ensure_ascii=False)
        return Seal(path, "written", sha256, content=f"{content}\n")
    try:
        sealed = json.loads(read_text(Path(path), MAX_SCENE_BYTES))
        sha256 = str(sealed.pop("sha256"))
        lines = [(str(name), unit, *numbers) for name, unit, *numbers in sealed["predicted"]]
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
        raise SceneError(path, ["is no sealed prediction; expected another name"]) from None
    if _hash(sealed) != sha256:
        problem = "its content does not have the SHA-256 that it states: it was altered"
        return Seal(path, "altered", sha256, (problem,))
    problems = [
        f"{key}: {sealed.get(key)} is sealed, now {document[key]}"
        for key in ("scene", "place")
        if sealed.get(key) != document[key]
    ]
    differing = [
        (old, new) for old, new in zip(lines, rows, strict=False) if not _is_equal(old, new)
    ]
    if differing or len(lines) != len(rows):
        count = len(differing) + abs(len(lines) - len(rows))
        first = ""
        if differing:
            old, new = differing[0]
            first = f"; first {old[0]}: {old[2]} is sealed, now {new[0]}: {new[2]}"
        problems.append(f"{count} of {len(lines)} predictions differ{first}")
    return Seal(path, "different" if problems else "verified", sha256, tuple(problems))


def _is_equal(old: Sequence[Any], new: Sequence[Any]) -> bool:
    tolerance = 2.0 * 10.0**-DIGITS
    return all(
        before == after
        or (
            isinstance(before, float)
            and isinstance(after, float)
            and abs(before - after) <= tolerance
        )
        for before, after in zip(old, new, strict=False)
    )


@dataclass(frozen=True, kw_only=True)
class Comparison(Result):
    """A report beside its prediction."""

    report: InspectionReport
    measured: list[Measurand]
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
        if self.seal is not None:
            seal = replace(self.seal, content="")
            document["seal"] = {key: value for key, value in vars(seal).items() if key != "content"}
        return document

    def named_files(self) -> dict[str, str]:
        return {self.seal.file: self.seal.content} if self.seal and self.seal.content else {}

    def caveats(self) -> Iterator[str]:
        yield from super().caveats()
        yield from self.report_caveats()

    def report_caveats(self) -> Iterator[str]:
        yield from self.report.notes
        if self.outside:
            yield f"{self.outside:,} holes are beyond the travel; their errors are continued"
        if self.seal is not None:
            yield from (f"seal {self.seal.file}: {problem}" for problem in self.seal.problems)

    def blocks(self) -> Iterator[Block]:
        at = ", ".join(f"{value:.6g}" for value in self.place)
        yield f"{self.scene.title} · {self.report.file}, {len(self.report.names):,} holes"
        yield f"  clamped at {at} mm and degrees; compared after best-fit placement"
        yield "  Geometry only: no forces, heat, wear or servo"
        yield from self.comparison_blocks()

    def comparison_blocks(self) -> Iterator[Block]:
        if self.seal is not None:
            words = {"written": "predicted report sealed", "verified": "seal verified"}
            state = words.get(self.seal.state, f"seal {self.seal.state}")
            yield f"  {state}: {self.seal.file}, SHA-256 {self.seal.sha256[:16]}…"
        compared = [abs(row.en) for row in self.measured if row.en is not None]
        if compared:
            agreeing = sum(en <= 1.0 for en in compared)
            yield f"  |E_n| ≤ 1 for {agreeing:,} of {len(compared):,} measurands (ISO/IEC 17043)"
        elif self.report.deviation_mm is not None:
            yield "  no E_n: an uncertainty is unknown (± ?), of the errors or of the measurement"
        ordered = sorted(self.measured, key=_importance)
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
            for row in ordered
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


def _importance(row: Measurand) -> tuple[bool, float]:
    """Order by |E_n|, then the shape of the part and the largest differences."""
    if row.en is not None:
        return False, -abs(row.en)
    difference = row.predicted_um - (row.measured_um or 0.0)
    return row.name != "part", -abs(difference)
