"""What is drawn in a real Chromium: surfaces, lines, marks, machine, rotary axes."""

from dataclasses import replace

import numpy as np
import pytest

from app.page_tab import SCENES, wait_until_open
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine import drawn_bodies, tool_point
from warpspace.app.state.app_state import start_state
from warpspace.app.state.look import linear_spans, slice_spans
from warpspace.app.viewport.marks import corner_arrows
from warpspace.field.evaluate import evaluate_exact
from warpspace.picture.mesh import isoline_pieces, map_mesh
from warpspace.picture.traces import evaluate_axis_motion, evaluate_traces, name_trace, trace_lines
from warpspace.scene.library import load_scene

LIVE = LiveModel()
START = start_state(SCENES[0])


def looking(**changes):
    return replace(START, look=replace(START.look, **changes))


def test_surfaces_slices_isolines_and_marks(tab):
    def draws(state):
        wanted = map_mesh(LIVE.evaluate(state)).vertices_mm
        tab.until(lambda: tab.shows(wanted))

    tab.choose("Show as", "cut octant")
    draws(looking(surface="cut"))
    tab.choose("Show as", "slices")
    draws(looking(surface="slices"))
    tab.send("Slice YZ", "4")
    look = looking(surface="slices").look.with_slice("X", 4.0, slice_spans(START.scene)["X"])
    draws(replace(START, look=look))
    tab.until(lambda: tab.drawn("/box/grid") is not None)
    tab.choose("Show as", "grid lines only")
    tab.until(lambda: tab.drawn("/box/grid") is None)
    tab.choose("Show as", "surface")
    draws(START)
    tab.until(lambda: tab.drawn("/box/grid") is not None)

    picture = LIVE.evaluate(looking(isolines=True))
    worst = picture.drawn_mm[np.unravel_index(np.argmax(picture.values), picture.values.shape)]
    tab.until(lambda: np.allclose(tab.place("/marks/ball"), worst, atol=0.01))
    assert tab.drawn("/box/isolines") is None
    tab.tick("Isolines")
    pieces = isoline_pieces(picture).reshape(-1, 3)
    tab.until(lambda: (found := tab.drawn("/box/isolines")) is not None and len(found) > 0)
    tab.until(lambda: np.allclose(tab.drawn("/box/isolines"), pieces, atol=2e-3))
    tab.tick("Corner arrows")
    tab.until(lambda: tab.drawn("/marks/arrows") is not None)
    found = tab.drawn("/marks/arrows")
    grid = picture.grid
    arrows = corner_arrows(
        grid.shape, grid.nominal_mm, picture.field.error_um, picture.exaggeration
    )
    for at in (*arrows.start_mm, *arrows.end_mm):
        assert np.linalg.norm(found - at, axis=-1).min() < 0.01


def test_the_machine_moves_bends_carries_the_tool_point_and_stays_hidden(tab):
    def stands(state):
        wanted = {p.body.name: p.vertices_mm for p in drawn_bodies(LIVE.evaluate(state))}
        found = {name: tab.drawn(f"/machine/{name}") for name in wanted}
        return all(
            at is not None
            and at.shape == wanted[name].shape
            and np.allclose(at, wanted[name], atol=2e-3)
            for name, at in found.items()
        )

    tab.panel("Machine")
    assert tab.drawn("/machine/R_bed") is None
    tab.tick("Machine bodies")
    state = replace(START, machine=START.machine.switched(shown=True))
    tab.until(lambda: stands(state))
    spans, machine = linear_spans(START.scene), state.machine
    for axis, value in (("X", 200.0), ("Y", -150.0), ("Z", -400.0)):
        tab.send(f"Machine {axis}", str(value))
        machine = machine.with_linear(axis, value, spans[axis])
        tab.until(lambda machine=machine: tab.session.state.machine.linear_mm == machine.linear_mm)
    tab.send("Machine B", "-30")
    state = replace(state, machine=machine).with_position("B", -30.0)
    tab.until(lambda: stands(state))
    point = tool_point(LIVE.evaluate(state)).drawn_mm
    tab.until(lambda: np.allclose(tab.place("/machine/tool_point"), point, atol=0.01))
    tab.tick("Bodies deformed by the errors")
    straight = replace(state, machine=state.machine.switched(bent=False))
    tab.until(lambda: stands(straight))
    assert not stands(state)
    tab.tick("Machine bodies")
    tab.until(lambda: tab.drawn("/machine/R_bed") is None)
    # hidden stays hidden, in another page of the same browser too
    tab.until(lambda: tab.drawn("/ghost_machine/R_bed") is not None)
    tab.button("Hide machine")
    tab.until(lambda: tab.drawn("/ghost_machine/R_bed") is None)
    tab.until(lambda: not tab.session.state.machine.ghost)
    page = tab.page.context.new_page()
    page.goto(f"{tab.viewer.url}/?fixedDpr=1")
    wait_until_open(page)
    page.get_by_role("button", name="Show machine", exact=True).wait_for()
    page.close()
    tab.button("Show machine")
    tab.until(lambda: tab.drawn("/ghost_machine/R_bed") is not None)


FIRST, SECOND = "C at B 0°, point (275, 0, 0) mm", "C at B −30°, point (0, 275, 450) mm"


@pytest.mark.own_page
def test_a_trace_is_chosen_plotted_and_its_axis_turned_until_the_page_is_left(tab):
    scene = load_scene("teach_wobbling_table")
    tab.session.context.post(lambda _: start_state(scene, nodes=5))
    tab.panel("Rotary axes")
    tab.until(lambda: tab.text("polar name") == FIRST)
    tab.until(lambda: tab.text("polar radial turns") == "twice a turn")
    tab.until(lambda: tab.text("polar tilt turns") == "once a turn")
    lines = {name_trace(line.trace): line for line in trace_lines(evaluate_traces(scene, 1.0))}
    drawn = tab.drawn("/traces/actual")
    for name in (FIRST, SECOND):
        if name == SECOND:
            tab.choose("Trace", name)
            tab.until(lambda: tab.text("polar name") == SECOND)
        for part in evaluate_axis_motion(scene, lines[name], evaluate_exact).motions:
            for word, value in (("pv", part.peak_to_valley), ("value", part.motion_value)):
                at, wanted = f"polar {part.name} {word}", pytest.approx(value, abs=0.0051)
                tab.until(lambda at=at, wanted=wanted: tab.number(at) == wanted)
    tab.until(lambda: tab.session.state.rotary.chosen == SECOND)
    tab.until(lambda: not np.allclose(tab.drawn("/traces/actual"), drawn, atol=1.0))
    tab.press("Control+z")
    tab.until(lambda: tab.text("polar name") == FIRST)

    tab.session.context.post(lambda _: START)
    tab.panel("Machine")
    tab.tick("Machine bodies")
    tab.panel("Rotary axes")
    tab.until(lambda: tab.drawn("/machine/C_table") is not None)
    still, stage = tab.still(lambda: tab.drawn("/machine/C_table")), tab.session.context.stage
    tab.button("Play rotation")
    tab.until(lambda: tab.page.locator("[data-value='turning']").count() > 0)
    tab.until(lambda: not np.allclose(tab.drawn("/machine/C_table"), still, atol=1.0))
    tab.until(lambda: tab.drawn("/rotation/actual") is not None)
    tab.button("Pause rotation")
    tab.until(lambda: not stage.playing)
    tab.still(lambda: tab.drawn("/machine/C_table"))
    tab.button("Stop")
    tab.until(lambda: np.allclose(tab.drawn("/machine/C_table"), still, atol=1e-3))
    tab.until(lambda: tab.drawn("/rotation/actual") is None)
    tab.button("Play rotation")
    tab.until(lambda: stage.playing)
    tab.page.goto("about:blank")
    tab.until(lambda: not stage.playing)
