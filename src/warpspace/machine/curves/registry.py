"""The kinds of error curve there are. A new one is a module beside this and a line below."""

from collections.abc import Mapping

from warpspace.exceptions import UnknownNameError
from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.harmonics import Harmonics
from warpspace.machine.curves.poly import Poly
from warpspace.machine.curves.ramp import Ramp
from warpspace.machine.curves.table import Table

CurveKind = type[ErrorFunction]
Form = tuple[str, ...]
"""Keys of the table that spells a curve in a scene file."""

_KINDS: list[CurveKind] = [Constant, Ramp, Poly, Harmonics, Table]
"""In the order of lists: simplest first."""


def curve_kinds() -> tuple[CurveKind, ...]:
    """List all kinds of curve, simplest first."""
    return tuple(_KINDS)


def curve_kind(title: str) -> CurveKind:
    """Find a kind of curve by its title.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    kinds = {kind.title: kind for kind in _KINDS}
    if title not in kinds:
        raise UnknownNameError("kind of curve", title, kinds)
    return kinds[title]


def register_curve(kind: CurveKind) -> None:
    """Add a kind of curve; it appears in scene files, the app, reports and figures.

    Parameters
    ----------
    kind : type
        A subclass of `ErrorFunction` with a name, a title and keys in scene files of its own.

    Raises
    ------
    ValueError
        If another kind has one of them.
    """
    for other in _KINDS:
        keys = {form[0] for form in kind.forms} & {form[0] for form in other.forms}
        if keys or kind.name == other.name or kind.title == other.title:
            raise ValueError(
                f"the kind of curve {kind.name!r} cannot be added: {other.name!r} has the same"
                " name, title or key; expected ones of its own"
            )
    _KINDS.append(kind)


def unregister_curve(kind: CurveKind) -> None:
    """Take away a kind of curve that was added."""
    _KINDS.remove(kind)


def find_form(raw: Mapping[str, object]) -> tuple[CurveKind, Form] | None:
    """Find the kind of curve, and its form, that a table of a scene file spells."""
    return next(
        ((kind, form) for kind in _KINDS for form in kind.forms if form[0] in raw),
        None,
    )


def spell_forms() -> str:
    """Spell all that a scene file may give for an error."""
    tables = (
        "{ " + ", ".join(f"{key} =" for key in form).replace("=,", "= ,") + " }"
        for kind in _KINDS
        for form in kind.forms
    )
    return f"a number or one of {', '.join(tables)}"
