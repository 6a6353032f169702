"""Exports: what is drawn, under its own name; the offline page and pictures of the view."""

import csv
import html
import json
import re
import threading
from dataclasses import replace
from io import BytesIO, StringIO

import numpy as np
import pytest
from PIL import Image

import glb
from offline import EVIL, opened_offline, wait_for_the_map
from warpspace.app.documents import legend
from warpspace.app.documents.offline_page import build_offline_html, offline_picture
from warpspace.app.documents.output_services import CancelledError
from warpspace.app.documents.transfers import exported_words, file_stem, shown_sides
from warpspace.app.drawing.camera import CameraMemory, fit_camera
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.live_model import DrawnScale, LiveModel
from warpspace.app.evaluation.scene_overlays import program_of
from warpspace.app.panels.panel import Job
from warpspace.app.state.app_state import Picked, Side, start_state
from warpspace.app.state.tree import put
from warpspace.cli import services
from warpspace.cli.services import draw_animation, draw_figure, draw_view, write_export
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop
from warpspace.outputs import animation
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figures.registry import draw_figure as draw
from warpspace.picture.formatting import range_words
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=5).with_amplitude("EXX", 6.0)
BOTH = with_sides(START, Side(), scene_side(SECOND))
WORDS = {
    "a": f"A: present errors: {FIRST.title}",
    "b": f"B: {SECOND.title}",
    "difference": f"B − A: {SECOND.title} − present errors: {FIRST.title}",
}


def picture_of(shown, state=BOTH):
    return LIVE.evaluate(put(state, "comparison.shown", shown))


@pytest.fixture
def _short(monkeypatch):
    """Animations of four small pictures."""
    monkeypatch.setattr(animation, "default_frames", lambda *_: (4, 15.0))
    monkeypatch.setattr(services, "ANIMATION_SIZE", (400, 300))


@pytest.mark.usefixtures("_short")
def test_an_animation_is_a_webp_up_to_the_factor_of_the_drawing():
    shares, job = [], Job("Animation", lambda: None)
    job.report_progress = shares.append
    paused = LIVE.evaluate(START, DrawnScale(10.0))  # the player stands at a smaller factor
    film = Image.open(BytesIO(draw_animation(paused, "exaggeration", ".webp", job)))
    assert (film.format, film.n_frames, film.size) == ("WEBP", 4, (400, 300))
    assert shares == [0.25, 0.5, 0.75, 1.0]
    frames = []
    for number in range(4):
        film.seek(number)
        frames.append(np.asarray(film.convert("L"), dtype=float))
    away = [np.abs(frame - frames[0]).mean() for frame in frames]
    assert away[2] > away[1] > 0.1  # there and ..
    assert away[3] == pytest.approx(away[1], rel=0.05)  # .. back


@pytest.mark.usefixtures("_short")
def test_the_program_of_a_page_is_written_as_a_video_in_the_settings_of_the_page():
    text = "G21 G90 G54\nG0 X-200 Y0 Z-100\nG1 X200 F500\nM30\n"
    part = replace(START.part, program=text, program_name="a.nc")
    state = replace(START, part=part, forms={"program.length_mm": "80"})
    picture, drawn = LIVE.evaluate(state), program_of(state, state.active_scene())
    assert (drawn.length_mm, drawn.file) == (80.0, "a.nc")
    video = draw_animation(picture, "program", ".mp4", Job("Animation", lambda: None))
    assert video[4:8] == b"ftyp"


@pytest.mark.usefixtures("_short")
def test_the_story_of_a_page_is_written_step_by_step():
    notes = load_scene("review_dvf5000").review
    state = replace(START, review=notes)
    film = draw_animation(LIVE.evaluate(state), "story", ".webp", Job("Animation", lambda: None))
    assert Image.open(BytesIO(film)).n_frames > 1


@pytest.mark.usefixtures("_short")
def test_an_animation_is_cancelled_and_shows_one_machine():
    job = Job("Animation", lambda: None)
    job.set()
    with pytest.raises(CancelledError):
        draw_animation(LIVE.evaluate(START), "exaggeration", ".webp", job)
    with pytest.raises(OptionError, match="one machine"):
        draw_animation(picture_of("difference"), "exaggeration", ".webp", job)


def rows_of(picture):
    """Rows of the exported CSV, once their errors are those that are drawn."""
    rows = list(csv.DictReader(StringIO(write_export(picture, ".csv").decode())))
    # three components, whatever loop and frame their columns name
    names = [name for name in rows[0] if re.fullmatch(r"error_.*[xyz]_um", name)]
    errors = np.array([[float(row[name]) for name in names] for row in rows])
    np.testing.assert_allclose(errors, picture.field.error_um.reshape(-1, 3), atol=1e-6)
    return rows


def extras_of(picture):
    return glb.opened(write_export(picture, ".glb"))[0]["asset"]["extras"]


@pytest.mark.parametrize(
    ("shown", "stem"),
    [("a", "A_present"), ("b", "B_dvf5000_second"), ("difference", "dvf5000_second_minus_present")],
)
def test_every_export_has_what_is_drawn_and_its_title(shown, stem):
    picture = picture_of(shown)
    rows = rows_of(picture)
    assert all(title in rows[0]["scene"] for title in WORDS[shown].split(": ", 1)[1].split(" − "))
    assert rows[0]["loop"] == "relative"
    extras = extras_of(picture)
    assert extras["settings"]["exaggeration"] == picture.exaggeration
    assert extras["colours"]["low"] == picture.scale.low
    assert extras["colours"]["high"] == picture.scale.high
    assert extras["statistics"]["max_um"] == pytest.approx(picture.statistics.max_um)
    for title in picture.compared.titles if shown == "difference" else [WORDS[shown][3:]]:
        assert title in extras["title"]
    if shown == "difference":
        assert extras["a"]["parameters"]["EXX"]["amplitude"] == 6.0
        assert "parameters" not in extras
    page = build_offline_html(picture)
    assert WORDS[shown] in page.partition("<main>")[0]
    errors = page.partition("<aside>")[2]
    assert ("A +6, B 0 µm" in errors) == (shown == "difference")
    assert ("+6 µm" in errors) == (shown == "a")
    assert file_stem(picture) == stem
    assert exported_words(picture).startswith(f"Pictures and exports show {WORDS[shown]}.")


def test_a_picture_without_a_comparison_has_the_name_of_its_scene():
    picture = LIVE.evaluate(START)
    assert (exported_words(picture), file_stem(picture)) == ("", "dvf5000_first")


@pytest.mark.render
def test_the_figure_is_a_sheet_of_both_and_the_difference_as_the_app_takes_it(renderer):
    pair = [one.active_scene() for one in shown_sides(picture_of("a"), sheet=True)]
    assert [scene.title for scene in pair] == [f"present errors: {FIRST.title}", SECOND.title]
    settings = FigureSettings(grid=5, exaggeration=picture_of("a").exaggeration)
    drawing = draw("comparison", pair, settings)
    difference = picture_of("difference")
    np.testing.assert_allclose(drawing.maps[2].picture.values, difference.values, atol=1e-6)
    np.testing.assert_allclose(drawing.maps[2].picture.drawn_mm, difference.drawn_mm, atol=1e-6)


def tilted(top=None):
    state = put(START, "look.quantity", "orientation")
    return LIVE.evaluate(state if top is None else put(state, "look.range_top", str(top)))


@pytest.mark.parametrize("top", [None, 7.0])
def test_glb_has_the_tilts_and_the_range_that_are_coloured(top):
    picture = tilted(top)
    extras = extras_of(picture)
    assert extras["settings"]["coloured"] == "tool-orientation error"
    assert extras["colours"]["high"] == (picture.scale.high if top is None else top)
    assert extras["colours"]["unit"] == "µrad"
    assert exported_words(picture).startswith("The figure shows the tilts")


@pytest.mark.render
def test_the_figure_shows_what_is_coloured_in_the_range_that_is_fixed(renderer):
    about = Image.open(BytesIO(draw_figure(tilted(7.0), "", threading.Event()))).info
    assert about["Title"].startswith("Orientation error of the tool axis")
    said = dict(pair.split("=") for pair in about["Description"].partition(";")[0].split(", "))
    assert (said["figure"], said["range"]) == ("orientation-map", "7")


def test_two_loops_on_one_sheet_are_refused_in_words():
    picture = picture_of("difference", replace(with_pin(START), loop=Loop("tool")))
    with pytest.raises(OptionError, match="same loop"):
        draw_figure(picture, "", threading.Event())
    # the other exports draw each side through its own
    assert rows_of(picture)[0]["loop"] == "tool − relative"


def test_volumes_that_differ_export_the_side_that_is_drawn():
    ranges = {**SECOND.workspace.ranges, "X": (-100.0, 100.0)}
    other = replace(SECOND, name="other", workspace=type(SECOND.workspace)(ranges))
    picture = picture_of("difference", with_sides(START, Side(), scene_side(other)))
    assert picture.compared.refused
    assert picture.compared.difference is None
    assert picture.compared.view == "b"
    assert len(shown_sides(picture, sheet=True)) == 1
    assert file_stem(picture) == "B_other"
    assert "sheet" not in exported_words(picture)


def without(key):
    return put(START, "exclusions.excluded", f"+{key}")


def fixed(state):
    return LIVE.evaluate(put(put(state, "look.range_top", "50"), "look.range_mode", "fixed"))


def test_conditions_name_what_is_excluded_and_the_range():
    assert legend.picture_conditions(LIVE.evaluate(START)) == ()
    both = put(without("EA0Z"), "exclusions.excluded", "+EAX")
    assert legend.picture_conditions(fixed(both)) == ("excluded: EAX, EA0Z", "range fixed 0–50 µm")
    only = put(START, "exclusions.only", "+EAX")
    assert legend.picture_conditions(LIVE.evaluate(only)) == ("only: EAX",)
    # an error that is zero changes nothing when it is left out
    assert legend.picture_conditions(LIVE.evaluate(without("EYX"))) == ()
    assert range_words(-20.0, 20.0, "µm") == "range fixed −20 to 20 µm"


def test_exports_say_the_conditions():
    picture = fixed(without("EA0Z"))
    assert rows_of(picture)[0]["conditions"] == "excluded: EA0Z; range fixed 0–50 µm"
    extras = extras_of(picture)
    assert extras["settings"]["conditions"] == ["excluded: EA0Z", "range fixed 0–50 µm"]
    assert extras["statistics"]["max_at_axes"]["Z"] in (-480.0, -80.0)
    footer = build_offline_html(picture).partition("<footer>")[2]
    assert "excluded: EA0Z" in footer
    assert "range fixed 0–50 µm" in footer
    assert "excluded: EA0Z" in legend.look_words(picture)  # of pictures of the screen


def test_a_comparison_says_the_conditions_of_each_side():
    picture = picture_of("difference", with_sides(without("EA0Z"), Side(), scene_side(SECOND)))
    assert legend.picture_conditions(picture) == ("A excluded: EA0Z",)
    assert rows_of(picture)[0]["conditions"] == "A excluded: EA0Z"
    conditions = [legend.state_conditions(one) for one in shown_sides(picture)]
    assert conditions == [("excluded: EA0Z",), ()]


def test_a_page_keeps_the_camera_and_the_point():
    at = {"X": 275.0, "Y": -225.0, "Z": -480.0}
    picture = LIVE.evaluate(replace(start_state(FIRST, nodes=5), picked=Picked(at)))
    camera = CameraMemory((9.25, 1.5, 2.5), (0.5, 0.25, 0.125), (0.0, 0.0, 1.0), 0.5)
    page = build_offline_html(picture, camera=camera)
    assert "51.7 µm at X 275 Y −225 Z −480" in page.partition("<aside>")[2]
    assert page != build_offline_html(picture)


def page_of(scene, **changes):
    choices = {"exaggeration": 1000.0, "nodes": 21, **changes}
    return build_offline_html(offline_picture(scene, **choices), {"title": scene.title, "n": 1})


def test_the_page_of_the_largest_grid_fits_a_mail_and_points_nowhere():
    text = page_of(FIRST, nodes=31)
    assert len(text.encode()) <= 3_000_000
    mean = offline_picture(FIRST, exaggeration=1000.0, nodes=31).statistics.mean_um
    for words in (FIRST.title, "×1000", f">{mean:.1f} µm", "pitch of Y"):
        assert words in text
    outer = re.sub(r'srcdoc="[^"]*"', "", text)
    assert not re.search(r"https?://|//\w+\.|\bsrc=|\bhref=", outer)
    assert "default-src 'none'" in html.unescape(outer)


def test_stored_provenance_can_be_read_back():
    text = page_of(replace(FIRST, title=EVIL), nodes=3)
    stored = re.search(r'id="warpspace">(.*?)</script>', text, re.DOTALL)
    assert json.loads(stored.group(1)) == {"title": EVIL, "n": 1}


UP_AND_PLACE = """() => {
  const { up, position } = window.__viserMutable.camera;
  return [...up.toArray(), ...position.toArray()];
}"""
TURN_OVER = """() => {
  const { camera, cameraControl } = window.__viserMutable;
  camera.up.set(0, 0, 1);
  cameraControl.updateCameraUp();
  cameraControl.setLookAt(3, 9, 2, 0, 0, 0, false);
}"""
VISIBLE_CONTROLS = """() => [...document.querySelectorAll("button, [role=alert]")]
  .filter(part => part.checkVisibility()).length"""


def test_opens_without_network_and_draws(browser, tmp_path):
    path = tmp_path / "scene.html"
    path.write_text(page_of(replace(FIRST, title=EVIL)), encoding="utf-8")
    with opened_offline(browser, path) as page:
        assert "exaggeration ×1000" in page.inner_text("header")
        wait_for_the_map(page, page.frame_locator("iframe").locator("canvas").first, 20_000)
        assert page.title() == f"{EVIL} · warpspace"
        bars = [bar.inner_text() for bar in page.locator("[data-bar-scale]").all()]
        assert [re.sub("^[0-9]+ ", "", text) for text in bars] == [
            "mm geometry", "µm error, drawn ×1000"
        ]  # fmt: skip
        (_, drawing) = page.frames
        assert not drawing.evaluate(VISIBLE_CONTROLS)
        # as if the first camera of viser, which may be any way up, arrived after ours
        upright = drawing.evaluate(UP_AND_PLACE)
        drawing.evaluate(TURN_OVER)
        page.wait_for_timeout(500)
        assert drawing.evaluate(UP_AND_PLACE) == pytest.approx(upright, abs=1e-3)
        page.mouse.move(600, 500)
        page.mouse.down()
        page.mouse.move(700, 520, steps=4)
        page.mouse.up()
        page.wait_for_timeout(500)
        assert drawing.evaluate(UP_AND_PLACE) != pytest.approx(upright, abs=0.1)


def test_a_picture_of_the_screen_says_what_it_shows_beside_its_pixels():
    picture = picture_of("difference")
    pose = fit_camera(picture.drawn_mm.reshape(-1, 3), 1.5, margins=(0.2, 0.2, 0.2, 0.2))
    pixels = np.zeros((400, 600, 4), np.uint8)
    pixels[180:220, 250:350] = (90, 10, 200, 255)
    words, px_per_mm = legend.projected_labels(picture, pose, 400, 600)
    unbarred = replace(picture, state=replace(BOTH, look=replace(BOTH.look, bars=False)))
    assert legend.projected_labels(unbarred, pose, 400, 600)[1] is None
    # a millimetre of the middle of the picture, seen from as far
    assert px_per_mm == pytest.approx(
        200.0 / np.tan(pose.fov_rad / 2.0)
        / (np.linalg.norm(np.subtract(pose.position, pose.look_at)) * 100.0), rel=0.2
    )  # fmt: skip
    bare, barred = (
        Image.open(BytesIO(draw_view(one, pixels, pose, threading.Event())))
        for one in (unbarred, picture)
    )
    assert barred.info["Title"] == WORDS["difference"]
    assert f"exaggeration ×{picture.exaggeration:g}" in barred.info["Description"]
    drawn, without = (np.asarray(one.convert("RGB")).astype(int) for one in (barred, bare))
    scene, without = drawn[-400:, :600], without[-400:, :600]
    assert (scene == without).all()
    assert (scene[185:215, 255:345] == (90, 10, 200)).mean() > 0.9
    beside = drawn[-400:, 600:]
    for value in (picture.scale.high, picture.scale.low):
        close = np.abs(beside - picture.scale.colours(np.array(value))).sum(axis=-1) < 12
        assert close.any()
    # words stand beside their points, of which the worst is named
    (worst,) = [spot for text, spot in words if text.startswith("max ")]
    left, top = np.round(worst - (90, 0)).astype(int)[0], 400 - round(worst[1])
    assert (scene[max(top - 90, 0) : top + 90, max(left, 0) : left + 180] < 128).any()
    assert any(text == "0" for text, _ in words)
