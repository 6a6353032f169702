"""A comparison as one line of text: what is compared, what is drawn, and what was pinned.

A side that is a scene, and what was pinned, are spelt as links of their own, so that they come
back as they are seen: by the name of a scene that is known, or with all that is in them.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from urllib.parse import urlencode

from warpspace.app.evaluation.compare import plain_state, scene_side
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import BEFORE, NOBODY, PRESENT, SHOWN, Comparison, Side
from warpspace.exceptions import OptionError

PREFIX = "compare."
PINNED = "pinned"
NOW = "now"
"""What is steered, in files and links."""
TITLE, OLD_TITLE = f"{BEFORE}: ", "snapshot: "
"""What the title of a pinned state begins with, now and in older files and links."""
LONGEST_TITLE = 200
NAMES = frozenset({"a", "b", "shown", "ghost", PINNED, "a.title", "b.title", "pinned.title"})
Write = Callable[[AppState], str]
Read = Callable[[str], AppState]


def comparison_line(comparison: Comparison[AppState], write: Write) -> str:
    """Spell a comparison as a query string.

    Parameters
    ----------
    comparison : Comparison[AppState]
    write : callable
        Spells a plain state as a link.

    Returns
    -------
    str
        Empty where nothing is compared and nothing pinned.
    """
    pairs: list[tuple[str, str]] = []
    for name, side in (("a", comparison.a), ("b", comparison.b)):
        if side is None or (name == "a" and side.state is None):
            continue
        pairs.append((name, _side_text(side, write)))
        if side.is_scene and side.state and side.title != scene_side(side.state.scene).title:
            pairs.append((f"{name}.title", side.title))
    if comparison.shown != Comparison().shown:
        pairs.append(("shown", comparison.shown))
    if not comparison.ghost:
        pairs.append(("ghost", "0"))
    pinned = comparison.pinned
    if pinned is not None and pinned.state is not None:
        pairs += [(PINNED, write(pinned.state)), ("pinned.title", pinned.title)]
    return urlencode([(PREFIX + name, value) for name, value in pairs])


def _side_text(side: Side[AppState], write: Write) -> str:
    """Spell one side: what is steered, a scene, or what was pinned."""
    if side.state is None:
        return NOW
    return write(side.state) if side.is_scene else PINNED


def with_comparison(state: AppState, pairs: Mapping[str, str], read: Read) -> AppState:
    """Give a state the comparison that somebody has written down.

    Parameters
    ----------
    state : AppState
    pairs : mapping of str to str
        Anything: it comes from a link or an uploaded file. What does not begin with `PREFIX` is
        not looked at.
    read : callable
        Builds the plain state of a link; raises where there is none.

    Returns
    -------
    AppState
        Numbers of the pinned state that are out of range are clamped; `notes` says so. In older
        links A was what is steered and B what was pinned: they change places, so that the change
        is still that from before to after.

    Raises
    ------
    WarpspaceError
        If anything in it means nothing: half a comparison would be another one.
    """
    given = {k.removeprefix(PREFIX): v for k, v in pairs.items() if k.startswith(PREFIX)}
    if not given:
        return state
    for name in given:
        if name not in NAMES:
            raise OptionError(f"the comparison says {name[:30]!r}, which means nothing")
    pinned = None
    notes = state.notes
    if PINNED in given:
        before = read(given[PINNED])
        notes = (*notes, *(f"{BEFORE}: {note}" for note in before.notes))
        plain = replace(plain_state(before), notes=())
        given_title = given.get("pinned.title", "")
        title = TITLE + given_title.removeprefix(OLD_TITLE).removeprefix(TITLE)
        pinned = Side(title[:LONGEST_TITLE], plain)
    a, b = (_side(given, name, pinned, read) for name in "ab")
    shown, ghost = given.get("shown", Comparison().shown), given.get("ghost", "1")
    if shown not in SHOWN or ghost not in ("0", "1"):
        raise OptionError("the comparison does not say what is drawn: expected a, b or difference")
    if given.get("pinned.title", "").startswith(OLD_TITLE) and a is None and b is pinned:
        a, b, shown = pinned, Side(), {"a": "b", "b": "a"}.get(shown, shown)
    found = Comparison(a or Side(), b, shown, ghost == "1", pinned)
    return replace(state, comparison=found, notes=notes)


def _side(
    given: Mapping[str, str], name: str, pinned: Side[AppState] | None, read: Read
) -> Side[AppState] | None:
    """Read one side; None where there is none."""
    text = given.get(name)
    if text is None or text == NOW:
        return None if text is None else Side()
    if text == PINNED:
        if pinned is None:
            raise OptionError("the comparison is with a pinned state, but holds none")
        return pinned
    side = scene_side(read(text).scene)
    title = given.get(f"{name}.title", side.title)[:LONGEST_TITLE]
    return side if title in (NOW, PRESENT, NOBODY, "") else replace(side, title=title)
