"""Texts of the forms: options of analyses by ``NAME.OPTION``, and the standard test, ``test``."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from warpspace.analysis.description import Analysis
from warpspace.analysis.options import Option
from warpspace.analysis.registry import entries
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Unreadable
from warpspace.app.state.typed_numbers import read_typed
from warpspace.bench.base import bench_names
from warpspace.exceptions import OptionError
from warpspace.scene.model import Scene

A = TypeVar("A", bound=Analysis)
TEST = "test"  # selected standard test; also the prefix of its options
MAX_ENTRIES, LONGEST = 100, 1000  # entries, and characters of one
_OPTION = re.compile(r"[a-z_]{1,40}")


def linked_forms(state: AppState) -> list[tuple[str, str]]:
    forms = state.forms.items()
    return [(name, text) for name, text in forms if _is_known(name) and len(text) <= LONGEST]


def with_form(state: AppState, name: str, text: str) -> AppState:
    """Set a form text from the page or a link; raises `Unreadable`."""
    if not _is_known(name) or (name == TEST and text not in bench_names()):
        raise Unreadable("expected an option of an analysis, or the name of a test")
    if len(state.forms) >= MAX_ENTRIES:
        raise Unreadable(f"expected at most {MAX_ENTRIES} options")
    return replace(state, forms={**state.forms, name: text[:LONGEST]})


def _is_known(name: str) -> bool:
    part, dot, option = name.partition(".")
    if not dot:
        return name == TEST
    is_listed = part == TEST or part in {entry.name for entry in entries()}
    return is_listed and _OPTION.fullmatch(option) is not None


def option_values(state: AppState, name: str) -> dict[str, str]:
    prefix = f"{name}."
    return {k.removeprefix(prefix): v for k, v in state.forms.items() if k.startswith(prefix)}


def read_form(
    kind: type[A], options: Sequence[Option], values: Mapping[str, str], scene: Scene
) -> A:
    """Build an analysis from texts; an `OptionError` refers to an option as ``{name}``."""
    arguments: dict[str, Any] = {}
    for option in options:
        text = values.get(option.name)
        if text is None or (not text.strip() and option.kind is not bool):
            continue
        if option.kind is bool:
            arguments[option.name] = text == "1"
        elif option.kind in (int, float) and option.grammar is None:
            number = read_typed(text, option.unit)
            if number is None:
                raise OptionError(f"{{{option.name}}} {text!r}; expected a number")
            arguments[option.name] = option.kind(number)
        elif option.grammar is not None and option.grammar.each:
            arguments[option.name] = tuple(option.read(word, scene) for word in text.split())
        else:
            arguments[option.name] = option.read(text, scene)
    return kind(**arguments)
