"""Why, compare, conventions and files in a real Chromium: what is done, and what is then shown."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from app.page_tab import SCENES, Tab, drawn_nodes
from warpspace.app.documents.scene_file import state_to_toml
from warpspace.app.evaluation.budget import Picked, answer
from warpspace.app.evaluation.compare import scene_side, with_sides
from warpspace.app.evaluation.conventions import Effects, with_choice
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.comparison import Side
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
LIVE = LiveModel()
START = start_state(SCENES[0])
PLACE = """name => {
  const node = window.__viserMutable.nodeRefFromName[name];
  return node && node.visible ? [node.position.x, node.position.y, node.position.z] : null;
}"""


def click_box(tab: Tab) -> None:
    """Click the front of the box."""
    tab.page.wait_for_timeout(500)
    tab.page.mouse.click(760, 480)
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 1)


def numbers(text: str) -> list[float]:
    return [float(n.replace("−", "-")) for n in re.findall(r"[+−-]?\d+\.?\d*", text)]


def test_a_click_on_the_box_says_why(tab: Tab) -> None:
    click_box(tab)
    picked = tab.state().picked
    assert picked is not None
    picture = LIVE.evaluate(START)
    found = answer(START, picked, picture.exaggeration)
    assert tab.number("why norm") == pytest.approx(
        float(np.linalg.norm(found.explanation.error_um)), abs=0.006
    )
    place = tab.page.evaluate(PLACE, "/why/marker")
    np.testing.assert_allclose(np.array(place) * 100.0, found.drawn_mm, atol=0.5)
    rows = tab.page.locator("[data-contribution]")
    assert rows.count() == len(found.explanation.contributions)
    along = [numbers(rows.nth(i).inner_text())[-4:] for i in range(rows.count())]
    assert [abs(row[0]) for row in along] == sorted((abs(row[0]) for row in along), reverse=True)
    error = numbers(tab.text("why error"))[:3]
    rest = np.array([row[1:] for row in along]).sum(axis=0)
    np.testing.assert_allclose(rest, error, atol=0.06)
    assert tab.page.get_by_text("2nd-order rest").is_visible()
    # no column is cut off at the edge of the page
    assert tab.page.evaluate(
        "document.querySelector('[data-contribution]').closest('table')"
        ".getBoundingClientRect().right < innerWidth - 5"
    )


def test_choosing_a_contribution_draws_axis_and_lever_and_follows(tab: Tab) -> None:
    click_box(tab)
    tab.page.locator("[data-contribution='EA0Z']").click()
    tab.until(lambda: tab.page.evaluate(PLACE, "/why/lever") is not None)
    assert tab.page.evaluate(PLACE, "/why/axis") is not None
    assert "mm across the axis" in tab.text("lever")
    before = tab.page.evaluate(PLACE, "/why/marker")
    tab.send("EXX", "9")
    state = START.with_amplitude("EXX", 9.0)
    picked = tab.state().picked
    assert picked is not None
    tab.until(lambda: tab.page.evaluate(PLACE, "/why/marker") != before)
    found = answer(state, picked, LIVE.evaluate(state).exaggeration)
    tab.until(
        lambda: np.allclose(
            np.array(tab.page.evaluate(PLACE, "/why/marker")) * 100.0, found.drawn_mm, atol=0.5
        )
    )
    tab.page.get_by_role("button", name="Clear", exact=True).click()
    tab.until(lambda: tab.page.evaluate(PLACE, "/why/marker") is None)
    tab.page.get_by_role("button", name="Undo", exact=True).click()
    tab.until(lambda: tab.page.evaluate(PLACE, "/why/marker") is not None)


def test_two_scenes_are_compared_with_one_scale(tab: Tab) -> None:
    tab.panel("Compare")
    tab.choose("B", SCENES[1].title)
    state = with_sides(START, Side(), scene_side(SCENES[1]))
    for name, word in (("B", "b"), ("B − A", "difference"), ("A", "a")):
        picture = LIVE.evaluate(replace(state, comparison=state.comparison.with_shown(word)))
        tab.page.get_by_role("button", name=name, exact=True).click()
        tab.until(lambda picture=picture: tab.shows(drawn_nodes(picture)))
        tab.page.get_by_role("button", name=f"▸ {name}", exact=True).wait_for()
        assert ("second machine" in tab.text("compared")) == (word != "a")
        for column, found in (
            ("A", picture.compared.a),
            ("B", picture.compared.b),
            ("B − A", picture.compared.difference),
        ):
            for row, value in (("mean", found.mean_um), ("RMS", found.rms_um)):
                shown = tab.page.inner_text(f"[data-compared='{row} {column}']")
                assert float(shown) == pytest.approx(value, abs=0.006)
    tab.until(lambda: tab.page.evaluate(PLACE, "/compare/other") is not None)
    tab.choose("B", "nothing")
    tab.until(lambda: tab.page.evaluate(PLACE, "/compare/other") is None)
    tab.until_shown(START)


def test_what_is_steered_is_compared_with_the_state_before(tab: Tab) -> None:
    tab.panel("Compare")
    tab.page.get_by_role("button", name="Pin as before").click()
    tab.until(lambda: tab.page.locator("[data-compared='mean B − A']").count() == 1)
    tab.send("EXX", "10")
    wanted = f"{LIVE.evaluate(START.with_amplitude('EXX', 10.0)).statistics.mean_um:.2f}"
    tab.until(lambda: tab.page.inner_text("[data-compared='mean B']") == wanted)
    mean = f"{LIVE.evaluate(START).statistics.mean_um:.2f}"
    assert tab.page.inner_text("[data-compared='mean A']") == mean


def test_a_convention_changes_the_map_and_says_by_how_much(tab: Tab) -> None:
    tab.panel("Conventions")
    effect = Effects().of(START)["component_errors=before_motion"]
    row = tab.page.locator("[data-choice='component_errors=before_motion']")
    tab.until(lambda: "…" not in row.inner_text())
    assert numbers(row.inner_text())[-2:] == pytest.approx(
        [effect.mean_um, effect.max_um], abs=0.006
    )
    row.click()
    state = with_choice(START, "component_errors=before_motion")
    tab.until_shown(state)
    tab.page.get_by_role("button", name="Conventions of the scene").click()
    tab.until_shown(START)


def test_the_reference_is_picked_on_the_box(tab: Tab) -> None:
    tab.panel("Conventions")
    tab.page.get_by_role("button", name="Pick the reference in 3-D").click()
    tab.page.wait_for_timeout(400)
    tab.page.mouse.click(760, 480)
    tab.until(lambda: tab.state().scene.reference is not None)
    state = tab.state()
    assert state.picked is None
    tab.until_shown(state)
    at = Picked(dict(state.scene.reference or {}))
    assert np.linalg.norm(answer(state, at, 1.0).explanation.error_um) < 1e-6


def test_a_saved_scene_opens_to_the_identical_state(
    tab: Tab, open_tab: Callable[[], Tab], tmp_path: Path
) -> None:
    tab.send("EXX", "7.5")
    tab.page.wait_for_timeout(100)
    tab.send("B [°]", "-20")
    tab.page.wait_for_timeout(100)
    tab.choose("Component", "E_y")
    state = tab.state()
    assert state.positions["B"] == -20.0
    tab.panel("Files")
    with tab.page.expect_download() as waiting:
        tab.page.get_by_role("button", name="Save scene", exact=True).click()
    assert waiting.value.suggested_filename == "dvf5000_first.toml"
    path = tmp_path / "dvf5000_first.toml"
    waiting.value.save_as(path)
    other = open_tab()
    other.panel("Files")
    other.upload("dvf5000_first.toml", path.read_bytes())
    other.until_shown(state)
    back = other.state()
    assert back.amplitudes == state.amplitudes
    assert back.component == "y"
    assert load_scene(path).errors.amplitude("EXX") == 7.5


def test_a_link_brings_camera_and_settings(tab: Tab, open_tab: Callable[..., Tab]) -> None:
    tab.send("EXX", "4")
    tab.page.wait_for_timeout(100)
    tab.page.get_by_role("button", name="True scale").click()
    tab.page.mouse.move(760, 480)
    tab.page.mouse.wheel(0, 400)
    tab.page.wait_for_timeout(600)
    tab.panel("Files")
    tab.page.get_by_role("button", name="Link", exact=True).click()
    tab.until(lambda: "view=" in tab.page.url)
    query = urlsplit(tab.page.url).query
    camera = tab.session.context.camera.remember()
    other = open_tab(query=f"&{query}")
    other.until(lambda: "true scale" in other.text("factor"))
    other.page.wait_for_timeout(800)
    assert other.session.state.amplitudes["EXX"] == 4.0
    assert other.session.state.exaggeration == 1.0
    np.testing.assert_allclose(
        other.session.context.camera.remember().position, camera.position, rtol=1e-3
    )


@pytest.mark.parametrize(("name", "ending"), [("View", "png"), ("HTML", "html"), ("GLB", "glb")])
def test_pictures_and_exports_are_downloaded(tab: Tab, name: str, ending: str) -> None:
    tab.panel("Files")
    with tab.page.expect_download(timeout=60_000) as waiting:
        tab.page.get_by_role("button", name=name, exact=True).click()
    content = Path(waiting.value.path()).read_bytes()
    begin = {"png": b"\x89PNG", "html": b"<!", "glb": b"glTF"}[ending]
    assert content.startswith(begin)
    stem = "dvf5000_first_view" if name == "View" else "dvf5000_first"
    assert waiting.value.suggested_filename == f"{stem}.{ending}"


@pytest.mark.render
def test_the_figure_is_drawn_and_can_be_cancelled(tab: Tab, renderer: str) -> None:
    tab.panel("Files")
    tab.page.get_by_role("button", name="Figure", exact=True).click()
    tab.page.get_by_role("button", name="Cancel", exact=True).click()
    tab.until(lambda: tab.page.get_by_text("Cancelled").count() > 0)
    tab.until(lambda: tab.page.get_by_role("button", name="Cancel", exact=True).count() == 0)
    with tab.page.expect_download(timeout=120_000) as waiting:
        tab.page.get_by_role("button", name="Figure", exact=True).click()
    assert Path(waiting.value.path()).read_bytes().startswith(b"\x89PNG")


def test_bad_uploads_are_refused_in_the_page_and_the_session_goes_on(tab: Tab) -> None:
    tab.panel("Files")
    problems = b'machine = "dvf5001"\nsurprise = 1\n[errors]\nEC0X = "a"\n'
    tab.upload("../../evil.toml", problems)
    tab.until(lambda: tab.page.get_by_text("4 problems").count() > 0)
    tab.upload("noise.toml", b"\xff\xfe\x00\x01")
    tab.until(lambda: tab.page.get_by_text("not UTF-8").count() > 0)
    tab.upload("big.toml", b"x" * (5 * 2**20))
    tab.until(lambda: tab.page.get_by_text("at most 4 MB").count() > 0)
    tab.send("EXX", "4")
    tab.until_shown(START.with_amplitude("EXX", 4.0))


def test_a_200_mb_upload_announced_by_a_hostile_page_is_not_kept(tab: Tab) -> None:
    tab.panel("Files")
    uuid = (
        tab.page.locator("input[type=file][accept^='.toml']")
        .get_attribute("id")
        .removeprefix("file_upload_")
    )
    script = """([uuid, transfer, size, parts]) => {
      const viewer = window.__viserMutable;
      viewer.sendMessage({type: 'FileTransferStartUpload', source_component_uuid: uuid,
        transfer_uuid: transfer, filename: '../../../big.toml', mime_type: 'text/plain',
        size_bytes: size, part_count: parts});
      for (let i = 0; i < 12; i++) viewer.sendMessage({type: 'FileTransferPart',
        source_component_uuid: uuid, transfer_uuid: transfer, part_index: i,
        content: new Uint8Array(524288)});
    }"""
    tab.page.evaluate(script, [uuid, "honest", 200 * 2**20, 400])
    tab.until(lambda: tab.page.get_by_text("200.0 MB large").count() > 0)
    tab.page.evaluate(script, [uuid, "liar", 100, 20])
    tab.until(lambda: tab.page.get_by_text("more has arrived").count() > 0)
    assert tab.session._client.gui._current_file_upload_states == {}
    tab.send("EXX", "4")
    tab.until_shown(START.with_amplitude("EXX", 4.0))


@pytest.mark.own_page
def test_ten_uploads_at_once_and_a_script_in_a_title(tab: Tab) -> None:
    tab.panel("Files")
    evil = "<img src=x onerror='window.hacked=1'><script>window.hacked=2</script>"
    scene = replace(SCENES[1], title=evil)
    text = state_to_toml(start_state(scene))
    for number in range(10):
        tab.upload(f"scene {number}.toml", text.encode())
    tab.until_shown(start_state(SCENES[1]), 30.0)
    tab.until(lambda: tab.state().scene.name == "scene 9", 30.0)
    tab.panel("Compare")
    tab.page.get_by_role("button", name="Pin as before").click()
    tab.page.wait_for_timeout(800)
    assert tab.page.evaluate("window.hacked") is None
    assert tab.page.get_by_text("<script>").first.is_visible()
    tab.page.get_by_role("button", name="Undo", exact=True).click()
