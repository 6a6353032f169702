"""Arguments and options that several commands share."""

import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from datetime import datetime
from functools import wraps
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Literal

import click

from warpspace.analysis.options import outside_travel, read_place
from warpspace.cli.file_arguments import OutputFile, SceneName
from warpspace.cli.tables import escape_json, progress, warn
from warpspace.exceptions import OptionError
from warpspace.resources import RENDERER_MB, check_address_space
from warpspace.scene.text_files import parse_number, parse_whole

if TYPE_CHECKING:
    from warpspace.field.evaluate import SecondOrder
    from warpspace.machine.definition import Machine
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.scene.model import Scene


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
LOOPS = ("tool", "workpiece", "relative")
DIRECTIONS = ("mean", "forward", "backward", "difference")
SECOND_ORDER = "warpspace.second_order"
"""Key of the second-order estimate in the context of a command, for its JSON object."""
COMPONENTS = ("norm", "x", "y", "z")


def scene_argument(name: str = "scene", **kwargs: Any) -> Decorator:
    return click.argument(name, type=SceneName(), **kwargs)


def deferred(place: str) -> Callable[..., Any]:
    """Return a function that imports the one at `place`, "module:function", when it is called.

    Modules of commands thus import at the top what they use, and help does not load them.
    """

    def call(*args: Any, **options: Any) -> Any:
        return resolve_name(place)(*args, **options)

    return call


def run_by(place: str) -> Callable[[Callable[[], None]], Callable[..., None]]:
    """Run a declared command by the function at `place`, imported when the command runs."""

    def decorate(declared: Callable[[], None]) -> Callable[..., None]:
        return wraps(declared)(deferred(place))

    return decorate


def choice_option(
    name: str, choices: Iterable[str], about: str, default: str | None = None, **traits: Any
) -> Decorator:
    """Build an option with one of some values; the help shows its default, if any."""
    kind, shown = click.Choice([*choices]), default is not None
    return click.option(name, type=kind, default=default, show_default=shown, help=about, **traits)


json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print exactly one JSON object on stdout."
)


placed_option = click.option(
    "--placed",
    is_flag=True,
    help="Remove the best-fit placement of the workpiece: three shifts and three small rotations"
    " that minimise the RMS error over the working volume. Uses the relative loop.",
)
loop_option = choice_option(
    "--loop",
    LOOPS,
    "Structural loop: tool point, workpiece point, or tool relative to workpiece.  [tool; relative"
    " with --placed or an axis under the workpiece]",
    None,
)
direction_option = click.option(
    "--direction",
    type=click.Choice(DIRECTIONS),
    help="Direction of travel for errors that depend on it: their mean, forward, backward, or the"
    " difference forward − backward, which maps the reversal.  [that of the scene]",
)
component_option = click.option(
    "--component",
    type=click.Choice(COMPONENTS),
    default="norm",
    show_default=True,
    help="Coloured quantity: the length |E| of the error, or one signed component, in µm.",
)


def read_exaggeration(
    _ctx: click.Context, _param: click.Parameter, text: str | None
) -> float | Literal["auto"] | None:
    if text is None:
        return None
    if text.strip().lower() == "auto":
        return "auto"
    try:
        return parse_number(text)
    except ValueError:
        expected = "expected auto or a number above 0"
        raise OptionError(f"--exaggeration {text!r}; {expected}") from None


exaggeration_option = click.option(
    "--exaggeration",
    metavar="auto|N",
    callback=read_exaggeration,
    help="Display factor of displacements: a number, or auto for a round number that suits the"
    " scene.  [that of the scene]",
)
at_option = click.option(
    "--at",
    "points",
    multiple=True,
    metavar="X=..,Y=..",
    help="Axis positions in mm and degrees, for instance X=0,Y=-225,Z=-480. Repeatable. Other"
    " axes keep their position in the scene (the middle of a range).",
)


def grid_option(default: int | None = 21, of: str = "of the working volume") -> Decorator:
    unsaid = "" if default else "  [21]"
    return click.option(
        "--grid",
        type=int,
        default=default,
        show_default=default is not None,
        help=f"Nodes per axis {of}, 2 to 101.{unsaid}",
    )


def parse_point(text: str, axes: Collection[str]) -> dict[str, float]:
    try:
        return read_place(text, axes)
    except ValueError as error:
        raise OptionError(f"--at {text!r}: {error}") from None


def warn_outside_travel(machine: "Machine", point: Mapping[str, float]) -> None:
    warn(*(f"--at {words}" for words in outside_travel(machine, point)))


def load_placed(
    name: str, direction: str | None, loop: str | None, *, placed: bool = False
) -> "Scene":
    """Load a scene for a direction of travel, its best-fit placement removed or not."""
    from warpspace.scene.library import load_scene
    from warpspace.scene.model import with_direction, with_placement

    return with_placement(with_direction(load_scene(name), direction), loop, placed=placed)


def warn_first_order(loop: str | None, *scenes: "Scene") -> None:
    from warpspace.scene.model import second_order

    warn_second_order(*(second_order(scene, loop) for scene in scenes))


def warn_second_order(*estimates: "SecondOrder") -> dict[str, float]:
    """Warn if first-order numbers are not accurate enough; JSON always reports the estimate."""
    from warpspace.field.evaluate import second_order_words

    warn(*second_order_words(*estimates))
    document = click.get_current_context().meta[SECOND_ORDER] = {
        "second_order_um": max(one.um for one in estimates)
    }
    return document


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object; raise an error for numbers that are not finite."""
    context = click.get_current_context(silent=True)
    click.echo(spell_json({**value, **(context.meta.get(SECOND_ORDER, {}) if context else {})}))


def spell_json(value: object) -> str:
    """Format a value as JSON; raise an error for numbers that are not finite."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, default=datetime.isoformat)
    return escape_json(text)


FIELDS = (".parquet", ".npz", ".csv", ".vts")
FIGURES = (".png", ".svg", ".pdf")
ROWS = (".parquet", ".csv")
SCENES = (".toml",)

force_option = click.option("--force", is_flag=True, help="Replace FILE if it exists.")
csv_option = click.option(
    "--csv", "csv_path", type=OutputFile(".csv"), help="Write the numbers to this CSV file."
)


def output_option(
    help_text: str, *endings: str, added: Callable[[], Iterable[str]] = tuple, required: bool = True
) -> Decorator:
    """Build the option --output for a file with one of some endings, or any."""
    kind = OutputFile(*endings, added=added)
    return click.option(
        "-o", "--output", metavar="FILE", required=required, type=kind, help=help_text
    )


def plot_option(what: str) -> Decorator:
    help_text = f"Draw the {what} into this file: .png, .svg or .pdf."
    return click.option("--plot", type=OutputFile(*FIGURES), help=help_text)


def write_text(
    path: str | Path, text: str | bytes, *, force: bool, original: bytes | None = None
) -> None:
    write_texts({path: text}, force=force, original=original)


def write_texts(
    texts: Mapping[str | Path, str | bytes], *, force: bool, original: bytes | None = None
) -> None:
    """Write all files, or none."""
    from warpspace.outputs.file_output import write_together

    with write_together(texts, overwrite=force, original=original) as temporaries:
        for temporary, text in zip(temporaries, texts.values(), strict=True):
            temporary.write_bytes(text.encode() if isinstance(text, str) else text)


def size_text(path: str) -> str:
    return f"{Path(path).stat().st_size / 1e6:.2f} MB"


VIEWS = ("iso", "front", "right", "top")


def read_size(
    _ctx: click.Context, _param: click.Parameter, text: str | None
) -> tuple[int, int] | None:
    if text is None:
        return None
    width, _, height = text.lower().replace("×", "x").partition("x")
    try:
        return parse_whole(width), parse_whole(height)
    except ValueError:
        raise OptionError(
            f"--size {text!r} cannot be read; expected WIDTHxHEIGHT in px, for instance 1600x1200"
        ) from None


def size_option(default: str | None, about: str) -> Decorator:
    return click.option(
        "--size", default=default, show_default=default is not None, metavar="WxH",
        callback=read_size, help=about,
    )  # fmt: skip


def figure_options(size: str | None = "1600x1200", sizes: str = "") -> Decorator:
    options = (
        component_option,
        exaggeration_option,
        choice_option("--view", VIEWS, "Position of the camera.", "iso"),
        size_option(size, f"Width and height of the picture in px.{sizes}"),
        loop_option,
        placed_option,
        direction_option,
        grid_option(),
        click.option("--dark", is_flag=True, help="Light drawing on a dark background."),
        force_option,
    )

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def figure_settings(*, grid: int, **options: Any) -> "FigureSettings":
    from warpspace.field.grid import node_counts
    from warpspace.outputs.drawing.settings import FigureSettings

    node_counts(grid)
    return FigureSettings(grid=grid, **options)


def draw_figure_file(
    name: str,
    scenes: "Sequence[Scene]",
    settings: "FigureSettings",
    target: str,
    *,
    force: bool,
    silent: bool = False,
) -> None:
    from warpspace.outputs.figure_files import write_figure

    check_address_space(RENDERER_MB, "drawing")
    with progress("drawing", silent=silent):
        write_figure(target, name, scenes, settings, force=force)
