"""Inspection reports of parts as readings, and the variation between parts as a session term.

A reading is the deviation of a hole along the axes of the part. The placement of each report is
unknown. The shape of each part (`PartShape`) differs from that of the machine by a random term;
the terms of all reports but one are unknowns of the fit, and their sum is zero, so that fitted
errors are those of the mean part.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpspace.calibration.kinds import FromVectors, Prediction
from warpspace.calibration.readings import MeasuredPart, Readings, ReadingTable
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.relative_motion import angle_error
from warpspace.machine.axes import direction_index, parameter
from warpspace.machine.errors import Constant, Ramp
from warpspace.parts.inspection_report import parse_report
from warpspace.parts.part_shape import PartShape, align
from warpspace.parts.workpiece import evaluate_points
from warpspace.scene.model import Scene, coverage_notes
from warpspace.units import MM_PER_UM, UM_PER_MM, Array

if TYPE_CHECKING:
    from warpspace.calibration.fit import Fit


class PartReports(FromVectors):
    """Deviations of the holes of a clamped part; its placement in the report is unknown."""

    name = "part"
    reads_text = True
    description = "inspection report of a part clamped at --place; its placement is unknown"
    columns = "nominal X, Y[, Z] and measured ones, or deviations, in any order; U95 [µm]"

    def read(self, table: ReadingTable, scene: Scene) -> Readings:
        report = parse_report(table.text, table.source)
        if scene.part.place is None:
            raise OptionError("{place} is missing; expected X,Y,Z where the part was clamped")
        shape = PartShape(report.nominal_mm, report.dimension)
        if not shape.is_estimable.all():
            expected = "expected holes that are not on one line or, with Z, in one plane"
            raise OptionError(f"{report.file}: scales and squareness not determined; {expected}")
        place = scene.part.place
        pose = transforms.placed(place[:3], place[3:])
        actual = evaluate_points(scene, transforms.apply(pose, report.nominal_mm))
        count = len(report.names)
        coordinates = {name: np.broadcast_to(at, count) for name, at in actual.coordinates.items()}
        deviation, alignment = align(report)
        ranges = {name: (float(at.min()), float(at.max())) for name, at in coordinates.items()}
        return Readings(
            self.name, coordinates, actual.point_mm, deviation,
            None if report.u_um is None else report.u_um * MM_PER_UM, (report.file,) * count,
            report.lines, report.source, (*report.notes, *coverage_notes(scene, ranges)),
            part=MeasuredPart(shape, pose[:3, :3], alignment),
        )  # fmt: skip

    def unknowns(self, readings: Readings) -> tuple[str, ...]:
        return tuple(name for name, _ in _effects(readings))

    def predict(
        self, readings: Readings, error_mm: Array, prediction: Prediction
    ) -> tuple[Array, Array, Array]:
        part, (count, size) = _part(readings), readings.observed_mm.shape
        effects = dict(_effects(readings))
        none = np.zeros(count * size)
        by_unknown = np.stack([effects.get(name, none) for name in prediction.unknowns], axis=-1)
        by_unknown = by_unknown.reshape(count, size, -1)
        by_error = np.broadcast_to(part.axes, (count, size, 3))
        return error_mm @ part.axes.T + by_unknown @ prediction.values, by_error, by_unknown

    def automatic_keys(self, readings: Readings, scene: Scene) -> tuple[str, ...]:
        """List scales, squareness and curved straightness of the axes that move.

        A straightness that is a ramp is a squareness to a part whose placement is unknown.
        """
        axes = [
            name
            for name, axis in scene.machine.axes.items()
            if axis.is_linear and np.ptp(readings.coordinates[name]) > 0.0
        ]
        directions = {direction_index(name) for name in axes}
        keys: list[str] = []
        for key in scene.parameter_keys:
            row = parameter(key)
            if row.axis not in axes or row.is_rotation or row.is_constant:
                continue
            is_curve = not isinstance(scene.errors.functions.get(key, 0), int | Constant | Ramp)
            is_scale = row.direction == direction_index(row.axis)
            if is_scale or (is_curve and row.direction in directions):
                keys.append(key)
        pairs = [(a, b) for at, a in enumerate(axes) for b in axes[at + 1 :]]
        return tuple(dict.fromkeys((*keys, *(angle_error(scene.machine, *p)[0] for p in pairs))))


def _part(readings: Readings) -> MeasuredPart:
    if readings.part is None:
        raise OptionError(f"{readings.source}: expected an inspection report")
    return readings.part


def _effects(readings: Readings) -> list[tuple[str, Array]]:
    """List the unknowns of a report with their effects on its readings, [n·d]."""
    part, label = _part(readings), readings.session[0]
    placement, shape = part.shape.columns
    turns = ("z",) if part.shape.size == 2 else tuple("xyz")
    names = [*"xyz"[: part.shape.size], *(f"turn {letter}" for letter in turns)]
    effects = [(f"{label} {name}", column) for name, column in zip(names, placement.T, strict=True)]
    for other, factor in part.terms:
        columns = zip(part.shape.names, factor * shape.T, strict=True)
        effects += [(f"{other} {name}", column) for name, column in columns]
    return effects


def couple_parts(sets: Sequence[Readings]) -> tuple[Readings, ...]:
    """Name the reports, and give each the session terms of which its own is made."""
    indices = [at for at, readings in enumerate(sets) if readings.part]
    names = [Path(sets[at].source).name for at in indices]
    labels = [
        f"{name} ({number})" if names.count(name) > 1 else name
        for number, name in enumerate(names, 1)
    ]
    check_dimensions(sets)
    coupled = list(sets)
    for at, label in zip(indices, labels, strict=True):
        negative = tuple((other, -1.0) for other in labels[:-1])
        terms = negative if label == labels[-1] else ((label, 1.0),)
        readings = sets[at]
        part = replace(_part(readings), terms=terms)
        coupled[at] = replace(readings, part=part, session=(label,) * len(readings))
    return tuple(coupled)


def check_dimensions(sets: Sequence[Readings]) -> None:
    if len({readings.part.shape.size for readings in sets if readings.part}) > 1:
        raise OptionError("{data}: reports with and without Z; expected the same coordinates")


@dataclass(frozen=True)
class SessionTerms:
    """Variation between parts: standard uncertainty of each number of the shape of one part."""

    labels: tuple[str, ...]  # (m,), reports
    values: Array  # [m, s], µm/m and µrad: shape of each part less that of the mean part
    u: float | None  # µm/m and µrad; None where one report does not tell
    dof: float
    source: str  # stated, estimated or unknown

    @classmethod
    def of(cls, fit: "Fit") -> "SessionTerms | None":
        """Estimate the variation by moments: squared terms less their variance from the scatter.

        The numbers of the shape are pooled. The degrees of freedom are reduced by the variance that
        is subtracted, so that those of the sum are 3·(m − 1), also where no variation is seen.
        """
        parts = [readings for readings in fit.model.sets if readings.part]
        if not parts:
            return None
        names, unknowns = _part(parts[0]).shape.names, fit.model.unknowns
        labels = tuple(readings.session[0] for readings in parts)
        select = np.zeros((len(labels) * len(names), len(unknowns)))
        for at, readings in enumerate(parts):
            for other, factor in _part(readings).terms:
                for number, name in enumerate(names):
                    row = at * len(names) + number
                    select[row, unknowns.index(f"{other} {name}")] = factor * UM_PER_MM
        values = select @ fit.solved.unknown
        count = len(fit.fitted.keys)
        scatter = float(np.trace(select @ fit.scatter_covariance[count:, count:] @ select.T))
        stated, free = fit.options.session_u, len(names) * (len(labels) - 1)
        table = values.reshape(len(labels), -1)
        if stated is not None:
            return cls(labels, table, stated, np.inf, "stated")
        if not free:
            return cls(labels, table, None, np.inf, "unknown")
        total = max(float(values @ values), scatter * (1.0 + 1e-6), 1e-18)
        variance, dof = (total - scatter) / free, free * (1.0 - scatter / total) ** 2
        return cls(labels, table, float(np.sqrt(variance)), dof, "estimated")

    def columns(self, sets: Sequence[Readings]) -> Array:
        """Compute the change of all readings by one u of each number of the shape, [N, s], mm."""
        rows = [
            _part(readings).shape.columns[1]
            if readings.part
            else np.zeros((readings.observed_mm.size, self.values.shape[1]))
            for readings in sets
        ]
        return (self.u or 0.0) * MM_PER_UM * np.vstack(rows)

    def notes(self) -> Iterator[str]:
        if self.u is None:
            yield (
                f"{self.labels[0]}: intervals hold for this part only; expected several reports or"
                " the variation between parts (session-u) for those of the machine"
            )

    def as_json(self, fit: "Fit") -> dict[str, Any]:
        variation = {
            "standard_uncertainty": self.u,
            "degrees_of_freedom": self.values.size - self.values.shape[1]
            if self.source == "estimated"
            else None,
            "source": self.source,
        }
        rows = {"sessions": self._session_rows(fit), "shape": self._shape_rows(fit)}
        return {**rows, "between_parts": variation}

    def _shape_rows(self, fit: "Fit") -> list[dict[str, Any]]:
        """Evaluate the shape of the mean part, with intervals for it and for the next part.

        The next part is measured as these are. Without u both intervals are None, and that of the
        mean holds for the measured part alone.
        """
        from scipy.stats import t

        from warpspace.calibration.instruments import effective_dof

        parts = [readings for readings in fit.model.sets if readings.part]
        inverses = [_part(readings).shape.inverses[1] for readings in parts]
        shapes, scatters = list[Array](), list[Array]()
        for inverse, readings in zip(inverses, parts, strict=True):
            sigma_mm = fit.sigma_mm if readings.sigma_mm is None else readings.sigma_mm
            shapes.append(UM_PER_MM * inverse @ readings.observed_mm.ravel())
            scatters.append(np.sum((UM_PER_MM * inverse) ** 2, axis=1) * np.mean(sigma_mm**2))
        means, scatter = np.mean(shapes, axis=0), np.mean(scatters, axis=0)
        count, variance = len(parts), np.full_like(scatter, (self.u or 0.0) ** 2)
        shape = _part(parts[0]).shape
        halves: list[Array] = []
        for factor in (1.0 / count, 1.0 + 1.0 / count):
            terms = np.array([scatter, variance]) * factor
            dof = effective_dof(terms, [fit.scatter_dof, self.dof])
            halves.append(t.ppf(0.975, dof) * np.sqrt(terms.sum(axis=0)))
        return [
            {
                "measure": name,
                "unit": unit,
                "value": float(mean),
                "interval_95": [float(mean - half), float(mean + half)],
                "next_part_95": None
                if self.u is None
                else [float(mean - wide), float(mean + wide)],
            }
            for name, unit, mean, half, wide in zip(
                shape.names, shape.units, means, *halves, strict=True
            )
        ]

    def _session_rows(self, fit: "Fit") -> list[dict[str, Any]]:
        """Return placement and term of each report."""
        unknown = dict(zip(fit.model.unknowns, fit.solved.unknown.tolist(), strict=True))
        rows: list[dict[str, Any]] = []
        parts = [readings for readings in fit.model.sets if readings.part]
        for label, values, readings in zip(self.labels, self.values, parts, strict=True):
            part = _part(readings)
            size = part.shape.size
            move = np.array([unknown[f"{label} {x}"] for x in "xyz"[:size]] + [0.0] * (3 - size))
            turn = np.array([unknown.get(f"{label} turn {x}", 0.0) for x in "xyz"]) * MM_PER_UM
            pose = part.alignment @ transforms.rigid(transforms.vector_rotation(turn), move)
            angles = transforms.roll_pitch_yaw_deg(pose[:3, :3])
            names = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
            placement = dict(zip(names, [*pose[:3, 3].tolist(), *angles.tolist()], strict=True))
            if size == 2:
                placement = {name: placement[name] for name in ("x_mm", "y_mm", "c_deg")}
            term = dict(zip(part.shape.keys, values.tolist(), strict=True))
            rows.append({"file": label, "placement": placement, "term": term})
        return rows
