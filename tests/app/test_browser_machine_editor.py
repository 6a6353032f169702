"""Somebody makes the machine their own: another chain, other sizes, saved and opened again."""

import re
from pathlib import Path

import numpy as np
import pytest

from app.page_tab import SCENES, Tab
from warpspace.bodies.placed import load_bodies

pytestmark = pytest.mark.browser
START = str(SCENES[0].machine.chain)


def chain_of(tab: Tab) -> str:
    """The chain of the machine that the session shows."""
    return str(tab.session.state.scene.machine.chain)


def box(tab: Tab, label: str):
    """A number box of the editor by its spoken name."""
    return tab.page.get_by_label(label, exact=True)


def type_into(field, text: str) -> None:
    """Type into a box and take it over."""
    field.fill(text)
    field.press("Enter")


def slider_names(tab: Tab) -> list[str]:
    """Labels of the sliders of the tab Machine."""
    texts = tab.page.locator("label").all_text_contents()
    return [text for text in texts if re.fullmatch(r"Machine \w+ \[.*\]", text)]


def test_another_chain_is_typed_and_box_sliders_and_bodies_follow_and_undo_goes_back(tab: Tab):
    tab.panel("Machine editor")
    chain = tab.page.locator("input[name=chain]")
    assert chain.input_value() == START
    type_into(chain, "wBFXYZt")
    tab.until(lambda: chain_of(tab) == "wBFXYZt")
    tab.until(lambda: tab.page.locator("section[data-frame=C]").count() == 0)
    tab.until(lambda: tab.shows_state(tab.session.state))
    said = tab.page.locator(".mantine-Notification-root", has_text="axis C left out")
    said.first.wait_for()
    assert load_bodies(tab.session.state.scene.machine)
    tab.panel("Machine")
    tab.until(lambda: len(slider_names(tab)) == 4)
    assert not any("Machine C" in name for name in slider_names(tab))
    tab.panel("View")
    assert tab.page.locator("label", has_text=re.compile(r"^C \[°\]")).count() == 0
    tab.page.keyboard.press("Control+z")
    tab.until(lambda: chain_of(tab) == START)
    tab.until(lambda: tab.shows_state(tab.session.state))
    assert tab.session.state.scene == SCENES[0]
    tab.panel("Machine editor")
    tab.until(lambda: chain.input_value() == START)


def test_a_chain_that_cannot_be_read_stays_in_its_box_with_the_reason(tab: Tab):
    tab.panel("Machine editor")
    chain = tab.page.locator("input[name=chain]")
    type_into(chain, "wBBFXYZt <b>")
    problem = tab.page.locator("[data-value=chain-problem]")
    problem.wait_for()
    assert "cannot be read" in problem.inner_text() or "twice" in problem.inner_text()
    assert chain.input_value() == "wBBFXYZt <b>"
    assert tab.session.state.scene == SCENES[0]
    type_into(chain, START)
    tab.until(lambda: problem.count() == 0)
    assert tab.session.state.scene == SCENES[0]


def test_order_side_direction_and_numbers_are_changed_by_hand(tab: Tab):
    tab.panel("Machine editor")
    tab.page.get_by_role("button", name="Move X towards the tool").click()
    tab.until(lambda: chain_of(tab) == START.replace("XY", "YX"))
    tab.page.get_by_role("button", name="Let Y carry the workpiece").click()
    tab.until(lambda: "Y" in tab.session.state.scene.machine.chain.workpiece)
    tab.page.get_by_role("button", name="Direction of Y: with its name").click()
    tab.until(lambda: tab.session.state.scene.machine.axes["Y"].direction == -1)
    type_into(box(tab, "z of the offset of Z, in mm"), "12,5")
    tab.until(lambda: tab.session.state.scene.machine.axes["Z"].offset_mm[2] == 12.5)
    type_into(box(tab, "Rotation of B about x, in °"), "45")
    tab.until(lambda: tab.session.state.scene.machine.axes["B"].rotation_deg[0] == 45.0)
    type_into(box(tab, "Upper end of X in the working volume, in mm"), "100")
    tab.until(lambda: tab.session.state.scene.workspace.ranges["X"][1] == 100.0)
    tab.until(lambda: tab.shows_state(tab.session.state))
    type_into(box(tab, "Upper end of X in the working volume, in mm"), "lots")
    tab.page.locator(".mantine-Notification-root", has_text="expected a number").first.wait_for()
    assert tab.session.state.scene.workspace.ranges["X"][1] == 100.0
    assert box(tab, "Upper end of X in the working volume, in mm").input_value() == "100"


def test_a_changed_machine_is_saved_and_opened_again(tab: Tab, tmp_path: Path):
    tab.panel("Machine editor")
    z = SCENES[0].machine.axes["Z"].offset_mm[2]
    type_into(box(tab, "z of the offset of Z, in mm"), f"{z + 30:g}")
    tab.until(lambda: tab.session.state.scene.machine.axes["Z"].offset_mm[2] == z + 30.0)
    tab.until(lambda: tab.shows_state(tab.session.state))
    before, drawn = tab.session.state, tab.vertices()
    tab.panel("Files")
    with tab.page.expect_download() as download:
        tab.page.get_by_role("button", name="Save scene").click()
    text = Path(download.value.path()).read_bytes()
    assert b"[machine.offset_mm]" in text
    tab.page.keyboard.press("Control+z")
    tab.until(lambda: tab.session.state.scene == SCENES[0])
    tab.upload("mine.toml", text)
    tab.until(lambda: tab.session.state.scene.machine.axes == before.scene.machine.axes)
    tab.until(lambda: tab.shows(drawn))
    assert tab.session.state.scene.workspace == before.scene.workspace
    assert tab.session.state.amplitudes == before.amplitudes
    tab.panel("Machine editor")
    assert box(tab, "z of the offset of Z, in mm").input_value() == f"{z + 30:g}"


def test_a_machine_is_chosen_from_its_picture(tab: Tab):
    tab.panel("Machine editor")
    tab.page.get_by_role("button", name="Choose a machine …").click()
    tab.page.locator("[data-machine=gantry_mill]").click()
    tab.until(lambda: tab.session.state.scene.machine.name == "gantry_mill")
    tab.page.locator("[data-machine]").first.wait_for(state="detached")
    tab.until(lambda: tab.shows_state(tab.session.state))
    tab.page.get_by_role("button", name="Machine of the scene").click()
    tab.until(lambda: tab.session.state.scene == SCENES[0])
    assert np.isfinite(tab.vertices()).all()
