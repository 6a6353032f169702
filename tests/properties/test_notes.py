"""Review notes: what several people write is merged without a loss and read back as written."""

import random
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import reduce

import pytest
from hypothesis import given
from hypothesis import strategies as st

from products import first
from warpspace import load_scene
from warpspace.analysis.note_tables import note_numbers, stale_remark
from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.limits import MAX_NOTE_TEXT, MAX_NOTES, MAX_REPLACED, MAX_REPLIES
from warpspace.scene.library import parse_scene
from warpspace.scene.notes import (
    KINDS,
    STATUSES,
    Note,
    Reply,
    changed_number,
    merge_notes,
    story,
    with_note,
)
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import one_line

BEGAN = datetime(2026, 11, 22, 10, tzinfo=UTC)
SCENE = load_scene("dvf5000_first")


def read_back(note):
    return parse_scene(scene_to_toml(replace(SCENE, review=(note,))), "a").review


def heads(notes):
    return {one.version: one.text for note in notes for one in (note, *note.versions)}


class History:
    """Three people add, edit and answer notes in copies of one scene, and merge now and then."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.said, self.replaced, self.replies = {}, set(), set()
        self.copies = [()] * 3
        for turn in range(self.random.randint(5, 20)):
            who = self.random.randrange(3)
            self.copies[who] = self.act(self.copies[who], f"{who}/{turn}")
        # a fourth took a copy early and never wrote
        self.copies.append(self.copies[0][:1])

    def act(self, notes, text):
        what = self.random.choice(("add", "edit", "edit", "edit", "reply", "merge"))
        date = BEGAN + timedelta(seconds=self.random.randrange(50))
        if what == "merge":
            return merge_notes(notes, self.random.choice(self.copies))
        if what == "add" or not notes:
            note = Note(id=f"n{len(self.said)}", text=text, date=date)
            self.said[note.version] = text
            return with_note(notes, note)
        note = self.random.choice(notes)
        if what == "reply":
            self.replies.add((note.id, text))
            return with_note(notes, note.answered(Reply(text, date=date)))
        self.replaced |= heads([note]).keys()
        edited = note.edited(text=text, status=self.random.choice(STATUSES))
        self.said[edited.version] = text
        return with_note(notes, edited)


@pytest.mark.parametrize("histories", first(100, 1000))
def test_merging_loses_nothing_and_gives_the_same_in_any_order(histories):
    for seed in range(histories):
        history = History(seed)
        merged = merge_notes(*history.copies)
        left = {one: text for one, text in history.said.items() if one not in history.replaced}
        assert heads(merged) == left, seed
        assert {(one.id, own.text) for one in merged for own in one.replies} == history.replies
        assert merge_notes(merged, *history.copies) == merged
        for _ in range(2):
            copies = history.random.sample(history.copies, 4)
            assert reduce(merge_notes, copies) == merged, seed
            pairs = merge_notes(*copies[:2]), merge_notes(*copies[2:])
            assert merge_notes(*pairs) == merged, seed


def test_histories_hold_what_a_merge_can_meet():
    merged = [merge_notes(*History(seed).copies) for seed in range(100)]
    assert {0, 1, 2} <= {len(note.versions) for notes in merged for note in notes}


def test_an_edit_settles_what_stood_side_by_side():
    note = Note(text="first", date=BEGAN)
    (both,) = merge_notes([note.edited(text="mine")], [note.edited(text="yours")])
    assert {both.text, both.versions[0].text} == {"mine", "yours"}
    settled = both.edited(text="ours")
    assert merge_notes([settled], [both], [note]) == (settled,)


def test_a_note_can_be_edited_and_answered_as_often_as_its_file_holds():
    note = Note(text="0", date=BEGAN)
    for turn in range(MAX_REPLACED + 5):
        before, note = note, note.edited(text=f"{turn}")
    assert merge_notes([before], [note]) == (note,)
    for turn in range(MAX_REPLIES):
        note = note.answered(Reply(f"{turn}", date=BEGAN))
    assert read_back(note) == (note,)
    with pytest.raises(OptionError, match="200 replies already"):
        note.answered(Reply("one more"))
    with pytest.raises(OptionError, match="together 201 replies"):
        merge_notes([note], [replace(note, replies=(Reply("one more", date=BEGAN),))])


def test_more_notes_than_a_file_holds_are_refused():
    notes = tuple(Note(id=f"n{one}", text="x", date=BEGAN) for one in range(MAX_NOTES))
    assert len(with_note(notes, notes[3].edited(text="y"))) == MAX_NOTES
    for add in (with_note, lambda a, b: merge_notes(a, [b])):
        with pytest.raises(OptionError, match="expected at most 500"):
            add(notes, Note(text="z"))


IDS = st.text("abcdefghijklmnopqrstuvwxyz0123456789", min_size=1, max_size=16)
TEXTS = st.text(
    st.characters(exclude_categories=("Cc", "Cs")) | st.sampled_from("\n\t\"'\\#=[]"),
    min_size=1,
    max_size=50,
)
NUMBERS = st.floats(0.0, 1e5, allow_subnormal=False)
MEASURED = st.dictionaries(st.sampled_from(("mean_um", "max_um", "here_um")), NUMBERS)
VALUES = st.floats(-1e5, 1e5, allow_subnormal=False) | st.integers(-500, 500)
CHANGEABLE = st.sampled_from(("EA0Z", "tolerances.EXX"))
AT = st.dictionaries(st.sampled_from("XYZBC"), VALUES)
DATES = st.datetimes(min_value=datetime(1970, 1, 1), timezones=st.just(UTC))  # noqa: DTZ001
AUTHORS = TEXTS.map(one_line)
REPLIES = st.builds(Reply, text=TEXTS, author=AUTHORS, date=DATES)


def notes(**more):
    return st.builds(
        Note, kind=st.sampled_from(KINDS), at=AT, text=TEXTS, author=AUTHORS, date=DATES,
        status=st.sampled_from(STATUSES), numbers=MEASURED, before=MEASURED,
        change=st.dictionaries(CHANGEABLE, st.tuples(VALUES, VALUES)),
        step=st.integers(0, MAX_NOTES), view=TEXTS, replaces=st.lists(IDS, max_size=3).map(tuple),
        **more,
    )  # fmt: skip


@given(
    found=notes(id=st.just("a"), replies=st.lists(REPLIES, max_size=3).map(tuple)),
    versions=st.lists(notes(id=st.just("a")), max_size=2).map(tuple),
)
def test_a_file_holds_a_note_as_it_is(found, versions):
    note = replace(found, versions=versions)
    (read,) = read_back(note)
    assert read == note
    numbers = [[one.version for one in (each, *each.versions)] for each in (read, note)]
    assert numbers[0] == numbers[1]


def test_the_longest_text_is_kept_and_one_character_more_is_refused():
    for text in ("x" * MAX_NOTE_TEXT, "µ" * MAX_NOTE_TEXT):
        note = Note(text=text)
        assert read_back(note) == (note,)
        with pytest.raises(SceneError, match="expected at most 2000 characters"):
            read_back(Note(text=f"{text}x"))


def test_numbers_hold_until_they_are_off_by_more_than_the_printed_digit():
    then = {"max_um": 51.72, "here_um": 46.0}
    assert not changed_number(then, {"max_um": 51.73, "here_um": 45.99, "mean_um": 1.0})
    assert not changed_number({}, {})
    assert changed_number(then, {"max_um": 51.74, "here_um": 46.0})
    assert changed_number(then, {"max_um": 51.72})
    assert changed_number(then, {"max_um": 46.11, "here_um": 46.0}) == "51.7 → 46.1 µm"
    assert changed_number(then, {"max_um": 51.74, "here_um": 46.0}) == "51.72 → 51.74 µm"
    assert changed_number(then, {"max_um": 51.72}) == "46.0 → nothing µm"


@given(change=st.floats(-20.0, 20.0), x=st.floats(-275.0, 275.0), b=st.floats(-120.0, 30.0))
def test_a_note_holds_for_its_scene_and_is_stale_where_the_error_at_its_point_changes(change, x, b):
    note = Note(text="x", at={"X": x, "Y": -225.0, "Z": -480.0, "B": b})
    note = replace(note, numbers=note_numbers(SCENE, [note])[0])
    errors = SCENE.errors.with_amplitude("EA0Z", 33.9 + change, (-480.0, -80.0))
    changed = replace(SCENE, errors=errors)
    (now,) = note_numbers(changed, [note])
    assert stale_remark(note, note_numbers(SCENE, [note])[0]) == ""
    off = max(abs(now[name] - at) for name, at in note.numbers.items())
    assert bool(stale_remark(note, now)) == (off > 0.0105)  # of two digits each


def test_a_note_of_an_axis_that_is_gone_has_no_numbers():
    assert note_numbers(SCENE, [Note(text="x", at={"U": 1.0})]) == [{}]


def test_a_story_is_told_by_step():
    steps = [Note(id=f"n{step}", text="x", step=step, date=BEGAN) for step in (3, 0, 1, 2)]
    assert [one.step for one in story(steps)] == [1, 2, 3]
