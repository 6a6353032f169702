"""A user computes a table in the tab Compensate, sees what it leaves, saves it, and goes back."""

import json
import zipfile
from pathlib import Path

import pytest
from click.testing import CliRunner

from app.conftest import Tab
from warpspace.cli.commands.compensate import compensate

pytestmark = pytest.mark.browser
TABLE = "HEIDENHAIN .COM and .CMA, nonlinear axis error compensation"


def compute(tab: Tab, points: str) -> None:
    """Choose a table, and have it computed."""
    tab.panel("Compensate")
    tab.choose("Table", TABLE)
    box = tab.page.get_by_label("Points per axis", exact=True).first
    box.fill(points)
    box.press("Enter")
    tab.page.wait_for_timeout(100)
    tab.page.get_by_role("button", name="Compute", exact=True).click()


@pytest.mark.own_page
def test_a_table_is_computed_drawn_saved_and_undone(tab: Tab, tmp_path: Path) -> None:
    target = tmp_path / "compensation.cma"
    asked = f"{tab.state().scene.name} --format heidenhain --grid 9 --json -o"
    command = CliRunner().invoke(compensate, [*asked.split(), str(target)])
    wanted = json.loads(command.stdout)
    tab.panel("Compensate")
    assert "press Compute" in tab.text("compensation note")
    compute(tab, "9")
    tab.until(lambda: tab.page.locator("[data-value='compensation']").count() == 1, seconds=60.0)
    for word, key in (("mean", "mean_um"), ("RMS", "rms_um"), ("P95", "p95_um"), ("max", "max_um")):
        for side in ("before", "after"):
            assert tab.text(f"compensation {word} {side}") == f"{wanted[side][key]:.3f}"
    assert tab.text("compensation size") == str(wanted["numbers"])

    start = tab.state()
    tab.choose("The box shows", "before and after")
    tab.until(lambda: tab.session.state.controller is not None)
    tab.until_shown(tab.session.state)
    tab.until(lambda: "with the table heidenhain" in tab.text("compared"))
    assert abs(float(tab.text("mean").split()[0]) - wanted["after"]["mean_um"]) < 0.02
    assert "this table" in tab.text("compensation box")
    tab.panel("Repair")
    tab.until(lambda: "without the table" in tab.page.inner_text("body"))

    tab.choose("The box shows", "what is left")
    tab.until(lambda: tab.session.state.comparison.b is None)
    tab.until_shown(tab.session.state)
    assert "with the table heidenhain" in tab.text("with the table")

    with tab.page.expect_download() as download:
        tab.page.get_by_role("button", name="Save table", exact=True).click()
    saved = tmp_path / "saved.zip"
    download.value.save_as(saved)
    with zipfile.ZipFile(saved) as bundle:
        for name in bundle.namelist():
            assert bundle.read(name) == (tmp_path / name).read_bytes()
        assert len(bundle.namelist()) == len(wanted["files"])

    tab.session.context.post(lambda state: state.with_amplitude("EXX", 5.0))
    tab.until(lambda: tab.page.locator("[data-value='compensation stale']").count() == 1)
    for _ in range(3):
        tab.page.keyboard.press("Control+z")
        tab.page.wait_for_timeout(100)
    tab.until(lambda: tab.session.state.controller is None)
    assert tab.session.state.amplitudes == start.amplitudes
    tab.until(lambda: tab.page.locator("[data-value='with the table']").count() == 0)


def test_nonsense_is_answered_in_one_line(tab: Tab) -> None:
    compute(tab, "9" * 5000)
    tab.until(lambda: "at most 100 characters" in tab.text("compensation trouble"))
    box = tab.page.get_by_label("Points per axis", exact=True).first
    box.fill("X=<b>")
    box.press("Enter")
    tab.page.wait_for_timeout(100)
    tab.page.get_by_role("button", name="Compute", exact=True).click()
    tab.until(lambda: "expected a number of points" in tab.text("compensation trouble"))
    assert "--grid" not in tab.text("compensation trouble")
    assert tab.session.state.controller is None
