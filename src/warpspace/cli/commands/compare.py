"""Command `compare`: two scenes and their difference."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.figure_options import draw_figure_file, figure_options, parse_settings
from warpspace.cli.file_options import check_output, output_option
from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.cli.terminal import echo

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpspace.analysis.statistics import Statistics
    from warpspace.scene.model import Scene


@click.command()
@scene_argument("first", metavar="A")
@scene_argument("second", metavar="B")
@output_option("Draw both and their difference: .png, .svg or .pdf.", required=False)
@figure_options()
@json_option
def compare(
    first: str,
    second: str,
    output: str | None,
    direction: str | None,
    *,
    force: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Compare the errors of two scenes; the change is B − A.

    Beside the statistics of both and their change stand those of |E_B − E_A|, the length of the
    change of the error vector. The scenes are compared node by node, so that both must have the
    same working volume. With -o both and the change are drawn on one sheet, with one colour scale
    and one exaggeration.
    """
    from warpspace.analysis.statistics import statistics
    from warpspace.outputs.drawing.style import FIGURE_ENDINGS
    from warpspace.picture.comparison import scene_change, statistics_change
    from warpspace.picture.scene_picture import evaluate_picture
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import in_direction

    target = None
    if output is not None:
        target = check_output(output, FIGURE_ENDINGS, force=force, scenes=[first, second])
    settings = parse_settings(**options)
    scenes = [in_direction(load_scene(name), direction) for name in (first, second)]
    with progress("evaluating", silent=as_json):
        pictures = [evaluate_picture(s, grid=settings.grid, loop=settings.loop) for s in scenes]
    compared = [*pictures, scene_change(pictures[0], pictures[1])]
    found = [picture.statistics for picture in compared]
    if target is not None:
        draw_figure_file("comparison", scenes, settings, target, force=force, silent=as_json)
    if as_json:
        names = ("a", "b", "difference")
        nodes = [statistics(picture.field, picture.grid.coordinates) for picture in compared]
        print_json(
            {
                **{name: asdict(part) for name, part in zip(names, found, strict=True)},
                "change": statistics_change(found[0], found[1]),
                "statistics_nodes": {
                    name: asdict(part) for name, part in zip(names, nodes, strict=True)
                },
            }
        )
        return
    _print(scenes, found)
    if output is not None:
        echo(f"wrote {output}")


def _print(scenes: "Sequence[Scene]", found: "Sequence[Statistics]") -> None:
    """Print the statistics of A, B, their change, and those of the length of the change."""
    from warpspace.picture.comparison import (
        CHANGE,
        DIFFERENCE_LENGTH,
        STATISTICS,
        statistics_change,
    )
    from warpspace.picture.coordinates import own_axes, spell_at, spell_point

    for letter, scene in zip("AB", scenes, strict=True):
        print_text(f"{letter}  {scene.name}: {scene.title}")
    change = statistics_change(found[0], found[1])
    columns = (
        Column("|E|", leads=True),
        *number_columns(("A", "B", CHANGE, DIFFERENCE_LENGTH), "µm"),
    )
    rows = [
        (
            name,
            f"{getattr(found[0], key):.2f}",
            f"{getattr(found[1], key):.2f}",
            f"{change[key]:+.2f}",
            f"{getattr(found[2], key):.2f}",
        )
        for name, key in STATISTICS.items()
    ]
    print_table(columns, rows)
    for name, part in zip(("A", "B", DIFFERENCE_LENGTH), found, strict=True):
        if part.max_um > 0.0:
            worst = own_axes(scenes[0], part.max_at_axes)
            print_text(f"  max of {name} at {spell_point(worst, part.max_at_mm)} mm")
            print_text(f"  --at {spell_at(worst)}")
