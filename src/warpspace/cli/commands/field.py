"""Command `field`: errors at points, or over the grid of the working volume."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import (
    check_output,
    check_targets,
    csv_option,
    force_option,
    output_option,
    size_text,
)
from warpspace.cli.options import (
    at_option,
    direction_option,
    grid_option,
    json_option,
    loop_option,
    parse_point,
    scene_argument,
    spell_json,
    warn_outside_travel,
)
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.uncertain import FieldUncertainty
    from warpspace.field.basis import ErrorField
    from warpspace.field.evaluate import View
    from warpspace.field.grid import Grid
    from warpspace.scene.model import Scene
    from warpspace.units import Array

MAX_LISTED = 20
POINTS_AT_ONCE = 5000
"""Points that are turned into JSON at a time."""


@click.command()
@scene_argument()
@at_option
@grid_option(None)
@loop_option
@direction_option
@click.option(
    "--uncertainty",
    "uncertain",
    is_flag=True,
    help="Also what the standard uncertainties of SCENE's errors give (k = 1, first order).",
)
@click.option("--exact", is_flag=True, help="Full rotations and all products, not the first order.")
@click.option(
    "--frame",
    type=click.Choice(("machine", "workpiece")),
    default="machine",
    show_default=True,
    help="Frame of the resulting vectors.",
)
@csv_option
@output_option(
    "Write all points to this file: .parquet, .npz, .csv or, of a grid, .vts.", required=False
)
@force_option
@json_option
def field(
    scene: str,
    points: tuple[str, ...],
    grid: int | None,
    loop: str,
    frame: str,
    direction: str | None,
    csv_path: str | None,
    output: str | None,
    *,
    force: bool,
    exact: bool,
    uncertain: bool,
    as_json: bool,
) -> None:
    """Evaluate the errors of SCENE at points or over a grid.

    Errors are actual − nominal, in µm; the orientation error is the rotation vector of the tool
    axis, in µrad. Without --at the grid of the working volume is evaluated.
    """
    from dataclasses import asdict

    from warpspace.analysis.statistics import statistics, volume_statistics
    from warpspace.picture.coordinates import own_axes, spell_at, spell_point
    from warpspace.picture.words import direction_words
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import choose_view, in_direction

    if points and grid is not None:
        raise OptionError("--at and --grid exclude each other; give one of them")
    check_targets(scene, force=force, csv_path=csv_path)
    if output is not None:
        _check_output(output, scene, force=force, points=bool(points))
    loaded = in_direction(load_scene(scene), direction)
    view = choose_view(loaded, loop, frame)
    spread = None
    with progress("evaluating", silent=as_json):
        axes, result, nodes = _evaluate(loaded, points, grid, view, exact=exact)
        if uncertain:
            from warpspace.scene.uncertainty import evaluate_uncertainty

            at = axes if points else None
            spread = evaluate_uncertainty(loaded, at=at, grid=grid, loop=loop, frame=frame)
        plain = statistics(result, axes)
        summary = plain if nodes is None else volume_statistics(result, nodes)
    files = [path for path in (csv_path, output) if path is not None]
    if files:
        from warpspace.outputs.exports.fields import FieldRecord, write_field
        from warpspace.picture.scene_picture import field_remarks

        about = {**field_remarks(loaded, view, exact=exact), "frame": frame}
        with progress("writing", silent=as_json):
            for path in files:
                write_field(FieldRecord(axes, result, about, spread), path, overwrite=force)
    if spread is not None:
        from warpspace.scene.uncertainty import flat_uncertainty

        spread = flat_uncertainty(spread)
    if as_json:
        found = {"statistics": asdict(summary)}
        if nodes is not None:
            found["statistics_nodes"] = asdict(plain)
        if output is not None:
            size = {"output": output, "points_written": result.norm_um.size}
            click.echo(spell_json({**size, **found}))
            return
        _print_json(axes, result, found, spread)
        return
    words = (f"{loop} loop", *direction_words(loaded), "exact" if exact else "first order")
    print_text(" · ".join((loaded.title, *words)))
    if points:
        units = [loaded.machine.axes[name].unit for name in axes]
        _list_points(axes, result, units, spread)
    over = "" if nodes is None else ", over the volume"
    print_text(
        f"  {result.norm_um.size} points{over}: mean {summary.mean_um:.2f},"
        f" RMS {summary.rms_um:.2f}, P95 {summary.p95_um:.2f}, max {summary.max_um:.2f} µm"
    )
    if spread is not None:
        print_text(
            f"  standard uncertainty of |E|: mean {spread.norm_um.mean():.2f},"
            f" max {spread.norm_um.max():.2f} µm"
        )
    if nodes is not None:
        print_text(f"  each node counted once: mean {plain.mean_um:.2f} µm")
    worst = own_axes(loaded, summary.max_at_axes)
    print_text(f"  max at {spell_point(worst, summary.max_at_mm)} mm")
    print_text(f"  --at {spell_at(worst)}")
    for path in files:
        print_text(f"  {path}: {size_text(Path(path))}")


def _check_output(output: str, scene: str, *, force: bool, points: bool) -> None:
    """Refuse a file that cannot be written, or cannot hold what it is to hold."""
    from warpspace.outputs.exports.fields import FIELD_ENDINGS, GRID_ENDINGS

    target = check_output(output, FIELD_ENDINGS, force=force, scenes=(scene,))
    if points and target.suffix.lower() in GRID_ENDINGS:
        others = ", ".join(ending for ending in FIELD_ENDINGS if ending not in GRID_ENDINGS)
        raise OptionError(
            f"{output}: a {target.suffix} file holds a grid, --at gives points; expected {others}"
        )


def _evaluate(
    scene: "Scene", points: tuple[str, ...], grid: int | None, view: "View", *, exact: bool
) -> "tuple[Mapping[str, Array], ErrorField, Grid | None]":
    """Evaluate at the points given or over the grid; axis positions broadcast to the field."""
    import numpy as np

    from warpspace.field.grid import DEFAULT_NODES, build_grid
    from warpspace.kinematics.model import complete_coordinates
    from warpspace.scene.pipeline import evaluate, evaluate_grid

    if points:
        typed = [parse_point(text, scene.machine.axes) for text in points]
        full = [
            complete_coordinates(scene.machine, point, scene.workspace.positions) for point in typed
        ]
        axes = {name: np.array([point[name] for point in full]) for name in scene.machine.axes}
        found = evaluate(scene, at=axes, loop=view.loop, exact=exact, frame=view.frame)
        for point in typed:
            warn_outside_travel(scene.machine, point)
        return axes, found, None
    nodes = DEFAULT_NODES if grid is None else grid
    built = build_grid(scene.model, scene.workspace, nodes)
    return built.coordinates, evaluate_grid(scene, built, view, exact=exact), built


def _print_json(
    axes: "Mapping[str, Array]",
    result: "ErrorField",
    found: "Mapping[str, Mapping[str, object]]",
    spread: "FieldUncertainty | None",
) -> None:
    """Print the JSON object piece by piece: a million points are never held as one text."""
    import numpy as np

    from warpspace.field.basis import ErrorField

    arrays = (result.nominal_mm, result.error_um, result.norm_um, result.orientation_urad)
    if not all(np.isfinite(values).all() for values in arrays):
        raise OptionError("the field has points whose error is no number; JSON cannot hold them")
    click.echo('{"points": [', nl=False)
    nominal, error, orientation = (
        values.reshape(-1, 3)
        for values in (result.nominal_mm, result.error_um, result.orientation_urad)
    )
    positions = {
        name: np.broadcast_to(values, result.norm_um.shape).reshape(-1)
        for name, values in axes.items()
    }
    for start in range(0, result.norm_um.size, POINTS_AT_ONCE):
        part = slice(start, start + POINTS_AT_ONCE)
        rows = _rows(
            {name: values[part] for name, values in positions.items()},
            ErrorField(nominal[part], error[part], orientation[part]),
        )
        if spread is not None:
            for index, row in enumerate(rows, start=start):
                row["uncertainty_um"] = spread.error_um[index].tolist()
                row["uncertainty_norm_um"] = float(spread.norm_um[index])
                row["uncertainty_urad"] = spread.orientation_urad[index].tolist()
        click.echo((", " if start else "") + spell_json(rows)[1:-1], nl=False)
    click.echo(
        "]" + "".join(f', "{name}": {spell_json(part)}' for name, part in found.items()) + "}"
    )


def _rows(axes: "dict[str, Array]", result: "ErrorField") -> list[dict[str, object]]:
    """Spell points as the JSON output has them."""
    positions = [dict(zip(axes, row, strict=True)) for row in zip(*axes.values(), strict=True)]
    return [
        {
            "axes": {name: float(value) for name, value in position.items()},
            "nominal_mm": nominal,
            "error_um": error,
            "norm_um": norm,
            "orientation_urad": orientation,
        }
        for position, nominal, error, norm, orientation in zip(
            positions,
            result.nominal_mm.tolist(),
            result.error_um.tolist(),
            result.norm_um.tolist(),
            result.orientation_urad.tolist(),
            strict=True,
        )
    ]


def _list_points(
    axes: "Mapping[str, Array]",
    result: "ErrorField",
    units: "Sequence[str]",
    spread: "FieldUncertainty | None",
) -> None:
    """Print the first points, one line each."""
    listed = min(result.norm_um.size, MAX_LISTED)
    errors, tilts = result.error_um.tolist(), result.orientation_urad.tolist()
    places = result.nominal_mm.tolist()
    columns = (
        Column("point", is_number=True, leads=True),
        *(
            Column(f"axis {name}", unit, is_number=True)
            for name, unit in zip(axes, units, strict=True)
        ),
        *number_columns(("in R x", "y", "z"), "mm"),
        *number_columns(("error x", "y", "z", "|E|"), "µm"),
        *number_columns(("tilt x", "y", "z"), "µrad"),
        *number_columns(() if spread is None else ("u x", "y", "z", "u |E|"), "µm"),
    )
    rows = [
        (
            str(index + 1),
            *(f"{values[index]:g}" for values in axes.values()),
            *(f"{value:g}" for value in places[index]),
            *(f"{value:+.3f}" for value in errors[index]),
            f"{result.norm_um[index]:.3f}",
            *(f"{value:+.3f}" for value in tilts[index]),
            *(() if spread is None else _spelled(spread, index)),
        )
        for index in range(listed)
    ]
    print_table(columns, rows)
    if result.norm_um.size > MAX_LISTED:
        print_text(f"  … {result.norm_um.size - MAX_LISTED} more; -o, --csv or --json has all")


def _spelled(spread: "FieldUncertainty", index: int) -> list[str]:
    """Spell the standard uncertainty of one point."""
    return [f"{value:.3f}" for value in (*spread.error_um[index], spread.norm_um[index])]
