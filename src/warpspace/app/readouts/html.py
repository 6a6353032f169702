"""HTML of the readouts: one template each, all in the classes of one style sheet.

The templates escape every value by themselves; only what is `Markup` already goes in as it is.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, SupportsFloat

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpspace.app.readouts import numbers
from warpspace.machine.parameters import parameter
from warpspace.picture.coordinates import spell_at, spell_coordinate, spell_point
from warpspace.picture.words import spell_short
from warpspace.units import Array

PACKAGE = "warpspace.app.readouts"


@cache
def _templates() -> Environment:
    """Load the templates of this folder."""
    environment = Environment(
        loader=PackageLoader(PACKAGE),
        autoescape=True,
        undefined=StrictUndefined,
        auto_reload=False,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    spell: dict[str, Callable[..., object]] = {
        "short": spell_short,
        "coordinate": spell_coordinate,
        "signed": numbers.signed,
        "small": numbers.small,
        "parameter": parameter,
    }
    environment.filters.update(spell)
    functions: dict[str, Any] = {"point": point}
    environment.globals.update(functions)
    return environment


def point(axes: Mapping[str, SupportsFloat], point_mm: Array | Sequence[float]) -> Markup:
    """Spell a point in both of its coordinates, with a button that copies it.

    Parameters
    ----------
    axes : mapping of str to float, mm or degrees
        Positions of all axes.
    point_mm : ndarray or sequence of float, [3], mm
        The point in R, as it is drawn.

    Returns
    -------
    Markup
        The button copies what the option ``--at`` of a command takes.
    """
    text = render("point", text=spell_point(axes, point_mm), at=spell_at(axes))
    return Markup(text)  # noqa: S704 - escaped by its template


def render(name: str, /, **values: object) -> str:
    """Fill in the template of a readout.

    Parameters
    ----------
    name : str
        Of a file ``templates/NAME.html.j2``.
    **values
        What the template names; a missing one is an error.

    Returns
    -------
    str
        HTML in the classes of `style_sheet`.
    """
    return _templates().get_template(f"{name}.html.j2").render(values)


def message(text: str, value: str = "", *, small: bool = False) -> str:
    """Put a sentence into a block of its own.

    Parameters
    ----------
    text : str
    value : str, optional
        Name by which tests and scripts find it, in the attribute ``data-value``.
    small : bool, optional
        In small print.
    """
    return render("message", text=text, value=value, small=small)


@cache
def style_sheet() -> str:
    """Give the style sheet that all readouts need on their page, once."""
    return (files(PACKAGE) / "readouts.css").read_text(encoding="utf-8")
