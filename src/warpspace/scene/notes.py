"""Review notes of a scene: notes, questions and decisions with the numbers they are based on.

A note is never changed in place: an edit is a new version that lists those it replaces, so that
files of two people merge without loss. Concurrent versions are kept until one is chosen.
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
TOLERANCES = "tolerances."  # prefix of the key of a half width in `Note.change`
MEASURES = ("mean_um", "max_um", "here_um")
PRINTED_UM = 0.01  # last digit of a stored number; a note whose numbers deviate by more is stale
Pair = tuple[float, float]


def now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply to a note."""

    text: str
    author: str = ""
    date: datetime = field(default_factory=now)


@dataclass(frozen=True, slots=True)
class NoteAnchor:
    """Anchor of a note that is not a point of the volume."""

    loop: str = ""  # of a trace of the rotary axes
    point_mm: Vector | None = None  # the traced point, in the workpiece (or tool) frame
    body: str = ""  # frame of the machine's body, the letter of its axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """One note, question or decision."""

    id: str = field(default_factory=lambda: os.urandom(3).hex())
    kind: str = "note"
    # axis positions of its point, mm or degrees; empty: of the whole machine
    at: Mapping[str, float] = field(default_factory=dict[str, float])
    on: NoteAnchor | None = None  # the trace or body that the point belongs to
    text: str
    author: str = ""
    date: datetime = field(default_factory=now)
    status: str = "open"
    loop: str = "tool"  # of its numbers
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])  # µm, by `MEASURES`
    # of a decision: the numbers before it, and from and to of each error, µm or µrad, by key
    before: Mapping[str, float] = field(default_factory=dict[str, float])
    change: Mapping[str, Pair] = field(default_factory=dict[str, Pair])
    step: int = 0  # in the sequence of the story; 0 for none
    view: str = ""  # state of the page, as in a link
    replies: tuple[Reply, ...] = ()
    replaces: tuple[str, ...] = ()  # versions that this one replaces, by `version`
    versions: tuple["Note", ...] = ()  # concurrent versions

    @property
    def version(self) -> str:
        """Digest of the content and of the replaced versions."""
        from hashlib import sha256  # slow to import, and few scenes have notes

        content = note_to_toml(replace(self, replies=(), versions=()))
        # 275 and 275.0 are the same number
        canonical = json.loads(json.dumps(content, default=datetime.isoformat), parse_int=float)
        text = json.dumps(canonical, sort_keys=True)
        return sha256(text.encode()).hexdigest()[:12]

    def edited(self, **changes: Any) -> "Note":
        """Return an edited version, which replaces this one and the concurrent ones."""
        heads = (self, *self.versions)
        replaced = dict.fromkeys(digest for one in heads for digest in (*one.replaces, one.version))
        # copies older than the last ones remain concurrent when merged
        return replace(self, **changes, replaces=(*replaced,)[-MAX_REPLACED:], versions=())

    def answered(self, reply: Reply) -> "Note":
        if len(self.replies) >= MAX_REPLIES:
            raise OptionError(f"{self.id} has {MAX_REPLIES} replies already; expected no more")
        return replace(self, replies=(*self.replies, reply))


def changed_number(stored: Mapping[str, float], current: Mapping[str, float]) -> str:
    """Format the number of a note that has changed, if any: "51.7 → 46.1 µm"."""
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
    """List the notes of the story in sequence."""
    return sorted((one for one in notes if one.step), key=lambda one: (one.step, one.date, one.id))


def with_note(notes: Sequence[Note], note: Note) -> tuple[Note, ...]:
    """Add a note, or replace the one with its identity."""
    by_id = {one.id: one for one in (*notes, note)}
    if len(by_id) > MAX_NOTES:
        raise OptionError(f"there are {len(notes)} notes already; expected at most {MAX_NOTES}")
    return tuple(by_id.values())


def merge_notes(*lists: Iterable[Note]) -> tuple[Note, ...]:
    """Merge notes by identity, with all replies and concurrent versions.

    The result does not depend on the order or the number of merges.
    """
    copies: dict[str, list[Note]] = {}
    for notes in lists:
        for note in notes:
            copies.setdefault(note.id, []).append(note)
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
    """Return the entries of a note in a file, without empty ones."""
    entries = asdict(note, dict_factory=_filled)
    for version in (entries, *entries.get("versions", ())):
        if version["loop"] == "tool":
            del version["loop"]
    return entries


def _filled(entries: Iterable[tuple[str, object]]) -> dict[str, Any]:
    return {name: value for name, value in entries if value not in ("", 0, None, {}, ())}
