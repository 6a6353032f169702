"""Work in a real Chromium: repair, tables, calibration, tolerances, imports, another machine."""

import json
import re
import zipfile
from dataclasses import replace

import pytest
from click.testing import CliRunner

import warpspace
from app.page_tab import SCENES
from warpspace.analysis.repair import Repair
from warpspace.app.evaluation.calibration import bundled
from warpspace.app.state.app_state import start_state
from warpspace.bodies.placed import load_bodies
from warpspace.cli.main import cli
from warpspace.scene.library import load_scene

TABLE = "HEIDENHAIN .COM and .CMA, nonlinear axis error compensation"


def test_the_best_repair_is_found_and_applied_with_two_actions_and_undone_with_one(tab):
    start, found = start_state(SCENES[0]), Repair().run(SCENES[0])
    tab.panel("Repair")  # action 1
    tab.until(lambda: tab.page.locator("[data-repair='2 mean']").count() == 1)
    for size, repair in ((1, found.repairs[0]), (2, found.repairs[1])):
        shown = float(tab.page.inner_text(f"[data-repair='{size} mean']"))
        assert shown == pytest.approx(repair.mean_um, abs=0.006)
    out = float(tab.page.inner_text("[data-repair='EA0Z out max']"))
    assert out == pytest.approx(63.59, abs=0.006)
    tab.page.locator("[data-set='2'] button", has_text="Apply").click()  # action 2
    wanted = pytest.approx(found.repairs[1].adjust["EA0Z"])
    tab.until(lambda: tab.session.state.amplitudes["EA0Z"] == wanted)
    tab.until_shown(tab.session.state)
    tab.panel("Compare")
    compared = tab.page.locator(".ws-comparison")
    for words in ("before repair", "30.89", f"{found.repairs[1].mean_um:.2f}"):
        tab.until(lambda words=words: words in compared.inner_text())
    tab.press("Control+z")  # one takes it back
    tab.until(lambda: tab.session.state == start)


def compute(tab, points):
    """Choose a table, and have it computed."""
    tab.panel("Compensate")
    tab.choose("Table", TABLE)
    box = tab.page.get_by_label("Points per axis", exact=True).first
    box.fill(points)
    box.press("Enter")
    tab.arrived("Points per axis", points)
    tab.button("Compute")


def test_a_table_is_computed_drawn_saved_and_undone(tab, tmp_path):
    target = tmp_path / "compensation.cma"
    asked = f"{SCENES[0].name} --format heidenhain --grid 9 --json -o"
    command = CliRunner().invoke(cli, ["compensate", *asked.split(), str(target)])
    wanted = json.loads(command.stdout)
    tab.panel("Compensate")
    tab.until(lambda: "press Compute" in tab.text("compensation note"))
    compute(tab, "X=<b>")
    tab.until(lambda: "expected a number of points" in tab.text("compensation trouble"))
    assert tab.session.state.controller is None
    compute(tab, "9")
    tab.until(lambda: tab.page.locator("[data-value='compensation']").count() == 1, seconds=60.0)
    for word, key in (("mean", "mean_um"), ("RMS", "rms_um"), ("P95", "p95_um"), ("max", "max_um")):
        for side in ("before", "after"):
            at, value = f"compensation {word} {side}", f"{wanted[side][key]:.3f}"
            tab.until(lambda at=at, value=value: tab.text(at) == value)
    tab.until(lambda: tab.text("compensation size") == str(wanted["numbers"]))

    tab.choose("The box shows", "before and after")
    tab.until(lambda: tab.session.state.controller is not None)
    tab.until_shown(tab.session.state)
    tab.until(lambda: "with the table heidenhain" in tab.text("compared"))
    tab.until(lambda: abs(float(tab.text("mean").split()[0]) - wanted["after"]["mean_um"]) < 0.02)
    tab.until(lambda: "this table" in tab.text("compensation box"))
    tab.choose("The box shows", "what is left")
    tab.until(lambda: tab.session.state.comparison.b is None)
    tab.until_shown(tab.session.state)
    tab.until(lambda: "with the table heidenhain" in tab.text("with the table"))

    with tab.page.expect_download() as download:
        tab.button("Save table")
    saved = tmp_path / "saved.zip"
    download.value.save_as(saved)
    with zipfile.ZipFile(saved) as bundle:
        for name in bundle.namelist():
            assert bundle.read(name) == (tmp_path / name).read_bytes()
        assert len(bundle.namelist()) == len(wanted["files"])

    tab.session.context.post(lambda state: state.with_amplitude("EXX", 5.0))
    tab.until(lambda: tab.page.locator("[data-value='compensation stale']").count() == 1)
    for _ in range(3):
        tab.press("Control+z")
    tab.until(lambda: tab.session.state.controller is None)
    tab.until(lambda: tab.session.state == start_state(SCENES[0]))
    tab.until(lambda: tab.page.locator("[data-value='with the table']").count() == 0)


def test_readings_are_uploaded_fitted_compared_and_applied(tab):
    scene = load_scene("fork_head_bc")  # the machine that the bundled readings are of
    tab.session.context.post(lambda state: state.with_scene(scene))
    tab.until(lambda: tab.session.state.scene is scene)
    tab.panel("Calibrate")
    tab.until(lambda: "Add a CSV file" in tab.text("calibration note"))
    start = tab.session.state
    tab.button("Fit")
    tab.until(lambda: "no readings yet" in tab.text("calibration trouble"))
    name, content = "<b onclick=x>probe.csv", bundled("tcp_on.csv").encode()
    for file, given in (("big.csv", b"1" * (2 * 2**20 + 1)), (name, content)):
        with tab.page.expect_file_chooser() as chooser:
            tab.button("Add readings …")
        chooser.value.set_files({"name": file, "mimeType": "text/csv", "buffer": given})
        if file == "big.csv":
            tab.until(lambda: "at most 2 MB" in tab.text("calibration trouble"))
    remove = tab.page.get_by_role("button", name="Remove b onclick_x_probe.csv")
    tab.until(lambda: remove.count() == 1)
    tab.until(lambda: "23" in tab.page.inner_text("[data-file='0']"))
    tab.button("Fit")
    tab.until(lambda: tab.page.locator("[data-value='calibration']").count() == 1, seconds=60.0)
    tab.until(lambda: tab.text("calibration rms before") == "278.3")
    tab.until(lambda: tab.text("calibration rms after") == "61.5")
    drawn = "() => !!window.__viserMutable.nodeRefFromName['/calibration/residuals']"
    tab.choose("Residual arrows in the box", "before")
    tab.until(lambda: tab.page.evaluate(drawn))
    tab.until(lambda: "× " in tab.text("calibration arrows"))
    tab.choose("Residual arrows in the box", "none")
    tab.until(lambda: not tab.page.evaluate(drawn))

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
    tab.press("Control+z")
    tab.until(lambda: "EB0B" not in tab.session.state.amplitudes)
    tab.until(lambda: tab.page.locator("[data-word='apply']").count() == 1)

    tab.session.context.post(lambda state: state.with_amplitude("EXX", 5.0))
    tab.until(lambda: tab.page.locator("[data-value='calibration stale']").count() == 1)
    remove.click()
    tab.until(lambda: tab.page.locator("[data-file='0']").count() == 0)


HISTOGRAM = """() => Object.values(window.__viserTestpoints.uplots)
  .map(plot => [...plot.chart.data].map(line => [...line])).filter(data => data.length === 4)
  .map(([at, within, beyond, limit]) => {
    let area = 0;
    for (let i = 1; i < at.length; ++i)
      area += (at[i] - at[i - 1]) * (within[i] + within[i - 1] + beyond[i] + beyond[i - 1]) / 2;
    return [Math.round(area / (at[1] - at[0])), at.filter((_, i) => !Number.isNaN(limit[i]))];
  })[0]"""
"""Machines in all bars, and where the line of the limit is drawn."""


def half_widths(state):
    return {key: state.tolerances.get(key).half_width for key in state.amplitudes}


def test_tolerances_are_traded_and_95_percent_at_40_um_takes_three_actions_and_one_to_undo(tab):
    def probability():
        """The number, and what it is of."""
        return tab.number("probability"), tab.page.inner_text(
            "[data-value='probability'] >> xpath=.."
        )

    before = half_widths(tab.session.state)
    squareness = "EA0Z · squareness of Z to Y ±"
    # 1
    tab.panel("Tolerances")
    tab.page.wait_for_selector("[data-word='fixed EA0Z']")
    opened = probability()[0]
    assert 50.0 < opened < 70.0  # everywhere in the volume
    tab.until(lambda: "limit 50 µm" in tab.text("histogram"))
    tab.until(lambda: tab.page.evaluate(HISTOGRAM) == [20_000, [50.0, 50.0]])
    tab.send(squareness, "2")
    tab.until(lambda: probability()[0] > opened + 3.0)
    tab.button("Tolerances of the scene")
    tab.until(lambda: half_widths(tab.session.state) == before)
    # 2
    tab.box("|E| allowed").fill("40")
    tab.box("|E| allowed").press("Enter")
    tab.until(lambda: tab.session.state.specification.limit_um == 40.0)
    tab.until(lambda: "40 µm" in probability()[1])
    tab.send("|E| allowed", "NaN")  # changes nothing
    # 3
    tab.button("Allocate")
    # meanwhile the rest of the page answers
    tab.send("EXX · ", "3")
    tab.until(lambda: tab.session.state.amplitudes["EXX"] == 3.0)
    tab.until(tab.page.locator("[data-value='allocated']").is_visible, 60.0)
    state = tab.session.state
    tab.until(lambda: 95.0 <= tab.number("probability") < 96.0)
    # of the command's Monte Carlo, on machines of its own
    scene = replace(state.scene, tolerances=state.tolerances)
    run = warpspace.montecarlo(scene, samples=50_000, seed=123, spec_um=40.0, over="max", grid=11)
    assert run.probability.probability == pytest.approx(0.95, abs=0.005)
    after = half_widths(state)
    assert after != before
    assert after["EX0B"] == 0.0
    tab.until(lambda: float(tab.box(squareness).input_value()) == after["EA0Z"])
    tab.button("Undo")
    tab.until(lambda: half_widths(tab.session.state) == before)
    assert tab.session.state.specification.limit_um == 40.0
    tab.until(lambda: not tab.page.locator("[data-value='allocated']").is_visible())


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

COMP = b"-200 0.001 0.003\n0 0.002 0.004\n200 0.005 0.006\n"
PROBLEM = "[data-value='import-problem']"


def preview(tab):
    """Text of the preview, once it is there."""
    tab.page.wait_for_selector(PREVIEW)
    return tab.page.inner_text(PREVIEW)


def test_measured_data_are_shown_and_applied_when_asked_and_asked_for_what_they_do_not_say(tab):
    before = tab.session.state
    tab.panel("Files")
    tab.upload("x.csv", RUNS)
    text = preview(tab)
    for fragment in ("EXX", "recognised", "x.csv", "by direction", "+ -", "mm, um", "reversal"):
        assert fragment in text
    tab.until(lambda: tab.page.locator(f"{PREVIEW} svg polyline").count() == 2)
    tab.button("Cancel")
    tab.page.wait_for_selector(PREVIEW, state="detached")
    assert tab.session.state.scene == before.scene
    tab.upload("x.csv", RUNS)
    preview(tab)
    tab.button("Apply")
    tab.until(lambda: "EXX" in tab.session.state.scene.errors)
    tab.until(lambda: tab.session.state.amplitudes["EXX"] == pytest.approx(5.0))
    assert tab.session.state.scene.measured["EXX"].count == 6
    # the errors that the scene had are still there
    assert set(before.scene.errors) <= set(tab.session.state.scene.errors)

    # files that belong together are dropped together
    com = "BEGIN T_Y.COM MM\nNR AXISPOS X\n0 -200 0.001\n1 0 0.002\n2 200 0.004\n[END]\n"
    cma = "BEGIN T.CMA MM\nNR ACTIVE Y\n0 * T_Y\n[END]\n"
    tab.page.evaluate(DROP, [["T_Y.COM", com], ["T.CMA", cma]])
    tab.until(lambda: "T.CMA" in preview(tab) and "T_Y.COM" in preview(tab))
    assert "EXY" in preview(tab)
    tab.button("Cancel")
    tab.page.wait_for_selector(PREVIEW, state="detached")

    tab.upload("joint.comp", COMP)
    tab.page.wait_for_selector(PROBLEM)
    tab.until(lambda: "which axis" in tab.text("import-problem"))
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
    tab.until(lambda: {*before.scene.errors, "EXX", "EYY"} <= set(tab.session.state.scene.errors))


def test_another_chain_is_typed_a_machine_chosen_and_undo_goes_back(tab):
    def chain_of():
        return str(tab.session.state.scene.machine.chain)

    def sliders():
        texts = tab.page.locator("label").all_text_contents()
        return [text[8] for text in texts if re.fullmatch(r"Machine \w+ \[.*\]", text)]

    start = chain_of()
    tab.panel("Machine editor")
    chain = tab.page.locator("input[name=chain]")
    tab.until(lambda: chain.input_value() == start)
    chain.fill("wBFXYZt")
    chain.press("Enter")
    tab.until(lambda: chain_of() == "wBFXYZt")
    tab.until(lambda: tab.page.locator("section[data-frame=C]").count() == 0)
    tab.until(lambda: tab.shows_state(tab.session.state))
    said = tab.page.locator(".mantine-Notification-root", has_text="axis C left out")
    said.first.wait_for()
    assert load_bodies(tab.session.state.scene.machine)
    tab.panel("Machine")
    tab.until(lambda: {*sliders()} == {*"XYZB"})
    tab.panel("View")
    tab.until(lambda: tab.page.locator("label", has_text=re.compile(r"^C \[°\]")).count() == 0)
    tab.press("Control+z")
    tab.until(lambda: tab.session.state.scene == SCENES[0])
    tab.until(lambda: tab.shows_state(tab.session.state))
    tab.panel("Machine editor")
    tab.until(lambda: chain.input_value() == start)

    tab.button("Choose a machine …")
    tab.page.locator("[data-machine=gantry_mill]").click()
    tab.until(lambda: tab.session.state.scene.machine.name == "gantry_mill")
    tab.page.locator("[data-machine]").first.wait_for(state="detached")
    tab.until(lambda: tab.shows_state(tab.session.state))
    own = tab.session.state.scene
    assert tab.session.state.amplitudes == start_state(own).amplitudes
    tab.until(lambda: own.title in tab.page.title())
    left = tab.page.locator("[data-value='left behind']")
    assert f"those of “{SCENES[0].title}” are left behind" in left.inner_text()
    tab.press("Control+z")
    left.wait_for(state="detached")
    tab.until_shown(start_state(SCENES[0]))
