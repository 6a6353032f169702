"""A user adds readings, fits, compares and applies in the tab Calibrate; undo takes it back."""

import pytest

from app.page_tab import Tab
from warpspace.app.evaluation.calibration import bundled
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser


def opened(tab: Tab) -> None:
    """Show the machine that the bundled readings are of."""
    scene = load_scene("fork_head_bc")
    tab.session.context.post(lambda state: state.with_scene(scene))
    tab.until(lambda: tab.session.state.scene is scene)
    tab.panel("Calibrate")


def test_readings_are_uploaded_fitted_compared_and_applied(tab: Tab) -> None:
    opened(tab)
    assert "Add a CSV file" in tab.text("calibration note")
    start = tab.state()
    tab.page.get_by_role("button", name="Fit", exact=True).click()
    tab.until(lambda: "no readings yet" in tab.text("calibration trouble"))
    with tab.page.expect_file_chooser() as chooser:
        tab.page.get_by_role("button", name="Add readings …").click()
    content = bundled("tcp_on.csv").encode()
    name = "<b onclick=x>probe.csv"
    chooser.value.set_files({"name": name, "mimeType": "text/csv", "buffer": content})
    tab.until(lambda: tab.page.locator("[data-file='0']").count() == 1)
    assert "23" in tab.page.inner_text("[data-file='0']")
    assert tab.page.get_by_role("button", name="Remove b onclick_x_probe.csv").count() == 1
    tab.page.get_by_role("button", name="Fit", exact=True).click()
    tab.until(lambda: tab.page.locator("[data-value='calibration']").count() == 1, seconds=60.0)
    assert tab.text("calibration rms before") == "278.3"
    assert tab.text("calibration rms after") == "61.5"

    compare = tab.page.locator("[data-value='calibration'] [data-word='compare']")
    compare.focus()
    tab.page.keyboard.press("Enter")  # reached by key alone
    tab.until(lambda: tab.session.state.comparison.b is not None)
    assert tab.session.state.amplitudes == start.amplitudes
    tab.until_shown(tab.session.state)

    tab.page.locator("[data-value='calibration'] [data-word='apply']").click()
    tab.until(lambda: "EB0B" in tab.session.state.amplitudes)
    tab.until(lambda: tab.page.locator("[data-value='calibration applied']").count() == 1)
    tab.until_shown(tab.session.state)
    tab.page.keyboard.press("Control+z")
    tab.until(lambda: "EB0B" not in tab.session.state.amplitudes)
    tab.until(lambda: tab.page.locator("[data-word='apply']").count() == 1)

    tab.session.context.post(lambda state: state.with_amplitude("EXX", 5.0))
    tab.until(lambda: tab.page.locator("[data-value='calibration stale']").count() == 1)
    tab.page.get_by_role("button", name="Remove b onclick_x_probe.csv").click()
    tab.until(lambda: tab.page.locator("[data-file='0']").count() == 0)


def test_arrows_stand_in_the_box_and_bad_files_are_refused(tab: Tab) -> None:
    opened(tab)
    tab.choose("Bundled readings", "tcp_on.csv")
    tab.until(lambda: tab.page.locator("[data-file='0']").count() == 1)
    with tab.page.expect_file_chooser() as chooser:
        tab.page.get_by_role("button", name="Add readings …").click()
    large = {"name": "big.csv", "mimeType": "text/csv", "buffer": b"1" * (2 * 2**20 + 1)}
    chooser.value.set_files(large)
    tab.until(lambda: "at most 2 MB" in tab.text("calibration trouble"))
    tab.page.get_by_role("button", name="Fit", exact=True).click()
    tab.until(lambda: tab.page.locator("[data-value='calibration']").count() == 1, seconds=60.0)
    tab.choose("Residual arrows in the box", "before")
    drawn = "() => !!window.__viserMutable.nodeRefFromName['/calibration/residuals']"
    tab.until(lambda: tab.page.evaluate(drawn))
    assert "× " in tab.text("calibration arrows")
    tab.choose("Residual arrows in the box", "none")
    tab.until(lambda: not tab.page.evaluate(drawn))
