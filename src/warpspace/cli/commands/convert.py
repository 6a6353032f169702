"""Command `convert`: the errors of a scene in another convention, with the same field."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from warpspace.cli.file_options import check_output, force_option, output_option
from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError, near_miss

if TYPE_CHECKING:
    from warpspace.scene.conversion import Converted, Target
    from warpspace.scene.model import Scene

FORMS = {
    "component_errors": "after_motion or before_motion, or by axis: rotary:before_motion,X:…",
    "straightness": "end_point, least_squares or minimum_zone, or by axis: X:least_squares,…",
    "zero_at": "positions of axes: X:0,Y:-225",
    "reference": "constants, or the point that is held: X:0,Y:0,Z:-280",
    "measuring_line": "points in the frames of axes in mm, x/y/z: X:0/150/-80,…",
    "squareness": "right_hand, over_90 or under_90",
}
"""What each convention takes."""
MAX_SHOWN = 40


@click.command()
@scene_argument()
@click.option(
    "--to",
    "wishes",
    multiple=True,
    required=True,
    metavar="CONVENTION=VALUE",
    help="Repeatable: " + "; ".join(f"{name}={form}" for name, form in FORMS.items()) + ".",
)
@output_option("Scene file to write: .toml.")
@force_option
@json_option
def convert(
    scene: str, wishes: tuple[str, ...], output: str, *, force: bool, as_json: bool
) -> None:
    """Write the errors of SCENE in another convention.

    The field stays the same: the file is read again, and the exact fields of both are compared at
    500 places of the travel, whose largest difference is printed. What cannot be converted exactly
    is refused.
    """
    from warpspace.outputs.files import write_atomically
    from warpspace.scene.conversion import convert_scene
    from warpspace.scene.library import load_scene

    target = check_output(output, (".toml",), force=force, scenes=[scene])
    loaded = load_scene(scene)
    wanted = _target(loaded, wishes)
    with progress("converting", silent=as_json):
        found = convert_scene(loaded, wanted)
    head = f"# Converted from {loaded.name} by warpspace convert: {'; '.join(wishes)}\n"
    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(head + found.text, encoding="utf-8")
    if as_json:
        print_json(_json(found))
        return
    _print(loaded, found)
    echo(f"wrote {output}")


def _target(scene: "Scene", wishes: Sequence[str]) -> "Target":
    """Read what is asked for.

    Raises
    ------
    OptionError
        If an option cannot be read.
    """
    from warpspace.kinematics.conversion.reference_line import ReferenceLine
    from warpspace.kinematics.conversion.squareness import SquarenessSign
    from warpspace.kinematics.model import ComponentErrors
    from warpspace.scene.conversion import Target, choose_axes

    target = Target()
    for wish in wishes:
        name, equals, text = (part.strip() for part in wish.partition("="))
        if not equals or name not in FORMS:
            hint = near_miss(name, FORMS) or f"; expected one of {', '.join(FORMS)}"
            raise OptionError(f"--to {wish!r}: unknown convention {name!r}{hint}")

        def refuse(wish: str = wish, name: str = name) -> OptionError:
            return OptionError(f"--to {wish!r} cannot be read; expected {FORMS[name]}")

        def by_axis(read: Callable[[str], object], kinds: str, text: str = text) -> dict[str, Any]:
            """Read values by axis, or one for all."""
            found: dict[str, object] = {}
            for part in text.split(","):
                axis, colon, value = (word.strip() for word in part.rpartition(":"))
                found |= choose_axes(scene, axis if colon else "all", read(value), kinds)
            return found

        def one_of(
            names: Sequence[str], refuse: Callable[[], OptionError] = refuse
        ) -> Callable[[str], str]:
            """Read one of some names."""

            def read(value: str) -> str:
                if value not in names:
                    raise refuse()
                return value

            return read

        def numbers(count: int, refuse: Callable[[], OptionError] = refuse) -> Callable[[str], Any]:
            """Read so many numbers."""
            return lambda value: _numbers(value, count, refuse)

        if name == "component_errors":
            orders = by_axis(one_of([*ComponentErrors]), "all")
            target = replace(target, component_errors=orders)
        elif name == "straightness":
            lines = by_axis(one_of([*ReferenceLine]), "linear")
            target = replace(target, straightness=lines)
        elif name == "zero_at":
            if ":" not in text:
                raise refuse()
            target = replace(target, zero_at=by_axis(numbers(1), "all"))
        elif name == "reference" and text == "constants":
            target = replace(target, reference=text)
        elif name == "reference":
            if ":" not in text:
                raise refuse()
            target = replace(target, reference=by_axis(numbers(1), "all"))
        elif name == "squareness":
            sign = one_of([*SquarenessSign])(text)
            target = replace(target, notation=replace(target.notation, squareness=sign))
        else:
            if ":" not in text:
                raise refuse()
            places = by_axis(numbers(3), "all")
            target = replace(target, notation=replace(target.notation, measuring_line_mm=places))
    return target


def _numbers(text: str, count: int, refuse: Callable[[], OptionError]) -> Any:
    """Read one number, or several with strokes between."""
    try:
        found = tuple(float(part) for part in text.split("/"))
    except ValueError:
        raise refuse() from None
    limited = all(math.isfinite(value) and abs(value) <= 1e5 for value in found)
    if len(found) != count or not limited:
        raise refuse()
    return found[0] if count == 1 else found


def _json(found: "Converted") -> Mapping[str, object]:
    """Spell the result as the JSON output has it."""
    return {
        "largest_um": found.largest_um,
        "largest_urad": found.largest_urad,
        "changed": {key: {"from": a, "to": b} for key, (a, b) in found.changed.items()},
        "notes": list(found.notes),
    }


def _print(scene: "Scene", found: "Converted") -> None:
    """Print what has changed, and that the field has not."""
    from warpspace.machine.parameters import parameter

    count = len(found.changed)
    print_text(f"{scene.title}: {count} error{'' if count == 1 else 's'} written otherwise")
    columns = (
        Column("error", leads=True),
        Column("unit"),
        *number_columns(("was", "is written"), "largest"),
    )
    rows = [
        (key, parameter(key).unit, f"{a:.4g}", f"{b:.4g}")
        for key, (a, b) in list(found.changed.items())[:MAX_SHOWN]
    ]
    if rows:
        print_table(columns, rows)
    for note in found.notes:
        print_text(f"  {note}")
    print_text(
        f"  exact fields differ by at most {found.largest_um:.1e} µm and"
        f" {found.largest_urad:.1e} µrad (500 places of the travel, read again from the file)"
    )
