"""Registry of error curves: a new kind is a module and a line below."""

from collections.abc import Mapping

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.polynomial_pieces import Pieces
from warpspace.machine.curves.simple import Constant, Directional, Harmonics, Poly, Ramp
from warpspace.machine.curves.table import TableCurve, TwoArguments
from warpspace.plugins import Registry

CurveKind = type[ErrorFunction]
Form = tuple[str, ...]  # keys of the table of a curve in a scene file

_KINDS: Registry[CurveKind] = Registry(
    "kind of curve",
    {
        kind.name: kind
        for kind in (Constant, Ramp, Poly, Harmonics, TableCurve, TwoArguments, Directional, Pieces)
    },
)
"""By name, in the order of lists, the simplest first."""
curve_kinds, unregister_curve = _KINDS.members, _KINDS.unregister


def curve_kind(title: str) -> CurveKind:
    kinds = {kind.title: kind for kind in curve_kinds()}
    if title not in kinds:
        raise UnknownNameError("kind of curve", title, kinds)
    return kinds[title]


def register_curve(kind: CurveKind) -> None:
    """Add a kind of curve; it appears in scene files, the app, reports and figures."""
    for other in _KINDS.values():
        keys = {form[0] for form in kind.forms} & {form[0] for form in other.forms}
        if keys or kind.title == other.title:
            raise OptionError(
                f"kind of curve {kind.name!r}: {other.name!r} is already registered with the same"
                " title or key"
            )
    _KINDS.register(kind)


def find_form(raw: Mapping[str, object]) -> tuple[CurveKind, Form] | None:
    """Find the kind and form of a curve in a table of a scene file."""
    forms = (
        (kind, form)
        for list_kinds in (_KINDS.values, curve_kinds)  # plug-ins are looked for where none fits
        for kind in list_kinds()
        for form in kind.forms
    )
    return next((pair for pair in forms if pair[1][0] in raw), None)


def spell_forms() -> str:
    tables = (
        "{ " + ", ".join(f"{key} =" for key in form).replace("=,", "= ,") + " }"
        for kind in curve_kinds()
        for form in kind.forms
    )
    return f"a number or one of {', '.join(tables)}"
