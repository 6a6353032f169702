"""Files, links, kept tabs and lists of scenes: identical, or refused with one message."""

import base64
import json
import tracemalloc
import zlib
from dataclasses import fields, replace
from urllib.parse import parse_qsl, urlencode

import pytest

from app.hostile import upload
from products import pairwise
from warpspace.app.documents import transfers
from warpspace.app.documents.scene_file import (
    MOST_OPENED,
    PREFIX,
    SIDES,
    SceneList,
    camera_of,
    open_link,
    open_text,
    settings_line,
    settings_of,
    state_to_link,
    state_to_toml,
    with_settings,
)
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation import compare
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels.conventions import with_choice, with_reference
from warpspace.app.server.tab_keeper import (
    COMPARISON,
    NEVER_RESTORED,
    START_VALUES,
    page_copy_text,
    read_page_copy,
)
from warpspace.app.state import edits
from warpspace.app.state.app_state import Comparison, Side, start_state
from warpspace.app.state.tree import leaves, put
from warpspace.exceptions import OptionError, SceneError, WarpspaceError
from warpspace.machine.errors import Ramp, TableCurve
from warpspace.machine.limits import MAX_ERROR, MAX_PACKED_TEXT
from warpspace.scene.library import load_scene, scene_names

KNOWN = FIRST, SECOND = (load_scene("dvf5000_first"), load_scene("dvf5000_second"))
START = start_state(FIRST)
CAMERA = CameraMemory((10.0, -20.0, 12.0), (0.0, 0.5, 1.5), (0.0, 0.0, 1.0), 0.384)


@pytest.mark.parametrize("way", ["file", "link"])
def test_conventions_curves_camera_and_what_is_compared_come_back_identical(way):
    # what no other machine knows by name is stored with its content
    curve = TableCurve((-275.0, 275.0), ((-275.0, 0.0), (0.0, 8.0), (275.0, -2.0)))
    pinned = compare.with_pin(with_choice(edits.with_curve(START, "EXX", curve), "direction C=-1"))
    opened = replace(SECOND, name="shop floor", title="Shop floor, machine 7")
    compared = compare.with_sides(
        pinned, compare.scene_side(opened), pinned.comparison.a
    ).comparison
    state = with_reference(with_choice(START, "component_errors=before_motion"), {"X": 5.0})
    state = edits.with_curve(state, "EYY", Ramp(state.axis_span("EYY"), 2.5))
    state = replace(state.without_notes(), comparison=replace(compared, shown="difference"))
    if way == "file":
        back, camera = open_text(state_to_toml(state, CAMERA), "dvf5000_first", "x.toml")
    else:
        back, camera = open_link(state_to_link(state, CAMERA, KNOWN), KNOWN)
    assert back.notes == ()
    assert camera == CAMERA
    assert back.scene.model == state.scene.model
    assert back.scene.reference == state.scene.reference
    assert {k: back.curve(k) for k in back.amplitudes} == {
        k: state.curve(k) for k in state.amplitudes
    }
    assert back.comparison.a == state.comparison.a
    assert back.comparison.pinned is back.comparison.b
    shown, again = (LiveModel().evaluate(replace(one, nodes=5)) for one in (state, back))
    assert (shown.drawn_mm == again.drawn_mm).all()
    assert shown.compared.titles == again.compared.titles


def test_a_proposal_that_is_looked_at_comes_back():
    state = compare.with_proposal(START, with_reference(START, {"X": 5.0}).scene, "Repaired")
    back, _ = open_text(state_to_toml(state), "x", "x.toml")
    assert back.comparison.b.state.scene.reference == state.comparison.b.state.scene.reference
    titles = LiveModel().evaluate(replace(back, nodes=5)).compared.titles
    assert titles == (f"present errors: {FIRST.title}", "Repaired")


def test_every_part_of_a_comparison_is_written():
    written = {*SIDES, *(leaf.linked for leaf in leaves(START).values())}
    assert {f"compare.{field.name}" for field in fields(Comparison)} <= written
    assert {field.name for field in fields(Side)} == {"title", "state", "is_scene"}


@pytest.mark.parametrize("name", scene_names())
def test_every_bundled_scene_opens_from_its_saved_state(name):
    state = start_state(load_scene(name))
    back, _ = open_text(state_to_toml(state), name, name)
    if not state.part.is_empty:  # a saved text names its mesh and program, and does not hold them
        assert back.part.is_empty
        back = replace(back, part=state.part, look=replace(back.look, surface=state.look.surface))
    assert back == state


def test_a_link_to_a_known_scene_is_short_and_readable():
    link = state_to_link(START.with_amplitude("EXX", 2.5), None, [FIRST])
    assert link == "scene=dvf5000_first&EXX=2.5"
    back, camera = open_link(link, [FIRST])
    assert back == START.with_amplitude("EXX", 2.5)
    assert camera is None
    link = state_to_link(compare.with_sides(START, Side(), compare.scene_side(SECOND)), None, KNOWN)
    assert link == "scene=dvf5000_first&compare.b=scene%3Ddvf5000_second"


def test_a_link_reads_as_it_has_always_been_spelt():
    line = (
        "EXX=2.5&B=-30.0&exaggeration=2000.0&component=x&loop=tool&placed=1&nodes=11"
        "&shown.dark=1&look.surface=cut&look.slices_mm.X=10.0&machine.linear_mm.X=20.0"
        "&specification.limit_um=25.0&specification.fixed=EXX&rotary.off=1&rotary.own=1.0,2.0,3.5"
        "&rotary.held.B=-15.0,0.0&test=r-test&test.path=0&test.points=9&excluded=EXX&only=EAX,EBX"
        "&why.trace=tool,1.0,2.0,3.0&why.X=1.5&why.B=-10.0&lever=EAX"
    )
    back = with_settings(START, line)
    assert back.notes == ()
    assert sorted(parse_qsl(settings_line(back))) == sorted(parse_qsl(line))


def test_hostile_settings_are_clamped_or_left_out_and_named():
    line = (
        "EXX=1e9&EYX=nan&B=500&nodes=1e6&exaggeration=-3&component=<b>&loop=all&look.surface=evil"
        "&shown.dark=maybe&rotary.off=0,99,-1&rotary.held.B=inf&excluded=EXX,evil&why.X=1e9"
        "&look.slices_mm.X=1e9&specification.limit_um=1e12&__class__=1&camera=1,2"
    )
    back = with_settings(START, line)
    assert back.amplitudes["EXX"] == MAX_ERROR
    assert back.component == "norm"
    assert abs(back.picked.at["X"]) <= 300.0
    assert any("ignored" in note for note in back.notes)
    assert with_settings(START, "x" * 20_000).without_notes() == START


@pytest.mark.parametrize(
    "numbers",
    [
        "",
        "1,2,3",
        "nan," * 9 + "1",
        "0,0,0,0,0,0,0,0,1,0.4",
        "1e9,0,0,0,0,0,0,0,1,0.4",
        "5,5,5,0,0,0,0,0,1,9",
        "5,5,5,0,0,0,0,0,0,0.4",
        "5,5,5,0,0,0,0,0,1,x",
    ],
)
def test_cameras_that_see_nothing_are_not_taken(numbers):
    assert camera_of(f"camera={numbers}") is None


@pytest.mark.parametrize(
    ("safe", "given", "kept"),
    [
        (transfers.safe_name, "../../etc/passwd", "passwd"),
        (transfers.safe_name, "..\\..\\evil.toml", "evil"),
        (transfers.safe_name, "a<script>.toml", "a_script"),
        (transfers.safe_name, "", "scene"),
        (transfers.safe_name, "\x00\n", "scene"),
        (transfers.safe_name, "x" * 300, "x" * 60),
        (transfers.safe_name, "my machine.v2.toml", "my machine.v2"),
        # those of received data keep their ending
        (transfers.safe_file_name, "a b.CSV", "a b.CSV"),
        (transfers.safe_file_name, "../../<img src=x>.csv", "img src_x.csv"),
        (transfers.safe_file_name, "noending", "noending.txt"),
        (transfers.safe_file_name, ".", "file.txt"),
    ],
)
def test_names_from_a_browser_are_made_safe(safe, given, kept):
    assert safe(given) == kept


def test_uploads_that_are_no_scene_are_refused_with_every_problem():
    with pytest.raises(OptionError, match="at most 4 MB"):
        transfers.read_upload(upload("big.toml", b"x" * (4 * 2**20 + 1)))
    with pytest.raises(OptionError, match="not UTF-8"):
        transfers.upload_text(b"\xff\xfe\x00", "x.toml")
    with pytest.raises(SceneError) as caught:
        open_text('machine = "dvf5001"\nsurprise = 1\n[errors]\nEC0X = "a"\n', "x", "x.toml")
    assert len(caught.value.problems) >= 3


def edited():
    return replace(put(START.with_amplitude("EXX", 7.125), "positions.B", "-20"), component="z")


@pytest.mark.parametrize(
    "state",
    [
        edited(),
        compare.with_pin(edited()).with_amplitude("EXX", 1.0),
        edits.with_curve(
            edited(), "EYX", TableCurve((-275.0, 275.0), ((-275.0, 1.0), (0.0, -3.0)))
        ),
    ],
    ids=["known scene", "comparison", "edited curve"],
)
def test_a_tab_comes_back_whole_with_its_camera(state):
    found, camera, missing = read_page_copy(page_copy_text(state, CAMERA, KNOWN), KNOWN)
    assert found.resulting_scene().errors == state.resulting_scene().errors
    if state.loaded is None:  # so that Reset goes where it went
        assert found == state
    assert camera == CAMERA
    assert missing[: len(NEVER_RESTORED)] == NEVER_RESTORED


def test_scene_that_the_server_has_no_more_comes_back_from_its_file():
    found, _, missing = read_page_copy(page_copy_text(edited(), None, KNOWN), KNOWN[1:])
    assert found.resulting_scene().errors == edited().resulting_scene().errors
    assert found.component == "z"
    assert missing == (*NEVER_RESTORED, START_VALUES)
    # and so does one that has changed under its name
    other = replace(KNOWN[1], name="dvf5000_first")
    found, *_ = read_page_copy(page_copy_text(edited(), None, KNOWN), [other])
    assert found.resulting_scene().errors == edited().resulting_scene().errors


def test_comparison_that_is_too_large_is_left_out_and_named(monkeypatch):
    state = compare.with_pin(edited()).with_amplitude("EXX", 1.0)
    alone = page_copy_text(START.with_amplitude("EXX", 1.0), None, KNOWN)
    monkeypatch.setattr("warpspace.app.server.tab_keeper.MAX_KEPT_TEXT", len(alone) + 300)
    found, _, missing = read_page_copy(page_copy_text(state, None, KNOWN), KNOWN)
    assert found.comparison.b is None
    assert found.amplitudes["EXX"] == 1.0
    assert COMPARISON in missing
    monkeypatch.setattr("warpspace.app.server.tab_keeper.MAX_KEPT_TEXT", 10)
    assert page_copy_text(state, None, KNOWN) == ""


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "7", "[" * 100_000, json.dumps({"file": 7}), json.dumps({"file": "x = ["}),
     json.dumps({"link": "scene=../../etc", "file": "\x00"}), "x" * 800_000],
    ids=range(9),
)  # fmt: skip
def test_anything_may_come_from_a_page(text):
    with pytest.raises(WarpspaceError):
        read_page_copy(text, KNOWN)


def test_opened_scenes_are_bounded_and_the_oldest_goes():
    scenes = SceneList({FIRST.title: FIRST})
    opened = [replace(SECOND, name=f"upload {n}", title=f"Upload {n}") for n in range(23)]
    dropped = [scenes.add(scene)[1] for scene in opened]
    assert dropped == [""] * MOST_OPENED + ["Upload 0", "Upload 1", "Upload 2"]
    assert list(scenes) == [FIRST.title, *(f"Upload {n}" for n in range(3, 23))]
    assert len(scenes) == MOST_OPENED + 1
    assert scenes.fixed == (FIRST,)
    # one that has left and is shown again (undo) comes back as the newest
    assert scenes.add(opened[0]) == ("Upload 0", "Upload 3")
    assert list(scenes)[-1] == "Upload 0"


def test_titles_are_unique_and_never_words_of_the_page():
    scenes = SceneList({FIRST.title: FIRST})
    again = replace(FIRST, name="other")
    assert scenes.add(again) == (f"{FIRST.title} (2)", "")
    assert scenes.add(replace(SECOND, title="present errors"))[0] == "present errors (2)"
    assert scenes.add(replace(SECOND, title="", name="nothing"))[0] == "nothing (2)"
    assert scenes[f"{FIRST.title} (2)"] is again
    assert scenes.add(load_scene("dvf5000_first")) == (FIRST.title, "")  # an equal one needs none


KNOWN_SCENES = (*KNOWN, load_scene("teach_tilted_c"))
PINNED = compare.pinned_side(START.with_amplitude("EXX", 3.0))
COMPARED = [Side(), PINNED, *map(compare.scene_side, KNOWN_SCENES)]


@pytest.mark.parametrize(("a", "b"), pairwise(COMPARED, COMPARED, together=1))
def test_link_and_file_give_the_identical_comparison(a, b):
    for shown, ghost in (("a", True), ("b", False), ("difference", True)):
        comparison = Comparison(a, b, shown, ghost=ghost, pinned=PINNED)
        for compared in (comparison, comparison.off()):
            state = replace(START, comparison=compared)
            assert open_link(state_to_link(state, None, KNOWN_SCENES), KNOWN_SCENES)[0] == state
            assert open_text(state_to_toml(state), "dvf5000_first", "x.toml")[0] == state


def packed(text):
    return base64.urlsafe_b64encode(zlib.compress(text.encode())).decode().rstrip("=")


def opened(way, line):
    """Open what a line adds to a link, or to a file."""
    if way == "link":
        return open_link(f"scene=dvf5000_first&{line}", KNOWN_SCENES)[0]
    return open_text(f"# warpspace-view: {line}\n{state_to_toml(START)}", "x", "x.toml")[0]


def compared(**given):
    """What a link adds that compares."""
    return urlencode([(PREFIX + name.replace("_", "."), value) for name, value in given.items()])


WAYS = pytest.mark.parametrize("way", ["file", "link"])
MANY = "&".join(f"a{n}=1" for n in range(1000))


@pytest.mark.parametrize(
    "link",
    [
        "?",
        "pinned",
        "scene=nobody",
        "scene=../../etc/passwd",
        "file=!!!",
        "file=" + "A" * 61_000,
        "file=" + packed("x = 1\n" * MAX_PACKED_TEXT),
        "file=" + packed('title = "x"'),
        MANY,
    ],
)
@pytest.mark.parametrize("way", ["file", "link", "alone"])
def test_a_link_that_means_nothing_is_refused_alone_and_in_a_comparison(way, link):
    with pytest.raises((OptionError, SceneError)) as caught:
        open_link(link, KNOWN) if way == "alone" else opened(way, compared(b=link))
    assert len(str(caught.value)) < 400


def test_links_that_hold_nothing_or_more_than_an_address_are_not_followed():
    with pytest.raises(OptionError):
        open_link("", KNOWN)
    with pytest.raises(OptionError, match="expected at most 5,500"):
        open_link(transfers.unpack("A" * 8_000), KNOWN)
    assert transfers.unpack(transfers.pack("scene=dvf5000_first")) == "scene=dvf5000_first"


def test_a_short_link_with_one_key_of_many_parts_is_refused_at_once():
    """Such a link of 419 characters took 7.7 GB."""
    text = 'machine = "dvf5000"\na' + ".a" * 40_000 + " = 1\n"
    link = urlencode({"name": "x", "file": packed(text)})
    assert len(link) < 600
    with pytest.raises(SceneError, match="the scene in the link: line 2: a key of over 8 parts"):
        open_link(link, KNOWN)


def test_in_a_comparison_no_other_is_looked_at_and_wild_numbers_are_clamped_and_named():
    nested = f"scene=dvf5000_first&{compared(pinned='scene=nobody')}"
    assert opened("link", compared(pinned=nested, b="pinned")).comparison.b.state == START
    back = opened("link", compared(pinned="scene=dvf5000_first&EXX=1e9", b="pinned"))
    assert back.comparison.b.state.amplitudes["EXX"] == MAX_ERROR
    assert any(note.startswith("before: EXX") for note in back.notes)


@WAYS
def test_what_means_nothing_in_a_comparison_is_left_out_and_named(way):
    back = opened(way, compared(b="now", shown="<script>", ghost="maybe", evil="1"))
    assert back.comparison == Comparison(b=Side())
    assert all(name in back.notes[0] for name in ("shown", "ghost", "evil"))


@pytest.mark.parametrize("title", ["now", "present errors", "nothing", "", "x" * 1_000])
def test_titles_from_a_link_cannot_pose_as_something_else(title):
    given = {"b": "scene=dvf5000_second", "pinned": "scene=dvf5000_first"}
    back = opened("link", compared(**given, b_title=title, pinned_title=title))
    for side in (back.comparison.b, back.comparison.pinned):
        assert side.title not in ("now", "present errors", "nothing", "")
        assert len(side.title) <= 200


@pytest.mark.parametrize(
    "text", ["all,1,2,3", "workpiece,1,2", "workpiece,1,2,nan", "workpiece,1e9,0,0", ",,,", ""]
)
def test_a_trace_that_means_nothing_is_left_out_and_named(text):
    back = opened("link", urlencode({"why.trace": text, "why.C": "3"}))
    assert back.picked is None
    assert any("ignored" in note for note in back.notes)


@pytest.mark.parametrize("text", ["\n" * 300_000, "#\n" * 200_000, "# warpspace-view: a\n" * 9])
def test_remarks_at_the_head_of_a_file_take_little_memory(text):
    tracemalloc.start()
    try:
        settings_of(text)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()
