"""Validate the sections of a raw document one by one and collect every problem in plain words."""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from warpspace.exceptions import SHOWN_PROBLEMS, near_miss
from warpspace.scene.schema import (
    ALTERNATIVES,
    TAG_AT,
    BodySection,
    ConventionSection,
    DefaultTolerances,
    MachineSection,
    PointsSection,
    RangeSpec,
    Text,
    ToleranceSpec,
    ToleranceValue,
    ViewSection,
)
from warpspace.scene.words import location, spell_value

_ADAPTERS: dict[str, TypeAdapter[Any]] = {
    "text": TypeAdapter(Text),
    "machine": TypeAdapter(MachineSection),
    "body": TypeAdapter(BodySection),
    "convention": TypeAdapter(ConventionSection),
    "range": TypeAdapter(RangeSpec),
    "points_mm": TypeAdapter(PointsSection),
    "tolerance": TypeAdapter(ToleranceValue),
    "default": TypeAdapter(DefaultTolerances),
    "view": TypeAdapter(ViewSection),
}
_EXPECTED = {
    "string_type": "expected a text",
    "dict_type": "expected a table",
    "model_type": "expected a table",
    "model_attributes_type": "expected a table",
    "list_type": "expected a list",
    "finite_number": "expected a finite number",
    "too_long": "expected at most {max_length} entries",
    "string_too_long": "expected at most {max_length} characters",
    "less_than_equal": "expected at most {le:g}",
    "greater_than_equal": "expected at least {ge:g}",
    "greater_than": "expected a number above {gt:g}",
}
_WRONG_TYPE = frozenset({"float_type", "literal_error"})
_FIELDS = {
    name: tuple(model.model_fields)
    for name, model in (
        ("machine", MachineSection),
        ("body", BodySection),
        ("convention", ConventionSection),
        ("points_mm", PointsSection),
        ("tolerance", ToleranceSpec),
        ("default", DefaultTolerances),
        ("view", ViewSection),
    )
}


class Problems:
    """A list of problems that validation adds to."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, key: str, text: str, value: object = ...) -> None:
        """Note one problem: key, value and what was expected."""
        shown = "" if value is ... else f" = {spell_value(value)}"
        self.lines.append(f"{key}{shown}: {text}" if key else text)

    def unknown(self, section: str, name: str, known: Iterable[str], what: str) -> None:
        """Note a name that is not among the known ones."""
        hint = near_miss(name, known) if len(self.lines) < SHOWN_PROBLEMS else ""
        self.lines.append(f"{location(section, [name])}: unknown {what}{hint}")

    def unknown_value(self, key: str, value: str, known: Iterable[str], what: str) -> None:
        """Note a value that is not among the known names."""
        self.add(key, f"unknown {what}{near_miss(value, known)}", value)

    def validate(self, adapter: str, key: str, value: object) -> Any:
        """Validate one value.

        Parameters
        ----------
        adapter : str
            Name of the kind of value.
        key : str
            Where it stands in the file.
        value : object

        Returns
        -------
        object or None
            The validated value; None where problems were noted.
        """
        try:
            return _ADAPTERS[adapter].validate_python(value)
        except ValidationError as error:
            for item in error.errors(include_url=False):
                self._note(adapter, key, dict(item))
        return None

    def _note(self, adapter: str, key: str, item: Mapping[str, Any]) -> None:
        """Put one pydantic finding into the words of the file."""
        kind, parts = str(item["type"]), tuple(item["loc"])
        tag_at = TAG_AT.get(adapter)
        where = location(key, parts, tag_at)
        if kind == "extra_forbidden":
            known = _FIELDS.get(adapter, ())
            self.unknown(location(key, parts[:-1], tag_at), str(parts[-1]), map(str, known), "key")
        elif kind == "missing":
            self.add(where, "is missing")
        else:
            union = (
                None if tag_at is None or len(parts) != tag_at + 1 else (adapter, *parts)[tag_at]
            )
            self.add(where, _expected(kind, item, union), item["input"])

    def table(self, key: str, value: object) -> dict[str, object]:
        """Give a table as a dictionary; note a problem and give an empty one for anything else."""
        if value is None:
            return {}
        if isinstance(value, dict):
            return {str(name): entry for name, entry in value.items()}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
        self.add(key, "expected a table", value)
        return {}


def _expected(kind: str, item: Mapping[str, Any], union: int | str | None) -> str:
    """Say what was expected where pydantic found something else."""
    huge = isinstance(item["input"], int) and not isinstance(item["input"], bool)
    if union in ALTERNATIVES and kind in _WRONG_TYPE and not (huge and kind == "float_type"):
        return f"expected {ALTERNATIVES[str(union)]}"
    if kind == "float_type":
        return "is too large; expected a finite number" if huge else "expected a number"
    context = dict(item.get("ctx", {}))
    if kind == "literal_error":
        return f"expected {context['expected']}".replace("'", '"')
    return _EXPECTED[kind].format(**context) if kind in _EXPECTED else str(item["msg"])
