"""The table of compensation whose effect is drawn: in words, and without it."""

from dataclasses import replace

from warpspace.app.state.app_state import AppState, Side

WITHOUT = "Of the machine without the table of compensation, which the box is drawn with: {}."
"""Said wherever numbers are worked out from the errors, not taken from what is drawn."""


def table_words(state: AppState) -> str:
    """Say which table corrects the machine; empty where none does."""
    return "" if state.controller is None else f"with the table {state.controller.label}"


def drawn_tables(state: AppState) -> tuple[str, ...]:
    """Name the tables of a state and of what it is compared with, each once."""
    sides: tuple[Side | None, ...] = (state.comparison.a, state.comparison.b)
    held = (state, *(side.state for side in sides if side is not None))
    found = [one.controller.label for one in held if one is not None and one.controller is not None]
    return tuple(dict.fromkeys(found))


def without_words(state: AppState) -> str:
    """Say that numbers are of the machine without a table; empty where there is none."""
    names = " and ".join(drawn_tables(state))
    return WITHOUT.format(names) if names else ""


def without_table(state: AppState) -> AppState:
    """Give a state without its table; a comparison that has one ends, since it would be another.

    What was pinned goes with it, if it has a table.
    """
    if not drawn_tables(state):
        return state
    return replace(state, controller=None, comparison=replace(state.comparison.off(), pinned=None))
