"""Review notes of a scene: what somebody pinned, asked or decided, and the numbers it rests on.

A note is never changed in place: an edit is a new version that names those it replaces, so that two
people's files merge without a loss. Where both have edited a note, the versions stand side by side
until somebody chooses one.
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from warpspace.exceptions import OptionError
from warpspace.machine.definition import Vector
from warpspace.machine.limits import MAX_NOTES, MAX_REPLACED, MAX_REPLIES

KINDS = ("note", "question", "decision")
STATUSES = ("open", "done")
TOLERANCES = "tolerances."  # before the key of a half width among what a decision changed
MEASURES = ("mean_um", "max_um", "here_um")
PRINTED_UM = 0.01  # last digit of a stored number; a note whose numbers are off by more is stale
Pair = tuple[float, float]


def now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)


@dataclass(frozen=True, slots=True)
class Reply:
    """What somebody has answered to a note."""

    text: str
    author: str = ""
    date: datetime = field(default_factory=now)


@dataclass(frozen=True, slots=True)
class NoteAnchor:
    """What a note is pinned to, where it is not a point of the volume."""

    loop: str = ""  # of a trace of the rotary axes
    point_mm: Vector | None = None  # the traced point, in the workpiece (or tool) frame
    body: str = ""  # frame of the machine's body, the letter of its axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """One note, question or decision."""

    id: str = field(default_factory=lambda: os.urandom(3).hex())
    kind: str = "note"
    # mm or degrees; where the axes stand at the point it is about; empty: about the whole
    at: Mapping[str, float] = field(default_factory=dict[str, float])
    on: NoteAnchor | None = None  # the trace or body that the point belongs to
    text: str
    author: str = ""
    date: datetime = field(default_factory=now)
    status: str = "open"
    loop: str = "tool"  # that its numbers are of
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])  # µm, by `MEASURES`
    # of a decision: the numbers before it, and from and to of each error, µm or µrad, by key
    before: Mapping[str, float] = field(default_factory=dict[str, float])
    change: Mapping[str, Pair] = field(default_factory=dict[str, Pair])
    step: int = 0  # its place in the story; 0 for none
    view: str = ""  # what was on the screen, as in a link
    replies: tuple[Reply, ...] = ()
    replaces: tuple[str, ...] = ()  # the versions that this one was made from, by `version`
    versions: tuple["Note", ...] = ()  # edits that somebody else made of the same note

    @property
    def version(self) -> str:
        """What this version is known by: a digest of what it says and of what it replaces."""
        from hashlib import sha256  # slow to import, and few scenes have notes

        content = note_to_toml(replace(self, replies=(), versions=()))
        # 275 and 275.0 are one number, as which of them a file gives is not for sure
        canonical = json.loads(json.dumps(content, default=datetime.isoformat), parse_int=float)
        text = json.dumps(canonical, sort_keys=True)
        return sha256(text.encode()).hexdigest()[:12]

    def edited(self, **changes: Any) -> "Note":
        """Give the version after an edit; it replaces this one and those beside it."""
        heads = (self, *self.versions)
        replaced = dict.fromkeys(digest for one in heads for digest in (*one.replaces, one.version))
        # a copy that is older than these is kept beside the note when they are merged
        return replace(self, **changes, replaces=(*replaced,)[-MAX_REPLACED:], versions=())

    def answered(self, reply: Reply) -> "Note":
        if len(self.replies) >= MAX_REPLIES:
            raise OptionError(f"{self.id} has {MAX_REPLIES} replies already; expected no more")
        return replace(self, replies=(*self.replies, reply))


def changed_number(stored: Mapping[str, float], current: Mapping[str, float]) -> str:
    """Say which number of a note no longer holds, if any: "51.7 → 46.1 µm"."""
    for name in reversed(MEASURES):
        before, after = stored.get(name), current.get(name)
        if before is None:
            continue
        if after is None:
            return f"{before:.1f} → nothing µm"
        if abs(after - before) > PRINTED_UM * (1.0 + 1e-9):
            digits = 1 if f"{before:.1f}" != f"{after:.1f}" else 2
            return f"{before:.{digits}f} → {after:.{digits}f} µm"
    return ""


def story(notes: Iterable[Note]) -> list[Note]:
    """List the notes that tell a story, in their order."""
    return sorted((one for one in notes if one.step), key=lambda one: (one.step, one.date, one.id))


def with_note(notes: Sequence[Note], note: Note) -> tuple[Note, ...]:
    """Add a note, or put it in the place of the one with its identity."""
    by_id = {one.id: one for one in (*notes, note)}
    if len(by_id) > MAX_NOTES:
        raise OptionError(f"there are {len(notes)} notes already; expected at most {MAX_NOTES}")
    return tuple(by_id.values())


def merge_notes(*lists: Iterable[Note]) -> tuple[Note, ...]:
    """Unite notes by identity: replies united, what was edited by several side by side.

    The result is the same in whatever order and however often lists are merged.
    """
    copies: dict[str, list[Note]] = {}
    for one in (note for notes in lists for note in notes):
        copies.setdefault(one.id, []).append(one)
    merged = [_merged(same) for same in copies.values()]
    if len(merged) > MAX_NOTES:
        raise OptionError(f"together {len(merged)} notes; expected at most {MAX_NOTES}")
    return tuple(sorted(merged, key=lambda one: (one.date, one.id)))


def _merged(copies: Sequence[Note]) -> Note:
    heads = [head for one in copies for head in (one, *one.versions)]
    by_version = {one.version: replace(one, replies=(), versions=()) for one in heads}
    replaced = {digest for one in heads for digest in one.replaces}
    first, *versions = [by_version[digest] for digest in sorted(by_version.keys() - replaced)]
    replies = {reply for one in copies for reply in one.replies}
    answered = sorted(replies, key=lambda one: (one.date, one.author, one.text))
    if max(len(answered), len(versions)) > MAX_REPLIES:
        raise OptionError(
            f"{first.id}: together {len(answered)} replies and {len(versions)} other versions;"
            f" expected at most {MAX_REPLIES} of each"
        )
    return replace(first, replies=tuple(answered), versions=tuple(versions))


def note_to_toml(note: Note) -> dict[str, Any]:
    """Give the entries of a note in a file; what says nothing is left out."""
    entries = asdict(note, dict_factory=_filled)
    for version in (entries, *entries.get("versions", ())):
        if version["loop"] == "tool":
            del version["loop"]
    return entries


def _filled(entries: Iterable[tuple[str, object]]) -> dict[str, Any]:
    return {name: value for name, value in entries if value not in ("", 0, None, {}, ())}
