"""What `calibrate` says: the errors found, what cannot be told apart, and the residuals."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from warpspace.cli.tables import Column, number_columns, print_table, print_text

if TYPE_CHECKING:
    from warpspace.calibration.circles import Circle
    from warpspace.calibration.next_best import Step
    from warpspace.calibration.readings import Readings
    from warpspace.calibration.results import Calibration, Residuals
    from warpspace.scene.model import Scene


def write_residuals(path: str, found: "Calibration", *, force: bool) -> None:
    """Write the residuals, one line a reading."""
    from warpspace.outputs.files import write_atomically

    axes = tuple(found.scene.machine.axes)
    units = ["mm" if found.scene.machine.axes[name].is_linear else "deg" for name in axes]
    head = [f"axis_{name}_{unit}" for name, unit in zip(axes, units, strict=True)]
    parts = ("before_x", "before_y", "before_z", "after_x", "after_y", "after_z")
    with (
        write_atomically(Path(path), overwrite=force) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["file", "line", "use", "session", *head, *(f"{p}_mm" for p in parts)])
        for use, groups in (("fitted", found.fitted), ("predicted", found.predicted)):
            for group in groups:
                for row in _residual_rows(group, axes):
                    writer.writerow([row[0], row[1], use, *row[2:]])


def _residual_rows(group: "Residuals", axes: Sequence[str]) -> list[list[object]]:
    """Spell the readings of one file: file, line, session, axis positions, residuals."""
    readings = group.readings
    rows: list[list[object]] = []
    for at, line in enumerate(readings.lines):
        before = [*map(float, group.before_mm[at]), "", ""][:3]
        after = [*map(float, group.after_mm[at]), "", ""][:3]
        session = readings.session[at].lstrip("=+-@\t\r")
        places = [float(readings.coordinates[name][at]) for name in axes]
        rows.append([Path(readings.source).name, line, session, *places, *before, *after])
    return rows


def calibration_json(
    found: "Calibration",
    circles: "Sequence[Circle]",
    apart: dict[tuple[str, ...], str],
    steps: "Sequence[Step]",
) -> dict[str, object]:
    """Spell all of it as the JSON output has it."""
    from dataclasses import asdict

    from warpspace.calibration.rank import spell_rank
    from warpspace.machine.parameters import parameter

    def spelled(group: "Residuals") -> dict[str, object]:
        readings = group.readings
        return {
            "file": Path(readings.source).name,
            "kind": readings.kind,
            "readings": [
                {
                    "line": line,
                    "session": readings.session[at],
                    "axes": {k: float(v[at]) for k, v in readings.coordinates.items()},
                    "before_mm": group.before_mm[at].tolist(),
                    "after_mm": group.after_mm[at].tolist(),
                    "outlier": at in group.outliers,
                }
                for at, line in enumerate(readings.lines)
            ],
        }

    return {
        "parameters": [
            {
                "key": one.key,
                "unit": parameter(one.key).unit,
                "before": one.before,
                "value": one.value,
                "standard_uncertainty": one.standard_uncertainty,
                "interval_95": None if one.interval is None else list(one.interval),
                "identifiable": one.identifiable,
            }
            for one in found.parameters
        ],
        "rank": found.rank.rank,
        "confounded": [list(group) for group in found.rank.confounded],
        "unseen": list(found.rank.unseen),
        "cannot_tell": list(spell_rank(found.rank, found.slopes)),
        "separated_by": [{"keys": list(group), "measurement": m} for group, m in apart.items()],
        "rms_before_mm": found.rms_before_mm,
        "rms_after_mm": found.rms_after_mm,
        "rms_predicted_before_mm": found.rms_predicted_before_mm,
        "rms_predicted_after_mm": found.rms_predicted_after_mm,
        "sigma_mm": found.sigma_mm,
        "degrees_of_freedom": found.freedom,
        "set_up_mm": dict(found.unknowns),
        "correlation": {"keys": list(found.keys), "matrix": found.correlation.tolist()},
        "circles": [asdict(circle) for circle in circles],
        "next": [
            {
                "measurement": step.candidate.name,
                "map_before_um": step.map_before_um,
                "map_after_um": step.map_after_um,
            }
            for step in steps
        ],
        "fitted": [spelled(group) for group in found.fitted],
        "predicted": [spelled(group) for group in found.predicted],
        "notes": list(found.notes),
    }


def print_calibration(
    scene: "Scene", found: "Calibration", sets: "Sequence[Readings]", circles: "Sequence[Circle]"
) -> None:
    """Print what was found and what is left."""
    from warpspace.machine.parameters import parameter

    files = ", ".join(f"{Path(one.source).name} ({one.kind}, {len(one)} readings)" for one in sets)
    print_text(f"{scene.title} · {files}")
    for note in found.notes:
        print_text(f"  note: {note}")
    for circle in circles:
        (first, second), (a, b) = circle.plane, circle.centre_mm
        runs = " and ".join(filter(None, circle.sessions)) or "all readings"
        print_text(
            f"  circle about {circle.axis} in {first}–{second} ({runs}): radius"
            f" {circle.radius_mm:.6f} mm, centre {first} {a:.6f}, {second} {b:.6f} mm,"
            f" RMS {1e3 * circle.rms_mm:.1f} µm"
        )
    print_text(
        f"  residuals (RMS of the vectors): {found.rms_before_mm:.4f} mm before,"
        f" {found.rms_after_mm:.4f} mm after"
    )
    if found.rms_predicted_before_mm is not None:
        print_text(
            f"  predicted, not fitted: {found.rms_predicted_before_mm:.4f} mm before,"
            f" {found.rms_predicted_after_mm:.4f} mm after"
        )
    columns = (
        Column("key", leads=True),
        Column("name"),
        *(Column(name, is_number=True) for name in ("before", "value", "± u")),
        Column("unit"),
        Column("95 % interval", is_number=True),
        Column("told"),
    )
    rows: list[tuple[str, ...]] = []
    for one in found.parameters:
        if one.key in found.rank.unseen and not one.before:
            continue
        row = parameter(one.key)
        if one.standard_uncertainty is None or one.interval is None:
            rows.append((one.key, row.name, f"{one.before:.1f}", "", "", row.unit, "", "no"))
            continue
        low, high = one.interval
        numbers = f"{one.value:.1f}", f"{one.standard_uncertainty:.1f}"
        told = "yes" if one.identifiable else "in part"
        span = f"{low:.1f} to {high:.1f}"
        rows.append((one.key, row.name, f"{one.before:.1f}", *numbers, row.unit, span, told))
    print_table(columns, rows)
    if any("in part" in row for row in rows):
        print_text("  told in part: if those that look like it are what the scene says")
    width = f"{1e3 * found.sigma_mm:.2f} µm" if found.sigma_mm < 1.0 else f"{found.sigma_mm:.2f} mm"
    print_text(f"  standard deviation of one component {width}, {found.freedom} degrees of freedom")
    for group in (*found.fitted, *found.predicted):
        for at in group.outliers:
            line = group.readings.lines[at]
            print_text(f"  far off: {Path(group.readings.source).name} line {line}")


def print_apart(
    found: "Calibration", apart: dict[tuple[str, ...], str], steps: "Sequence[Step]"
) -> None:
    """Print what cannot be told apart, and what would help."""
    from warpspace.calibration.rank import spell_rank

    for words in spell_rank(found.rank, found.slopes):
        print_text(f"  {words}")
    for group, measurement in apart.items():
        print_text(f"    {group[0]} would be told by: {measurement}")
    if steps:
        print_text("Next measurements, each for the greatest gain:")
        heads = ("map before", "map after")
        columns = (Column("measurement", leads=True, wraps=True), *number_columns(heads, "µm"))
        rows = [
            (step.candidate.name, f"{step.map_before_um:.2f}", f"{step.map_after_um:.2f}")
            for step in steps
        ]
        print_table(columns, rows)
        print_text("  map: standard uncertainty of the position error, RMS over the volume")
