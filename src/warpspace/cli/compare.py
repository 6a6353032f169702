"""Command `compare`: two scenes and their difference."""

from dataclasses import asdict
from typing import Any

import click

from warpspace.cli.figure_options import figure_options, parse_settings
from warpspace.cli.options import json_option, print_json, scene_argument


@click.command()
@scene_argument("first", metavar="A")
@scene_argument("second", metavar="B")
@click.option(
    "-o", "--output", type=click.Path(), help="Draw both and their difference: .png, .svg or .pdf."
)
@figure_options
@json_option
def compare(
    first: str, second: str, output: str | None, *, force: bool, as_json: bool, **options: Any
) -> None:
    """Compare the errors of two scenes, node by node; the difference is B − A.

    Both must have the same working volume. With -o both and the difference are drawn on one sheet,
    with one colour scale and one exaggeration.
    """
    from warpspace.outputs.drawing.style import FIGURE_ENDINGS
    from warpspace.outputs.files import check_target, write_atomically
    from warpspace.picture.comparison import subtract_scenes
    from warpspace.picture.scene_picture import evaluate_picture
    from warpspace.scene.library import load_scene

    target = None if output is None else check_target(output, FIGURE_ENDINGS, overwrite=force)
    settings = parse_settings(**options)
    scenes = [load_scene(first), load_scene(second)]
    pictures = [evaluate_picture(s, grid=settings.grid, loop=settings.loop) for s in scenes]
    found = {
        "a": pictures[0].statistics,
        "b": pictures[1].statistics,
        "difference": subtract_scenes(pictures[1], pictures[0], "B − A").statistics,
    }
    if target is not None:
        from warpspace.outputs.worker import FigureWorker

        with FigureWorker() as worker:
            content = worker.render("comparison", scenes, settings, target.suffix.lower()[1:])
        with write_atomically(target, overwrite=force) as temporary:
            temporary.write_bytes(content)
    if as_json:
        print_json({name: asdict(part) for name, part in found.items()})
        return
    width = max(len(scene.name) for scene in scenes) + 4
    for name, part in zip(
        (f"A  {scenes[0].name}", f"B  {scenes[1].name}", "B − A"), found.values(), strict=True
    ):
        at = ", ".join(f"{value:g}" for value in part.max_at_mm)
        click.echo(
            f"{name:<{width}} mean {part.mean_um:7.2f}  RMS {part.rms_um:7.2f}  P95"
            f" {part.p95_um:7.2f}  max {part.max_um:7.2f} µm at ({at}) mm"
        )
    if output is not None:
        click.echo(f"wrote {output}")
