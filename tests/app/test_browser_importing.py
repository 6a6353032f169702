"""Measured data in the app: a preview of what a file would bring, applied or cancelled."""

import json

import pytest

from app.page_tab import Tab

pytestmark = pytest.mark.browser

RUNS = (
    b"X [mm],run,direction,EXX [um],u(EXX) [um]\n"
    b"-200,1,+,1.0,0.3\n0,1,+,2.0,0.3\n200,1,+,5.0,0.3\n"
    b"200,1,-,4.0,0.3\n0,1,-,1.0,0.3\n-200,1,-,0.5,0.3\n"
)
PREVIEW = "[data-value='import']"
DROP = """files => {
  const carried = new DataTransfer();
  for (const [name, text] of files) carried.items.add(new File([text], name));
  document.body.dispatchEvent(new DragEvent("drop",
    {bubbles: true, cancelable: true, dataTransfer: carried}));
}"""

TAKES = """() => {
  const carried = new DataTransfer();
  carried.items.add(new File(["0"], "a.csv"));
  return !document.body.dispatchEvent(new DragEvent("dragover",
    {bubbles: true, cancelable: true, dataTransfer: carried}));
}"""


COMP = b"-200 0.001 0.003\n0 0.002 0.004\n200 0.005 0.006\n"
PROBLEM = "[data-value='import-problem']"
FOLDER = "What the files do not say"


def preview(tab: Tab) -> str:
    """Text of the preview, once it is there."""
    tab.page.wait_for_selector(PREVIEW)
    return tab.page.inner_text(PREVIEW)


def test_a_measured_table_is_shown_and_only_applied_when_asked(tab: Tab) -> None:
    before = tab.state()
    tab.panel("Files")
    tab.upload("x.csv", RUNS)
    text = preview(tab)
    for fragment in ("EXX", "recognised", "x.csv", "by direction", "+ -", "mm, um", "reversal"):
        assert fragment in text
    assert tab.page.locator(f"{PREVIEW} svg polyline").count() == 2
    tab.page.get_by_role("button", name="Cancel", exact=True).last.click()
    tab.page.wait_for_selector(PREVIEW, state="detached")
    assert tab.state().scene == before.scene
    tab.upload("x.csv", RUNS)
    preview(tab)
    tab.page.get_by_role("button", name="Apply", exact=True).last.click()
    tab.until(lambda: "EXX" in tab.state().scene.errors)
    assert tab.state().amplitudes["EXX"] == pytest.approx(5.0)
    assert tab.state().scene.measured["EXX"].count == 6
    # the errors that the scene had are still there
    assert set(before.scene.errors) <= set(tab.state().scene.errors)


def test_dropped_files_that_belong_together_are_read_together(tab: Tab) -> None:
    com = "BEGIN T_Y.COM MM\nNR AXISPOS X\n0 -200 0.001\n1 0 0.002\n2 200 0.004\n[END]\n"
    cma = "BEGIN T.CMA MM\nNR ACTIVE Y\n0 * T_Y\n[END]\n"
    tab.until(lambda: tab.page.evaluate(TAKES))
    for files in ([["T_Y.COM", com], ["T.CMA", cma]], [["T.CMA", cma], ["T_Y.COM", com]]):
        tab.page.evaluate(DROP, files)
        tab.until(lambda: tab.page.locator(PREVIEW).count() == 1 and "T.CMA" in preview(tab))
        tab.until(lambda: "T_Y.COM" in preview(tab))
        assert "EXY" in preview(tab)
        tab.page.get_by_role("button", name="Cancel", exact=True).last.click()
        tab.page.wait_for_selector(PREVIEW, state="detached")


def test_a_bad_or_hostile_file_changes_nothing_and_is_named(tab: Tab) -> None:
    before = tab.state()
    tab.panel("Files")
    for name, content, fragment in (
        ("bad.csv", b"X [mm],EXX [um]\n0,1\n0,2\n", "line 3"),
        ("b.xlsx", b"PK\x03\x04", "spreadsheet"),
        ("../../<img src=x>.csv", b"X [mm],EXX\n0,1\n", "no unit"),
        ("far.csv", b"X [mm],EXX [um]\n0,1\n9000,2\n", "travel"),
    ):
        tab.upload(name, content)
        tab.page.get_by_text(fragment).first.wait_for()
    assert tab.page.locator(PREVIEW).count() == 0
    assert tab.state().scene == before.scene
    assert json.dumps("<img") not in tab.page.content()


def test_what_a_file_does_not_say_is_asked_for_in_the_window(tab: Tab) -> None:
    before = tab.state()
    tab.panel("Files")
    tab.upload("joint.comp", COMP)
    tab.page.wait_for_selector(PROBLEM)
    assert "which axis" in tab.text("import-problem")
    apply = tab.page.get_by_role("button", name="Apply", exact=True).last
    assert apply.is_disabled()
    assert tab.page.locator(PREVIEW).count() == 0
    tab.written("Axis").fill("<img src=x onerror=alert(1)>")
    tab.until(lambda: "<img" in tab.text("import-problem"))
    assert tab.page.locator(f"{PROBLEM} img").count() == 0
    tab.written("Axis").fill("Y")
    tab.until(lambda: tab.page.locator(PREVIEW).count() == 1 and "EYY" in preview(tab))
    tab.until(lambda: not tab.page.locator(PROBLEM).is_visible())
    assert not apply.is_disabled()
    tab.choose("Variant", "type-1")
    tab.until(lambda: "taken for offsets" not in preview(tab))
    apply.click()
    tab.until(lambda: "EYY" in tab.state().scene.errors)
    assert set(before.scene.errors) <= set(tab.state().scene.errors)


def test_a_choice_that_does_not_fit_keeps_the_preview_and_cannot_be_applied(tab: Tab) -> None:
    before = tab.state()
    tab.panel("Files")
    tab.upload("x.csv", RUNS)
    preview(tab)
    assert not tab.page.get_by_label("Format", exact=True).first.is_visible()
    tab.page.get_by_text(FOLDER).click()
    tab.choose("Format", "marlin: Marlin skew correction, M852 and Configuration.h")
    tab.page.wait_for_selector(PROBLEM)
    assert "x.csv: has no skew factors" in tab.text("import-problem")
    assert "EXX" in preview(tab)
    assert "As it was last read" in preview(tab)
    apply = tab.page.get_by_role("button", name="Apply", exact=True).last
    tab.until(apply.is_disabled)
    # neither sign nor variant is asked of a table of measured errors
    tab.choose("Format", "recognised: measurement table of warpspace")
    tab.until(lambda: not tab.page.locator(PROBLEM).is_visible())
    assert not tab.page.get_by_label("Sign", exact=True).first.is_visible()
    tab.until(lambda: not apply.is_disabled())
    tab.page.get_by_role("button", name="Cancel", exact=True).last.click()
    tab.page.wait_for_selector(PREVIEW, state="detached")
    assert tab.state().scene == before.scene
