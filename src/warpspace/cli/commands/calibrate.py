"""Command `calibrate`: the errors of a machine out of measured data."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import (
    check_output,
    check_targets,
    csv_option,
    force_option,
    output_option,
    plot_option,
)
from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.calibration.circles import Circle
    from warpspace.calibration.next_best import Step
    from warpspace.calibration.readings import Readings
    from warpspace.calibration.results import Calibration, Residuals
    from warpspace.scene.model import Scene

ENDINGS = (".toml",)


@click.command()
@scene_argument()
@click.option(
    "--data",
    required=True,
    multiple=True,
    metavar="FILE",
    help="CSV file of readings, or the name of a bundled one such as tcp_on.csv. Repeatable.",
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    metavar="KIND",
    help="points, sphere, sphere-tcp, lengths, or a test with its options such as"
    " circular:plane=XZ:radius=150 (`warpspace test --list`; its test sphere is r-test here)."
    " Once for all files, or once for each, --data before --predict."
    "  [told by the columns of each file]",
)
@click.option(
    "--fit",
    multiple=True,
    metavar="KEYS|auto",
    help="Parameters to find, with commas between; KEY:ramp and KEY:constant choose the curve of a"
    " component error.  [auto: those that the readings can show]",
)
@click.option(
    "--predict",
    multiple=True,
    metavar="FILE",
    help="Readings that are not fitted but predicted. Repeatable.",
)
@click.option("--robust", is_flag=True, help="Let readings far off count less.")
@click.option("--priors", is_flag=True, help="Count the tolerances of SCENE as knowledge.")
@click.option(
    "--next",
    "next_count",
    type=int,
    metavar="N",
    help="Name the N measurements that would lower the uncertainty of the map most.",
)
@output_option("Write SCENE with the errors found: .toml.", required=False)
@plot_option("residuals before and after, and the errors found")
@csv_option
@force_option
@json_option
def calibrate(
    scene: str,
    data: tuple[str, ...],
    kinds: tuple[str, ...],
    fit: tuple[str, ...],
    predict: tuple[str, ...],
    next_count: int | None,
    output: str | None,
    plot: str | None,
    csv_path: str | None,
    *,
    robust: bool,
    priors: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Find the errors of the machine of SCENE in measured data.

    Least squares with the exact model; it says which parameters the readings determine, which they
    cannot tell apart, standard uncertainties and 95 % intervals, and what is left. Readings with a
    column u_um (standard uncertainty) are weighted by it. A column session, or run, tells set-ups
    apart: each has its own place of the sphere or the station, or its own shift.
    """
    from warpspace.calibration.calibrate import calibrate as find
    from warpspace.calibration.circles import circles_of
    from warpspace.calibration.next_best import next_best, separating
    from warpspace.calibration.readings import find_data, read_readings
    from warpspace.calibration.results import Request
    from warpspace.calibration.table import read_table
    from warpspace.calibration.terms import read_keys
    from warpspace.scene.library import load_scene

    files = [find_data(name) for name in (*data, *predict)]
    target = _target(output, ENDINGS, scene, files, force=force)
    check_targets(scene, force=force, plot=plot, csv_path=csv_path)
    loaded = load_scene(scene)
    request = Request(read_keys(fit), robust=robust, priors=priors)
    each = _each(kinds, len(files))
    read = [
        read_readings(name, loaded, kind)
        for name, kind in zip((*data, *predict), each, strict=True)
    ]
    sets, held = read[: len(data)], read[len(data) :]
    with progress("fitting", silent=as_json):
        found = find(loaded, sets, request, held)
    circles = [
        circle
        for one in sets
        if one.kind == "sphere"
        for circle in circles_of(read_table(find_data(one.source)), loaded)
    ]
    apart: dict[tuple[str, ...], str] = {}
    steps: Sequence[Step] = ()
    if next_count is not None or found.rank.confounded:
        with progress("looking for further measurements", silent=as_json):
            apart = separating(loaded, sets, found)
            steps = next_best(loaded, sets, found, next_count) if next_count is not None else ()
    if target is not None:
        _write_scene(target, found, force=force)
    if csv_path is not None:
        _write_csv(csv_path, found, force=force)
    if plot is not None:
        from warpspace.outputs.charts import calibration_chart, write_chart

        write_chart(
            calibration_chart(found, f"Calibration · {loaded.title}"), plot, overwrite=force
        )
    if as_json:
        print_json(_json(found, circles, apart, steps))
        return
    _print(loaded, found, sets, circles)
    _print_apart(found, apart, steps)
    for path in filter(None, (output, csv_path, plot)):
        echo(f"wrote {path}")


def _each(kinds: Sequence[str], files: int) -> Sequence[str | None]:
    """Give each file its kind.

    Raises
    ------
    OptionError
        If there are neither one nor as many kinds as files.
    """
    if len(kinds) <= 1:
        return [kinds[0] if kinds else None] * files
    if len(kinds) != files:
        raise OptionError(
            f"--kind is given {len(kinds)} times for {files} files; expected 1 or {files}"
        )
    return kinds


def _target(
    output: str | None, endings: Sequence[str], scene: str, files: "Sequence[Path]", *, force: bool
) -> "Path | None":
    """Check where the scene is to be written; neither the scene nor the data are replaced."""
    if output is None:
        return None
    from warpspace.outputs.files import check_target

    target = check_output(output, endings, force=force, scenes=[scene])
    return check_target(target, endings, overwrite=force, inputs=files)


def _write_scene(target: "Path", found: "Calibration", *, force: bool) -> None:
    """Write the calibrated scene."""
    from warpspace.outputs.files import write_atomically
    from warpspace.scene.save import scene_to_toml

    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(scene_to_toml(found.scene), encoding="utf-8")


def _write_csv(path: str, found: "Calibration", *, force: bool) -> None:
    """Write the residuals, one line a reading."""
    import csv
    from pathlib import Path

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
    from pathlib import Path

    readings = group.readings
    rows: list[list[object]] = []
    for at, line in enumerate(readings.lines):
        before = [*map(float, group.before_mm[at]), "", ""][:3]
        after = [*map(float, group.after_mm[at]), "", ""][:3]
        session = readings.session[at].lstrip("=+-@\t\r")
        places = [float(readings.coordinates[name][at]) for name in axes]
        rows.append([Path(readings.source).name, line, session, *places, *before, *after])
    return rows


def _json(
    found: "Calibration",
    circles: "Sequence[Circle]",
    apart: dict[tuple[str, ...], str],
    steps: "Sequence[Step]",
) -> dict[str, object]:
    """Spell all of it as the JSON output has it."""
    from dataclasses import asdict
    from pathlib import Path

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


def _print(
    scene: "Scene", found: "Calibration", sets: "Sequence[Readings]", circles: "Sequence[Circle]"
) -> None:
    """Print what was found and what is left."""
    from pathlib import Path

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


def _print_apart(
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
