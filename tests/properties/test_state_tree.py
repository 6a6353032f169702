"""States made of random values of every leaf come back from links, files and undo."""

from dataclasses import fields, is_dataclass, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpspace.app.documents.scene_file import (
    file_notes,
    named_link,
    open_text,
    settings_line,
    state_to_toml,
    view_of,
    with_settings,
)
from warpspace.app.panels.note_panels import clean
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.leaf import default_of, description
from warpspace.app.state.store import VIEW, StateStore, changes
from warpspace.app.state.tree import leaves, put, spell, stored, value
from warpspace.scene.library import load_scene
from warpspace.scene.notes import Note, with_note
from warpspace.scene.text_files import one_line

SCENES = ("dvf5000_first", "fork_head_bc", "machine_c_frame_mill", "teach_tilted_c")
STARTS = [start_state(load_scene(name)) for name in SCENES]
SENT = "|nan|1e999|−3,5 µm|20 µrad|+EXX|-EXX,+EYX|\ud800|<b>|1;2|" + "9" * 50
HOSTILE = st.text(max_size=60) | st.sampled_from(SENT.split("|"))
TEXTS = {
    "specification.costs": ["EXX=2.5", "EXX=4; EYX=0.25", ""],
    "picked": ["X 1,5 Y -200", "Z=-300 B 10", ""],
    "picked.trace": ["tool,1.0,2.0,3.0", "relative,0.0,0.0,-1e-05"],
}

NOTE = "review"  # what is sent for a note that somebody pins

SPELT: set[tuple[str, str, object]] = set()
"""Scenes and leaves with values that were read back from their own spelling."""


def likely(draw, leaf):
    low, high = (leaf.span.low, leaf.span.high) if leaf.span else (0.0, 50.0)
    numbers = st.floats(low, high).map(repr)
    if leaf.kind in ("number", "point", "numbers"):
        count = {"number": 1, "point": 3}.get(leaf.kind, 4)
        found = ",".join(draw(numbers) for _ in range(count))
        return draw(st.sampled_from([found, *leaf.choices]))
    if leaf.kind in ("switch", "choice"):
        return draw(st.sampled_from([*(leaf.choices or "01")]))
    if leaf.kind == "keys":
        return ",".join(draw(st.lists(st.sampled_from([*leaf.choices, "?"]), max_size=4)))
    return draw(st.sampled_from(TEXTS.get(leaf.path, ["all", "ü&=%"])))


@st.composite
def events(draw):
    """Draw what a page sends for leaves, one group as likely as another; some of it is anything."""
    number = draw(st.integers(0, len(STARTS) - 1))
    state, sent = STARTS[number], []
    for _ in range(draw(st.integers(1, 12))):
        if draw(st.integers(0, 9)) == 0:
            sent.append((NOTE, draw(HOSTILE)))
        known = leaves(state)
        groups = {path: path.rpartition(".")[0] or path for path in known}
        group = draw(st.sampled_from(sorted({*groups.values()})))
        leaf = known[draw(st.sampled_from([path for path in known if groups[path] == group]))]
        text = draw(HOSTILE) if draw(st.integers(0, 3)) == 0 else likely(draw, leaf)
        state = put(state, leaf.path, text)
        sent.append((leaf.path, text))
    return SCENES[number], sent


def done(state, path, text):
    if path != NOTE:
        return put(state, path, text).without_notes()
    at = dict.fromkeys(state.scene.machine.axes, 1.5)
    words, view = clean(text), view_of(state, None)
    note = Note(text=words or "?", author=one_line(words), at=at, view=view)
    return replace(state, review=with_note(state.review, note))


def survives(scene, sent):
    state = start = STARTS[SCENES.index(scene)]
    steps = StateStore(start)
    for number, (path, text) in enumerate(sent):
        state = done(state, path, text)
        steps.apply(lambda _, state=state: state, at=10.0 * number)
    linked = with_settings(start_state(state.scene), settings_line(state))
    opened, _ = open_text(state_to_toml(state), scene, "x.toml")
    assert linked.notes == opened.notes == ()
    assert opened.tolerances == state.tolerances
    # a link by name has none: with notes the whole file is packed, or it is said that they are out
    assert (linked.review, opened.review) == ((), file_notes(state))
    assert not state.review or not named_link(state, None, None)
    for path, leaf in leaves(state).items():
        found = value(state, path)
        if leaf.span and isinstance(found, float):
            assert leaf.span.low <= found <= leaf.span.high, path
        for back in (linked, opened) if leaf.linked else ():
            assert stored(back, path) == stored(state, path), path
        # what is typed into `picked` lies on the surface, never on a trace
        if path != "picked" and (scene, path, found) not in SPELT:
            assert value(put(state, path, spell(state, path)), path) == found, path
            SPELT.add((scene, path, found))
    while steps.past:
        assert steps.undoes
        steps.undo()
    assert not changes(with_view_of(start, steps.state), start)
    assert steps.state.page == state.page
    while steps.future:
        steps.redo()
    assert not changes(with_view_of(state, steps.state), state)


def with_view_of(seen, state):
    """Return a state with the view of another one, which undo does not change."""
    return replace(state, **{name: getattr(seen, name) for name in VIEW})


@given(events())
def test_any_state_comes_back_from_link_file_and_undo(drawn):
    survives(*drawn)


@pytest.mark.nightly
@pytest.mark.parametrize("part", range(4))  # none of them takes five minutes
@settings(max_examples=2_500, derandomize=False)
@given(drawn=events())
def test_thousands_of_states_come_back_from_link_file_and_undo(part, drawn):
    survives(*drawn)


@given(st.text(max_size=40), HOSTILE)
def test_what_no_leaf_is_called_is_noted(path, text):
    assert put(STARTS[0], f"{path}.", text).notes


def test_no_field_that_is_looked_at_goes_without_words():
    for group in fields(AppState):
        inner = default_of(group)
        if is_dataclass(inner) and description(group) is None:
            assert all(description(field) for field in fields(inner)), group.name
