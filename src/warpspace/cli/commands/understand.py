"""The command `field`: errors at points or over the working volume."""

import click

from warpspace.cli import shared_options


@click.command()
@shared_options.scene_argument()
@shared_options.at_option
@shared_options.grid_option(None)
@shared_options.loop_option
@shared_options.placed_option
@shared_options.direction_option
@click.option(
    "--exact",
    is_flag=True,
    help="Exact kinematic chain with full rotations, in place of the first order.",
)
@shared_options.choice_option(
    "--frame", ("machine", "workpiece"), "Frame of the resulting vectors.", "machine"
)
@shared_options.csv_option
@shared_options.output_option(
    "Write all points to this file: .parquet, .npz, .csv or, of a grid, .vts.",
    *shared_options.FIELDS,
    required=False,
)
@shared_options.force_option
@shared_options.json_option
@shared_options.run_by("warpspace.cli.field_output:print_field")
def field() -> None:
    """Evaluate the errors of SCENE at points or over a grid.

    Errors are actual − nominal, in µm; the orientation error is the rotation vector of the tool
    axis, in µrad. Without --at the grid of the working volume is evaluated. If SCENE states
    the uncertainty of its errors, U95 is reported for each point, in files too.
    """
