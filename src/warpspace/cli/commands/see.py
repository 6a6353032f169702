"""Commands by which errors are seen: the app, figures, comparisons, files, the design review."""

import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.analyses import print_blocks
from warpspace.cli.file_arguments import SceneName
from warpspace.cli.shared_options import (
    FIGURES,
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
    say_first_order,
    scene_argument,
    size_text,
)
from warpspace.cli.tables import echo, print_text, progress
from warpspace.exceptions import OptionError, RenderError, UnknownNameError
from warpspace.outputs.exports.formats import (
    ExportFormat,
    export_formats,
    register_format,
    write_export,
)
from warpspace.outputs.figures.registry import figure_command, figure_names

if TYPE_CHECKING:
    from warpspace.analysis.description import Analysis


SERVICES = "warpspace.cli.services"
MOVING = (".gif", ".webp", ".mp4")
SIZE, MOVING_SIZE = (1600, 1200), (960, 720)
FRAMES, FPS = 48, 15.0
register_format(
    ExportFormat(
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
    help="Address to serve on. Anything but this machine's own is open to the network; the link"
    " that is printed then carries a token, which the app asks for.",
)
@click.option("--port", type=int, help="Port to serve on.  [the next free one from 8080]")
@click.option(
    "--shared",
    is_flag=True,
    help="One review for all: every tab shows the same state and may change it.",
)
@click.option(
    "--allow-host",
    "allow_hosts",
    multiple=True,
    metavar="NAME",
    help="A further name the page is reached by, for instance that of a proxy. May be repeated.",
)
@click.option(
    "--token",
    help="Ask for this token: 12 or more letters, digits and . _ ~ -"
    "  [a random one, with a --host that other machines reach]",
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

    SCENE is dvf5000_first where it is left out.
    """
    # Before numpy is loaded: a slider move is one short product, and threads of OpenBLAS that spin
    # for it beside a browser that draws in software make it thirty times slower.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from warpspace.app.server.request_policy import Access
    from warpspace.app.server.viewer import run_viewer
    from warpspace.bodies.own_meshes import check_meshes
    from warpspace.cli.services import build_services
    from warpspace.scene.library import load_scene, scene_names, scene_path

    path = scene_path(scene)
    original = path.read_bytes() if path.is_file() else b""
    shown = load_scene(scene)
    check_meshes(shown.machine)
    bundled = {name: shown if name == scene else load_scene(name) for name in scene_names()}
    run_viewer(
        shown,
        {loaded.title: loaded for loaded in bundled.values()},
        services=replace(
            build_services(),
            is_current=lambda opened: (
                opened is not shown or (path.is_file() and path.read_bytes() == original)
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
@output_option("File to write: .png, .svg or .pdf; .gif, .webp or .mp4 move.", *FIGURES, *MOVING)
@click.option(
    "--figure",
    metavar="NAME",
    help=f"What to draw: {', '.join(figure_names())}.  [error-map]",
)
@click.option(
    "--motion",
    type=click.Choice(("exaggeration", "rotation")),
    help="What moves: from true scale to the display factor and back, or one turn of the rotary"
    " table.  [exaggeration]",
)
@click.option("--frames", type=int, help=f"Pictures of one round of what moves.  [{FRAMES}]")
@click.option("--fps", type=float, help=f"Pictures a second.  [{FPS:g}]")
@figure_options(size=None, sizes="  [1600x1200; 960x720 of what moves]")
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
    """Draw a still or moving picture of SCENE.

    The picture carries its exaggeration, scale bars, statistics and provenance. It is the same,
    byte for byte, whenever it is repeated. Charts keep their own height to the width given. Camera
    and colour scale of a moving picture stay the same.
    """
    moves = Path(output).suffix.lower() in MOVING
    given = {"--motion": motion, "--frames": frames, "--fps": fps}
    if moves and figure not in (None, "error-map"):
        raise OptionError(f"figure {figure!r} does not move; expected a .png, .svg or .pdf file")
    for option, value in given.items():
        if value is not None and not moves:
            raise OptionError(f"{option} belongs to a .gif, .webp or .mp4 file; given {output}")
    name = figure or "error-map"
    if name in figure_names(scenes=2):
        command = figure_command(name) or "compare A B -o FILE"
        raise OptionError(f"figure {name!r} takes two scenes or more: warpspace {command}")
    if name not in figure_names():
        raise UnknownNameError("figure", name, figure_names())
    settings = figure_settings(size=size or (MOVING_SIZE if moves else SIZE), **options)
    moving = None
    if moves:
        from warpspace.outputs.animation import AnimationSettings

        moving = AnimationSettings(
            motion or "exaggeration",
            FRAMES if frames is None else frames,
            FPS if fps is None else fps,
            settings,
        )
    loaded = load_placed(scene, direction, settings.loop, placed=placed)
    say_first_order(settings.loop, loaded)
    if moving is None:
        draw_figure_file(name, [loaded], settings, output, force=force)
        echo(f"wrote {output}")
        return
    from warpspace.outputs.animation import write_animation

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

    Beside the statistics of both and their change stand those of |E_B − E_A|, the length of the
    change of the error vector. The scenes are compared node by node, so that both must have the
    same working volume. With -o both and the change are drawn on one sheet, with one colour scale
    and one exaggeration.
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
    with progress("evaluating", silent=as_json):
        pictures = [evaluate_picture(s, grid=settings.grid, loop=settings.loop) for s in scenes]
    compared = [*pictures, scene_change(pictures[0], pictures[1])]
    say_first_order(settings.loop, *scenes)
    sure = [*(volume_uncertainty(one.scene, one.view, settings.grid) for one in pictures), None]
    both = zip(sure, (picture.statistics for picture in compared), strict=True)
    found = [one.with_expanded_uncertainty(numbers) if one else numbers for one, numbers in both]
    if output is not None:
        draw_figure_file("comparison", scenes, settings, output, force=force, silent=as_json)
    if as_json:
        names = ("a", "b", "difference")
        nodes = [statistics(picture.field, picture.grid.coordinates) for picture in compared]
        change = {"change": statistics_change(found[0], found[1])}
        at_nodes = {"statistics_nodes": to_json(dict(zip(names, nodes, strict=True)))}
        print_json({**to_json(dict(zip(names, found, strict=True))), **change, **at_nodes})
        return
    for letter, scene in zip("AB", scenes, strict=True):
        print_text(f"{letter}  {scene.name}: {scene.title}")
    print_blocks(statistics_blocks(scenes[0], "AB", found))
    for letter, one, numbers in zip("AB", sure, found, strict=False):
        print_blocks(u95_lines(one and one.errors, {letter: numbers}))
    if output is not None:
        echo(f"wrote {output}")


@click.command()
@scene_argument()
@output_option(
    f"File to write: {', '.join(f'{form.ending} ({form.about})' for form in export_formats())}.",
    added=lambda: [form.ending for form in export_formats()],
)
@exaggeration_option
@grid_option()
@component_option
@loop_option
@direction_option
@force_option
def export(
    scene: str,
    output: str,
    loop: str,
    direction: str | None,
    *,
    force: bool,
    **options: Any,
) -> None:
    """Write SCENE into a file for other programs.

    The ending of FILE chooses the format. Every format carries the scene, the settings, the display
    factor and the program's version.
    """
    from warpspace.picture.model import evaluate_picture

    with progress("writing"):
        picture = evaluate_picture(load_placed(scene, direction, loop), loop=loop, **options)
        write_export(picture, Path(output), overwrite=force)
    kind = next(form for form in export_formats() if form.ending == Path(output).suffix.lower())
    if kind.left_out:
        echo(f"{output}: {picture.scene.machine.title}, {size_text(output)}")
        print_text(f"  {kind.left_out}")
        return
    say_first_order(loop, picture.scene)
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
    help="Another machine to set beside those of the report, within the tolerances of the first;"
    " may be given several times.",
)
@click.option(
    "--with",
    "others",
    multiple=True,
    metavar="NAME",
    help="Also what another analysis says of SCENE without options of its own, for instance"
    " certify; may be given several times.",
)
@click.option(
    "--limit",
    "spec_um",
    type=float,
    help="Of |E| in µm, to say whether it is kept, and how likely a machine keeps it; otherwise"
    " that of SCENE.",
)
@click.option("--author", default="", help="Who answers for it; on the first page.")
@click.option(
    "--question",
    "questions",
    multiple=True,
    metavar="TEXT",
    help="What is still open; on the first page; may be given several times.",
)
@click.option(
    "--samples",
    type=int,
    default=100_000,
    show_default=True,
    help="How many machines are drawn from the tolerances.",
)
@click.option(
    "--distribution",
    type=click.Choice(("uniform", "normal")),
    default="uniform",
    show_default=True,
    help="uniform over the tolerance, or normal with 3σ = half width.",
)
@click.option(
    "--seed",
    type=int,
    default=0,
    show_default=True,
    help="Of the random numbers; the same seed gives the same numbers.",
)
@grid_option()
@exaggeration_option
@loop_option
@force_option
def report(
    scenes: tuple[str, ...],
    output: str,
    concepts: tuple[str, ...],
    others: tuple[str, ...],
    *,
    force: bool,
    **options: Any,
) -> None:
    """Write the design review of one SCENE or two.

    The first page is the verdict: whether the limit is kept, four numbers, a map and what to do.
    Appendices hold the evidence: maps, contributions at the worst point, errors and tolerances,
    gains, Monte Carlo, conventions and provenance. With --concepts also a table and pictures of
    machines side by side, as `warpspace concepts` has them; --with adds an appendix of any other
    analysis. The file needs no network.
    """
    from warpspace.analysis.description import ignore_progress
    from warpspace.outputs.report import ReportSettings, write_report
    from warpspace.scene.library import load_scene, scene_path

    if len(scenes) > 2:
        raise OptionError(f"report: {len(scenes)} scenes; expected one, or two to compare")
    settings = ReportSettings(**options)
    loaded = [load_scene(scene) for scene in scenes]
    beside = [load_scene(scene) for scene in concepts]
    asked = {name: _asked(name) for name in others}
    say_first_order(settings.loop, *loaded)
    with progress("writing the review", total=1.0) as bar:
        written = write_report(
            loaded,
            output,
            settings,
            embed=deferred(f"{SERVICES}:embed_view"),
            tell=deferred(f"{SERVICES}:tell_story"),
            concepts=beside,
            results={
                f"{heading}: {scene.title}": analysis.run(scene, ignore_progress)
                for heading, analysis in asked.items()
                for scene in loaded
            },
            files=[scene_path(scene) for scene in (*scenes, *concepts)],
            overwrite=force,
            watch=bar.reach,
        )
    titles = " and ".join(scene.title for scene in loaded)
    echo(f"{output}: design review of {titles}, {size_text(output)}")
    if written.missing:
        raise RenderError(f"{output} is written without figures: {'; '.join(written.missing)}")


def _asked(name: str) -> "Analysis":
    from warpspace.analysis.registry import find_analysis

    try:
        return find_analysis(name)()
    except TypeError:
        raise OptionError(f"--with {name}: needs options of its own: warpspace {name}") from None
