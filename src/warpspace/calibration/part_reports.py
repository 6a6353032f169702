"""Inspection reports of parts as readings.

A reading is the deviation of a hole along the axes of the part. The placement of each report is
unknown. The shape of each part (`PartShape`) differs from that of the machine by a random term;
the terms of all reports but one are unknowns of the fit, and their sum is zero, so that fitted
errors are those of the mean part.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

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
from warpspace.units import MM_PER_UM, Array


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
        part, (count, size) = measured_part(readings), readings.observed_mm.shape
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


def measured_part(readings: Readings) -> MeasuredPart:
    """Return the part of readings that are an inspection report."""
    if readings.part is None:
        raise OptionError(f"{readings.source}: expected an inspection report")
    return readings.part


def _effects(readings: Readings) -> list[tuple[str, Array]]:
    """List the unknowns of a report with their effects on its readings, [n·d]."""
    part, label = measured_part(readings), readings.session[0]
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
        part = replace(measured_part(readings), terms=terms)
        coupled[at] = replace(readings, part=part, session=(label,) * len(readings))
    return tuple(coupled)


def check_dimensions(sets: Sequence[Readings]) -> None:
    if len({readings.part.shape.size for readings in sets if readings.part}) > 1:
        raise OptionError("{data}: reports with and without Z; expected the same coordinates")
