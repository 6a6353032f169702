"""Questions in a real Chromium: why, where, compared, conventions, links and files."""

import json
import re
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from click.testing import CliRunner

from app.page_tab import SCENES
from warpspace.app.browser.page import PARAMETER
from warpspace.app.documents.scene_file import state_to_toml
from warpspace.app.evaluation.budget import Picked, answer
from warpspace.app.evaluation.conventions import Effects, with_choice
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.edits import with_excluded
from warpspace.cli.main import cli
from warpspace.scene.library import load_scene

LIVE = LiveModel()
START = start_state(SCENES[0])
WORST = "X=275,Y=-225,Z=-480,B=0,C=0"
WORST_PLACE = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"


def click_box(tab):
    """Click the front of the box."""
    tab.still(tab.eye)
    tab.page.mouse.click(760, 480)


def numbers(text):
    return [float(n.replace("−", "-")) for n in re.findall(r"[+−-]?\d+\.?\d*", text)]


def answered(tab):
    """Wait until the budget is that of the point asked about; give it."""
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 1)
    state = tab.session.state
    found = answer(state, state.picked, LIVE.evaluate(state).exaggeration)
    norm = float(np.linalg.norm(found.explanation.error_um))
    tab.until(lambda: tab.number("why norm") == pytest.approx(norm, abs=0.006))
    tab.until(lambda: np.allclose(tab.place("/why/marker"), found.drawn_mm, atol=0.5))
    return found


def test_a_click_on_the_box_says_why_and_follows_the_errors(tab):
    click_box(tab)
    found = answered(tab)
    rows = tab.page.locator("[data-contribution]")
    tab.until(lambda: rows.count() == len(found.explanation.contributions))
    along = [numbers(rows.nth(i).inner_text())[-4:] for i in range(rows.count())]
    assert [abs(row[0]) for row in along] == sorted((abs(row[0]) for row in along), reverse=True)
    error = numbers(tab.text("why error"))[:3]
    rest = np.array([row[1:] for row in along]).sum(axis=0)
    np.testing.assert_allclose(rest, error, atol=0.06)
    tab.until(tab.page.get_by_text("2nd-order rest").is_visible)
    tab.page.locator("[data-contribution='EA0Z']").click()
    tab.until(lambda: tab.place("/why/lever") is not None)
    tab.until(lambda: tab.place("/why/axis") is not None)
    tab.until(lambda: "mm across the axis" in tab.text("lever"))
    tab.send("EXX", "9")
    tab.until(lambda: tab.session.state.amplitudes["EXX"] == 9.0)
    answered(tab)
    tab.button("Clear")
    tab.until(lambda: tab.place("/why/marker") is None)
    tab.button("Undo")
    tab.until(lambda: tab.place("/why/marker") is not None)


def check_worst(tab):
    """Compare the error of the budget with the command line's; give it, µm."""
    asked = ["field", "dvf5000_first", "--at", WORST, "--exact", "--json"]
    norm = json.loads(CliRunner().invoke(cli, asked).stdout)["points"][0]["norm_um"]
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 1)
    tab.until(lambda: tab.text("why norm") == f"{norm:.2f} µm")
    return norm


def test_the_worst_point_is_one_key_away_is_copied_and_its_rows_are_worked_with(tab):
    tab.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    eye = tab.still(tab.eye)
    tab.page.keyboard.press("w")
    budget = tab.page.get_by_role("tab", name="Error budget", exact=True)
    tab.until(lambda: budget.get_attribute("aria-selected") == "true")
    assert check_worst(tab) == pytest.approx(51.7, abs=0.05)
    tab.until(lambda: tab.text("why at").startswith(WORST_PLACE))
    assert tab.eye() == eye  # viser's camera does not fly off with the same key
    tab.page.locator("[data-value='why at'] .ws-copy").click()
    tab.until(lambda: tab.page.evaluate("navigator.clipboard.readText()") == WORST)

    tab.button("Edit EB0Z")
    focused = "document.activeElement.closest('[id]')?.id"
    tab.until(lambda: tab.page.evaluate(focused) == tab.widget("EB0Z"))
    tab.until(lambda: tab.session.state.chosen_error == "EB0Z")
    tab.page.keyboard.press("ArrowRight")
    tab.until(lambda: tab.session.state.amplitudes["EB0Z"] != START.amplitudes["EB0Z"])
    tab.button("Reset")
    tab.button("Exclude EA0Z")
    without = LIVE.evaluate(with_excluded(START, "EA0Z", True)).statistics.max_um
    tab.until(lambda: tab.session.state.exclusions.excluded == {"EA0Z"})
    tab.until(lambda: abs(tab.number("max") - without) < 0.006)
    tab.button("Include EA0Z")
    check_worst(tab)
    tab.press("n")
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 0)


def test_a_convention_changes_the_map_says_by_how_much_and_a_reference_is_picked(tab):
    tab.panel("Conventions")
    effect = Effects().of(START)["component_errors=before_motion"]
    row = tab.page.locator("[data-choice='component_errors=before_motion']")
    tab.until(lambda: "…" not in row.inner_text())
    shown = pytest.approx([effect.mean_um, effect.max_um], abs=0.006)
    tab.until(lambda: numbers(row.inner_text())[-2:] == shown)
    row.click()
    tab.until_shown(with_choice(START, "component_errors=before_motion"))
    tab.button("Conventions of the scene")
    tab.until_shown(START)
    tab.button("Pick the reference in 3-D")
    tab.page.get_by_text("Click a point of the box …").wait_for()
    click_box(tab)
    tab.until(lambda: tab.session.state.scene.reference is not None)
    state = tab.session.state
    assert state.picked is None
    tab.until_shown(state)
    at = Picked(dict(state.scene.reference))
    assert np.linalg.norm(answer(state, at, 1.0).explanation.error_um) < 1e-6


def test_a_link_brings_scene_errors_camera_and_comparison(tab, open_tab):
    tab.choose("Scene", SCENES[1].title)
    tab.until(lambda: tab.session.state.scene is SCENES[1])
    before = tab.session.state
    tab.panel("Compare")
    tab.button("Pin as before")
    tab.until(lambda: tab.page.locator("[data-compared='mean B − A']").count() == 1)
    tab.send("EXX", "10")
    tab.until(lambda: tab.session.state.amplitudes["EXX"] == 10.0)
    tab.button("B − A")
    tab.until(lambda: tab.session.state.comparison.shown == "difference")
    tab.press("t")
    tab.until(lambda: "true scale" in tab.text("factor"))
    tab.until_shown(tab.session.state)
    tab.page.mouse.move(760, 480)
    start = tab.still(tab.eye)
    tab.page.mouse.wheel(0, 400)
    tab.until(lambda: not np.allclose(tab.eye(), start))
    tab.still(tab.eye)
    camera = tab.still(lambda: tab.session.context.camera.remember().position)
    tab.panel("Files")
    tab.button("Link")
    tab.until(lambda: f"{PARAMETER}=" in tab.page.url)
    state = tab.session.state

    # sliders of the scene that is replaced are told nothing any more: no page reports an error
    other = open_tab(query=f"&{urlsplit(tab.page.url).query}")
    other.until(lambda: other.session.state == state)
    other.until_shown(state)
    other.until(
        lambda: np.allclose(other.session.context.camera.remember().position, camera, rtol=1e-3)
    )
    other.panel("Compare")
    other.until(lambda: other.page.locator("[data-compared='mean B − A']").count() == 1)
    title = state.comparison.pinned.title
    other.until(lambda: other.page.get_by_label("A", exact=True).input_value() == title)
    other.button("A")  # and it goes on from there
    other.until_shown(before.with_exaggeration(1.0))


def test_scenes_are_saved_opened_and_refused_and_exports_downloaded(tab, tmp_path):
    tab.send("EXX", "7.5")
    tab.until(lambda: tab.session.state.amplitudes["EXX"] == 7.5)
    tab.send("B [°]", "-20")
    tab.until(lambda: tab.session.state.positions["B"] == -20.0)
    tab.choose("Component", "E_y")
    tab.until(lambda: tab.session.state.component == "y")
    state = tab.session.state
    tab.panel("Files")
    path = tmp_path / "dvf5000_first.toml"
    with tab.page.expect_download() as waiting:
        tab.button("Save scene")
    assert waiting.value.suggested_filename == path.name
    waiting.value.save_as(path)
    assert load_scene(path).errors.amplitude("EXX") == 7.5
    for name, file, begin in (
        ("View", "dvf5000_first_view.png", b"\x89PNG"),
        ("HTML", "dvf5000_first.html", b"<!"),
        ("GLB", "dvf5000_first.glb", b"glTF"),
    ):
        tab.until(lambda: tab.page.get_by_role("button", name="Cancel", exact=True).count() == 0)
        with tab.page.expect_download(timeout=60_000) as waiting:
            tab.button(name)
        assert Path(waiting.value.path()).read_bytes().startswith(begin)
        assert waiting.value.suggested_filename == file

    # ten at once: the last one is shown
    for number in range(10):
        text = state_to_toml(start_state(SCENES[1]))
        tab.upload(f"scene {number}.toml", text.encode())
    tab.until(lambda: tab.session.state.scene.name == "scene 9", 30.0)
    tab.upload("../../evil.toml", b'machine = "dvf5001"\nsurprise = 1\n[errors]\nEC0X = "a"\n')
    tab.until(lambda: tab.page.get_by_text("4 problems").count() > 0)
    tab.upload("noise.toml", b"\xff\xfe\x00\x01")
    tab.until(lambda: tab.page.get_by_text("not UTF-8").count() > 0)
    tab.upload("big.toml", b"x" * (5 * 2**20))
    tab.until(lambda: tab.page.get_by_text("at most 4 MB").count() > 0)
    tab.upload(path.name, path.read_bytes())
    tab.until_shown(state)
    tab.until(lambda: tab.session.state.amplitudes == state.amplitudes)
    assert tab.session.state.component == "y"
    tab.send("EXX", "4")
    tab.until_shown(state.with_amplitude("EXX", 4.0))


@pytest.mark.render
def test_the_figure_is_drawn_and_can_be_cancelled(tab, renderer):
    tab.panel("Files")
    tab.button("Figure")
    tab.button("Cancel")
    tab.until(lambda: tab.page.get_by_text("Cancelled").count() > 0)
    tab.until(lambda: tab.page.get_by_role("button", name="Cancel", exact=True).count() == 0)
    with tab.page.expect_download(timeout=120_000) as waiting:
        tab.button("Figure")
    assert Path(waiting.value.path()).read_bytes().startswith(b"\x89PNG")
