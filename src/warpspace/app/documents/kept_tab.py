"""What a page keeps of its tab, for a server that has been restarted and knows no tab."""

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from warpspace.app.documents.files import safe_name
from warpspace.app.documents.scene_file import (
    MAX_LINK,
    named_link,
    open_link,
    open_text,
    state_to_toml,
)
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import Comparison
from warpspace.app.state.table import without_table
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.limits import MAX_KEPT_TEXT
from warpspace.scene.model import Scene

LINK, FILE, NAME, ALONE, TABLE = "link", "file", "name", "alone", "table"
NEVER_KEPT = (
    "what Undo and Redo could go back to",
    "other scenes that were opened in this tab",
    "which error's curve was shown",
    "a file that was being made",
)
COMPARISON = "the comparison, which was too large to keep"
NO_TABLE = "the table of compensation that the box was drawn with, and its comparison"
START_VALUES = "the values that Reset goes back to: it goes back to those restored"
UNREADABLE = "what this tab has kept cannot be read"


@dataclass(frozen=True, slots=True)
class Restored:
    """What has come back."""

    state: AppState
    camera: CameraMemory | None
    missing: tuple[str, ...]  # what has not, in words


def kept_text(state: AppState, camera: CameraMemory | None, known: Sequence[Scene]) -> str:
    """Spell a state for its page to keep."""
    bare = without_table(state)
    table, state = bare is not state, bare
    alone = replace(state, comparison=Comparison())
    for whole in (state,) if alone == state else (state, alone):
        with suppress(OptionError):
            kept = {NAME: whole.scene.name, FILE: state_to_toml(whole, camera)}
            link = named_link(whole, camera, known)
            if link and len(link) <= MAX_LINK:
                kept[LINK] = link
            if whole is not state:
                kept[ALONE] = "yes"
            if table:
                kept[TABLE] = "yes"
            text = json.dumps(kept)
            if len(text) <= MAX_KEPT_TEXT:
                return text
    return ""


def read_kept(text: str, known: Sequence[Scene]) -> Restored:
    """Build what a page has kept."""
    kept = _parse(text)
    file, link = kept.get(FILE, ""), kept.get(LINK, "")
    lost = {ALONE: COMPARISON, TABLE: NO_TABLE}
    missing = (*NEVER_KEPT, *(words for key, words in lost.items() if key in kept))
    with suppress(WarpspaceError):
        state, camera = open_link(link, known)
        if state_to_toml(state, camera) == file:
            return Restored(state, camera, missing)
    state, camera = open_text(file, safe_name(kept.get(NAME, ""), "kept"), "what this tab has kept")
    return Restored(state, camera, (*missing, START_VALUES))


def _parse(text: str) -> dict[str, str]:
    if len(text) > MAX_KEPT_TEXT:
        raise OptionError(UNREADABLE)
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        raise OptionError(UNREADABLE) from None
    if not isinstance(found, dict):
        raise OptionError(UNREADABLE)
    return {str(key): value for key, value in found.items() if isinstance(value, str)}  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
