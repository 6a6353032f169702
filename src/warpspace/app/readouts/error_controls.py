"""Number box and buttons of one error: only, exclude, curve. HTML, and what a click does."""

from collections.abc import Callable

from markupsafe import Markup

from warpspace.app.readouts.html import render
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.ranges import Exclusions
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.machine.axes import Parameter
from warpspace.machine.errors import Constant
from warpspace.machine.limits import MAX_TYPED_NUMBER

ONLY, EXCLUDE, CURVE, VALUE = "only", "exclude", "curve", "value"
Attributes = Callable[[str], Markup]
SWITCHES = (
    (ONLY, "only", "Only", "Only this error, or only those that are chosen so"),
    (EXCLUDE, "×", "Exclude", "Exclude this error; its value is kept"),
)
"""Word, face, name and explanation of the switches."""


def error_controls(
    row: Parameter,
    exclusions: Exclusions,
    value: float,
    button: Attributes,
    text_box: Attributes,
    attempt: int = 0,
) -> str:
    """Draw the number box and the buttons of one error in their present state."""
    excluded = {ONLY: exclusions.only, EXCLUDE: exclusions.excluded}
    return render(
        "error_controls",
        row=row,
        name=f"{row.key}, {row.name}",
        active=exclusions.active(row.key),
        switches=[(*switch, row.key in excluded[switch[0]]) for switch in SWITCHES],
        curve=CURVE,
        button=button,
        box=text_box(f"{VALUE} {row.key}"),
        number=spell_typed(value),
        longest=MAX_TYPED_NUMBER,
        attempt=attempt,
    )


def refusal(row: Parameter, typed: str, value: float) -> str:
    """Say that what was typed is no number, and which value stays, µm or µrad."""
    kept = spell_typed(value).replace("-", "−")
    return f"{row.key}: “{typed}” is no number; it stays {kept} {row.unit}."


def slider_hint(state: AppState, row: Parameter, effect_um: float | None = None) -> str:
    """Say what the slider of an error moves, and its effect alone, µm, where that is known."""
    function = state.scene.errors.functions.get(row.key)
    meaning = (function or Constant((0.0, 0.0))).slider_words(row.axis)
    span = state.spans[row.key]
    effect = ""
    if effect_um is not None:
        table = " and without a table" if state.controller is not None else ""
        effect = f" Alone{table} it gives the volume an RMS of {effect_um:.3g} µm."
    return (
        f"{row.name}, {row.kind.value}: {meaning}. "
        f"{span.low:g} to {span.high:g} {row.unit}, in the scene {state.start[row.key]:g}.{effect}"
    )


def with_switched(state: AppState, word: str) -> AppState:
    """Do what a click of only or exclude asks for."""
    what, _, key = word.partition(" ")
    if what == ONLY:
        return edits.with_only(state, key, key not in state.exclusions.only)
    if what == EXCLUDE:
        return edits.with_excluded(state, key, key not in state.exclusions.excluded)
    return state
