"""Validate the sections of a raw document one by one and collect every problem in plain words."""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from warpspace.exceptions import near_miss
from warpspace.scene.schema import (
    TAGS,
    ConventionSection,
    DefaultTolerances,
    ErrorSpec,
    MachineSection,
    PointsSection,
    RangeSpec,
    Text,
    ToleranceValue,
    ViewSection,
)

_ADAPTERS: dict[str, TypeAdapter[Any]] = {
    "text": TypeAdapter(Text),
    "machine": TypeAdapter(MachineSection),
    "convention": TypeAdapter(ConventionSection),
    "range": TypeAdapter(RangeSpec),
    "points_mm": TypeAdapter(PointsSection),
    "error": TypeAdapter(ErrorSpec),
    "tolerance": TypeAdapter(ToleranceValue),
    "default": TypeAdapter(DefaultTolerances),
    "view": TypeAdapter(ViewSection),
}
_SHOWN = 60
_EXPECTED = {
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "string_type": "expected a text",
    "dict_type": "expected a table",
    "model_type": "expected a table",
    "model_attributes_type": "expected a table",
    "list_type": "expected a list",
    "tuple_type": "expected a list",
    "finite_number": "expected a finite number",
    "missing": "is missing",
    "union_tag_invalid": "expected another kind of value",
}
_FIELDS = {
    name: frozenset(model.model_fields)
    for name, model in (
        ("machine", MachineSection),
        ("convention", ConventionSection),
        ("points_mm", PointsSection),
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
        shown = "" if value is ... else f" = {shorten(value)}"
        self.lines.append(f"{key}{shown}: {text}" if key else text)

    def unknown(self, section: str, name: str, known: Iterable[str], what: str) -> None:
        """Note a name that is not among the known ones."""
        prefix = f"{section}." if section else ""
        self.lines.append(f"{prefix}{name}: unknown {what}{near_miss(name, known)}")

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
        where = location(key, item["loc"])
        kind = str(item["type"])
        if kind == "extra_forbidden":
            parent, _, name = where.rpartition(".")
            self.unknown(parent, name, _FIELDS.get(adapter, ()), "key")
        elif kind == "missing":
            self.add(where, "is missing")
        elif kind in ("tuple_type", "too_long", "missing_argument") and "actual" in item:
            self.add(where, str(item["msg"]).lower(), item["input"])
        else:
            message = str(item["msg"])
            text = _EXPECTED.get(kind, message[0].lower() + message[1:])
            self.add(where, text.replace("input should be", "expected"), item["input"])

    def table(self, key: str, value: object) -> dict[str, object]:
        """Give a table as a dictionary; note a problem and give an empty one for anything else."""
        if value is None:
            return {}
        if isinstance(value, dict):
            return {str(name): entry for name, entry in value.items()}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
        self.add(key, "expected a table", value)
        return {}


def location(key: str, parts: Iterable[int | str]) -> str:
    """Spell a location as it stands in the file, without the tags of unions."""
    text = key
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part not in TAGS or (part in ("ramp", "poly", "table") and text.endswith(f".{part}")):
            text += f".{part}" if text else part
    return text


def shorten(value: object) -> str:
    """Show a value from a file in at most a line."""
    text = repr(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "…"
