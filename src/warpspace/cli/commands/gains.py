"""Command `gains`: how much of each error arrives at the functional point, and the lever behind."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import check_targets, csv_option, force_option, plot_option
from warpspace.cli.options import (
    at_option,
    json_option,
    loop_option,
    parse_point,
    print_json,
    scene_argument,
    warn_outside_travel,
)
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from warpspace.analysis.gains import Gain
    from warpspace.scene.model import Scene


@click.command()
@scene_argument()
@loop_option
@at_option
@click.option(
    "--max",
    "over_travel",
    is_flag=True,
    help="The largest absolute gains over the machine's travel instead of those at a point.",
)
@click.option(
    "--step",
    "step_deg",
    type=float,
    help="With --max: step of rotary axes in degrees (ends of linear axes are exact).  [1; 5 for"
    " three rotary axes]",
)
@click.option(
    "--share",
    type=float,
    default=0.8,
    show_default=True,
    help="Key errors: the largest that together make up this share of the sum of squares.",
)
@csv_option
@plot_option("chart")
@force_option
@json_option
def gains(
    scene: str,
    loop: str,
    points: tuple[str, ...],
    step_deg: float | None,
    share: float,
    csv_path: str | None,
    plot: str | None,
    *,
    force: bool,
    over_travel: bool,
    as_json: bool,
) -> None:
    """Rank the error parameters of SCENE by their gain.

    A gain is the displacement of the functional point per unit of an error: µm per µm or µm per
    µrad, signed at a point (--at, by default the middle of the scene's ranges). The lever from the
    origin of the frame an error sits in to the point explains it: 1 m gives 1 µm per µrad.
    """
    from warpspace.scene import verbs
    from warpspace.scene.library import load_scene

    if len(points) > 1 or (points and over_travel):
        raise OptionError("--at: expected one point, and none with --max")
    if step_deg is not None and not over_travel:
        raise OptionError("--step belongs to --max")
    check_targets(scene, force=force, plot=plot, csv_path=csv_path)
    loaded = load_scene(scene)
    place = parse_point(points[0], loaded.machine.axes) if points else None
    warn_outside_travel(loaded.machine, place or {})
    with progress("computing", silent=as_json):
        found = verbs.gains(
            loaded,
            at=place,
            loop=loop,
            over_travel=over_travel,
            step_deg=step_deg,
            share=share,
        )
    where = _where(found, loop, over_travel=over_travel)
    if csv_path is not None:
        _write_csv(csv_path, loaded, found, force=force)
    if plot is not None:
        from warpspace.outputs.charts import write_chart

        chart = _chart(loaded, found, where, share, signed=not over_travel)
        write_chart(chart, plot, overwrite=force)
    if as_json:
        print_json({"gains": [_json_row(gain) for gain in found]})
        return
    print_text(f"{loaded.machine.title} · {where}")
    _print_table(loaded, found, over_travel=over_travel)
    keys = sum(gain.is_key for gain in found)
    print_text(
        f"  * key errors: the largest {keys} make up {share:.0%} of the sum of squares, one µm and"
        " one µrad counted alike"
    )


def thesis_keys(scene: "Scene") -> tuple[str, ...]:
    """Give the key errors of the thesis (table 4-7) for its machine, none for any other."""
    from warpspace.analysis.thesis.rows import printed_tables

    if scene.machine.name != "dvf5000":
        return ()
    return tuple(key for key, row in printed_tables()["table_4_7"].items() if isinstance(row, list))


def _where(found: "Sequence[Gain]", loop: str, *, over_travel: bool) -> str:
    """Say which loop and point the gains belong to."""
    if over_travel:
        return f"{loop} loop · largest absolute gains over the travel"
    at = ", ".join(f"{name} {value:g}" for name, value in found[0].at.items())
    return f"{loop} loop · gains at {at}"


def _json_row(gain: "Gain") -> dict[str, object]:
    """Spell one gain as the JSON output has it."""
    return {
        "key": gain.key,
        "symbol": gain.parameter.symbol,
        "unit": gain.unit,
        "x": gain.x,
        "y": gain.y,
        "z": gain.z,
        "norm": gain.norm,
    }


def _explain(gain: "Gain") -> str:
    """Read a gain off its lever: the coordinate of the lever that is the largest component."""
    if not gain.parameter.is_rotation:
        return ""
    largest = max(abs(gain.x), abs(gain.y), abs(gain.z))
    for index, length in enumerate(gain.lever_mm):
        if largest > 0.0 and abs(abs(length) * 1e-3 - largest) < 1e-9:
            parts = [
                f"{vector[index]:+g} {name}"
                for name, vector in gain.lever_parts_mm
                if abs(vector[index]) > 1e-6
            ]
            total = f"{'xyz'[index]}: {length:+g} mm"
            return f"{total} = {' '.join(parts)}" if len(parts) > 1 else total
    return ""


def _print_table(scene: "Scene", found: "Sequence[Gain]", *, over_travel: bool) -> None:
    """Print the ranked table."""
    marked = thesis_keys(scene)
    columns = (
        Column(leads=True),
        Column("key", leads=True),
        Column("symbol"),
        *number_columns(("|E|", "x", "y", "z")),
        Column("unit"),
        *((Column("thesis"),) if marked else ()),
        Column("name", wraps=True),
        *number_columns(("lever x", "y", "z"), "mm"),
        Column(
            "lever of |E| at" if over_travel else "largest component read off the lever", wraps=True
        ),
    )
    rows = [
        (
            *("*" if gain.is_key else "", gain.key, gain.parameter.symbol),
            *(f"{value:.3f}" for value in (gain.norm, gain.x, gain.y, gain.z)),
            gain.unit,
            *(("key" if gain.key in marked else "",) if marked else ()),
            gain.parameter.name,
            *(f"{value:.6g}" if gain.parameter.is_rotation else "" for value in gain.lever_mm),
            _place(gain) if over_travel else _explain(gain),
        )
        for gain in found
    ]
    print_table(columns, rows)


def _place(gain: "Gain") -> str:
    """Say where on the travel a gain is largest: the axes of its kind, linear or rotary."""
    from warpspace.machine.axes import is_rotary

    if not gain.parameter.is_rotation:
        return ""
    rotary = is_rotary(gain.parameter.axis)
    return ", ".join(
        f"{name} {value:g}" for name, value in gain.at.items() if is_rotary(name) == rotary
    )


def _write_csv(path: str, scene: "Scene", found: "Sequence[Gain]", *, force: bool) -> None:
    """Write one row a parameter, lever and axis positions included."""
    import csv

    from warpspace.outputs.files import write_atomically

    marked = thesis_keys(scene)
    axes = [f"{name}_{'mm' if name in 'XYZ' else 'deg'}" for name in found[0].at]
    lever = ("lever_x_mm", "lever_y_mm", "lever_z_mm")
    head = ("key", "symbol", "name", "unit", "x", "y", "z", "norm", *lever, "key_error")
    with (
        write_atomically(path, overwrite=force) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file)
        writer.writerow((*head, "thesis_key_error", *axes))
        for gain in found:
            numbers = (gain.x, gain.y, gain.z, gain.norm, *gain.lever_mm)
            writer.writerow(
                (
                    *(gain.key, gain.parameter.symbol, gain.parameter.name, gain.unit),
                    *(f"{number:.9g}" for number in numbers),
                    int(gain.is_key),
                    int(gain.key in marked),
                    *(f"{number:.9g}" for number in gain.at.values()),
                )
            )


def _chart(
    scene: "Scene", found: "Sequence[Gain]", where: str, share: float, *, signed: bool
) -> "Figure":
    """Draw the chart."""
    from warpspace.outputs.charts import gains_chart

    title = f"Error gains · {scene.machine.title}"
    return gains_chart(found, title, where, share, signed=signed)
