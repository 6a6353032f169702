"""Solo, mute and curve of one error as three small buttons: HTML, and what a click of them does."""

from collections.abc import Callable

from markupsafe import Markup

from warpspace.app.readouts.html import render
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.exclusions import Exclusions
from warpspace.machine.parameters import Parameter

SOLO, MUTE, CURVE = "solo", "mute", "curve"
Attributes = Callable[[str], Markup]
SWITCHES = (
    (SOLO, "S", "Solo", "Solo: show the effect of this error alone, or with others on solo"),
    (MUTE, "M", "Mute", "Mute: leave this error out; its value is kept"),
)
"""Word, letter, name and explanation of the switches."""


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
    excluded = {SOLO: exclusions.soloed, MUTE: exclusions.muted}
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
    """Do what a click of solo or mute asks for.

    Parameters
    ----------
    state : AppState
    word : str
        For instance "solo EAX"; it comes from a browser, and what means nothing changes nothing.
    """
    what, _, key = word.partition(" ")
    if what == SOLO:
        return edits.with_soloed(state, key, key not in state.exclusions.soloed)
    if what == MUTE:
        return edits.with_muted(state, key, key not in state.exclusions.muted)
    return state
