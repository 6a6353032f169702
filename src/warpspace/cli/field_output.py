"""Output of the command `field`: points, statistics, files and JSON of an error field."""

from collections.abc import Mapping, Sequence

import click
import numpy as np

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.analysis.description import to_json
from warpspace.analysis.statistics import statistics, volume_statistics
from warpspace.analysis.uncertainty import propagation
from warpspace.cli import shared_options
from warpspace.cli.analyses import print_blocks
from warpspace.cli.tables import print_text, progress
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField, View, placed_words
from warpspace.field.grid import DEFAULT_NODES, Grid, build_grid
from warpspace.kinematics.model import complete_coordinates
from warpspace.picture.formatting import direction_words, point_axes, spell_at, spell_point
from warpspace.scene import model
from warpspace.units import Array

MAX_LISTED = 20
POINTS_AT_ONCE = 5000  # points that are converted to JSON at a time


def print_field(
    scene: str,
    points: tuple[str, ...],
    grid: int | None,
    loop: str | None,
    frame: str,
    direction: str | None,
    csv_path: str | None,
    output: str | None,
    *,
    force: bool,
    exact: bool,
    placed: bool,
    as_json: bool,
) -> None:
    if points and grid is not None:
        raise OptionError("--at and --grid exclude each other; use one of them")
    if points and output is not None and output.lower().endswith(".vts"):
        endings = ", ".join(ending for ending in shared_options.FIELDS if ending != ".vts")
        raise OptionError(
            f"{output}: a .vts file holds a grid, --at defines points; expected {endings}"
        )
    files = [path for path in (csv_path, output) if path is not None]
    loaded = shared_options.load_placed(scene, direction, loop, placed=placed)
    view = model.choose_view(loaded, loop, frame)
    with progress("evaluating", silent=as_json):
        axes, result, nodes = _evaluate(loaded, points, grid, view, exact=exact)
        places = axes if nodes is None else None
        estimate: dict[str, float] = {}
        if not exact:
            first = result if nodes is None and frame == model.FRAMES[0] else None
            orders = model.second_order(loaded, loop, at=places, first=first)
            estimate = shared_options.warn_second_order(orders)
        node_statistics = statistics(result, axes)
        u95 = {}
        if nodes is None:
            uncertainty = propagation.field_uncertainty(loaded, result.error_um, axes, view)
            summary = node_statistics
            u95 = uncertainty.columns if uncertainty and uncertainty.errors.is_known else {}
        else:
            uncertainty = propagation.volume_uncertainty(loaded, view, max(nodes.shape))
            summary = volume_statistics(result, nodes)
            if files or as_json:
                u95 = propagation.u95_columns(loaded, result, axes, view, nodes.point_mm)
        summary = uncertainty.with_expanded_uncertainty(summary) if uncertainty else summary
    if files:
        from warpspace.outputs.exports.fields import FieldRecord, write_field
        from warpspace.picture.model import field_remarks

        about = {**field_remarks(loaded, view, exact=exact), "frame": frame}
        with progress("writing", silent=as_json):
            for path in files:
                write_field(FieldRecord(axes, result, about, u95), path, overwrite=force)
    if as_json:
        document: dict[str, object] = {"loop": view.loop, "frame": frame}
        document["statistics"] = to_json(summary)
        if view.placed_over is not None:
            document["placement"] = "fitted out"
        document |= estimate
        if view.reference is not None:
            document["reference"] = dict(view.reference)
        if nodes is not None:
            document["statistics_nodes"] = to_json(node_statistics)
        if output is not None:
            size = {"output": output, "points_written": result.norm_um.size}
            click.echo(shared_options.spell_json({**size, **document}))
            return
        if uncertainty and uncertainty.errors.unknown:
            document["unknown"] = uncertainty.errors.unknown
        if nodes is None and uncertainty and u95:
            u95["covariance_um2"] = uncertainty.covariance_um2
            if loaded.limit_um is not None:
                u95["probability"] = uncertainty.conformance_probability(loaded.limit_um)
        _print_json(axes, result, document, u95)
        return
    conditions = (*direction_words(loaded), *placed_words(view))
    headings = (f"{view.loop} loop", *conditions, "exact" if exact else "first order")
    print_text(" · ".join((loaded.title, *headings)))
    if points:
        units = [loaded.machine.axes[name].unit for name in axes]
        _list_points(axes, result, units, u95)
    volume = "" if nodes is None else ", over the volume"
    print_text(
        f"  {result.norm_um.size} points{volume}: mean {summary.mean_um:.2f},"
        f" RMS {summary.rms_um:.2f}, P95 {summary.p95_um:.2f}, max {summary.max_um:.2f} µm"
    )
    for line in propagation.u95_lines(uncertainty and uncertainty.errors, {"": summary}):
        print_text(line)
    if nodes is not None:
        print_text(f"  each node counted once: mean {node_statistics.mean_um:.2f} µm")
    worst = point_axes(loaded, summary.max_at_axes)
    print_text(f"  max at {spell_point(worst, summary.max_at_mm)} mm")
    print_text(f"  --at {spell_at(worst)}")
    for path in files:
        print_text(f"  {path}: {shared_options.size_text(path)}")


def _evaluate(
    scene: model.Scene, points: tuple[str, ...], grid: int | None, view: View, *, exact: bool
) -> tuple[Mapping[str, Array], ErrorField, Grid | None]:
    if points:
        typed = [shared_options.parse_point(text, scene.machine.axes) for text in points]
        full = [
            complete_coordinates(scene.machine, point, scene.workspace.positions) for point in typed
        ]
        axes = {name: np.array([point[name] for point in full]) for name in scene.machine.axes}
        error_field = model.evaluate(scene, at=axes, loop=view.loop, exact=exact, frame=view.frame)
        for point in typed:
            shared_options.warn_outside_travel(scene.machine, point)
        return axes, error_field, None
    nodes = build_grid(scene.model, scene.workspace, DEFAULT_NODES if grid is None else grid)
    return nodes.coordinates, model.evaluate_grid(scene, nodes, view, exact=exact), nodes


def _print_json(
    axes: Mapping[str, Array],
    result: ErrorField,
    document: Mapping[str, object],
    u95: Mapping[str, Array],
) -> None:
    """Print the JSON object in pieces: the text of a million points would not fit."""
    columns = {
        "nominal_mm": result.nominal_mm,
        "error_um": result.error_um,
        "norm_um": result.norm_um,
        "orientation_urad": result.orientation_urad,
    }
    if not all(np.isfinite(values).all() for values in columns.values()):
        raise OptionError("errors of the field are not finite; JSON cannot represent them")
    columns |= u95
    shape, size = result.norm_um.shape, result.norm_um.size
    positions = [np.broadcast_to(values, shape).reshape(-1) for values in axes.values()]
    flat = [values.reshape(size, *values.shape[len(shape) :]) for values in columns.values()]
    click.echo('{"points": [', nl=False)
    for start in range(0, size, POINTS_AT_ONCE):
        part = slice(start, start + POINTS_AT_ONCE)
        places = zip(*(values[part].tolist() for values in positions), strict=True)
        numbers = zip(*(values[part].tolist() for values in flat), strict=True)
        rows = [
            {"axes": dict(zip(axes, place, strict=True)), **dict(zip(columns, row, strict=True))}
            for place, row in zip(places, numbers, strict=True)
        ]
        click.echo((", " if start else "") + shared_options.spell_json(rows)[1:-1], nl=False)
    entries = [f', "{name}": {shared_options.spell_json(part)}' for name, part in document.items()]
    click.echo(f"]{''.join(entries)}}}")


def _list_points(
    axes: Mapping[str, Array], result: ErrorField, units: Sequence[str], u95: Mapping[str, Array]
) -> None:
    columns = (
        Column("point", "d", leads=True),
        *(Column(f"axis {name}", "g", unit) for name, unit in zip(axes, units, strict=True)),
        *number_columns(("in R x", "y", "z"), "g", "mm"),
        *number_columns(("error x", "y", "z"), "+.3f", "µm"),
        Column("|E|", ".3f", "µm", joins=True),
        *number_columns(("tilt x", "y", "z"), "+.3f", "µrad"),
        *number_columns(("U95 x", "y", "z", "U95 |E|") if u95 else (), ".3f", "µm"),
    )
    rows = [
        (
            index + 1,
            *(values[index] for values in axes.values()),
            *result.nominal_mm[index],
            *result.error_um[index],
            result.norm_um[index],
            *result.orientation_urad[index],
            *((*u95["u95_um"][index], u95["u95_norm_um"][index]) if u95 else ()),
        )
        for index in range(min(result.norm_um.size, MAX_LISTED))
    ]
    print_blocks([Table(columns, rows)])
    if result.norm_um.size > MAX_LISTED:
        print_text(f"  … {result.norm_um.size - MAX_LISTED} more; -o, --csv or --json has all")
