"""A comparison, a point of a trace and a lever in files and links: identical, or one message."""

import base64
import tracemalloc
import zlib
from dataclasses import fields, replace
from urllib.parse import urlencode

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpspace.app.documents.links import pack, unpack
from warpspace.app.documents.scene_file import (
    is_looked_at,
    open_link,
    open_text,
    state_to_link,
    state_to_toml,
)
from warpspace.app.documents.stored_comparison import NAMES, PREFIX
from warpspace.app.evaluation.compare import pinned_side, scene_side, with_pin, with_sides
from warpspace.app.evaluation.conventions import with_choice
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Comparison, Side
from warpspace.app.state.picked import Picked
from warpspace.exceptions import OptionError, SceneError, WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Ramp, Table
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.library import load_scene

FIRST, SECOND, TABLE = (
    load_scene(name) for name in ("dvf5000_first", "dvf5000_second", "teach_tilted_c")
)
KNOWN = (FIRST, SECOND, TABLE)
START = start_state(FIRST)
TRACE = Picked(
    {"X": 0.0, "Y": 0.0, "Z": -280.0, "B": -30.0, "C": 1.0 / 3.0}, Loop.WORKPIECE, (275.0, 0.1, 0.0)
)
KEYS = st.sampled_from(["EXX", "EYX", "EAX", "EC0Y", "EBZ", "EXC"])
EDITS = st.lists(st.tuples(KEYS, st.floats(-20.0, 20.0)), max_size=3)


def saved(state: AppState) -> AppState:
    """The state as a scene of its own: what a file can hold of it."""
    scene = scene_of(state)
    return replace(
        state,
        scene=scene,
        loaded=None,
        start=start_state(scene).start,
        spans=start_state(scene).spans,
        position_spans=start_state(scene).position_spans,
    )


@st.composite
def plain_states(draw: st.DrawFn, scene=None) -> AppState:
    state = start_state(scene or draw(st.sampled_from(KNOWN)))
    for key, value in draw(EDITS):
        state = state.with_amplitude(key, value)
    for axis in state.positions:
        state = state.with_position(axis, draw(st.floats(-90.0, 90.0)))
    state = state.with_loop(draw(st.sampled_from([*Loop]))).with_nodes(draw(st.integers(3, 31)))
    state = state.with_component(draw(st.sampled_from(["norm", "x", "y", "z"])))
    state = state.with_exaggeration(draw(st.none() | st.floats(1.0, 1e5)))
    own = draw(st.none() | st.tuples(*[st.floats(-500.0, 500.0)] * 3))
    return replace(state, rotary=state.rotary.with_own(own)).without_notes()


@st.composite
def states(draw: st.DrawFn) -> AppState:
    state = draw(plain_states())
    at = draw(st.sampled_from([None, Picked({"X": 1.5, "Y": -0.1, "Z": -100.0}), TRACE]))
    if at is not None and at.at.keys() <= state.scene.machine.axes.keys():
        lever = draw(st.sampled_from(["", "EAX", "EC0Y"]))
        state = replace(state, picked=at, lever=lever)
    pinned = draw(st.none() | plain_states().map(pinned_side))
    sides = [Side(), *map(scene_side, KNOWN), *([pinned] if pinned else [])]
    a, b = (draw(st.sampled_from(sides)) for _ in range(2))
    comparison = Comparison(a, b, draw(st.sampled_from(["a", "b", "difference"])), pinned=pinned)
    if draw(st.booleans()):
        comparison = comparison.off()
    return replace(state, comparison=replace(comparison, ghost=draw(st.booleans())))


@settings(max_examples=60, deadline=None)
@given(states())
def test_link_gives_the_identical_state(state: AppState) -> None:
    assert open_link(state_to_link(state, None, KNOWN), KNOWN)[0] == state


@settings(max_examples=60, deadline=None)
@given(states())
def test_file_gives_the_identical_state(state: AppState) -> None:
    back, _ = open_text(state_to_toml(state), state.scene.name, "x.toml")
    assert back == saved(state)
    # and what is saved then is the same text
    assert state_to_toml(back) == state_to_toml(state)


@pytest.mark.parametrize("way", ["file", "link"])
def test_an_edited_snapshot_and_an_opened_scene_come_back_as_they_were(way: str) -> None:
    """What no other machine knows by name is stored with its content."""
    curve = Table((-275.0, 275.0), ((-275.0, 0.0), (0.0, 8.0), (275.0, -2.0)))
    pinned = with_choice(edits.with_curve(START, "EXX", curve), "direction C=-1")
    pinned = with_choice(pinned, "component_errors=before_motion").with_amplitude("EYX", 3.0)
    opened = replace(SECOND, name="shop floor", title="Shop floor, machine 7")
    now = edits.with_curve(START, "EYY", Ramp(edits.axis_span(START, "EYY"), 2.5))
    state = with_sides(with_pin(pinned), scene_side(opened), with_pin(pinned).comparison.a)
    state = replace(now, comparison=state.comparison.with_shown("difference"))
    if way == "file":
        back, _ = open_text(state_to_toml(state), now.scene.name, "x.toml")
    else:
        back, _ = open_link(state_to_link(state, None, KNOWN), KNOWN)
    assert back.notes == ()
    pictures = [LiveModel().evaluate(one.with_nodes(5)) for one in (state, back)]
    assert pictures[0].statistics == pictures[1].statistics
    assert (pictures[0].drawn_mm == pictures[1].drawn_mm).all()
    assert pictures[0].compared.titles == pictures[1].compared.titles
    assert back.comparison.a == state.comparison.a
    assert back.comparison.pinned is back.comparison.b


def test_a_comparison_of_known_scenes_is_short_and_readable() -> None:
    state = with_sides(START, Side(), scene_side(SECOND))
    link = state_to_link(state, None, KNOWN)
    assert link == "scene=dvf5000_first&compare.b=scene%3Ddvf5000_second"


def test_every_part_of_a_comparison_is_written() -> None:
    """A field added to the comparison must find its way into files and links."""
    assert {field.name for field in fields(Comparison)} == {
        name for name in NAMES if "." not in name
    }
    assert {field.name for field in fields(Side)} == {"title", "state", "is_scene"}
    assert {field.name for field in fields(Picked)} == {"at", "loop", "point_mm"}


def packed(text: str) -> str:
    return base64.urlsafe_b64encode(zlib.compress(text.encode())).decode().rstrip("=")


BOMB = "file=" + packed("x = 1\n" * 1_000_000)
NESTED = "scene=dvf5000_first&" + urlencode({"compare.pinned": "scene=nobody"})


@pytest.mark.parametrize(
    "pairs",
    [
        {"b": "scene=nobody"},
        {"b": "scene=../../etc/passwd"},
        {"b": "?"},
        {"b": "pinned"},
        {"b": "file=!!!"},
        {"b": BOMB},
        {"b": "file=" + packed('title = "x"')},
        {"b": "now", "shown": "<script>"},
        {"b": "now", "ghost": "maybe"},
        {"b": "now", "evil": "1"},
        {"pinned": "&".join(f"a{n}=1" for n in range(1000))},
    ],
)
@pytest.mark.parametrize("way", ["file", "link"])
def test_a_comparison_that_means_nothing_is_refused(way: str, pairs: dict[str, str]) -> None:
    line = urlencode([(PREFIX + name, value) for name, value in pairs.items()])
    text = f"# warpspace-compare: {line}\n{state_to_toml(START)}"
    link = f"scene=dvf5000_first&{line}"
    with pytest.raises(WarpspaceError) as caught:
        open_text(text, "x", "x.toml") if way == "file" else open_link(link, KNOWN)
    assert isinstance(caught.value, (OptionError, SceneError))
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(("old", "new"), [("a", "b"), ("b", "a"), ("difference", "difference")])
def test_an_older_link_with_a_snapshot_shows_the_same_change(old: str, new: str) -> None:
    """It had what is steered as A and the snapshot as B, and drew A − B."""
    given = {"b": "pinned", "shown": old, "pinned": "scene=dvf5000_second"}
    given["pinned.title"] = "snapshot: DVF5000 · 2 changed"
    line = urlencode([(PREFIX + name, value) for name, value in given.items()])
    back, _ = open_link(f"scene=dvf5000_first&{line}", KNOWN)
    found = back.comparison
    assert (found.shown, found.a, found.b) == (new, found.pinned, Side())
    assert found.pinned is not None
    assert found.pinned.title == "before: DVF5000 · 2 changed"
    again, _ = open_link(state_to_link(back, None, KNOWN), KNOWN)
    assert again.comparison == found


def test_a_comparison_within_a_comparison_is_not_looked_at() -> None:
    line = urlencode({"compare.pinned": NESTED, "compare.b": "pinned"})
    back, _ = open_link(f"scene=dvf5000_first&{line}", KNOWN)
    assert back.comparison.b.state == START


def test_wild_numbers_of_a_snapshot_are_clamped_and_named() -> None:
    line = urlencode({"compare.pinned": "scene=dvf5000_first&EXX=1e9", "compare.b": "pinned"})
    back, _ = open_link(f"scene=dvf5000_first&{line}", KNOWN)
    assert back.comparison.b.state.amplitudes["EXX"] == MAX_ERROR
    assert any(note.startswith("before: EXX") for note in back.notes)


@pytest.mark.parametrize("title", ["now", "present errors", "nothing", "", "x" * 1_000])
def test_titles_from_a_link_cannot_pose_as_something_else(title: str) -> None:
    given = {"b": "scene=dvf5000_second", "b.title": title, "pinned": "scene=dvf5000_first"}
    given["pinned.title"] = title
    line = urlencode([(PREFIX + name, value) for name, value in given.items()])
    back, _ = open_link(f"scene=dvf5000_first&{line}", KNOWN)
    for side in (back.comparison.b, back.comparison.pinned):
        assert side.title not in ("now", "present errors", "nothing", "")
        assert len(side.title) <= 200


@pytest.mark.parametrize(
    "text", ["all,1,2,3", "workpiece,1,2", "workpiece,1,2,nan", "workpiece,1e9,0,0", ",,,", ""]
)
def test_a_trace_that_means_nothing_is_left_out_and_named(text: str) -> None:
    back, _ = open_link(
        f"scene=dvf5000_first&{urlencode({'why.trace': text, 'why.C': '3'})}", KNOWN
    )
    assert back.picked is None
    assert any("left out" in note for note in back.notes)


def test_a_link_to_a_scene_that_only_this_tab_has_carries_it() -> None:
    mine = start_state(replace(SECOND, name="dvf5000_first", title="Mine"))
    back, _ = open_link(state_to_link(mine, None, KNOWN), KNOWN)
    assert back == mine


def test_a_short_link_with_one_key_of_many_parts_is_refused_at_once() -> None:
    """Such a link of 419 characters took 7.7 GB."""
    text = 'machine = "dvf5000"\na' + ".a" * 40_000 + " = 1\n"
    link = urlencode({"name": "x", "file": packed(text)})
    assert len(link) < 600
    with pytest.raises(SceneError, match="the scene in the link: line 2: a key of over 8 parts"):
        open_link(link, KNOWN)
    with pytest.raises(SceneError, match=r"x.toml: line 2: a key of over 8 parts"):
        open_text(text, "x", "x.toml")


def test_a_link_longer_than_an_address_is_not_unpacked() -> None:
    with pytest.raises(OptionError, match="expected at most 8,000"):
        unpack("A" * 8_001)
    assert unpack(pack("scene=dvf5000_first")) == "scene=dvf5000_first"


@pytest.mark.parametrize("text", ["\n" * 300_000, "#\n" * 200_000, "# warpspace-view: a\n" * 9])
def test_remarks_at_the_head_of_a_file_take_little_memory(text: str) -> None:
    tracemalloc.start()
    try:
        is_looked_at(text)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()
