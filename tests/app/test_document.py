"""Files and links: a state comes back identical, and what is hostile is refused or clamped."""

import base64
import zlib
from dataclasses import fields, replace

import pytest

from warpspace.app.documents.received_files import safe_file_name, safe_name, upload_text
from warpspace.app.documents.scene_file import (
    MAX_PACKED_TEXT,
    open_link,
    open_text,
    state_to_link,
    state_to_toml,
)
from warpspace.app.documents.view_settings import camera_of, settings_line, with_settings
from warpspace.app.evaluation.budget import Picked
from warpspace.app.evaluation.conventions import with_choice, with_reference
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, Shown, start_state
from warpspace.app.state.look import Look, MachineLook, RotaryLook
from warpspace.app.state.specification import Specification
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.errors import Ramp
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.library import load_scene, scene_names

SCENE = load_scene("dvf5000_first")
START = start_state(SCENE)
EVIL_CSV = """title = "x"
machine = "dvf5000"
[errors]
EXX = { csv = "/etc/passwd", column = "a" }
"""
CAMERA = CameraMemory((10.0, -20.0, 12.0), (0.0, 0.5, 1.5), (0.0, 0.0, 1.0), 0.384)
LOOKED = {
    "amplitudes",
    "positions",
    "exaggeration",
    "component",
    "loop",
    "nodes",
    "shown",
    "exclusions",
    "tolerances",
    "specification",
    "look",
    "machine",
    "rotary",
    "picked",
    "lever",
}


def busy() -> AppState:
    """A state in which nearly everything differs from the scene as opened."""
    state = START.with_amplitude("EXX", 3.3).with_amplitude("EBZ", 1.0 / 3.0)
    state = edits.with_curve(state, "EYY", Ramp(edits.axis_span(state, "EYY"), 2.5))
    state = state.with_position("B", -30.0).with_position("C", 45.0).with_exaggeration(2000.0)
    state = state.with_component("x").with_loop("relative").with_nodes(11)
    state = state.with_shown(**{f.name: not getattr(state.shown, f.name) for f in fields(Shown)})
    state = edits.with_only(edits.with_excluded(state, "EXX", True), "EAX", True)
    state = edits.with_half_width(state, "EXX", 7.5)
    look = state.look.with_choice(surface="slices", quantity="orientation").with_top(12.5)
    for name in ("isolines", "arrows", "worst", "bars", "follow"):
        look = look.switched(**{name: not getattr(look, name)})
    span = edits.Span(-275.0, 275.0, 1.0)
    state = replace(
        state,
        look=look.with_slice("X", 10.0, span),
        machine=state.machine.switched(shown=True, bent=False, ghost=False).with_linear(
            "X", 20.0, span
        ),
        rotary=state.rotary.with_point(1, on=False)
        .with_own((10.0, 20.0, 30.5))
        .with_held("B", (-15.0, 0.0)),
        specification=Specification(
            25.0, "max", "normal", 99.0, frozenset({"EXX", "EAZ"}), "EA0Z=4,EXY=0.5"
        ),
        picked=Picked({"X": 1.5, "Y": -2.0, "Z": -100.0}),
        lever="EAX",
    )
    state = with_reference(with_choice(state, "component_errors=before_motion"), {"X": 5.0})
    return with_choice(state, "direction C=-1").without_notes()


@pytest.mark.parametrize("way", ["file", "link"])
def test_everything_looked_at_comes_back_identical(way: str) -> None:
    state = busy()
    if way == "file":
        back, camera = open_text(state_to_toml(state, CAMERA), "dvf5000_first", "x.toml")
    else:
        back, camera = open_link(state_to_link(state, CAMERA, [SCENE]), [SCENE])
    assert back.notes == ()
    assert camera == CAMERA
    for name in LOOKED:
        assert getattr(back, name) == getattr(state, name), name
    assert back.scene.model == state.scene.model
    assert back.scene.reference == state.scene.reference
    assert {k: edits.curve_of(back, k) for k in back.amplitudes} == {
        k: edits.curve_of(state, k) for k in state.amplitudes
    }


def test_every_setting_is_written() -> None:
    """A field added to the look of things must find its way into files and links."""
    line = settings_line(replace(busy(), scene=SCENE, loaded=None))
    for group, kind in (
        ("shown", Shown),
        ("look", Look),
        ("machine", MachineLook),
        ("specification", Specification),
    ):
        for field in fields(kind):
            assert f"{group}.{field.name}" in line, field.name
    assert {field.name for field in fields(RotaryLook)} == {"off", "own_mm", "held", "chosen"}


@pytest.mark.parametrize("name", scene_names())
def test_every_bundled_scene_opens_from_its_saved_state(name: str) -> None:
    state = start_state(load_scene(name))
    back, _ = open_text(state_to_toml(state), name, name)
    assert back == state


def test_a_link_to_a_known_scene_is_short_and_readable() -> None:
    link = state_to_link(START.with_amplitude("EXX", 2.5), None, [SCENE])
    assert link == "scene=dvf5000_first&EXX=2.5"
    back, camera = open_link(link, [SCENE])
    assert back == START.with_amplitude("EXX", 2.5)
    assert camera is None


@pytest.mark.parametrize(
    "link",
    [
        "",
        "scene=nobody",
        "scene=../../etc/passwd",
        "file=!!!",
        "file=" + "A" * 61_000,
        "file=" + base64.urlsafe_b64encode(zlib.compress(b"x = 1\n" * MAX_PACKED_TEXT)).decode(),
        "file=" + base64.urlsafe_b64encode(zlib.compress(b'title = "x"')).decode(),
        "&".join(f"a{n}=1" for n in range(1000)),
    ],
)
def test_hostile_links_are_refused_with_a_message(link: str) -> None:
    with pytest.raises((OptionError, SceneError)):
        open_link(link, [SCENE])


def test_hostile_settings_are_clamped_or_left_out_and_named() -> None:
    line = (
        "EXX=1e9&EYX=nan&B=500&nodes=1e6&exaggeration=-3&component=<b>&loop=all&look.surface=evil"
        "&shown.dark=maybe&rotary.off=0,99,-1&rotary.held.B=inf&excluded=EXX,evil&why.X=1e9"
        "&look.slices_mm.X=1e9&specification.limit_um=1e12&__class__=1&camera=1,2"
    )
    back = with_settings(START, line)
    assert back.amplitudes["EXX"] == back.spans["EXX"].high == MAX_ERROR
    assert back.amplitudes["EYX"] == START.amplitudes["EYX"]
    assert back.positions["B"] == START.position_spans["B"].high
    assert back.component == "norm"
    assert back.loop == START.loop
    assert back.look.surface == "surface"
    assert back.rotary.off == frozenset({0})
    assert back.exclusions.excluded == frozenset({"EXX"})
    assert back.picked is not None
    assert abs(back.picked.at["X"]) <= 300.0
    assert any("left out" in note for note in back.notes)
    assert with_settings(START, "x" * 20_000) == START


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
def test_cameras_that_see_nothing_are_not_taken(numbers: str) -> None:
    assert camera_of(f"camera={numbers}") is None


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("..\\..\\evil.toml", "evil"),
        ("a<script>.toml", "a_script"),
        ("", "scene"),
        ("...", "scene"),
        ("\x00\n", "scene"),
        ("x" * 300, "x" * 60),
        ("my machine.v2.toml", "my machine.v2"),
    ],
)
def test_names_from_a_browser_are_made_safe(given: str, kept: str) -> None:
    assert safe_name(given) == kept


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("a b.CSV", "a b.CSV"),
        ("../../<img src=x>.csv", "img src_x.csv"),
        ("noending", "noending.txt"),
        ("x.c/../sv", "sv.txt"),
        (".", "file.txt"),
    ],
)
def test_file_names_of_received_data_keep_their_ending(given: str, kept: str) -> None:
    assert safe_file_name(given) == kept


def test_uploads_that_are_no_scene_are_refused_with_every_problem() -> None:
    with pytest.raises(OptionError, match="at most 4 MB"):
        upload_text(b"x" * (4 * 2**20 + 1), "big.toml")
    with pytest.raises(OptionError, match="not UTF-8"):
        upload_text(b"\xff\xfe\x00", "x.toml")
    with pytest.raises(SceneError) as caught:
        open_text('machine = "dvf5001"\nsurprise = 1\n[errors]\nEC0X = "a"\n', "x", "x.toml")
    assert len(caught.value.problems) >= 3
    with pytest.raises(SceneError, match="CSV files are not read"):
        open_text(
            EVIL_CSV,
            "x",
            "x.toml",
        )
