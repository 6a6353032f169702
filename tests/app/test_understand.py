"""Why, and where: a point that is clicked or typed, its causes, the best adjustment, gains."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.parts import LIVE, Alone, lone_part, wait
from products import first
from warpspace.analysis.commands.distance import Distance
from warpspace.analysis.description import ignore_progress
from warpspace.analysis.registry import entries
from warpspace.app.browser import actions as do
from warpspace.app.drawing.around import draw_surroundings
from warpspace.app.drawing.labels import point_labels
from warpspace.app.evaluation import point_explanation
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.point_explanation import explain_point, pick, pick_worst, with_picked
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.explanation import DistancePanel, VolumePanel, WorstPanel
from warpspace.app.panels.improve import BestPanel
from warpspace.app.state.app_state import Picked, start_state
from warpspace.app.state.tree import put
from warpspace.app.state.typed_numbers import read_positions
from warpspace.kinematics.model import Loop
from warpspace.picture.formatting import spell_at, spell_axes, spell_point
from warpspace.scene.library import load_scene, scene_names
from warpspace.scene.model import evaluate

FIRST = load_scene("dvf5000_first")
START = start_state(FIRST)


def look_at(picture, target):
    eye = picture.drawn_mm.reshape(-1, 3).mean(axis=0) + np.array([1500.0, -4000.0, 2500.0])
    return eye, target - eye


@pytest.mark.parametrize("surface", ["surface", "cut", "slices"])
def test_a_ray_through_a_drawn_node_finds_its_axis_positions(surface):
    state = replace(START, look=replace(START.look, surface=surface), nodes=11)
    picture = LIVE.evaluate(replace(state, shown=replace(state.shown, traces=False)))
    drawn = picture.slices[0].drawn_mm.reshape(11, 11, 3) if picture.slices else picture.drawn_mm
    target = drawn[4, 2] if picture.slices else drawn[2, 0, 3]
    picked, at = pick(picture, *look_at(picture, target))
    assert picked.point_mm is None
    if not picture.slices:
        np.testing.assert_allclose(at, target, atol=0.01)
        for axis, index in (("X", 2), ("Y", 0), ("Z", 3)):
            there = picture.grid.coordinates[axis].reshape(-1)[index]
            assert picked.at[axis] == pytest.approx(there, abs=0.01)


def test_a_ray_past_everything_and_hostile_rays_find_nothing():
    picture = LIVE.evaluate(START)
    eye, towards = look_at(picture, picture.drawn_mm[0, 0, 0])
    assert pick(picture, eye, -towards) is None
    for bad in (np.nan, np.inf, 1e300):
        assert pick(picture, np.full(3, bad), towards) is None
    assert pick(picture, eye, np.zeros(3)) is None
    assert pick(picture, np.zeros(2), towards) is None


def test_a_trace_in_front_of_the_box_is_what_a_click_on_it_means():
    picture = LIVE.evaluate(START.with_amplitude("EXC", 1.0))
    lines, hits = picture.traces[0], 0
    for trace, points in zip(lines.group.traces, lines.actual_mm, strict=True):
        for target in points[::6]:
            picked, _ = pick(picture, *look_at(picture, target)) or (Picked({}), None)
            hits += picked.point_mm == trace.point_mm
            assert picked.point_mm is None or picked.loop is Loop.WORKPIECE
    assert hits > 20


@pytest.mark.parametrize("name", first(*scene_names()))
def test_a_node_is_asked_about_where_it_is_drawn(name):
    picture = LiveModel().evaluate(replace(start_state(load_scene(name)), nodes=3))
    grid = picture.grid
    coordinates = {a: np.broadcast_to(at, grid.shape) for a, at in grid.coordinates.items()}
    for node in np.ndindex(grid.shape):
        at = {axis: float(positions[node]) for axis, positions in coordinates.items()}
        found = explain_point(picture.state, Picked(at), picture.exaggeration)
        shown = found.explanation.nominal_mm + found.shift_mm
        assert shown == pytest.approx(grid.nominal_mm[node], abs=1e-9)


WORST = {"X": 275.0, "Y": -225.0, "Z": -480.0}
PLACE = "axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51"
AT = "X=275,Y=-225,Z=-480,B=0,C=0"


def test_a_point_is_spelt_in_both_coordinates():
    axes = {**WORST, "B": 0.0, "C": 0.0}
    assert spell_point(axes, (275.0, -225.0, -51.0)) == PLACE
    assert spell_at(axes) == AT
    assert spell_axes({**axes, "B": -30.0}) == "axes X 275 Y −225 Z −480 B −30°"
    assert spell_axes({"B": 0.0, "C": 12.34}) == "axes B 0° C 12.3°"
    assert spell_point({}, (0.0, -0.04, 2.5)) == "in R x 0 y 0 z 2.5"
    assert spell_at({"C": -1e-9, "X": 1.25, "Y": 1.0 / 3.0}) == "X=1.25,Y=0.333333,C=0"


@pytest.mark.parametrize(
    "text",
    [
        "X 275 Y -225 Z -480",
        "X=275,Y=-225,Z=-480",
        "x275y-225z-480",
        "X: 275 mm; Y: −225 mm; Z: −480 mm",
        "X 2.75e2, Y -225,0, Z -480.",
        PLACE,
        f"--at {AT}",
        "  axes X +275   Y −225 Z −480 B 0° C 0° ",
    ],
)
def test_a_point_is_read_in_every_way_it_is_spelt(text):
    found = read_positions(text)
    assert {axis: found[axis] for axis in "XYZ"} == WORST
    assert put(START, "picked", text).picked == Picked(WORST)
    assert put(START, "picked", text).notes == ()


@pytest.mark.parametrize(
    "text", ["X", "275", "X 1 X 2", "X nan", "X 1e999", "X 1 2", "<b>", "X=1,Q=2", "A 5", "X - 5"]
)
def test_what_is_no_point_changes_nothing_and_is_said(text):
    asked = put(START, "picked", "X 1")
    state = put(asked, "picked", text)
    assert state.without_notes() == asked
    (note,) = state.notes
    assert "expected positions of the axes X, Y, Z, B, C, for instance X 275" in note


def test_a_typed_point_is_clamped_to_the_travel_and_said():
    travel = FIRST.machine.axes["X"].travel
    state = put(START, "picked", "X 1e5 B 500")
    assert state.picked.at["X"] == travel[1]
    assert state.positions["B"] == START.position_spans["B"].high
    assert len(state.notes) == 2
    assert "X of the point = 100000 is outside -275 to 275 mm" in " ".join(state.notes)
    middle = FIRST.workspace.positions
    assert (state.picked.at["Y"], state.picked.at["Z"]) == (middle["Y"], middle["Z"])
    moved = put(state.without_notes(), "picked", "Z -300")
    assert moved.picked.at == {**state.picked.at, "Z": -300.0}
    assert put(moved, "picked", "  ").picked is None


@pytest.mark.parametrize("at", [AT, "X=0,Y=0,Z=-280,B=-30,C=45", "X=-275,Y=225,Z=-80"])
def test_a_typed_point_has_the_error_of_the_exact_chain(at):
    state = put(START, "picked", at)
    shown = explain_point(state, state.picked, 1.0)
    wanted = evaluate(FIRST, at=read_positions(at), exact=True)
    np.testing.assert_allclose(shown.explanation.error_um, wanted.error_um, atol=1e-9)
    np.testing.assert_allclose(shown.explanation.nominal_mm, wanted.nominal_mm, atol=1e-9)
    assert dict(shown.at).keys() == FIRST.machine.axes.keys()


NUMBER = r"[+-]?\d+\.\d"


def html_of(part, state=START):
    return "".join(part.render(LIVE.evaluate(state)).values())


def settled(part, state=START):
    """Return the HTML of a part once its job has ended."""
    html_of(part, state)
    wait(part)
    return html_of(part, state)


@pytest.mark.parametrize("name", scene_names())
def test_what_is_said_of_the_worst_point_adds_up_to_its_error(name):
    state = start_state(load_scene(name), nodes=5)
    html = html_of(lone_part(WorstPanel), state)
    if "No error" in html:
        assert not LIVE.evaluate(state).field.error_um.any()
        return
    html = html.replace("−", "-")
    (shown,) = map(float, re.findall(rf"<h3>Worst point: ({NUMBER}) µm", html))
    causes = html[html.index("ws-causes") : html.index('data-piece="best"')]
    parts = [*map(float, re.findall(rf"<td>({NUMBER})</td>", causes))]
    assert sum(parts) == pytest.approx(shown, abs=0.05 * (len(parts) + 1) + 1e-9)


def test_the_worst_point_of_the_thesis_and_another_one():
    part = lone_part(WorstPanel)
    assert ": 51.7 µm" in html_of(part)
    assert re.search(r'title="squareness of Z to Y[^"]*">EA0Z</b></th><td>\+49.1', html_of(part))
    typed = put(START, "picked", "X 0 Y 0 Z −280")
    assert "This point" in html_of(part, typed)
    assert part.handle(typed, do.Signal.FORGET_POINT).picked is None
    part.context.picture = LIVE.evaluate(START)
    asked = part.handle(START, do.Input.SHOW_LEVER_OF("EA0Z"))
    assert (asked.lever, asked.picked) == ("EA0Z", pick_worst(part.context.picture))
    assert "mm lever arm" in html_of(part, asked)
    for word in ("<img>", "", "x" * 500):
        assert part.handle(START, do.Input.SHOW_LEVER_OF(word)).lever == ""
        assert "<img" not in html_of(part, put(START, "picked", word))


def test_the_best_adjustment_is_that_of_repair_and_is_applied_only_while_it_holds():
    part = lone_part(BestPanel)
    assert "Searching" in html_of(part)
    html = settled(part)
    assert "front column bolts + 0.01 mm (10 µm)" in html
    assert "EA0Z 33.9 → 21.7 µrad" in html
    assert "30.9 → 24.9 µm" in html
    applied = part.handle(START, do.Apply("best", 0))
    assert LIVE.evaluate(applied).statistics.max_um == pytest.approx(49.50, abs=0.01)
    assert applied.comparison.b is not None
    previewed = part.handle(START, do.Preview("best", 0))
    assert previewed.comparison.b.title == "after adjustment: front column bolts + 0.01 mm (10 µm)"
    assert previewed.amplitudes == START.amplitudes
    assert LIVE.evaluate(previewed).statistics.max_um == pytest.approx(49.50, abs=0.01)
    moved = START.with_amplitude("EAX", 9.0)
    assert "disabled" in html_of(part, moved)
    wait(part)
    for state, card in ((START, 0), (moved, 7)):
        assert part.handle(state, do.Apply("best", card)) is state


def test_excluded_errors_are_neither_adjusted_nor_lost():
    state, part = put(START, "exclusions.excluded", "+EA0Z"), lone_part(BestPanel)
    assert "EA0Z" not in settled(part, state)
    applied = part.handle(state, do.Apply("best", 0))
    assert applied.amplitudes["EA0Z"] == START.amplitudes["EA0Z"]
    state = put(START, "exclusions.excluded", ",".join(START.amplitudes))
    assert "No single adjustment improves it." in settled(part, state)


def test_numbers_of_the_volume_and_gains_at_the_point_that_was_asked_about():
    opened = replace(START, page=replace(START.page, open=frozenset({"volume", "gains"})))
    html = html_of(lone_part(VolumePanel), opened)
    for words in ("30.9 µm", "51.7 µm", "550 × 450 × 400 mm"):
        assert words in html
    part = lone_part(AnalysisPanel, "gains")
    assert "X 0, Y 0, Z −280" in settled(part, opened)
    asked = with_picked(opened, pick_worst(LIVE.evaluate(opened)))
    assert "X 275, Y −225, Z −480" in settled(part, asked)
    assert np.isfinite(part.outcome[1].gains[0].norm)


# --- A distance, picked on the map ----------------------------------------------------------------


def measuring(**points):
    entry = next(one for one in entries() if one.name == "distance")
    page = replace(START.page, open=START.page.open | {"distance"})
    forms = {f"distance.{name}": text for name, text in points.items()}
    state = replace(START, page=page, forms=forms)
    return Alone(DistancePanel, state, entry)


def click(alone, at, **more):
    picked = Picked(at, **more)
    alone.store.apply(lambda state: point_explanation.with_clicked(state, picked))
    return alone.store.state


def test_clicks_set_start_end_and_corner_in_turn_and_then_ask_about_a_point_again():
    alone = measuring(exact="1")
    alone.do(do.Signal.PICK_POINTS)
    assert "first point" in alone.html
    waiting = alone.store.state.forms
    assert click(alone, {"X": 1.0}, point_mm=(0.0, 0.0, 0.0)).forms == waiting
    for x in (-200.0, 200.0, 0.0):
        state = click(alone, {"X": x, "Y": 0.0 if x else 200.0})
    assert state.forms["distance.start"] == "X=-200,Y=0"
    assert state.forms["distance.corner"] == "X=0,Y=200"
    assert state.picked is None
    assert click(alone, {"X": 7.0}).picked == Picked({"X": 7.0})
    assert alone.do(do.Signal.CLEAR_POINTS).forms == {"distance.exact": "1"}


def test_a_folded_section_takes_no_clicks():
    alone = measuring()
    alone.do(do.Signal.PICK_POINTS)
    alone.store.apply(lambda state: replace(state, page=replace(state.page, open=frozenset())))
    assert click(alone, {"X": 7.0}).picked == Picked({"X": 7.0})
    assert alone.do(do.Signal.STOP_PICKING).forms == {}


def test_a_measured_distance_is_drawn_between_the_displaced_points_with_its_six_numbers():
    state = measuring(start="X=-200,Y=0", end="X=200,Y=0", corner="X=-200,Y=200").store.state
    picture = LIVE.evaluate(state)
    words = [label.text for label in point_labels(picture) if label.kind == "measured"]
    start, end, corner = ({"X": x, "Y": y} for x, y in ((-200, 0), (200, 0), (-200, 200)))
    found = Distance(start=start, end=end, corner=corner).run(FIRST, ignore_progress)
    assert words == found.lines()
    assert words[0].startswith("400.000 → ")
    assert words[1].count("Δ") == 3
    shapes = draw_surroundings(picture)
    drawn = [explain_point(state, Picked(at), picture.exaggeration).drawn_mm for at in found.at]
    ends = shapes["/measured/actual"].assigned["points"]
    np.testing.assert_allclose(ends[0], drawn[:2], atol=1e-3)
    assert len(ends) == len(shapes["/measured/nominal"].assigned["points"]) == 3


@pytest.mark.parametrize("text", ["", "Q=1", "X=200,Y=0", "X=1e99", "<b>"])
def test_points_that_measure_nothing_draw_nothing(text):
    state = measuring(start=text, end="X=200,Y=0").store.state
    assert "/measured/actual" not in draw_surroundings(LIVE.evaluate(state))


def test_without_errors_the_worst_point_says_so():
    part = lone_part(WorstPanel)
    picture = LIVE.evaluate(START.zeroed())
    assert part.heading(picture) == "Worst point"
    assert "No errors: every point is at its nominal position." in part.body(picture)
    assert part.heading(LIVE.evaluate(START)) == "Worst point: 51.7 µm"
