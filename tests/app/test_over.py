"""What lies over the drawing: heading, limit, colours, axes, labels, controls, a comparison."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import warpspace
from app.parts import LIVE, Alone, lone_part, section, wait
from warpspace.app.browser import actions as do
from warpspace.app.documents.legend import (
    largest_words,
    legend_html,
    marked,
    marks,
    place_words,
    ticks,
    within_limit_words,
)
from warpspace.app.drawing.box import box, only_bent
from warpspace.app.drawing.colours import colour_levels
from warpspace.app.drawing.labels import axes, point_labels
from warpspace.app.evaluation.compare import pinned_side, scene_side, with_pin, with_sides
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.design import SAMPLES, TolerancesPanel
from warpspace.app.panels.error_list import ErrorsPanel
from warpspace.app.panels.file_dialogs import ReportDialog
from warpspace.app.panels.overlay import (
    ComparePanel,
    ControlsPanel,
    HeadPanel,
    LegendPanel,
    OrderPanel,
    cause_words,
    chosen_map,
)
from warpspace.app.state.app_state import NOBODY, Side, start_state
from warpspace.app.state.tree import put
from warpspace.exceptions import SceneError
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.geometry.surfaces import deform
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ToleranceSet
from warpspace.picture.map_mesh import map_mesh
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.scene_writer import scene_to_toml

FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=9)


def limited(limit_um):
    return put(START, "specification.limit_um", str(limit_um))


def pieces(kind, state):
    part = lone_part(kind)
    part.context.scenes, part.context.camera = {}, SimpleNamespace(view="iso", orthographic=False)
    return part.render(LIVE.evaluate(state))


def test_the_heading_says_what_machines_within_tolerance_reach():
    none = replace(START, tolerances=ToleranceSet())
    largest = warpspace.montecarlo(FIRST, samples=SAMPLES, over="max").max_um
    words = pieces(OrderPanel, START)["head.allowed"]
    assert f"tolerances: {largest:.1f} µm sampled, 299.6 µm worst case" in words
    assert not pieces(OrderPanel, none)["head.allowed"]


@pytest.mark.parametrize(("limit", "kept"), [(51.0, False), (52.0, True), (1.0, False)])
def test_the_limit_is_kept_only_where_the_largest_error_keeps_it(limit, kept):
    words, kind = within_limit_words(LIVE.evaluate(limited(limit)))
    assert kind == ("ws-pass" if kept else "ws-fail")
    assert words.startswith("all of") is kept
    assert "100" not in words


def test_pass_and_fail_are_two_colours_told_apart_by_the_limit():
    state = limited(40.0)
    picture = LIVE.evaluate(put(state, "look.pass_fail", "1"))
    levels = colour_levels(picture.scale, picture.values)
    assert len(np.unique(levels)) == 2
    assert ((levels == levels.max()) == (picture.values > 40.0)).all()
    assert "linear-gradient" in legend_html(picture)
    assert 40.0 in picture.scale.ticks


def test_names_beside_the_colour_bar_keep_apart():
    for component, limit in (("norm", 51.5), ("norm", 500.0), ("x", 40.0)):
        picture = LIVE.evaluate(replace(limited(limit), component=component))
        placed = [mark.name_at for mark in marks(picture)]
        assert min(np.diff(placed)) > 0.06
        assert placed[-1] <= (1.07 if limit == 500.0 else 1.0)  # above the bar


def test_the_colour_bar_has_round_numbers_and_the_limit_as_a_mark():
    picture = LIVE.evaluate(limited(40.0))
    assert [text for text, _ in ticks(picture.scale)] == ["0", "20", "40", "60"]
    heights = {mark.name: mark.at for mark in marks(picture)}
    assert heights["limit"] == pytest.approx(40.0 / 60.0)
    legend = legend_html(picture)
    assert "limit 40<" in legend
    assert 'class="ws-hatched" style="bottom:66.67%"' in legend
    beyond = legend_html(LIVE.evaluate(limited(85.0)))
    assert "limit 85 ↑" in beyond
    assert "ws-hatched" not in beyond
    for low, high in ((0.0, 37.0), (-12.5, 12.5), (0.0, 0.003), (0.0, 1234.0)):
        of_scale = ticks(ColourScale(low, high))
        placed = [at for _, at in of_scale]
        assert 3 <= len(of_scale) <= 8
        assert min(np.diff(placed)) > 0.07
        for text, at in of_scale:
            assert float(text.replace("−", "-")) == pytest.approx(low + at * (high - low))


def test_without_errors_nothing_overlaps():
    zero = limited(50.0).zeroed()
    nominal, bent = LIVE.evaluate(zero), LIVE.evaluate(limited(50.0))
    assert "/ghost" not in box(nominal)  # its lines would be those of the actual box
    assert "/ghost" not in box(LIVE.evaluate(replace(limited(50.0), exaggeration=1.0)))
    assert "/ghost" in box(bent)
    assert not only_bent(bent, nominal)
    assert [mark.name for mark in marks(nominal)] == ["limit"]
    assert marks(LIVE.evaluate(start_state(FIRST).zeroed())) == []
    assert place_words(nominal) == cause_words(nominal) == ""
    assert largest_words(nominal) == "No errors"


def test_the_heading_of_another_machine_does_not_name_the_cause_of_the_one_before():
    panel, late = lone_part(HeadPanel), {"head.order", "head.allowed", "head.cause"}
    second = start_state(SECOND, nodes=9)
    for state in (START, START.zeroed(), second):
        assert late <= {*panel.render(LIVE.evaluate(state))}
    moved = second.with_amplitude("EXX", 3.0)  # during a drag they stay
    assert {*panel.render(LIVE.evaluate(moved))} == {"head"}


def test_a_scene_file_carries_the_limit():
    text = scene_to_toml(replace(FIRST, limit_um=40.0))
    back = start_state(parse_scene(text, "x"))
    assert back.specification.limit_um == back.resulting_scene().limit_um == 40.0
    assert START.resulting_scene().limit_um is None
    text = text.replace("limit_um = 40.0", "limit_um = -1")
    with pytest.raises(SceneError, match=r"view\.limit_um = -1: expected"):
        parse_scene(text, "x")


def test_a_scene_without_a_limit_is_not_judged_by_an_assumed_one():
    state = put(START, "look.pass_fail", "1")
    picture = LIVE.evaluate(state)
    assert "limit" not in marked(picture)
    assert picture.limit_um is None
    kept = pieces(LegendPanel, state)["head.kept"]
    assert ">no limit set<" in kept
    assert "ws-fail" not in kept
    assert "pass / fail" not in pieces(ControlsPanel, state)["controls"]
    dialog = ReportDialog(Alone(HeadPanel, state).context)
    assert "No limit is set." in str(dialog.body(picture))
    for name in ("allocate", "conformance"):
        panel = lone_part(TolerancesPanel if name == "allocate" else AnalysisPanel, name)
        panel.handle(state, do.Run(name))
        wait(panel)
        shown = section(panel, state)
        assert "Set a limit" in shown or "sets no limit" in shown
        # one control of the page, so that no id stands twice
        assert shown.count('id="ws-SetLeaf-specification-limit-um"') == (name == "allocate")
    # a limit that is set, or removed, is that of the scene; another scene has its own
    assert limited(40).resulting_scene().limit_um == 40.0
    assert put(limited(40), "specification.limit_um", "").resulting_scene() == FIRST
    assert limited(40).with_scene(load_scene("dvf5000_second")).specification.limit_um is None


def test_axes_are_numbered_in_positions_of_the_machine():
    picture = LIVE.evaluate(START)
    for k, axis in enumerate(axes(picture)):
        low, high = FIRST.workspace.ranges[axis.name]
        # a number lies where the nodes at that position are drawn
        nodes = np.moveaxis(picture.grid.nominal_mm, k, 0)[..., k].reshape(9, -1)[:, 0]
        for text, at in axis.ticks:
            position = float(text.replace("−", "-"))
            assert low <= position <= high
            if picture.grid.directions[k] > 0:
                expected = np.interp(position, np.linspace(low, high, 9), nodes)
                assert at[k] == pytest.approx(expected)


def test_the_worst_corner_is_labelled_once():
    picture = LIVE.evaluate(put(START, "look.arrows", "1"))
    kinds = [label.kind for label in point_labels(picture)]
    assert (kinds.count("worst"), kinds.count("corner")) == (1, 7)


def test_controls_set_what_is_coloured_and_how_the_machine_is_drawn():
    part = lone_part(ControlsPanel)
    limit = part.handle(limited(40), do.Input.COLOUR_BY("limit"))
    assert chosen_map(limit) == "limit"
    assert chosen_map(part.handle(limit, do.Input.COLOUR_BY("orientation.y"))) == "orientation.y"
    for word, drawn in (("off", (False, False)), ("ghost", (False, True)), ("solid", (True, True))):
        machine = part.handle(START, do.ShowMachine(word)).machine
        assert (machine.shown, machine.ghost) == drawn
    for kind in (do.Input.COLOUR_BY, do.Input.SET_TRAVEL):
        assert part.handle(START, kind("<script>")).scene is FIRST
    html = pieces(ControlsPanel, START)["controls"]
    assert 'id="ws-SetLeaf-look-isolines"' in html
    assert "look.surface&quot;,&quot;value&quot;:&quot;slices&quot;" in html


def test_rows_are_those_of_the_present_errors_whatever_is_drawn():
    rows = pieces(ErrorsPanel, START)
    for other in ("fork_head_bc", "teach_pitching_axis"):  # one with another chain
        compared = with_sides(START, scene_side(load_scene(other)), Side())
        compared = put(compared, "comparison.shown", "a")
        shown = pieces(ErrorsPanel, compared)
        assert f"For the present errors; the drawing shows A: {compared.comparison.a.title}." in (
            shown.pop("errors")
        )
        assert shown == {name: row for name, row in rows.items() if name != "errors"}
    present = put(compared, "comparison.shown", "b")
    assert "the drawing shows" not in pieces(ErrorsPanel, present)["errors"]


def test_comparing_is_shown_and_left_by_one_switch():
    assert pieces(ComparePanel, START)["compared"] == ""
    pinned = with_pin(START).with_amplitude("EXX", 9.0)
    html = pieces(ComparePanel, pinned)["compared"]
    assert html.count('aria-pressed="true"') == 1
    part = lone_part(ComparePanel)
    part.context.scenes = {}
    assert part.handle(pinned, do.Signal.END_COMPARISON).comparison.b is None
    assert part.handle(pinned, do.SetSide("b", NOBODY)).comparison.b is None
    assert part.handle(pinned, do.SetSide("a", "no such scene")) is pinned
    change = put(pinned, "comparison.shown", "difference")
    assert "change: mean" in pieces(HeadPanel, change)["head"]
    legend = pieces(LegendPanel, change)
    assert not legend["head.kept"]
    assert "E<sub>B</sub> − E<sub>A</sub>" in legend["legend"]


def picture_of(state, shown):
    return LIVE.evaluate(put(state, "comparison.shown", shown))


def test_a_and_b_share_colours_and_all_three_factor_and_numbers():
    state = with_sides(START, Side(), scene_side(SECOND))
    a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
    for scene, side, statistics in ((FIRST, a, a.compared.a), (SECOND, b, a.compared.b)):
        alone = LIVE.evaluate(start_state(scene, nodes=9))
        np.testing.assert_array_equal(side.field.error_um, alone.field.error_um)
        assert statistics == alone.statistics
    change = b.field.error_um - a.field.error_um
    np.testing.assert_allclose(difference.field.error_um, change, atol=1e-12)
    assert a.scale == b.scale
    assert a.exaggeration == b.exaggeration == difference.exaggeration
    assert a.compared.difference == difference.statistics
    np.testing.assert_array_equal(a.compared.other_mm, b.drawn_mm)


@pytest.mark.parametrize(("component", "label"), [("norm", "|E_B − E_A|"), ("y", "E_y, B − A")])
def test_a_change_has_colours_of_its_own(component, label):
    state = with_pin(replace(START, component=component))
    for key in ("EXX", "EYY"):
        state = state.with_amplitude(key, state.amplitudes[key] + 0.3)
    change = picture_of(state, "difference")
    largest = float(np.abs(change.values).max())
    assert change.scale.label == label
    assert largest <= change.scale.high + 1e-9
    assert change.scale.high <= 2.5 * largest < 0.1 * picture_of(state, "b").scale.high
    fixed = put(state, "look.range_top", "7.5")
    assert picture_of(fixed, "difference").scale.high == 7.5


def test_a_pinned_state_holds_no_comparison():
    twice = pinned_side(with_pin(START)).state.comparison
    assert (twice.b, twice.pinned) == (None, None)


def test_the_difference_is_cut_into_slices_evaluated_where_they_lie():
    look = replace(START.look, surface="slices", slices_mm={"X": 31.0})
    for component, quantity in (("norm", "position"), ("y", "position"), ("norm", "orientation")):
        state = replace(START, look=replace(look, quantity=quantity), component=component)
        state = with_sides(state.with_amplitude("EAX", 9.0), Side(), scene_side(SECOND))
        a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
        assert [part.axis for part in difference.slices] == [part.axis for part in a.slices]
        assert difference.slices[0].position_mm == 31.0
        for one, two, part in zip(a.slices, b.slices, difference.slices, strict=True):
            np.testing.assert_array_equal(one.grid.nominal_mm, two.grid.nominal_mm)
            error = two.field.error_um - one.field.error_um
            np.testing.assert_allclose(part.field.error_um, error, atol=1e-12)
            drawn = deform(one.grid.nominal_mm, error, difference.exaggeration)
            np.testing.assert_allclose(part.drawn_mm, drawn, atol=1e-9)
            tilts = two.field.orientation_urad - one.field.orientation_urad
            values = component_values(error if quantity == "position" else tilts, component)
            np.testing.assert_allclose(part.values, values, atol=1e-12)
        # what is drawn are the slices, on the shared scale
        mesh = map_mesh(difference)
        assert len(mesh.values) == sum(part.values.size for part in difference.slices)


@pytest.mark.parametrize(
    ("key", "cause"),
    [
        ("EA0Z", "Z is not square to Y"),
        ("EAY", "Y pitches"),
        ("ECY", "Y yaws"),
        ("EAX", "X rolls"),
        ("EYX", "X is not straight in y"),
        ("EXX", "of the positioning of X"),
        ("EA0C", "of the orientation of C about x"),
    ],
)
def test_the_cause_is_named_as_a_fault_of_the_machine(key, cause):
    assert parameter(key).cause == cause


def test_the_heading_is_a_sentence_about_the_largest_error_and_its_main_cause():
    assert "<h1>Errors up to 51.7 µm<" in pieces(HeadPanel, START)["head"]
    assert pieces(OrderPanel, START)["head.cause"] == ", mostly because Z is not square to Y"
    equal = dict.fromkeys(("EXX", "EYY", "EZZ"), 20.0)
    many = replace(START, amplitudes={**START.zeroed().amplitudes, **equal})
    assert pieces(OrderPanel, many)["head.cause"].startswith(", partly because ")
    none = START.zeroed()
    assert "<h1>No errors<" in pieces(HeadPanel, none)["head"]
    assert not pieces(OrderPanel, none)["head.cause"]
    changed = with_sides(START, Side(), scene_side(SECOND))
    difference = put(changed, "comparison.shown", "difference")
    assert "<h1>Change up to " in pieces(HeadPanel, difference)["head"]
    assert not pieces(OrderPanel, difference)["head.cause"]
