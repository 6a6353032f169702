"""Review notes of a scene: what somebody pinned, asked or decided, and the numbers it rests on.

A note is never changed in place: an edit is a new version that names those it replaces, so that two
people's files merge without a loss. Where both have edited a note, the versions stand side by side
until somebody chooses one.
"""

import hashlib
import json
import secrets
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

from warpspace.exceptions import OptionError
from warpspace.machine.axes import PARAMETERS
from warpspace.machine.description import Vector
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
class Mark:
    """What a note is pinned to, where it is not a point of the volume."""

    loop: str = ""  # of a trace of the rotary axes
    point_mm: Vector | None = None  # the traced point, in the workpiece (or tool) frame
    body: str = ""  # frame of the machine's body, the letter of its axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """One note, question or decision."""

    id: str = field(default_factory=lambda: secrets.token_hex(3))
    kind: str = "note"
    # mm or degrees; where the axes stand at the point it is about; empty: about the whole
    at: Mapping[str, float] = field(default_factory=dict[str, float])
    on: Mark | None = None  # the trace or body that the point belongs to
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
        said = note_to_toml(replace(self, replies=(), versions=()))
        # 275 and 275.0 are one number, as which of them a file gives is not for sure
        same = json.loads(json.dumps(said, default=datetime.isoformat), parse_int=float)
        text = json.dumps(same, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def edited(self, **changes: Any) -> "Note":
        """Give the version after an edit; it replaces this one and those beside it."""
        heads = (self, *self.versions)
        known = dict.fromkeys(digest for one in heads for digest in (*one.replaces, one.version))
        # a copy that is older than these is kept beside the note when they are merged
        return replace(self, **changes, replaces=(*known,)[-MAX_REPLACED:], versions=())

    def answered(self, reply: Reply) -> "Note":
        if len(self.replies) >= MAX_REPLIES:
            raise OptionError(f"{self.id} has {MAX_REPLIES} replies already; expected no more")
        return replace(self, replies=(*self.replies, reply))


def is_stale(then: Mapping[str, float], found: Mapping[str, float]) -> bool:
    """Tell whether numbers of a note no longer hold: off by more than the printed digit."""
    slack = PRINTED_UM * (1.0 + 1e-9)
    return any(name not in found or abs(found[name] - at) > slack for name, at in then.items())


def told(then: Mapping[str, float], found: Mapping[str, float]) -> str:
    """Say what has become of the first number that no longer holds: "51.7 → 46.1 µm"."""
    for name in reversed(MEASURES):
        if name in then and is_stale({name: then[name]}, found):
            after = f"{found[name]:.1f}" if name in found else "nothing"
            digits = 1 if f"{then[name]:.1f}" != after else 2
            after = f"{found[name]:.{digits}f}" if name in found else after
            return f"{then[name]:.{digits}f} → {after} µm"
    return ""


def story(notes: Iterable[Note]) -> list[Note]:
    """List the notes that tell a story, in their order."""
    return sorted((one for one in notes if one.step), key=lambda one: (one.step, one.date, one.id))


# --- Many notes -----------------------------------------------------------------------------------


def with_note(notes: Sequence[Note], note: Note) -> tuple[Note, ...]:
    """Add a note, or put it in the place of the one with its identity."""
    if any(one.id == note.id for one in notes):
        return tuple(note if one.id == note.id else one for one in notes)
    if len(notes) >= MAX_NOTES:
        raise OptionError(f"there are {len(notes)} notes already; expected at most {MAX_NOTES}")
    return (*notes, note)


def merge_notes(*lists: Iterable[Note]) -> tuple[Note, ...]:
    """Unite notes by identity: replies united, what was edited by several side by side.

    The result is the same in whatever order and however often lists are merged.
    """
    found: dict[str, list[Note]] = {}
    for one in (note for notes in lists for note in notes):
        found.setdefault(one.id, []).append(one)
    merged = [_merged(same) for same in found.values()]
    if len(merged) > MAX_NOTES:
        raise OptionError(f"together {len(merged)} notes; expected at most {MAX_NOTES}")
    return tuple(sorted(merged, key=lambda one: (one.date, one.id)))


def _merged(same: Sequence[Note]) -> Note:
    heads = [head for one in same for head in (one, *one.versions)]
    by_version = {one.version: replace(one, replies=(), versions=()) for one in heads}
    gone = {digest for one in heads for digest in one.replaces}
    left = {digest: one for digest, one in by_version.items() if digest not in gone}
    first, *others = [left[digest] for digest in sorted(left)]
    replies = {reply for one in same for reply in one.replies}
    answered = sorted(replies, key=lambda one: (one.date, one.author, one.text))
    if max(len(answered), len(others)) > MAX_REPLIES:
        raise OptionError(
            f"{first.id}: together {len(answered)} replies and {len(others)} other versions;"
            f" expected at most {MAX_REPLIES} of each"
        )
    return replace(first, replies=tuple(answered), versions=tuple(others))


# --- As in a file ---------------------------------------------------------------------------------


def is_changeable(key: str) -> bool:
    """Tell whether a decision may name this: an error, or the tolerance of one."""
    return key.removeprefix(TOLERANCES) in PARAMETERS


def note_to_toml(note: Note) -> dict[str, object]:
    """Give the entries of a note; what says nothing is left out."""
    mark = note.on or Mark()
    on = {"loop": mark.loop, "body": mark.body}
    entries: dict[str, object] = {
        "id": note.id,
        "kind": note.kind,
        "at": dict(note.at),
        "on": {
            **{name: value for name, value in on.items() if value},
            **({} if mark.point_mm is None else {"point_mm": list(mark.point_mm)}),
        },
        "text": note.text,
        "author": note.author,
        "date": note.date,
        "status": note.status,
        "loop": "" if note.loop == "tool" else note.loop,
        "numbers": dict(note.numbers),
        "before": dict(note.before),
        "change": {key: list(pair) for key, pair in note.change.items()},
        "step": note.step,
        "view": note.view,
        "replies": [_filled(asdict(one)) for one in note.replies],
        "replaces": list(note.replaces),
        "versions": [note_to_toml(one) for one in note.versions],
    }
    return _filled(entries)


def _filled(entries: Mapping[str, object]) -> dict[str, object]:
    return {name: value for name, value in entries.items() if value not in ("", 0, {}, [])}
