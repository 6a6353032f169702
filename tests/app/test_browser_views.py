"""Views, machine and rotary table in a real Chromium: what a user does, what is then drawn."""

from dataclasses import replace

import numpy as np
import pytest

from app.page_tab import Tab
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine import drawn_bodies, tool_point
from warpspace.app.state.app_state import start_state
from warpspace.app.state.look import linear_spans, slice_spans
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.app.viewport.tone_map import vertex_colours
from warpspace.geometry.colour import colour_table
from warpspace.picture.marks import corner_arrows
from warpspace.picture.mesh import isoline_pieces, map_mesh
from warpspace.scene.library import load_scene

pytestmark = pytest.mark.browser
LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"))
PLACE = """name => {
  const node = window.__viserMutable.nodeRefFromName[name];
  if (!node) return null;
  node.updateWorldMatrix(true, false);
  const e = node.matrixWorld.elements;
  return [e[12], e[13], e[14]];
}"""


def looking(**changes):
    return replace(START, look=replace(START.look, **changes))


def ends(tab: Tab, name: str, pieces: np.ndarray) -> bool:
    """Whether a node of lines has these pieces."""
    found = tab.drawn(name)
    return (
        found is not None
        and found.size == pieces.size
        and np.allclose(found.reshape(pieces.shape), pieces, atol=2e-3)
    )


def tick(tab: Tab, label: str) -> None:
    """Click a check box, as a user does."""
    tab.page.locator(f"[id='{tab.widget(label)}']").click()
    tab.page.wait_for_timeout(120)


def go(tab: Tab, name: str) -> None:
    """Open a tab of the page's panels."""
    tab.page.get_by_role("tab", name=name, exact=True).first.click()
    tab.page.wait_for_timeout(200)


def test_surface_cut_slices_and_lines(tab: Tab) -> None:
    tab.choose("Show as", "cut octant")
    cut = LIVE.evaluate(looking(surface="cut"))
    tab.until(lambda: tab.shows(map_mesh(cut).vertices_mm))
    tab.choose("Show as", "slices")
    tab.until(lambda: tab.shows(map_mesh(LIVE.evaluate(looking(surface="slices"))).vertices_mm))
    tab.thumb("Slice YZ").focus()
    for _ in range(4):
        tab.page.keyboard.press("ArrowRight")
        tab.page.wait_for_timeout(70)
    look = looking(surface="slices").look.with_slice("X", 4.0, slice_spans(START.scene)["X"])
    moved = LIVE.evaluate(replace(START, look=look))
    tab.until(lambda: tab.shows(map_mesh(moved).vertices_mm))
    assert tab.drawn("/box/grid") is not None
    tab.choose("Show as", "grid lines only")
    tab.until(lambda: tab.drawn("/box/grid") is None)
    tab.choose("Show as", "surface")
    tab.until(lambda: tab.shows(map_mesh(LIVE.evaluate(START)).vertices_mm))
    tab.until(lambda: tab.drawn("/box/grid") is not None)


def test_isolines_arrows_worst_point_and_bars(tab: Tab) -> None:
    assert tab.drawn("/box/isolines") is None
    tick(tab, "Isolines")
    picture = LIVE.evaluate(looking(isolines=True))
    tab.until(lambda: ends(tab, "/box/isolines", isoline_pieces(picture)))
    tick(tab, "Corner arrows")
    arrows = corner_arrows(
        picture.grid.shape, picture.grid.nominal_mm, picture.field.error_um, picture.exaggeration
    )
    tab.until(lambda: tab.drawn("/marks/arrows") is not None)
    found = tab.drawn("/marks/arrows")
    for start, end in zip(arrows.start_mm, arrows.end_mm, strict=True):
        for at in (start, end):
            assert np.linalg.norm(found - at, axis=-1).min() < 0.01
    worst = np.array(tab.page.evaluate(PLACE, "/marks/ball")) / SCENE_PER_MM
    at = np.unravel_index(np.argmax(picture.values), picture.values.shape)
    # the page turns z upwards into three.js' y upwards
    wanted = picture.drawn_mm[at]
    assert sorted(np.abs(worst)) == pytest.approx(sorted(np.abs(wanted)), abs=0.01)
    assert tab.page.locator("[data-bar-scale]").count() == 2
    tick(tab, "Scale bars")
    tab.until(lambda: tab.page.locator("[data-bar-scale]").count() == 0)


def test_orientation_error_and_colour_ranges(tab: Tab) -> None:
    tab.choose("Quantity", "tool-orientation error [µrad]")
    picture = LIVE.evaluate(looking(quantity="orientation"))

    def coloured(picture) -> bool:
        found = tab.surface()
        wanted = vertex_colours(picture.scale, map_mesh(picture).values)
        return found is not None and np.allclose(found[1], wanted, atol=1e-5)

    tab.until(lambda: coloured(picture))
    assert tab.page.get_by_text("|φ| [µrad]").first.is_visible()
    tab.send("Range ends at", "100")
    fixed = LIVE.evaluate(looking(quantity="orientation", range_mode="fixed", range_top=100.0))
    tab.until(lambda: coloured(fixed))
    tab.choose("Colour range", "shared")
    tab.until(lambda: coloured(LIVE.evaluate(looking(quantity="orientation", range_mode="shared"))))


def test_cameras(tab: Tab) -> None:
    camera = tab.session._client.camera

    def looks_along(direction: tuple[float, float, float]) -> bool:
        away = camera.position - camera.look_at
        return bool(np.allclose(away / np.linalg.norm(away), direction, atol=5e-3))

    for name, direction in (("Front", (0, -1, 0)), ("Right", (1, 0, 0)), ("Top", (0, 0, 1))):
        tab.page.get_by_role("button", name=name, exact=True).click()
        tab.until(lambda direction=direction: looks_along(direction))
    tab.page.get_by_role("button", name="Iso", exact=True).click()
    tab.until(lambda: not looks_along((0, 0, 1)))
    tab.page.wait_for_timeout(1500)  # the page tells the server where its camera has come to stand
    wide = camera.fov
    before = np.linalg.norm(camera.position - camera.look_at) * np.tan(wide / 2)
    tick(tab, "Orthographic")
    tab.until(lambda: abs(np.rad2deg(camera.fov) - 3.0) < 1e-6)

    def size() -> float:
        return float(np.linalg.norm(camera.position - camera.look_at) * np.tan(camera.fov / 2))

    tab.until(lambda: size() == pytest.approx(before, rel=5e-3))
    tick(tab, "Orthographic")
    tab.until(lambda: abs(camera.fov - wide) < 1e-6)


def test_pixels_have_the_colours_of_the_bar(tab: Tab) -> None:
    for label in (
        "Rotary traces",
        "Nominal box",
        "Grid lines",
        "Axes",
        "Worst point",
        "Scale bars",
    ):
        tick(tab, label)
    tab.page.evaluate(
        "() => document.querySelectorAll('.mantine-Notification-closeButton')"
        ".forEach(b => b.click())"
    )
    tab.page.get_by_role("button", name="Front", exact=True).click()
    tab.page.wait_for_timeout(300)
    tick(tab, "Orthographic")
    tab.page.wait_for_timeout(2500)
    picture = LIVE.evaluate(START)
    camera = tab.session._client.camera
    rect = tab.page.evaluate(
        "() => { const r = document.querySelector('canvas').getBoundingClientRect();"
        " return [r.left, r.top, r.width, r.height]; }"
    )
    screen = tab.screenshot()
    # inner nodes of the front face, projected
    nodes = picture.drawn_mm[2:-2, 0, 2:-2].reshape(-1, 3) * SCENE_PER_MM
    values = picture.values[2:-2, 0, 2:-2].reshape(-1)
    back = camera.position - camera.look_at
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    up = np.cross(back, right)
    seen = nodes - camera.position
    scale = rect[3] / 2.0 / np.tan(camera.fov / 2.0) / -(seen @ back)
    column = np.floor(rect[0] + rect[2] / 2.0 + scale * (seen @ right)).astype(int)
    row = np.floor(rect[1] + rect[3] / 2.0 - scale * (seen @ up)).astype(int)
    free = (column > 900) | (row > 160)  # not under the heading
    pixels = screen[row[free], column[free]]
    wanted = picture.scale.colours(values[free]).astype(int)
    # a pixel beside the node, whose value differs by less than a step of the map, is still right
    table = colour_table().astype(int)
    index = np.rint(picture.scale.fraction(values[free]) * 255).astype(int)
    near = np.stack([table[np.clip(index + step, 0, 255)] for step in (-1, 0, 1)])
    assert free.sum() > 200
    assert np.abs(pixels - near).max(axis=-1).min(axis=0).max() <= 3
    assert np.median(np.abs(pixels - wanted).max(axis=-1)) <= 2
    # between the nodes too, every pixel of the face is a colour of the bar
    low, high = (row[free].min(), row[free].max()), (column[free].min(), column[free].max())
    face = screen[low[0] : low[1], high[0] : high[1]].reshape(-1, 3)[::7]
    apart = np.abs(face[:, None, :] - table[None]).max(axis=-1).min(axis=-1)
    assert apart.max() <= 3


def machine_vertices(state) -> dict[str, np.ndarray]:
    return {p.body.name: p.vertices_mm for p in drawn_bodies(LIVE.evaluate(state))}


def test_machine_moves_bends_and_carries_the_tool_point(tab: Tab) -> None:
    go(tab, "Machine")
    assert tab.drawn("/machine/R_bed") is None
    tick(tab, "Machine bodies")
    state = replace(START, machine=START.machine.switched(shown=True))

    def stands(state) -> bool:
        found = {name: tab.drawn(f"/machine/{name}") for name in machine_vertices(state)}
        return all(
            at is not None and at.shape == wanted.shape and np.allclose(at, wanted, atol=2e-3)
            for at, wanted in zip(found.values(), machine_vertices(state).values(), strict=True)
        )

    tab.until(lambda: stands(state))
    spans = linear_spans(START.scene)
    machine = state.machine
    for axis, value in (("X", 200.0), ("Y", -150.0), ("Z", -400.0)):
        tab.send(f"Machine {axis}", str(value))
        tab.page.wait_for_timeout(120)
        machine = machine.with_linear(axis, value, spans[axis])
    tab.send("Machine B", "-30")
    state = replace(state, machine=machine).with_position("B", -30.0)
    tab.until(lambda: stands(state))
    point = tool_point(LIVE.evaluate(state))
    at = np.array(tab.page.evaluate(PLACE, "/machine/tool_point")) / SCENE_PER_MM
    assert sorted(np.abs(at)) == pytest.approx(sorted(np.abs(point.drawn_mm)), abs=0.01)
    tick(tab, "Bodies deformed by the errors")
    straight = replace(state, machine=state.machine.switched(bent=False))
    tab.until(lambda: stands(straight))
    assert not stands(state)
    tick(tab, "Machine bodies")
    tab.until(lambda: tab.drawn("/machine/R_bed") is None)


def test_circles_in_numbers_for_chosen_points_and_positions(tab: Tab) -> None:
    tab.choose("Scene", load_scene("teach_tilted_c").title)
    go(tab, "Rotary axes")
    tab.until(lambda: tab.page.locator("[data-value='circles']").count() > 0)
    table = tab.page.locator("[data-value='circles']").first
    assert "C at B −30°" in table.inner_text()
    tab.page.get_by_text("Traced points").first.click()
    tab.page.wait_for_timeout(300)
    tab.send("Own point", "[100, 0, 50]")
    tab.page.wait_for_timeout(120)
    tick(tab, "Trace a point of my own")
    tab.until(lambda: "point (100, 0, 50) mm" in table.inner_text())
    tab.send("B held at", "'-45, 10'")
    tab.until(lambda: "C at B −45°" in table.inner_text())
    assert "C at B −30°" not in table.inner_text()
    tab.page.get_by_role("button", name="Hold at every 90°").click()
    tab.until(lambda: "B at C 270°" in table.inner_text())
    rows = [r.split() for r in table.inner_text().splitlines() if r.startswith("C at B −45°")]
    # a C axis tilted by 40 µrad draws circles tilted by 40 µrad
    scene = load_scene("teach_tilted_c")
    tilt = np.hypot(scene.errors.amplitude("EA0C"), scene.errors.amplitude("EB0C"))
    assert {float(row[-2]) for row in rows} == {round(float(tilt), 1)}
    tab.send("B held at", "'nonsense'")
    tab.until(lambda: tab.page.get_by_text("nonsense left out").count() > 0)


def settled(tab: Tab) -> tuple[object, str]:
    """Wait until table and caption stand still, at most 15 s, and give both."""
    last: tuple[object, str] = (None, "")
    for _ in range(10):
        tab.page.wait_for_timeout(1500)
        now = (tab.drawn("/machine/C_table"), tab.text("turning"))
        if last[0] is not None and np.array_equal(now[0], last[0]) and now[1] == last[1]:
            break
        last = now
    return now


@pytest.mark.own_page
def test_rotation_plays_pauses_and_stops_with_its_session(tab: Tab) -> None:
    go(tab, "Machine")
    tick(tab, "Machine bodies")
    go(tab, "Rotary axes")
    tab.until(lambda: tab.drawn("/machine/C_table") is not None)
    still = tab.drawn("/machine/C_table")
    tab.page.get_by_role("button", name="Play rotation").click()
    tab.until(lambda: tab.page.locator("[data-value='turning']").count() > 0)
    tab.until(lambda: not np.allclose(tab.drawn("/machine/C_table"), still, atol=1.0))
    assert tab.drawn("/rotation/actual") is not None
    tab.page.get_by_role("button", name="Pause rotation").click()
    # steps on their way still arrive on a busy machine; then nothing moves for five steps' time
    paused, where = settled(tab)
    tab.page.wait_for_timeout(600)
    assert np.array_equal(tab.drawn("/machine/C_table"), paused)
    assert tab.text("turning") == where
    tab.page.get_by_role("button", name="Stop", exact=True).click()
    tab.until(lambda: np.allclose(tab.drawn("/machine/C_table"), still, atol=1e-3))
    tab.until(lambda: tab.drawn("/rotation/actual") is None)
    tab.page.get_by_role("button", name="Play rotation").click()
    stage = tab.session.context.stage
    tab.until(lambda: stage.playing)
    tab.page.goto("about:blank")
    tab.until(lambda: not stage.playing)
