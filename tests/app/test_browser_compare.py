"""A comparison in a real Chromium: stored in links and files, exported, sliced; and its limits."""

import csv
import io
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlencode

import numpy as np
import pytest

from app.frames import new_visitor
from app.page_tab import SCENES, Tab, drawn_nodes
from warpspace.app.browser.address import PARAMETER
from warpspace.app.documents import links
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.conventions import Effects, with_choice
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.server.viewer import Viewer
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Side
from warpspace.app.state.picked import Picked
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Table
from warpspace.picture.mesh import map_mesh

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext

pytestmark = pytest.mark.browser
LIVE = LiveModel()
START = start_state(SCENES[0])
LISTEN = """window.said = new Set();
new MutationObserver(() => document.querySelectorAll('.mantine-Notification-root').forEach(
  note => window.said.add(note.textContent))).observe(document, {childList: true, subtree: true});
"""
"""Keeps what the page says: on a busy machine a message may be gone before it is looked for."""
WORKSPACE = b"[workspace]\nX = [-275, 275]\nY = [-225, 225]\nZ = [-480, -80]\nB = 0\nC = 0\n"


@pytest.fixture
def follow(viewer: Viewer, browser: "Browser") -> Iterator[Callable[[str], Tab]]:
    """Open links, each as a visitor of its own; no page may report an error."""
    opened: list[tuple[BrowserContext, Tab]] = []

    def open_link(link: str) -> Tab:
        context = new_visitor(browser)
        context.add_init_script(LISTEN)
        query = f"&{PARAMETER}={links.pack(link)}#"
        opened.append((context, Tab(context.new_page(), viewer, query)))
        return opened[-1][1]

    yield open_link
    for context, tab in opened:
        context.close()
        assert tab.errors == []


def test_a_link_to_another_scene_with_changed_errors_leaves_no_message(
    follow: Callable[[str], Tab],
) -> None:
    """Sliders of the former scene must not be told anything once they are to be replaced."""
    tab = follow("scene=dvf5000_second&EXX=4&EC0Y=1")
    tab.until(lambda: tab.state().scene.name == SCENES[1].name)
    tab.page.wait_for_timeout(1500)


def compare_with_pin(tab: Tab) -> AppState:
    """Pin, change an error, and draw the difference; give the state it amounts to."""
    tab.panel("Compare")
    tab.page.get_by_role("button", name="Pin as before").click()
    tab.until(lambda: tab.page.locator("[data-compared='mean B − A']").count() == 1)
    tab.send("EXX", "10")
    state = with_pin(START).with_amplitude("EXX", 10.0)
    state = replace(state, comparison=state.comparison.with_shown("difference"))
    tab.page.wait_for_timeout(100)
    tab.page.get_by_role("button", name="B − A", exact=True).click()
    tab.until_shown(state)
    assert tab.state() == state
    return state


def said(tab: Tab) -> list[str]:
    """All messages the page has shown."""
    return tab.page.evaluate("[...window.said]")


def press_link(tab: Tab) -> str:
    """Press Link; give what stands in the address bar."""
    tab.panel("Files")
    tab.page.get_by_role("button", name="Link", exact=True).click()
    tab.until(lambda: f"{PARAMETER}=" in tab.page.url)
    return links.unpack(tab.page.url.partition(f"{PARAMETER}=")[2].split("&")[0])


def test_a_link_brings_the_comparison_with_the_state_before(
    tab: Tab, follow: Callable[[str], Tab]
) -> None:
    state = compare_with_pin(tab)
    other = follow(press_link(tab))
    other.until_shown(state)
    assert other.state() == state
    other.panel("Compare")
    other.until(lambda: other.page.locator("[data-compared='mean B − A']").count() == 1)
    before = state.comparison.pinned.title
    assert other.page.get_by_label("A", exact=True).input_value() == before
    assert other.page.get_by_label("B", exact=True).input_value() == "present errors"
    # and it goes on from there
    other.page.get_by_role("button", name="A", exact=True).click()
    other.until_shown(START)


def test_a_saved_scene_brings_the_comparison_of_two_scenes(
    tab: Tab, open_tab: Callable[[], Tab]
) -> None:
    tab.panel("Compare")
    tab.choose("B", SCENES[1].title)
    tab.until(lambda: tab.page.locator("[data-compared='mean B − A']").count() == 1)
    state = with_sides(START, Side(), scene_side(SCENES[1]))
    tab.panel("Files")
    with tab.page.expect_download() as waiting:
        tab.page.get_by_role("button", name="Save scene", exact=True).click()
    content = Path(waiting.value.path()).read_bytes()
    other = open_tab()
    other.panel("Files")
    other.upload("dvf5000_first.toml", content)
    other.until(lambda: other.state().comparison == state.comparison)
    other.panel("Compare")
    other.until(lambda: other.page.get_by_label("B", exact=True).input_value() == SCENES[1].title)
    other.page.get_by_role("button", name="B − A", exact=True).click()
    picture = LIVE.evaluate(replace(state, comparison=state.comparison.with_shown("difference")))
    other.until(lambda: other.shows(drawn_nodes(picture)))
    # a scene that says nothing of how it is looked at leaves the comparison alone
    other.upload("plain.toml", b'title = "Plain"\nmachine = "dvf5000"\n' + WORKSPACE)
    other.until(lambda: other.state().scene.title == "Plain")
    assert other.session.state.comparison.b == state.comparison.b
    assert other.errors == []


def test_a_point_of_a_trace_and_its_lever_come_with_a_link(
    tab: Tab, follow: Callable[[str], Tab]
) -> None:
    at = {"X": 0.0, "Y": 0.0, "Z": -280.0, "B": 0.0, "C": 45.0}
    asked = replace(
        START.with_amplitude("EC0B", 9.0),
        picked=Picked(at, Loop.WORKPIECE, (275.0, 0.0, 0.0)),
        lever="EC0B",
    )
    tab.session.context.post(lambda _: asked)
    tab.panel("Error budget")
    tab.until(lambda: tab.page.locator("[data-value='why norm']").count() == 1)
    norm = tab.text("why norm")
    other = follow(press_link(tab))
    other.panel("Error budget")
    other.until(lambda: other.page.locator("[data-value='why norm']").count() == 1)
    assert other.text("why norm") == norm
    assert "mm" in other.text("lever")
    assert other.state() == asked


def test_a_link_with_a_broken_comparison_says_so_and_changes_nothing(
    follow: Callable[[str], Tab],
) -> None:
    tab = follow(f"scene=dvf5000_second&EXX=7&{urlencode({'compare.b': 'file=!!!'})}")
    tab.until(lambda: any("is cut off" in text for text in said(tab)))
    assert len([text for text in said(tab) if "Link: failed" in text]) == 1
    assert tab.state() == START


def test_what_is_too_large_for_a_link_is_left_out_and_named(tab: Tab) -> None:
    rows = np.linspace(-275.0, 275.0, 200)
    noise = np.random.default_rng(1).normal(size=(3, 200))
    big = START
    for key, values in zip(("EXX", "EYX", "EZX"), noise, strict=True):
        curve = Table((-275.0, 275.0), tuple(zip(rows.tolist(), values.tolist(), strict=True)))
        big = edits.with_curve(big, key, curve)
    state = replace(START, comparison=with_pin(big).comparison)
    tab.session.context.post(lambda _: state)
    tab.until(lambda: tab.page.locator("[data-value='compared']").count() == 1)
    link = press_link(tab)
    tab.until(lambda: tab.page.get_by_text("Without the comparison").count() == 1)
    assert tab.page.get_by_text("too large for a link").count() == 1
    assert "compare" not in link
    with tab.page.expect_download() as waiting:
        tab.page.get_by_role("button", name="Save scene", exact=True).click()
    text = Path(waiting.value.path()).read_text(encoding="utf-8")
    back = open_text(text, "dvf5000_first", "x")[0].comparison
    assert back.pinned.title == state.comparison.pinned.title
    assert back.pinned.state.scene.errors == scene_of(big).errors


def test_exports_show_the_difference_that_is_drawn(tab: Tab) -> None:
    state = compare_with_pin(tab)
    picture = LIVE.evaluate(state)
    tab.panel("Files")
    tab.until(lambda: tab.page.locator("[data-value='exported']").count() == 1)
    assert tab.text("exported").startswith(f"Pictures and exports show {picture.compared.title}")
    contents: dict[str, bytes] = {}
    for name, ending in (("CSV", "csv"), ("HTML", "html"), ("GLB", "glb")):
        with tab.page.expect_download(timeout=60_000) as waiting:
            tab.page.get_by_role("button", name=name, exact=True).click()
        assert waiting.value.suggested_filename == f"after_minus_before.{ending}"
        contents[ending] = Path(waiting.value.path()).read_bytes()
        tab.until(lambda: tab.page.get_by_role("button", name="Cancel", exact=True).count() == 0)
    rows = list(csv.DictReader(io.StringIO(contents["csv"].decode())))
    largest = max(float(row["norm_um"]) for row in rows)
    assert largest == pytest.approx(picture.statistics.max_um, abs=1e-6)
    assert picture.compared.title in contents["html"].decode()
    length = int.from_bytes(contents["glb"][12:16], "little")
    assert "B − A" in str(json.loads(contents["glb"][20 : 20 + length]))
    tab.panel("Compare")
    tab.choose("B", "nothing")
    tab.panel("Files")
    tab.until(lambda: tab.page.locator("[data-value='exported']").count() == 0)


def test_the_difference_is_drawn_in_slices_and_cut_open(tab: Tab) -> None:
    tab.panel("Compare")
    tab.choose("B", SCENES[1].title)
    tab.page.wait_for_timeout(100)
    tab.page.get_by_role("button", name="B − A", exact=True).click()
    state = with_sides(START, Side(), scene_side(SCENES[1]))
    state = replace(state, comparison=state.comparison.with_shown("difference"))
    for shown, word in (("slices", "slices"), ("cut octant", "cut")):
        tab.choose("Show as", shown)
        look = state.look.with_choice(surface=word)
        mesh = map_mesh(LIVE.evaluate(replace(state, look=look)))
        tab.until(lambda mesh=mesh: tab.shows(mesh.vertices_mm))


def test_a_linear_axis_is_turned_round_in_the_conventions(tab: Tab) -> None:
    tab.panel("Conventions")
    effect = Effects().of(START)["direction X=-1"]
    row = tab.page.locator("[data-choice='direction X=-1']")
    tab.until(lambda: "…" not in row.inner_text())
    assert row.inner_text().split()[-2:] == [f"{effect.mean_um:.2f}", f"{effect.max_um:.2f}"]
    row.click()
    tab.until_shown(with_choice(START, "direction X=-1"))
    tab.until(lambda: row.get_attribute("aria-checked") == "true")
    tab.page.get_by_role("button", name="Conventions of the scene").click()
    tab.until_shown(START)


@pytest.mark.slow
@pytest.mark.own_page
@pytest.mark.proof
def test_opened_scenes_do_not_pile_up(tab: Tab, monkeypatch: pytest.MonkeyPatch) -> None:
    notes: list[str] = []
    # the page shows a few messages at a time, which would take minutes
    session = tab.session
    monkeypatch.setattr(
        session._client, "add_notification", lambda _, text, **__: notes.append(text)
    )
    tab.panel("Files")
    for number in range(22):
        scene = replace(SCENES[1], title=f"Machine {number}", name=f"machine {number}")
        tab.upload(f"machine {number}.toml", state_to_toml(start_state(scene)).encode())
        tab.until(lambda n=number: session.state.scene.title == f"Machine {n}")
    tab.until(lambda: any("Machine 1 left the list" in text for text in notes))
    tab.panel("View")
    tab.page.get_by_label("Scene", exact=True).first.click()
    tab.page.wait_for_timeout(300)
    options = tab.page.get_by_role("option").all_inner_texts()
    named = [text for text in options if text.startswith("Machine ")]
    assert named == [f"Machine {number}" for number in range(2, 22)]
    assert SCENES[0].title in options
