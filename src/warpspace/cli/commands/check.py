"""Command `check`: validate a scene and say what it holds, or set its errors against tolerances."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from warpspace.analysis.blocks import Block, Column, Table
from warpspace.cli.analyses import print_blocks
from warpspace.cli.guard import SceneName
from warpspace.cli.options import (
    RenamedOption,
    grid_option,
    json_option,
    loop_option,
    print_json,
    say_first_order,
    say_second_order,
    scene_argument,
)
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.measured import Check, Measured
    from warpspace.scene.model import Scene

OWN = "own"


@click.command()
@scene_argument("scenes", nargs=-1, required=True)
@click.option(
    "--against",
    cls=RenamedOption,
    former=("--tolerances",),
    type=SceneName(),
    metavar="SCENE|own",
    help="Set each error against the tolerances of this scene, for instance dvf5000_proposed, or of"
    " its own, and say what the model predicts. Then several SCENES may be named.",
)
@loop_option
@grid_option(11, "of the predicted map, with --against")
@json_option
def check(
    scenes: tuple[str, ...], against: str | None, loop: str, grid: int, *, as_json: bool
) -> None:
    """Validate SCENE and say what it holds.

    All problems of a file are reported at once, each with its key, its value and what was expected.

    With --against each error lies within its tolerance or outside it. Beside the predicted error
    stands what the LaserTRACER gave, for the machines of the thesis. The shear is that of the best
    affine fit to the predicted map: which plane became a rhombus.
    """
    from warpspace.analysis.measured import measured
    from warpspace.scene.library import load_scene

    loaded = [load_scene(name) for name in scenes]
    if against is None:
        if len(scenes) > 1:
            raise OptionError(f"{len(scenes)} scenes; expected one, or --against")
        _check(*loaded, as_json=as_json)
        return
    limits = None if against == OWN else load_scene(against).tolerances
    found = [measured(scene, tolerances=limits, loop=loop, grid=grid) for scene in loaded]
    say_first_order(loop, *loaded)
    pairs = list(zip(loaded, found, strict=True))
    if as_json:
        print_json({"machines": [_json(scene, result) for scene, result in pairs]})
        return
    for scene, result in pairs:
        print_blocks(_against(scene, result))


def _check(scene: "Scene", *, as_json: bool) -> None:
    from warpspace.bodies.own_meshes import check_meshes
    from warpspace.scene.model import second_order

    notes = (*scene.notes, *check_meshes(scene.machine))
    found = second_order(scene)
    say_second_order(found)
    non_zero = [key for key in scene.errors if scene.errors.amplitude(key) != 0.0]
    if as_json:
        print_json(
            {
                "scene": scene.name,
                "title": scene.title,
                "machine": scene.machine.name,
                "chain": str(scene.machine.chain),
                "parameters": len(scene.parameter_keys),
                "non_zero": non_zero,
                "linearisation_error_um": found.um,
                "notes": list(notes),
            }
        )
        return
    facts = [("machine", f"{scene.machine.title}, chain {scene.machine.chain}")]
    for name, (low, high) in scene.workspace.ranges.items():
        span = f"{low:g}" if low == high else f"{low:g} … {high:g}"
        facts.append((name, f"{span} {scene.machine.axes[name].unit}"))
    count = f"{len(non_zero)} of {len(scene.parameter_keys)} parameters not zero"
    facts.append(("errors", count + (f": {', '.join(non_zero)}" if non_zero else "")))
    facts.append(("first order", f"differs from the exact chain by at most {found.um:.2g} µm"))
    facts.extend(("note", note) for note in notes)
    columns = (Column(leads=True), Column(wraps=True))
    print_blocks((f"{scene.name}: valid. {scene.title}", Table(columns, facts)))


def laser_tracer_um(scene: "Scene") -> float | None:
    """Give the volumetric error measured on a machine of the thesis, µm; None for any other."""
    from warpspace.analysis.thesis.table import MACHINES, printed_tables

    names = [f"dvf5000_{name}" for name in MACHINES]
    if scene.name not in names:
        return None
    return float(printed_tables()["table_5_5"]["volumetric_um"][names.index(scene.name)])


def _json(scene: "Scene", result: "Measured") -> dict[str, object]:
    from dataclasses import asdict

    return {
        "scene": scene.name,
        "checks": [{**asdict(check), "passes": check.passes} for check in result.checks],
        "predicted": asdict(result.predicted),
        "statistics_nodes": asdict(result.predicted_nodes),
        "measured_um": laser_tracer_um(scene),
        "shear_urad": result.shear_urad,
    }


def _against(scene: "Scene", result: "Measured") -> Iterator[Block]:
    yield scene.title
    columns = (
        Column("limit"),
        Column("key"),
        Column("value", ".1f"),
        Column("unit"),
        Column("tolerance", _limits),
    )
    verdicts = {True: "within", False: "outside", None: "none"}
    rows = [(verdicts[one.passes], one.key, one.value, one.unit, one) for one in result.checks]
    yield Table(columns, rows)
    measured_um = laser_tracer_um(scene)
    beside = "" if measured_um is None else f"; LaserTRACER {measured_um:g} µm"
    yield (
        f"  predicted |E|: mean {result.predicted.mean_um:.2f}, RMS {result.predicted.rms_um:.2f},"
        f" max {result.predicted.max_um:.2f} µm over the volume;"
        f" mean of the nodes {result.predicted_nodes.mean_um:.2f} µm{beside}"
    )
    shears = ", ".join(f"{plane} {value:+.1f}" for plane, value in result.shear_urad.items())
    yield f"  shear of the volume: {shears} µrad"


def _limits(check: "Check") -> str:
    if check.centre is None or check.half_width is None:
        return "no tolerance"
    return f"{check.centre:g} ± {check.half_width:g}"
