"""The tab "Rotary axes" as a user works with it: one trace at a time, polar plots, play."""

import numpy as np
import pytest

from app.page_tab import Tab
from warpspace.app.state.app_state import start_state
from warpspace.field.evaluate import evaluate_exact
from warpspace.picture.axis_motion import evaluate_axis_motion, name_trace
from warpspace.picture.traces import evaluate_traces, trace_lines
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser

SECOND = "C at B −30°, point (0, 275, 450) mm"


@pytest.fixture
def wobbling(tab: Tab) -> Tab:
    """The tab with the wobbling table, the panel in front."""
    scene = load_scene("teach_wobbling_table")
    tab.session.context.post(lambda _: start_state(scene, nodes=5))
    tab.panel("Rotary axes")
    # a page that another test has left may have a plot already
    tab.until(lambda: "point (275, 0, 0) mm" in tab.text("polar name"))
    return tab


def test_no_trace_where_no_error_moves_one(tab: Tab) -> None:
    tab.panel("Rotary axes")
    tab.until(lambda: "No error moves" in tab.text("polar none"))
    for name in ("actual", "nominal", "others"):
        assert tab.drawn(f"/traces/{name}") is None
    tab.session.context.post(lambda state: state.with_amplitude("EXC", 3.0))
    tab.until(lambda: tab.page.locator("[data-value='polar name']").count() > 0)
    tab.until(lambda: tab.drawn("/traces/actual") is not None)
    assert tab.drawn("/traces/others") is not None


def test_chosen_trace_is_drawn_named_and_plotted_as_the_exact_model_has_it(
    wobbling: Tab,
) -> None:
    tab = wobbling
    scene = load_scene("teach_wobbling_table")
    lines = {name_trace(line.trace): line for line in trace_lines(evaluate_traces(scene, 1.0))}
    assert tab.text("polar name") == "C at B 0°, point (275, 0, 0) mm"
    tab.until(lambda: tab.text("polar radial turns") == "twice a turn")
    assert tab.text("polar tilt turns") == "once a turn"
    first = tab.drawn("/traces/actual")
    for name in (tab.text("polar name"), SECOND):
        if name != tab.text("polar name"):
            tab.choose("Trace", name)
            tab.until(lambda name=name: tab.text("polar name") == name)
        wanted = evaluate_axis_motion(scene, lines[name], evaluate_exact)
        assert wanted is not None
        for part in wanted.motions:
            assert tab.number(f"polar {part.name} pv") == pytest.approx(
                part.peak_to_valley, abs=0.0051
            )
            assert tab.number(f"polar {part.name} value") == pytest.approx(
                part.motion_value, abs=0.0051
            )
    assert tab.state().rotary.chosen == SECOND
    tab.until(lambda: not np.allclose(tab.drawn("/traces/actual"), first, atol=1.0))
    tab.page.evaluate("document.activeElement.blur()")
    tab.page.keyboard.press("Control+z")
    tab.until(lambda: tab.text("polar name") == "C at B 0°, point (275, 0, 0) mm")


def test_play_turns_the_table_of_a_machine_that_is_not_shown(wobbling: Tab) -> None:
    tab = wobbling
    assert tab.drawn("/machine/C_table") is None
    tab.page.get_by_role("button", name="Play rotation").click()
    tab.until(lambda: tab.drawn("/machine/C_table") is not None)
    still = tab.drawn("/machine/C_table")
    tab.until(lambda: not np.allclose(tab.drawn("/machine/C_table"), still, atol=1.0))
    assert tab.drawn("/machine/X_saddle") is None
    tab.page.get_by_role("button", name="Pause rotation").click()
    tab.page.get_by_role("button", name="Stand here").click()
    tab.until(lambda: tab.session.state.positions["C"] > 0.0)
    tab.until(lambda: tab.drawn("/machine/C_table") is None)
    tab.page.keyboard.press("Control+z")
    tab.until(lambda: tab.session.state.positions["C"] == 0.0)


def test_position_of_the_machine_follows_the_play(wobbling: Tab) -> None:
    tab = wobbling
    tab.page.get_by_role("button", name="Play rotation").click()
    tab.panel("Machine")
    tab.until(lambda: float(tab.box("Machine C").input_value()) > 5.0)
    tab.panel("Rotary axes")
    tab.page.get_by_role("button", name="Stop", exact=True).click()
    tab.panel("Machine")
    tab.until(lambda: float(tab.box("Machine C").input_value()) == 0.0)
