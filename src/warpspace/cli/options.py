"""Arguments and options that several commands share."""

import json
import math
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, Literal

import click
from click.shell_completion import CompletionItem

from warpspace.cli.terminal import echo, escape_json
from warpspace.exceptions import OptionError
from warpspace.machine.axes import is_axis_name

if TYPE_CHECKING:
    from warpspace.machine.description import Machine

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
LOOPS = ("tool", "workpiece", "relative")
DIRECTIONS = ("mean", "forward", "backward", "difference")
COMPONENTS = ("norm", "x", "y", "z")


class SceneName(click.ParamType[str]):
    """A bundled scene or a path; the shell completes both."""

    name = "scene"

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002 - signature of click
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        """Offer the bundled names, and files."""
        from warpspace.scene.library import scene_names

        names = [name for name in scene_names() if name.startswith(incomplete)]
        return [CompletionItem(name) for name in names] or [CompletionItem(incomplete, type="file")]


def scene_argument(name: str = "scene", **kwargs: Any) -> Decorator:
    """Add a SCENE argument."""
    return click.argument(name, type=SceneName(), **kwargs)


json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print exactly one JSON object on stdout."
)
loop_option = click.option(
    "--loop",
    type=click.Choice(LOOPS),
    default="tool",
    show_default=True,
    help="Structural loop: tool point, workpiece point, or tool relative to workpiece.",
)
direction_option = click.option(
    "--direction",
    type=click.Choice(DIRECTIONS),
    help="Direction of travel for errors that depend on it: their mean, forward, backward, or the"
    " difference forward − backward, which maps the reversal.  [what the scene says]",
)
component_option = click.option(
    "--component",
    type=click.Choice(COMPONENTS),
    default="norm",
    show_default=True,
    help="What the colours show: the length |E| of the error, or one signed component, in µm.",
)
exaggeration_option = click.option(
    "--exaggeration",
    metavar="auto|N",
    help="Display factor of displacements: a number, or auto for a round one that suits the scene."
    "  [what the scene says]",
)
at_option = click.option(
    "--at",
    "points",
    multiple=True,
    metavar="X=..,Y=..",
    help="Axis positions in mm and degrees, for instance X=0,Y=-225,Z=-480. Repeatable. Axes left"
    " out stand at their place in the scene (the middle of a range).",
)


def grid_option(default: int | None = 21, of: str = "of the working volume") -> Decorator:
    """Add the option --grid: nodes per axis of what is named."""
    unsaid = "" if default else "  [21]"
    return click.option(
        "--grid",
        type=int,
        default=default,
        show_default=default is not None,
        help=f"Nodes per axis {of}, 2 to 101.{unsaid}",
    )


def parse_point(text: str, axes: Collection[str], option: str = "--at") -> dict[str, float]:
    """Read axis positions as a user types them.

    Parameters
    ----------
    text : str
        For instance ``X=0,Y=-225,B=30``.
    axes : collection of str
        Letters of the axes there are.
    option : str, optional
        What it was given with, for messages.

    Returns
    -------
    dict of str to float, mm or degrees

    Raises
    ------
    OptionError
        If it cannot be read.
    """
    expected = "expected axis=number pairs with commas between, for instance X=0,Y=-225,B=30"
    found: dict[str, float] = {}
    for part in text.replace(";", ",").split(","):
        name, equals, number = part.partition("=")
        name = name.strip().upper()
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not equals or not math.isfinite(value) or not (len(name) == 1 or is_axis_name(name)):
            raise OptionError(f"{option} {text!r}: {part.strip()!r} cannot be read; {expected}")
        if name not in axes:
            known = ", ".join(axes)
            raise OptionError(f"{option} {text!r}: unknown axis {name}; expected one of {known}")
        if name in found:
            raise OptionError(f"{option} {text!r}: axis {name} is given twice")
        if abs(value) > 1e5:
            raise OptionError(
                f"{option} {text!r}: {value:g}; expected at most ±100000 mm or degrees"
            )
        found[name] = value
    return found


def warn_outside_travel(machine: "Machine", point: Mapping[str, float]) -> None:
    """Say on stderr where a position lies outside the travel of its axis.

    Parameters
    ----------
    machine : Machine
    point : mapping of str to float, mm or degrees
        As typed.
    """
    for name, value in point.items():
        axis = machine.axes[name]
        low, high = axis.travel
        if not low <= value <= high:
            unit = f" {axis.unit}" if axis.is_linear else axis.unit
            echo(
                f"warpspace: warning: --at {name}={value:g} is outside the travel of {name},"
                f" {low:g} to {high:g}{unit}; its errors are continued beyond it",
                err=True,
                fg="yellow",
            )


def parse_exaggeration(text: str | None) -> float | Literal["auto"] | None:
    """Read a display factor as a user types it.

    Parameters
    ----------
    text : str or None
        A number or "auto"; None where the option is absent.

    Returns
    -------
    float, "auto" or None

    Raises
    ------
    OptionError
        If it is neither.
    """
    if text is None:
        return None
    if text.strip().lower() == "auto":
        return "auto"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise OptionError(f"--exaggeration {text!r}; expected auto or a number above 0")
    return value


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object; numbers that are not finite are refused rather than misspelt."""
    click.echo(spell_json(value))


def spell_json(value: object) -> str:
    """Spell a value as JSON; numbers that are not finite are refused rather than misspelt."""
    return escape_json(json.dumps(value, ensure_ascii=False, allow_nan=False))
