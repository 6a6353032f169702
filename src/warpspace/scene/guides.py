"""Reading the positioning errors of the two guides of a gantry: a mean, and a rotation."""

from collections.abc import Collection
from pathlib import Path
from typing import TypeGuard, cast

from warpspace.exceptions import OptionError
from warpspace.machine.curves.combination import combine_curves
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.description import Machine
from warpspace.machine.gantry import Gantry, default_across
from warpspace.machine.parameters import PARAMETERS
from warpspace.scene.curves import read_curve
from warpspace.scene.sections import Problems

KEY = "guides"
MEAN = (0.5, 0.5)


def is_guides(raw: object) -> TypeGuard[dict[str, object]]:
    """Tell whether the value of an error gives the curves of two guides."""
    return isinstance(raw, dict) and KEY in raw


def read_guides(
    key: str,
    raw: dict[str, object],
    span: tuple[float, float],
    where: str,
    folder: Path | None,
    problems: Problems,
    machine: Machine,
    given: Collection[str],
) -> dict[str, ErrorFunction]:
    """Read ``{ guides = [CURVE, CURVE] }``.

    Parameters
    ----------
    key : str
        Of the error.
    raw : dict of str to object
    span : tuple of float, (2,), mm
        Range of the axis.
    where : str
        Place of the value in the file.
    folder : Path or None
        Folder that CSV names are relative to; None where CSV files are not allowed.
    problems : Problems
        What was found so far.
    machine : Machine
    given : collection of str
        Keys of the other errors of the file.

    Returns
    -------
    dict of str to ErrorFunction
        The mean as the positioning error of the axis, the difference over the distance of the
        guides as its rotation; empty where problems were noted.
    """
    axis = PARAMETERS[key].axis
    gantry = machine.gantries.get(axis)
    if gantry is None:
        # The rest is checked all the same, with a distance that plays no part.
        problems.add(where, f"guides need the distance between them; expected {_spelled(axis)}")
        gantry = Gantry(axis, 1000.0, default_across(axis))
    if key != gantry.positioning_key:
        expected = f"expected guides in {gantry.positioning_key}, the positioning of {axis}"
        problems.add(where, expected, raw)
        return {}
    if gantry.rotation_key in given:
        found = f"follows from the guides of {key}; expected one of the two"
        problems.add(f"errors.{gantry.rotation_key}", found)
    for name in raw:
        if name != KEY:
            problems.unknown(where, name, (KEY,), "key")
    pair = raw[KEY]
    entries = cast("list[object]", pair) if isinstance(pair, list) else []
    if len(entries) != 2:
        problems.add(f"{where}.{KEY}", "expected [first guide, second guide]", pair)
        return {}
    curves = [
        read_curve(
            entry,
            span,
            f"{where}.{KEY}[{index}]",
            folder,
            problems,
            axis=axis,
            axes=machine.axes,
        )
        for index, entry in enumerate(entries)
    ]
    first, second = curves
    if first is None or second is None:
        return {}
    weight = gantry.rotation_weight
    try:
        return {
            key: combine_curves(first, second, MEAN),
            gantry.rotation_key: combine_curves(first, second, (-weight, weight)),
        }
    except OptionError as error:
        problems.add(where, str(error))
        return {}


def _spelled(axis: str) -> str:
    """Spell the table that makes an axis a gantry."""
    return f"[machine.gantry] {axis} = {{ span_mm = 1800 }} (a linear axis)"
