"""The switchboard of conventions as HTML: every choice with what it changes."""

from collections.abc import Callable, Mapping

from warpspace.app.evaluation.conventions import Effect, choices, chosen, own_state
from warpspace.app.state.app_state import AppState
from warpspace.machine.parameters import LINEAR_AXES

GROUPS = {
    "component_errors": ("Component errors", "where the errors of a motion act"),
    "loop": ("Loop", "whose error is looked at"),
    "reference": ("Reference", "what is held still"),
    "rotary": ("Table direction", "+1 with its name, −1 against"),
    "linear": ("Direction of linear axes", "likewise"),
}
WORDS = {
    "component_errors=after_motion": "after motion (moving body)",
    "component_errors=before_motion": "before motion (fixed directions)",
    "loop=tool": "tool point",
    "loop=workpiece": "workpiece point",
    "loop=relative": "tool relative to workpiece",
    "reference=absolute": "absolute",
    "reference=point": "a point is held still",
}
Attributes = Callable[[str, str], str]
_CELL = 'style="text-align:right;padding:3px 0 3px 6px;font-variant-numeric:tabular-nums"'


def spell_choice(choice: str) -> str:
    """Spell a choice for people."""
    if choice in WORDS:
        return WORDS[choice]
    axis, _, sign = choice.removeprefix("direction ").partition("=")
    return f"{axis} {'+1' if sign == '1' else '−1'}"


def _group(choice: str) -> str:
    """Give the key of `GROUPS` that a choice belongs to."""
    what, _, axis = choice.split("=", maxsplit=1)[0].partition(" ")
    return what if not axis else "linear" if axis in LINEAR_AXES else "rotary"


def switchboard_html(state: AppState, effects: Mapping[str, Effect], attributes: Attributes) -> str:
    """Spell the switchboard.

    Parameters
    ----------
    state : AppState
    effects : mapping of str to Effect
        By choice; what is missing is not known yet.
    attributes : callable
        Gives the attributes that make a row clickable, by choice and ARIA role.

    Returns
    -------
    str
        HTML without any word of a user's.
    """
    in_force, own = chosen(state), chosen(own_state(state))
    rows: list[str] = []
    group = ""
    for choice in choices(state):
        name = _group(choice)
        if name != group:
            group = name
            title, meaning = GROUPS[name]
            rows.append(
                f'<tr><td colspan="4" style="padding:8px 0 1px"><b>{title}</b>'
                f' <span style="opacity:.65">{meaning}</span></td></tr>'
            )
        on = choice in in_force
        dot = "●" if on else "○"
        weight = "font-weight:600;" if on else ""
        mark = ' <span style="opacity:.6;font-weight:400">scene</span>' if choice in own else ""
        rows.append(
            f'<tr data-choice="{choice}" aria-checked="{str(on).lower()}"'
            f' style="cursor:pointer;{weight}" {attributes(choice, "radio")}>'
            f'<td style="width:16px">{dot}</td><td>{spell_choice(choice)}{mark}</td>'
            f"{_numbers(effects.get(choice), is_own=choice in own)}</tr>"
        )
    total = effects.get("all")
    rows.append(
        '<tr data-choice="all" style="border-top:1px solid rgba(128,128,128,.6)"><td></td>'
        f"<td>all choices together</td>{_numbers(total, is_own=False)}</tr>"
    )
    return (
        '<div style="padding:0 12px 8px;line-height:1.35;font-size:12px">'
        '<table style="width:100%;border-collapse:collapse">'
        f'<tr style="opacity:.65"><td colspan="2">changes the map by [µm]</td>'
        f"<td {_CELL}>mean</td><td {_CELL}>max</td></tr>{''.join(rows)}</table>"
        '<div style="opacity:.65;margin-top:4px">Length of the change at the same axis positions,'
        " each choice alone against the scene's own conventions, over 7×7×7 nodes.</div></div>"
    )


def _numbers(effect: Effect | None, *, is_own: bool) -> str:
    """Spell what a choice changes."""
    if is_own:
        return f"<td {_CELL}>–</td><td {_CELL}>–</td>"
    if effect is None:
        return f"<td {_CELL}>…</td><td {_CELL}>…</td>"
    return f"<td {_CELL}>{effect.mean_um:.2f}</td><td {_CELL}>{effect.max_um:.2f}</td>"
