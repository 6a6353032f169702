"""Solo, mute and curve of one error as three small buttons: HTML, and what a click of them does."""

import html
from collections.abc import Callable

from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.exclusions import Exclusions
from warpspace.machine.parameters import Parameter

SOLO, MUTE, CURVE = "solo", "mute", "curve"
Attributes = Callable[[str], str]
_WAVE = (
    '<svg width="12" height="10" viewBox="0 0 12 10" aria-hidden="true"><path d="M1 5c1.7-5.5'
    ' 3.3-5.5 5 0s3.3 5.5 5 0" fill="none" stroke="currentColor" stroke-width="1.5"/></svg>'
)
STYLE = """<style>
.ws-error { position: relative; height: 0; z-index: 1; }
.ws-error > span { position: absolute; right: 10px; top: -1px; display: flex; gap: 2px; }
.ws-error button { width: 20px; height: 20px; padding: 0; border-radius: 4px; cursor: pointer;
  display: flex; align-items: center; justify-content: center; background: none; color: inherit;
  border: 1px solid rgba(128, 128, 128, .4); font: 600 11px/1 system-ui, sans-serif; opacity: .7; }
.ws-error button:hover { opacity: 1; border-color: currentColor; }
.ws-error button:focus-visible { opacity: 1; outline: 2px solid
  var(--mantine-primary-color-filled); outline-offset: 1px; }
.ws-error button[aria-pressed="true"] { opacity: 1; color: var(--mantine-color-body);
  background: var(--mantine-primary-color-filled); border-color: transparent; }
.ws-error button[aria-pressed="true"][data-word^="mute"] {
  background: var(--mantine-color-text); }
div:has(> .ws-error) + div p { white-space: nowrap; overflow: hidden; text-overflow: ellipsis;
  padding-right: 65px; box-sizing: border-box !important; font-size: .83em !important;
  letter-spacing: -.3px !important; }
div:has(> .ws-error) + div label wbr { display: none; }
/* what is silent stands back, and can still be moved */
div:has(> .ws-silent) + div { opacity: .45; }
</style>"""
"""Put the buttons at the end of the line with the slider's label, which follows them."""


def emphasis_buttons(row: Parameter, exclusions: Exclusions, button: Attributes) -> str:
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
        HTML to stand directly before the error's slider, see `STYLE`.
    """
    name = html.escape(f"{row.key}, {row.name}", quote=True)
    active = exclusions.active(row.key)
    silent = "" if active else " ws-silent"
    group = name if active else f"{name}, silent"
    solo, mute = row.key in exclusions.soloed, row.key in exclusions.muted
    switches = (
        (SOLO, "S", "Solo", solo, "Solo: hear this error alone, or with others on solo"),
        (MUTE, "M", "Mute", mute, "Mute: leave this error out; its value is kept"),
    )
    spelt = "".join(
        f'<button {button(f"{word} {row.key}")} aria-pressed="{str(on).lower()}" '
        f'aria-label="{label} {name}" title="{hint}">{letter}</button>'
        for word, letter, label, on, hint in switches
    )
    return (
        f'<div class="ws-error{silent}" role="group" aria-label="{group}"><span>{spelt}'
        f'<button {button(f"{CURVE} {row.key}")} aria-label="Curve of {name}" '
        f'title="Curve along {row.axis}, below">{_WAVE}</button></span></div>'
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
