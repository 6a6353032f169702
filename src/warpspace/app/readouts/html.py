"""HTML of the readouts: one template each, all in the classes of one style sheet.

The templates escape every value by themselves; only what is `Markup` already goes in as it is.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, SupportsFloat

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from warpspace.machine.axes import parameter
from warpspace.picture.words import spell_at, spell_coordinate, spell_point
from warpspace.units import MINUS, THIN_SPACE, Array, spell_short

# --- Spelling of numbers with their sign, and of large counts -------------------------------------


def signed(value: float, digits: int = 2) -> str:
    """Spell a number with its sign; zero has none."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        text = f"{0.0:.{digits}f}"
    return text.replace("-", MINUS)


def small(value: float) -> str:
    """Spell a signed number that may be tiny: to four decimals, below them in powers of ten."""
    if value == 0.0:
        return "0"
    return (f"{value:+.4f}" if abs(value) >= 5e-5 else f"{value:+.0e}").replace("-", MINUS)


def thousands(count: int) -> str:
    """Spell a large count with thin spaces: ``20 000``."""
    return f"{count:,}".replace(",", THIN_SPACE)


PACKAGE = "warpspace.app.readouts"


@cache
def _templates() -> Environment:
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
        "signed": signed,
        "small": small,
        "parameter": parameter,
        "lowered": lowered,
    }
    environment.filters.update(spell)
    functions: dict[str, Any] = {"point": point}
    environment.globals.update(functions)
    return environment


def lowered(text: str) -> Markup:
    """Set the letter behind an underscore lower: |E_B − E_A|."""
    return Markup(re.sub("_(.)", r"<sub>\1</sub>", str(escape(text))))  # noqa: S704 - escaped before


def point(axes: Mapping[str, SupportsFloat], point_mm: Array | Sequence[float]) -> Markup:
    """Spell a point in both of its coordinates, with a button that copies it."""
    text = render("point", text=spell_point(axes, point_mm), at=spell_at(axes))
    return Markup(text)  # noqa: S704 - escaped by its template


def render(name: str, /, **values: object) -> str:
    """Fill in the template of a readout."""
    return _templates().get_template(f"{name}.html.j2").render(values)


def message(text: str, value: str = "", *, small: bool = False) -> str:
    """Put a sentence into a block of its own."""
    return render("message", text=text, value=value, small=small)


@cache
def style_sheet() -> str:
    """Give the style sheet that all readouts need on their page, once."""
    return (files(PACKAGE) / "readouts.css").read_text(encoding="utf-8")
