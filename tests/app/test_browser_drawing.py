"""What is drawn in a real Chromium: surfaces, lines, marks, machine, rotary axes."""

from dataclasses import replace

import numpy as np
import pytest

from app.frames import new_visitor
from app.page_tab import SCENES, Tab, same_points, wait_until_open
from warpspace.app.browser import actions as do
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.machine_bodies import drawn_bodies, tool_point
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.kinematics.transforms import apply
from warpspace.picture.map_mesh import isoline_pieces, map_mesh

LIVE = LiveModel()
START = start_state(SCENES[0])


def test_surfaces_slices_isolines_and_marks(tab):
    def draws(*sent):
        state = START
        for path, value in sent:
            tab.send(do.SetLeaf(path, str(value)))
            state = put(state, path, value)
        tab.until(lambda: tab.shows_state(state))
        tab.until(lambda: tab.drawn("/box/grid") is not None)
        return LIVE.evaluate(state)

    draws(("look.surface", "cut"))
    draws(("look.surface", "slices"), ("look.slices_mm.X", "4"))
    tab.send(do.SetLeaf("look.surface", "grid"))
    tab.until(lambda: tab.drawn("/box/grid") is None)
    picture = draws(("look.surface", "surface"))
    worst = picture.drawn_mm[np.unravel_index(np.argmax(picture.values), picture.values.shape)]
    tab.until(lambda: np.allclose(tab.place("/marks/ball"), worst, atol=0.01))
    assert tab.drawn("/box/isolines") is None
    picture = draws(("look.isolines", "1"), ("look.arrows", "1"))
    pieces = isoline_pieces(picture).reshape(-1, 3)
    tab.until(lambda: same_points(tab.drawn("/box/isolines"), pieces))
    tab.until(lambda: tab.drawn("/marks/arrows") is not None)
    found = tab.drawn("/marks/arrows")
    for nodes in (picture.grid.nominal_mm, picture.drawn_mm):
        for at in nodes[::20, ::20, ::20].reshape(-1, 3):
            assert np.linalg.norm(found - at, axis=-1).min() < 0.01


def test_the_machine_moves_bends_and_carries_the_tool_point(tab):
    def stands(state):
        wanted = {
            p.body.name: apply(p.pose, p.surface.vertices_mm)
            for p in drawn_bodies(LIVE.evaluate(state))
        }
        return all(same_points(tab.drawn(f"/machine/{name}"), wanted[name]) for name in wanted)

    tab.send(do.ShowMachine("solid"))
    state = put(START, "machine.shown", "1")
    tab.until(lambda: stands(state))
    for path, value in (
        *(("machine.linear_mm.X", "200"), ("machine.linear_mm.Y", "-150")),
        *(("machine.linear_mm.Z", "-400"), ("positions.B", "-30")),
    ):
        tab.send(do.SetLeaf(path, str(value)))
        state = put(state, path, value)
    tab.until(lambda: stands(state))
    point = tool_point(LIVE.evaluate(state))[0]
    tab.until(lambda: np.allclose(tab.place("/machine/tool_point"), point, atol=0.01))
    tab.send(do.SetLeaf("machine.bent", "0"))
    tab.until(lambda: stands(put(state, "machine.bent", "0")))
    assert not stands(state)
    tab.send(do.ShowMachine("ghost"))
    tab.until(lambda: tab.drawn("/machine/R_bed") is None)
    tab.until(lambda: tab.drawn("/ghost_machine") is not None)
    tab.send(do.ShowMachine("off"))
    tab.until(lambda: tab.drawn("/ghost_machine") is None)


def test_the_table_turns_until_the_page_is_left(open_tab):
    tab = open_tab()
    tab.send(do.ShowMachine("solid"))
    tab.until(lambda: tab.drawn("/machine/C_table") is not None)
    still, player = tab.still(lambda: tab.drawn("/machine/C_table")), tab.session.context.player
    tab.task("Machine")
    tab.unfold("Rotary axes")
    play = tab.page.locator("[data-piece='section.rotary']").get_by_role("button", name="Play C")
    play.click()
    tab.until(lambda: player.playing == "C")

    def is_at_rest():  # between two meshes there is none for a moment
        table = tab.drawn("/machine/C_table")
        return None if table is None else np.allclose(table, still, atol=1e-3)

    tab.until(lambda: is_at_rest() is False)
    tab.until(lambda: tab.drawn("/rotation/actual") is not None)
    tab.click("Pause C")
    tab.until(lambda: not player.playing)
    tab.click("Reset")
    tab.until(is_at_rest)
    tab.until(lambda: tab.drawn("/rotation/actual") is None)
    play.click()
    tab.until(lambda: player.playing == "C")
    worker = tab.session.worker
    tab.page.goto("about:blank")
    tab.until(lambda: not worker.is_alive())


RECORD = """() => setInterval(() => {
  const { warpspaceMesh: mesh, __viserMutable: view } = window, seen = (window.risen ??= []);
  view?.nodeRefFromName?.["/box/surface"]?.traverse(part => {
    const at = part.geometry?.attributes.position;
    const far = window.warpspaceViser?.cameraControl()?.distance;
    if (at && mesh) seen.push([mesh.solid, Array.from(at.array.slice(0, 300)), far]);
  });
}, 20)"""
GREET = """() => {
  warpspaceMesh.greet();
  const solid = warpspaceMesh.solid;
  dispatchEvent(new KeyboardEvent("keydown", { key: "Shift" }));
  return [solid, warpspaceMesh.solid];
}"""


def test_the_first_view_grows_from_true_scale_while_the_solid_machine_becomes_its_ghost(
    viewer, browser
):
    picture = LIVE.evaluate(START)
    drawn, true = (
        map_mesh(of).vertices_mm[:100] for of in (picture, replace(picture, exaggeration=1.0))
    )
    with new_visitor(browser) as context:
        page = context.new_page()
        page.add_init_script(f"({RECORD})()")
        tab = Tab(page, viewer, "&rise=on")
        tab.until(lambda: page.evaluate("risen.at(-1)[0] === 0 && risen.some(one => one[0] === 1)"))
        seen = page.evaluate("risen")
        shares = [
            float(np.mean((np.reshape(points, (-1, 3)) - true) * (drawn - true)))
            / float(np.mean((drawn - true) ** 2))
            for _, points, _ in seen
        ]
        assert shares[-1] == pytest.approx(1.0, abs=1e-3)
        assert min(shares) < 0.5
        while_growing = [(solid, share) for (solid, _, _), share in zip(seen, shares, strict=True)
                         if 0.0 < solid < 1.0]  # fmt: skip
        assert while_growing
        np.testing.assert_allclose([sum(pair) for pair in while_growing], 1.0, atol=1e-2)
        far = [distance for *_, distance in seen if distance]
        assert max(far) > 2.0 * far[-1], "it began with the whole machine"
        assert not tab.session.context.camera.is_moved
        assert page.evaluate(GREET) == [1, 0], "a key ends it"


def test_no_first_view_for_reduced_motion_and_programs(viewer, browser):
    for query, options in (("&rise=on", {"reduced_motion": "reduce"}), ("", {})):
        with new_visitor(browser, **options) as context:
            tab = Tab(context.new_page(), viewer, query)
            assert tab.page.evaluate(GREET) == [0, 0]


def test_the_exaggeration_is_played_by_keys(tab):
    factor = tab.session.context.picture.exaggeration
    tab.page.keyboard.press("p")
    tab.until(lambda: 1.0 < tab.session.context.picture.exaggeration < factor)
    tab.page.keyboard.press("p")
    tab.until(lambda: not tab.session.context.player.playing)
    slider = tab.page.get_by_label("Position of the exaggeration", exact=True)
    for key, end in (("Home", 1.0), ("End", factor), ("ArrowLeft", factor**0.99)):
        slider.press(key)
        tab.until(lambda end=end: abs(tab.session.context.picture.exaggeration - end) < 1e-3 * end)
    assert not tab.session.context.player.is_still
    tab.page.emulate_media(reduced_motion="reduce")
    tab.page.reload()
    wait_until_open(tab.page)
    tab.until(lambda: tab.session.context.player.is_still)
