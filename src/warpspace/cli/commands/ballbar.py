"""Command `ballbar`: the circular test of ISO 230-4 on the errors of a scene."""

import click

from warpspace.cli.file_options import check_targets, force_option, plot_option
from warpspace.cli.options import json_option, parse_point, print_json, scene_argument
from warpspace.cli.tables import print_text


@click.command()
@scene_argument()
@click.option(
    "--plane", required=True, type=click.Choice(("XY", "XZ", "YZ")), help="Plane of the circle."
)
@click.option("--radius", required=True, type=float, help="Radius in mm.")
@click.option(
    "--center",
    "--centre",
    "centre",
    metavar="X=..,Y=..",
    help="Axis positions of the centre in mm and degrees.  [middle of the working volume]",
)
@click.option("--points", type=int, default=360, show_default=True, help="Points of the circle.")
@plot_option("polar plot")
@force_option
@json_option
def ballbar(
    scene: str,
    plane: str,
    radius: float,
    centre: str | None,
    points: int,
    plot: str | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Run the circular test of ISO 230-4 on SCENE.

    It prints the circular deviation in µm, and the squareness in µrad that a ball bar would report.
    Radial deviations are taken between tool and workpiece, about the least-squares centre, from +
    first axis of the plane counter-clockwise. The model has neither backlash nor following errors:
    clockwise and counter-clockwise runs trace the same.

    The squareness comes out of the sin 2φ part, in the sign of EC0Y, EB0Z or EA0Z. Angular errors
    along the way look like squareness to a ball bar, and count.
    """
    from warpspace.bench.ballbar import ballbar as run
    from warpspace.scene.library import load_scene

    check_targets(scene, force=force, plot=plot)
    loaded = load_scene(scene)
    result = run(
        loaded,
        plane=plane,
        radius_mm=radius,
        centre=None if centre is None else parse_point(centre, loaded.machine.axes, "--center"),
        points=points,
    )
    middle = ", ".join(f"{name} {value:g}" for name, value in result.centre.items())
    where = f"{plane} plane · radius {radius:g} mm · centre {middle}"
    if plot is not None:
        from warpspace.outputs.charts import ballbar_chart, write_chart

        write_chart(
            ballbar_chart(result, f"Circular test · {loaded.title}", where), plot, overwrite=force
        )
    if as_json:
        print_json(
            {
                "circular_deviation_um": result.circular_deviation_um,
                "squareness_urad": result.squareness_urad,
                "radial_um": result.radial_um.tolist(),
            }
        )
        return
    first, second = plane
    print_text(f"{loaded.title} · {where}")
    print_text(
        f"  circular deviation G {result.circular_deviation_um:.2f} µm, clockwise and"
        " counter-clockwise alike (no backlash or following error in the model)"
    )
    print_text(
        f"  squareness {result.squareness_key} {result.squareness_urad:+.2f} µrad;"
        f" put in {result.given_urad:+.2f} µrad"
    )
    if abs(result.squareness_urad - result.given_urad) > 0.05:
        print_text("    the difference: angular errors along the circle that look like squareness")
    print_text(
        f"  mean radius {result.radius_um:+.2f} µm, {first} against {second}"
        f" {result.scale_difference_um:+.2f} µm, centre"
        f" ({result.centre_um[0]:+.2f}, {result.centre_um[1]:+.2f}) µm"
    )
