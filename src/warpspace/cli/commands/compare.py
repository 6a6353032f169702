"""Command `compare`: two scenes and their difference."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.figure_options import draw_figure_file, figure_options, parse_settings
from warpspace.cli.file_options import check_output, output_option
from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table
from warpspace.cli.terminal import echo

if TYPE_CHECKING:
    from warpspace.analysis.statistics import Statistics


@click.command()
@scene_argument("first", metavar="A")
@scene_argument("second", metavar="B")
@output_option("Draw both and their difference: .png, .svg or .pdf.", required=False)
@figure_options()
@json_option
def compare(
    first: str, second: str, output: str | None, *, force: bool, as_json: bool, **options: Any
) -> None:
    """Compare the errors of two scenes; the difference is B − A.

    They are compared node by node, so that both must have the same working volume. With -o both and
    the difference are drawn on one sheet, with one colour scale and one exaggeration.
    """
    from warpspace.outputs.drawing.style import FIGURE_ENDINGS
    from warpspace.picture.comparison import subtract_scenes
    from warpspace.picture.scene_picture import evaluate_picture
    from warpspace.scene.library import load_scene

    target = None
    if output is not None:
        target = check_output(output, FIGURE_ENDINGS, force=force, scenes=[first, second])
    settings = parse_settings(**options)
    scenes = [load_scene(first), load_scene(second)]
    with progress("evaluating", silent=as_json):
        pictures = [evaluate_picture(s, grid=settings.grid, loop=settings.loop) for s in scenes]
    found = {
        "a": pictures[0].statistics,
        "b": pictures[1].statistics,
        "difference": subtract_scenes(pictures[1], pictures[0], "B − A").statistics,
    }
    if target is not None:
        draw_figure_file("comparison", scenes, settings, target, force=force, silent=as_json)
    if as_json:
        print_json({name: asdict(part) for name, part in found.items()})
        return
    names = (f"A  {scenes[0].name}", f"B  {scenes[1].name}", "B − A")
    _print(list(zip(names, found.values(), strict=True)))
    if output is not None:
        echo(f"wrote {output}")


def _print(found: "list[tuple[str, Statistics]]") -> None:
    """Print the statistics, one line each."""
    columns = (
        Column(leads=True),
        *number_columns(("mean", "RMS", "P95", "max"), "µm"),
        Column("largest at x, y, z", "mm"),
    )
    rows = [
        (
            name,
            *(f"{value:.2f}" for value in (part.mean_um, part.rms_um, part.p95_um, part.max_um)),
            ", ".join(f"{value:g}" for value in part.max_at_mm),
        )
        for name, part in found
    ]
    print_table(columns, rows, indent=0)
