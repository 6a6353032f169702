"""What is drawn in a real Chromium: surfaces, lines, marks, machine, rotary axes."""

import re
from dataclasses import replace

import numpy as np

from app.page_tab import SCENES
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine import drawn_bodies, tool_point
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.picture.mesh import isoline_pieces

LIVE = LiveModel()
START = start_state(SCENES[0])


def looking(**changes):
    return replace(START, look=replace(START.look, **changes))


def test_surfaces_slices_isolines_and_marks(tab):
    def draws(state):
        tab.until(lambda: tab.shows_state(state))

    tab.send("state:set.look.surface", "cut")
    draws(looking(surface="cut"))
    tab.send("state:set.look.surface", "slices")
    draws(looking(surface="slices"))
    tab.send("state:set.look.slices_mm.X", 4)
    look = replace(looking(surface="slices").look, slices_mm={"X": 4.0})
    draws(replace(START, look=look))
    tab.until(lambda: tab.drawn("/box/grid") is not None)
    tab.send("state:set.look.surface", "grid")
    tab.until(lambda: tab.drawn("/box/grid") is None)
    tab.send("state:set.look.surface", "surface")
    draws(START)
    tab.until(lambda: tab.drawn("/box/grid") is not None)

    picture = LIVE.evaluate(looking(isolines=True))
    worst = picture.drawn_mm[np.unravel_index(np.argmax(picture.values), picture.values.shape)]
    tab.until(lambda: np.allclose(tab.place("/marks/ball"), worst, atol=0.01))
    assert tab.drawn("/box/isolines") is None
    tab.send("state:set.look.isolines", 1)
    pieces = isoline_pieces(picture).reshape(-1, 3)
    tab.until(lambda: (found := tab.drawn("/box/isolines")) is not None and len(found) > 0)
    tab.until(lambda: np.allclose(tab.drawn("/box/isolines"), pieces, atol=2e-3))
    tab.send("state:set.look.arrows", 1)
    tab.until(lambda: tab.drawn("/marks/arrows") is not None)
    found = tab.drawn("/marks/arrows")
    for nodes in (picture.grid.nominal_mm, picture.drawn_mm):
        for at in nodes[::20, ::20, ::20].reshape(-1, 3):
            assert np.linalg.norm(found - at, axis=-1).min() < 0.01


def test_the_machine_moves_bends_and_carries_the_tool_point(tab):
    def stands(state):
        wanted = {p.body.name: p.vertices_mm for p in drawn_bodies(LIVE.evaluate(state))}
        found = {name: tab.drawn(f"/machine/{name}") for name in wanted}
        return all(
            at is not None
            and at.shape == wanted[name].shape
            and np.allclose(at, wanted[name], atol=2e-3)
            for name, at in found.items()
        )

    assert tab.drawn("/machine/R_bed") is None
    tab.send("controls:machine", "solid")
    state = replace(START, machine=replace(START.machine, shown=True))
    tab.until(lambda: stands(state))
    machine = state.machine
    for axis, value in (("X", 200.0), ("Y", -150.0), ("Z", -400.0)):
        tab.send(f"state:set.machine.linear_mm.{axis}", value)
        machine = replace(machine, linear_mm={**machine.linear_mm, axis: value})
    tab.send("state:set.positions.B", -30)
    state = replace(state, machine=machine)
    state = put(state, "positions.B", "-30.0")
    tab.until(lambda: stands(state))
    point = tool_point(LIVE.evaluate(state))[0]
    tab.until(lambda: np.allclose(tab.place("/machine/tool_point"), point, atol=0.01))
    tab.send("state:set.machine.bent", 0)
    straight = replace(state, machine=replace(state.machine, bent=False))
    tab.until(lambda: stands(straight))
    assert not stands(state)
    tab.send("controls:machine", "ghost")
    tab.until(lambda: tab.drawn("/machine/R_bed") is None)
    tab.until(lambda: tab.drawn("/ghost_machine/R_bed") is not None)
    tab.send("controls:machine", "off")
    tab.until(lambda: tab.drawn("/ghost_machine/R_bed") is None)


def test_the_table_turns_until_the_page_is_left(open_tab):
    tab = open_tab()
    tab.send("controls:machine", "solid")
    tab.until(lambda: tab.drawn("/machine/C_table") is not None)
    still, stage = tab.still(lambda: tab.drawn("/machine/C_table")), tab.session.context.stage
    tab.task("Machine")
    tab.unfold("Rotary axes")
    turn = tab.page.get_by_role("button", name=re.compile("^Turn [ABC]"))
    turn.click()
    tab.until(lambda: stage.playing)
    tab.until(lambda: not np.allclose(tab.drawn("/machine/C_table"), still, atol=1.0))
    tab.until(lambda: tab.drawn("/rotation/actual") is not None)
    tab.click("Pause")
    tab.until(lambda: not stage.playing)
    tab.click("Stop")
    tab.until(lambda: np.allclose(tab.drawn("/machine/C_table"), still, atol=1e-3))
    tab.until(lambda: tab.drawn("/rotation/actual") is None)
    turn.click()
    tab.until(lambda: stage.playing)
    worker = tab.session._worker
    tab.page.goto("about:blank")
    tab.until(lambda: not worker.is_alive())
