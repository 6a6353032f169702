"""Command `measured`: measured machines against their tolerances, and what the model predicts."""

from typing import TYPE_CHECKING

import click

from warpspace.cli.options import (
    grid_option,
    json_option,
    loop_option,
    print_json,
    scene_argument,
)
from warpspace.cli.tables import Column, print_table, print_text

if TYPE_CHECKING:
    from warpspace.analysis.measured import Check, Measured
    from warpspace.scene.model import Scene


@click.command()
@scene_argument("scenes", nargs=-1, required=True)
@click.option(
    "--tolerances",
    metavar="SCENE",
    help="Take the tolerances of this scene, for instance dvf5000_proposed.  [each scene's own]",
)
@loop_option
@grid_option(11, "of the predicted map")
@json_option
def measured(
    scenes: tuple[str, ...], tolerances: str | None, loop: str, grid: int, *, as_json: bool
) -> None:
    """Set the errors of each SCENE against its tolerances.

    Each error lies within its tolerance or outside it. Beside the predicted error
    stands what the LaserTRACER gave, for the machines of the thesis. The shear is that of the best
    affine fit to the predicted map: which plane became a rhombus.
    """
    from warpspace.scene import verbs
    from warpspace.scene.library import load_scene

    loaded = [load_scene(name) for name in scenes]
    limits = None if tolerances is None else load_scene(tolerances).tolerances
    found = [verbs.measured(scene, tolerances=limits, loop=loop, grid=grid) for scene in loaded]
    pairs = list(zip(loaded, found, strict=True))
    if as_json:
        print_json({"machines": [_json(scene, result) for scene, result in pairs]})
        return
    for scene, result in pairs:
        _print(scene, result)


def laser_tracer_um(scene: "Scene") -> float | None:
    """Give the volumetric error measured on a machine of the thesis, µm; None for any other."""
    from warpspace.analysis.thesis.machines import MACHINES
    from warpspace.analysis.thesis.rows import printed_tables

    names = [f"dvf5000_{name}" for name in MACHINES]
    if scene.name not in names:
        return None
    return float(printed_tables()["table_5_5"]["volumetric_um"][names.index(scene.name)])


def _json(scene: "Scene", result: "Measured") -> dict[str, object]:
    """Spell a machine as the JSON output has it."""
    from dataclasses import asdict

    return {
        "scene": scene.name,
        "checks": [{**asdict(check), "passes": check.passes} for check in result.checks],
        "predicted": asdict(result.predicted),
        "statistics_nodes": asdict(result.predicted_nodes),
        "measured_um": laser_tracer_um(scene),
        "shear_urad": result.shear_urad,
    }


def _print(scene: "Scene", result: "Measured") -> None:
    """Print a machine."""
    print_text(scene.title)
    columns = (
        *(Column("limit"), Column("key")),
        *(Column("value", is_number=True), Column("unit"), Column("tolerance")),
    )
    rows = [
        (_verdict(check), check.key, f"{check.value:.1f}", check.unit, _limits(check))
        for check in result.checks
    ]
    print_table(columns, rows)
    measured_um = laser_tracer_um(scene)
    beside = "" if measured_um is None else f"; LaserTRACER {measured_um:g} µm"
    print_text(
        f"  predicted |E|: mean {result.predicted.mean_um:.2f}, RMS {result.predicted.rms_um:.2f},"
        f" max {result.predicted.max_um:.2f} µm over the volume;"
        f" mean of the nodes {result.predicted_nodes.mean_um:.2f} µm{beside}"
    )
    shears = ", ".join(f"{plane} {value:+.1f}" for plane, value in result.shear_urad.items())
    print_text(f"  shear of the volume: {shears} µrad")


def _verdict(check: "Check") -> str:
    """Say whether an error keeps its tolerance."""
    return {True: "within", False: "outside", None: "none"}[check.passes]


def _limits(check: "Check") -> str:
    """Spell a tolerance."""
    if check.centre is None or check.half_width is None:
        return "no tolerance"
    return f"{check.centre:g} ± {check.half_width:g}"
