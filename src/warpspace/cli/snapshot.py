"""Command `snapshot`: a figure of a scene into a file."""

import click

from warpspace.cli.options import COMPONENTS, loop_option, scene_argument
from warpspace.exceptions import OptionError, UnknownNameError

FIGURES = ("error-map",)
VIEWS = ("iso", "front", "right", "top")


def parse_size(text: str) -> tuple[int, int]:
    """Read a size as a user types it, for instance ``1600x1200``.

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    width, _, height = text.lower().replace("×", "x").partition("x")
    try:
        return int(width), int(height)
    except ValueError:
        raise OptionError(
            f"--size {text!r} cannot be read; expected WIDTHxHEIGHT in px, for instance 1600x1200"
        ) from None


def parse_exaggeration(text: str) -> float | None:
    """Read an exaggeration as a user types it; None for auto.

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    if text.strip().lower() == "auto":
        return None
    try:
        return float(text.strip().lstrip("×x"))
    except ValueError:
        raise OptionError(
            f"--exaggeration {text!r} cannot be read; expected auto or a number, for instance 1000"
        ) from None


@click.command()
@scene_argument()
@click.option("-o", "--output", required=True, type=click.Path(), help="A .png, .svg or .pdf file.")
@click.option(
    "--figure", default="error-map", show_default=True, metavar="NAME",
    help=f"What to draw: {', '.join(FIGURES)}.",
)  # fmt: skip
@click.option(
    "--component", type=click.Choice(COMPONENTS), default="norm", show_default=True,
    help="Length of the error, or one signed component.",
)  # fmt: skip
@click.option(
    "--exaggeration", default="auto", show_default=True, metavar="auto|N",
    help="Display factor of displacements.",
)  # fmt: skip
@click.option("--view", type=click.Choice(VIEWS), default="iso", show_default=True)
@click.option("--size", default="1600x1200", show_default=True, metavar="WxH", help="In px.")
@loop_option
@click.option("--grid", type=int, default=21, show_default=True, help="Nodes per axis, 2 to 101.")
@click.option("--dark", is_flag=True, help="Light ink on a dark ground.")
@click.option("--force", is_flag=True, help="Replace an existing file.")
def snapshot(
    scene: str,
    output: str,
    figure: str,
    component: str,
    exaggeration: str,
    view: str,
    size: str,
    loop: str,
    grid: int,
    *,
    dark: bool,
    force: bool,
) -> None:
    """Draw an error-map picture (or another figure) of SCENE into a file.

    The picture carries its exaggeration, scale bars, statistics and provenance. It is the same,
    byte for byte, whenever it is repeated.
    """
    from warpspace.field.grid import node_counts
    from warpspace.outputs.figures.settings import FigureSettings
    from warpspace.outputs.files import write_atomically
    from warpspace.outputs.targets import check_target, figure_format
    from warpspace.outputs.worker import FigureWorker
    from warpspace.scene.library import load_scene

    if figure not in FIGURES:
        raise UnknownNameError("figure", figure, FIGURES)
    form = figure_format(output)
    settings = FigureSettings(
        component, parse_exaggeration(exaggeration), view, parse_size(size), dark, loop, grid
    )
    node_counts(grid)
    check_target(output, force=force)
    loaded = load_scene(scene)
    with FigureWorker() as worker:
        content = worker.render(figure, [loaded], settings, form)
    with write_atomically(output) as temporary:
        temporary.write_bytes(content)
    click.echo(f"wrote {output}")
