"""Number box and buttons of one error: only, exclude, curve. HTML, and what a click does."""

from collections.abc import Callable

from markupsafe import Markup

from warpspace.app.readouts.html import render
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.exclusions import Exclusions
from warpspace.machine.parameters import Parameter

ONLY, EXCLUDE, CURVE = "only", "exclude", "curve"
Attributes = Callable[[str], Markup]
SWITCHES = (
    (ONLY, "only", "Only", "Only this error, or only those that are chosen so"),
    (EXCLUDE, "×", "Exclude", "Exclude this error; its value is kept"),
)
"""Word, face, name and explanation of the switches."""


def exclusion_buttons(row: Parameter, exclusions: Exclusions, button: Attributes) -> str:
    """Draw the buttons of one error in their present state.

    Parameters
    ----------
    row : Parameter
    exclusions : Exclusions
    button : callable
        Gives the attributes of a button that sends a word.

    Returns
    -------
    str
        HTML to stand directly before the error's slider: the style sheet puts the buttons
        at the end of the line with the slider's label.
    """
    excluded = {ONLY: exclusions.only, EXCLUDE: exclusions.excluded}
    return render(
        "exclusions",
        row=row,
        name=f"{row.key}, {row.name}",
        active=exclusions.active(row.key),
        switches=[(*switch, row.key in excluded[switch[0]]) for switch in SWITCHES],
        curve=CURVE,
        button=button,
    )


def with_switched(state: AppState, word: str) -> AppState:
    """Do what a click of only or exclude asks for.

    Parameters
    ----------
    state : AppState
    word : str
        For instance "only EAX"; it comes from a browser, and what means nothing changes nothing.
    """
    what, _, key = word.partition(" ")
    if what == ONLY:
        return edits.with_only(state, key, key not in state.exclusions.only)
    if what == EXCLUDE:
        return edits.with_excluded(state, key, key not in state.exclusions.excluded)
    return state
