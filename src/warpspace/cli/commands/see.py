"""Commands that show errors: app, figures, comparison, export, design review."""

import gc
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.analyses import print_blocks
from warpspace.cli.file_arguments import SceneName
from warpspace.cli.shared_options import (
    FIGURES,
    choice_option,
    component_option,
    deferred,
    direction_option,
    draw_figure_file,
    exaggeration_option,
    figure_options,
    figure_settings,
    force_option,
    grid_option,
    json_option,
    load_placed,
    loop_option,
    output_option,
    print_json,
    scene_argument,
    size_text,
    warn_first_order,
)
from warpspace.cli.tables import echo, print_text, progress
from warpspace.exceptions import OptionError, RenderError, UnknownNameError
from warpspace.outputs.exports import formats
from warpspace.outputs.figures.registry import figure_command, figure_names

if TYPE_CHECKING:
    from warpspace.analysis.description import Analysis


SERVICES = "warpspace.cli.services"
MOVING = (".gif", ".webp", ".mp4")
SIZE, MOVING_SIZE = (1600, 1200), (960, 720)
formats.register_format(
    formats.ExportFormat(
        ".html",
        "the interactive scene, one file that needs no network",
        f"{SERVICES}:write_page",
        in_app=False,
    )
)


@click.command()
@scene_argument(default="dvf5000_first")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to serve on. Any other than the loopback address is open to the network; the"
    " printed link then contains a token that the app requires.",
)
@click.option("--port", type=int, help="Port to serve on.  [the next free one from 8080]")
@click.option(
    "--shared", is_flag=True, help="Shared review: all tabs show and edit the same state."
)
@click.option(
    "--allow-host",
    "allow_hosts",
    multiple=True,
    metavar="NAME",
    help="Further host name of the page, for instance that of a proxy. Repeatable.",
)
@click.option(
    "--token",
    help="Require this token: 12 or more letters, digits and . _ ~ -"
    "  [a random one, if --host is open to the network]",
)
@click.option(
    "--no-token",
    is_flag=True,
    help="Require no token: anyone who can reach --host sees the scenes and can use the app.",
)
@click.option("--no-browser", is_flag=True, help="Only print the address of the page.")
def view(
    scene: str,
    allow_hosts: tuple[str, ...],
    token: str | None,
    *,
    no_token: bool,
    no_browser: bool,
    **options: Any,
) -> None:
    """Open SCENE in the browser, with a slider per error.

    Without SCENE, dvf5000_first is opened.
    """
    from warpspace.app.server.request_policy import Access
    from warpspace.app.server.viewer import run_viewer
    from warpspace.bodies.mesh_files import check_meshes
    from warpspace.cli.services import build_services
    from warpspace.scene.library import load_scene, scene_names, scene_path

    path = scene_path(scene)
    original = path.read_bytes() if path.is_file() else b""
    opened_scene = load_scene(scene)
    check_meshes(opened_scene.machine)
    bundled = {name: opened_scene if name == scene else load_scene(name) for name in scene_names()}
    gc.set_threshold(1_000, 10, 10)  # a server runs for long: close to Python's own
    run_viewer(
        opened_scene,
        {loaded.title: loaded for loaded in bundled.values()},
        services=replace(
            build_services(),
            is_current=lambda opened: (
                opened is not opened_scene or (path.is_file() and path.read_bytes() == original)
            ),
        ),
        access=Access(allow_hosts, token, no_token=no_token),
        code=sys.stdout.isatty(),
        browser=not no_browser,
        say=echo,
        warn=lambda text: echo(text, err=True, fg="yellow"),
        **options,
    )


@click.command()
@scene_argument()
@output_option(
    "File to write: .png, .svg or .pdf; animated .gif, .webp or .mp4.", *FIGURES, *MOVING
)
@click.option(
    "--figure", metavar="NAME", help=f"Figure to draw: {', '.join(figure_names())}.  [error-map]"
)
@choice_option(
    "--motion",
    ("exaggeration", "rotation", "program", "story"),
    "Motion: from true scale to the display factor and back, one turn of the rotary table, along"
    " the program of the scene, or the story of its notes.  [exaggeration]",
)
@click.option("--frames", type=int, help="Number of frames.  [48; program 160; story 6 per step]")
@click.option("--fps", type=float, help="Frames per second.  [15; program 8; story 1]")
@figure_options(size=None, sizes="  [1600x1200; 960x720 if animated]")
def draw(
    scene: str,
    output: str,
    figure: str | None,
    motion: str | None,
    frames: int | None,
    fps: float | None,
    direction: str | None,
    *,
    placed: bool,
    force: bool,
    size: tuple[int, int] | None,
    **options: Any,
) -> None:
    """Draw a figure or an animation of SCENE.

    The picture states exaggeration, scale bars, statistics and provenance. Repeated runs give
    identical files. The height of charts follows from their width. Camera and colour scale of an
    animation are fixed.
    """
    moves = Path(output).suffix.lower() in MOVING
    motion_options = {"--motion": motion, "--frames": frames, "--fps": fps}
    if moves and figure not in (None, "error-map"):
        raise OptionError(
            f"figure {figure!r} cannot be animated; expected a .png, .svg or .pdf file"
        )
    for option, value in motion_options.items():
        if value is not None and not moves:
            raise OptionError(f"{option} needs a .gif, .webp or .mp4 file; found {output}")
    name = figure or "error-map"
    if name in figure_names(scenes=2):
        command = figure_command(name) or "compare A B -o FILE"
        raise OptionError(f"figure {name!r} takes two scenes or more: warpspace {command}")
    if name not in figure_names():
        raise UnknownNameError("figure", name, figure_names())
    settings = figure_settings(size=size or (MOVING_SIZE if moves else SIZE), **options)
    loaded = load_placed(scene, direction, settings.loop, placed=placed)
    warn_first_order(settings.loop, loaded)
    if not moves:
        draw_figure_file(name, [loaded], settings, output, force=force)
        echo(f"wrote {output}")
        return
    from warpspace.outputs.animation import AnimationSettings, default_frames, write_animation

    motion, steps = motion or "exaggeration", ()
    if motion == "story":
        steps = deferred(f"{SERVICES}:build_story")(loaded, settings.grid)
    usual_frames, usual_fps = default_frames(motion, len(steps))
    moving = AnimationSettings(
        motion, usual_frames if frames is None else frames, usual_fps if fps is None else fps,
        settings, steps=steps,
    )  # fmt: skip
    with progress("drawing", moving.frames, "pictures") as bar:
        write_animation(loaded, output, moving, overwrite=force, progress=bar.advance)
    echo(f"{output}: {moving.frames} pictures, {moving.frames / moving.fps:.1f} s")


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

    Reports the statistics of both, their change, and those of |E_B − E_A|, the length of the change
    of the error vector. The scenes are compared node by node and must have the same working volume.
    With -o, both and the change are drawn on one sheet with the same colour scale and exaggeration.
    """
    from warpspace.analysis.description import to_json
    from warpspace.analysis.statistics import statistics
    from warpspace.analysis.uncertainty.propagation import u95_lines, volume_uncertainty
    from warpspace.picture.comparison import scene_change, statistics_blocks, statistics_change
    from warpspace.picture.model import evaluate_picture

    settings = figure_settings(**options)
    scenes = [
        load_placed(name, direction, settings.loop, placed=placed) for name in (first, second)
    ]
    settings = settings.for_scenes(scenes)
    with progress("evaluating", silent=as_json):
        pictures = [evaluate_picture(s, grid=settings.grid, loop=settings.loop) for s in scenes]
    compared = [*pictures, scene_change(pictures[0], pictures[1])]
    warn_first_order(settings.loop, *scenes)
    uncertainties = [
        *(volume_uncertainty(one.scene, one.view, settings.grid) for one in pictures),
        None,
    ]
    pairs = zip(uncertainties, (picture.statistics for picture in compared), strict=True)
    summaries = [
        one.with_expanded_uncertainty(numbers) if one else numbers for one, numbers in pairs
    ]
    if output is not None:
        draw_figure_file("comparison", scenes, settings, output, force=force, silent=as_json)
    if as_json:
        names = ("a", "b", "difference")
        nodes = [statistics(picture.field, picture.grid.coordinates) for picture in compared]
        change = {"change": statistics_change(summaries[0], summaries[1])}
        at_nodes = {"statistics_nodes": to_json(dict(zip(names, nodes, strict=True)))}
        print_json({**to_json(dict(zip(names, summaries, strict=True))), **change, **at_nodes})
        return
    for letter, scene in zip("AB", scenes, strict=True):
        print_text(f"{letter}  {scene.name}: {scene.title}")
    print_blocks(statistics_blocks(scenes[0], "AB", summaries))
    for letter, uncertainty, summary in zip("AB", uncertainties, summaries, strict=False):
        print_blocks(u95_lines(uncertainty and uncertainty.errors, {letter: summary}))
    if output is not None:
        echo(f"wrote {output}")


@click.command()
@scene_argument()
@output_option(
    "File to write: "
    f"{', '.join(f'{form.ending} ({form.about})' for form in formats.export_formats())}.",
    added=lambda: [form.ending for form in formats.export_formats()],
)
@exaggeration_option
@grid_option()
@component_option
@loop_option
@direction_option
@force_option
def export(
    scene: str, output: str, loop: str | None, direction: str | None, *, force: bool, **options: Any
) -> None:
    """Export SCENE for other programs.

    The ending of FILE selects the format. Every format contains the scene, the settings, the
    display factor and the version of the program.
    """
    from warpspace.picture.model import evaluate_picture

    with progress("writing"):
        picture = evaluate_picture(load_placed(scene, direction, loop), loop=loop, **options)
        formats.write_export(picture, Path(output), overwrite=force)
    kind = next(
        form for form in formats.export_formats() if form.ending == Path(output).suffix.lower()
    )
    if kind.left_out:
        echo(f"{output}: {picture.scene.machine.title}, {size_text(output)}")
        print_text(f"  {kind.left_out}")
        return
    warn_first_order(loop, picture.scene)
    echo(
        f"{output}: {picture.scene.title}, displacement drawn ×{picture.exaggeration:g},"
        f" {size_text(output)}"
    )


@click.command()
@scene_argument("scenes", nargs=-1, required=True)
@output_option("File to write: .html (with interactive 3-D views) or .pdf.", ".html", ".pdf")
@click.option(
    "--concepts",
    type=SceneName(),
    multiple=True,
    metavar="SCENE",
    help="Another machine to compare with those of the report, within the tolerances of the first."
    " Repeatable.",
)
@click.option(
    "--with",
    "appendices",
    multiple=True,
    metavar="NAME",
    help="Appendix with another analysis of SCENE at its default options, for instance form."
    " Repeatable.",
)
@click.option(
    "--limit",
    "spec_um",
    type=float,
    help="Limit of |E| in µm, for the verdict and the probability of conformance.  [that of SCENE]",
)
@click.option("--author", default="", help="Author, printed on page 1.")
@click.option(
    "--question",
    "questions",
    multiple=True,
    metavar="TEXT",
    help="Open question, printed on page 1. Repeatable.",
)
@click.option(
    "--samples",
    default=100_000,
    show_default=True,
    help="Number of machines sampled within the tolerances.",
)
@choice_option(
    "--distribution",
    ("uniform", "normal"),
    "Distribution: uniform over the tolerance, or normal with 3σ = half-width.",
    "uniform",
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    help="Seed of the random numbers; equal seeds give equal results.",
)
@grid_option()
@exaggeration_option
@loop_option
@force_option
def report(
    scenes: tuple[str, ...],
    output: str,
    concepts: tuple[str, ...],
    appendices: tuple[str, ...],
    *,
    force: bool,
    **options: Any,
) -> None:
    """Write the design review of one SCENE or two.

    The first page states the verdict (pass, fail or undecided), four numbers, a map and the
    recommended action. Appendices contain maps, contributions at the worst point, errors and
    tolerances, gains, Monte Carlo, conventions and provenance. --concepts adds a table and pictures
    of machines side by side, as `warpspace concepts` does; --with adds an appendix of another
    analysis. The file needs no network.
    """
    from warpspace.analysis.description import ignore_progress
    from warpspace.outputs.report import ReportSettings, write_report
    from warpspace.scene.library import load_scene, scene_path

    if len(scenes) > 2:
        raise OptionError(f"report: {len(scenes)} scenes; expected one, or two to compare")
    settings = ReportSettings(**options)
    loaded = [load_scene(scene) for scene in scenes]
    concept_scenes = [load_scene(scene) for scene in concepts]
    analyses = {name: _build_analysis(name) for name in appendices}
    warn_first_order(settings.loop, *loaded)
    with progress("writing the review", total=1.0) as bar:
        review = write_report(
            loaded,
            output,
            settings,
            embed=deferred(f"{SERVICES}:embed_view"),
            story_steps=deferred(f"{SERVICES}:build_story"),
            concepts=concept_scenes,
            results={
                f"{heading}: {scene.title}": analysis.run(scene, ignore_progress)
                for heading, analysis in analyses.items()
                for scene in loaded
            },
            files=[scene_path(scene) for scene in (*scenes, *concepts)],
            overwrite=force,
            watch=bar.reach,
        )
    titles = " and ".join(scene.title for scene in loaded)
    echo(f"{output}: design review of {titles}, {size_text(output)}")
    if review.missing:
        raise RenderError(f"{output} is written without figures: {'; '.join(review.missing)}")


def _build_analysis(name: str) -> "Analysis":
    from warpspace.analysis.registry import find_analysis

    kind = find_analysis(name)
    required = [option.flag for option in kind.options() if option.required]
    if required:
        raise OptionError(
            f"--with {name}: needs {', '.join(required)}; run `warpspace {name}` instead"
        )
    return kind()
