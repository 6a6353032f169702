"""Command `compare`: two scenes and their difference."""

from dataclasses import asdict
from typing import Any

import click

from warpspace.cli.analyses import print_blocks
from warpspace.cli.options import (
    FIGURES,
    draw_figure_file,
    figure_options,
    json_option,
    output_option,
    parse_settings,
    print_json,
    say_first_order,
    scene_argument,
)
from warpspace.cli.tables import echo, print_text, progress


@click.command()
@scene_argument("first", metavar="A")
@scene_argument("second", metavar="B")
@output_option("Draw both and their difference: .png, .svg or .pdf.", *FIGURES, required=False)
@figure_options()
@json_option
def compare(
    first: str,
    second: str,
    output: str | None,
    direction: str | None,
    *,
    placed: bool,
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
    from warpspace.picture.comparison import scene_change, statistics_blocks, statistics_change
    from warpspace.picture.model import evaluate_picture
    from warpspace.scene.library import load_scene
    from warpspace.scene.model import in_direction, placed_in

    settings = parse_settings(**options)
    scenes = [
        placed_in(in_direction(load_scene(name), direction), settings.loop, placed=placed)
        for name in (first, second)
    ]
    with progress("evaluating", silent=as_json):
        pictures = [evaluate_picture(s, grid=settings.grid, loop=settings.loop) for s in scenes]
    compared = [*pictures, scene_change(pictures[0], pictures[1])]
    say_first_order(settings.loop, *scenes)
    found = [picture.statistics for picture in compared]
    if output is not None:
        draw_figure_file("comparison", scenes, settings, output, force=force, silent=as_json)
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
    for letter, scene in zip("AB", scenes, strict=True):
        print_text(f"{letter}  {scene.name}: {scene.title}")
    print_blocks(statistics_blocks(scenes[0], "AB", found))
    if output is not None:
        echo(f"wrote {output}")
