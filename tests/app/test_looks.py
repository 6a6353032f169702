"""From a state to a picture: field, views, slices, machine, traces, colours, camera, room."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import MagicMock, Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glb import opened, values
from warpspace.app.drawing.around import arrows
from warpspace.app.drawing.box import LIMIT_NODES, BoxLayer, limit_shapes
from warpspace.app.drawing.camera import VIEWS, clipping, fit_camera
from warpspace.app.drawing.moving import ghost_machine, machine
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation import machine_bodies
from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.geometry.surfaces import isoline_levels
from warpspace.picture.map_mesh import isoline_labels
from warpspace.scene.library import load_scene
from warpspace.scene.model import evaluate

SCENE = load_scene("dvf5000_first")
START = start_state(SCENE)
LIVE = LiveModel()


@pytest.fixture(scope="module")
def picture():
    return LIVE.evaluate(START)


@pytest.mark.parametrize("factor", [1.0, 250.0])
def test_errors_are_drawn_with_the_factor_that_is_set(picture, factor):
    drawn = LIVE.evaluate(replace(START, exaggeration=factor))
    shift = drawn.drawn_mm - drawn.grid.nominal_mm
    np.testing.assert_allclose(shift, factor * 1e-3 * picture.field.error_um, atol=1e-9)


def test_traces_that_no_error_moves_are_not_drawn():
    assert LIVE.evaluate(START).traces
    assert LIVE.evaluate(START).moved_traces == {}
    moved = LIVE.evaluate(replace(START.with_amplitude("EXC", 2.0), nodes=3))
    assert set(moved.moved_traces) == {
        *(f"C at B {b}°, point (275, 0, 0) mm" for b in ("−30", "0", "30")),
        "B at C 0°, point (275, 0, 0) mm",
        *(f"C at B {b}°, point (0, 275, 450) mm" for b in ("−30", "0", "30")),
        "B at C 0°, point (0, 275, 450) mm",
    }
    assert machine_bodies.chosen_trace(moved) == "C at B 0°, point (275, 0, 0) mm"
    hidden = replace(moved.state, shown=replace(moved.state.shown, traces=False))
    assert LIVE.evaluate(hidden).moved_traces == {}


def test_kept_results_are_dropped_oldest_first():
    kept, built = Cache[str](10), list[str]()
    for name in "abacb":
        kept.get(name, lambda name=name: built.append(name) or name, lambda _: 5)
    assert built == ["a", "b", "c", "b"]


def looking(**changes):
    return replace(START, look=replace(START.look, **changes))


def test_cut_octant_opens_the_corner_towards_the_operator():
    picture = LIVE.evaluate(looking(surface="cut"))
    nodes = picture.grid.nominal_mm.reshape(-1, 3)[picture.topology.surface.nodes]
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    right_front_top, middle = np.array([high[0], low[1], high[2]]), (low + high) / 2.0
    away = [np.linalg.norm(nodes - at, axis=-1).min() for at in (right_front_top, middle)]
    assert away[0] > 150.0
    assert away[1] < 1e-9


def test_slices_lie_where_they_are_put_and_have_the_models_errors():
    places = {"X": 100.0, "Y": -50.5, "Z": -100.0}
    picture = LIVE.evaluate(looking(surface="slices", slices_mm=places))
    assert {part.axis: part.position_mm for part in picture.slices} == places
    for part in picture.slices:
        at = {k: np.broadcast_to(v, part.grid.shape) for k, v in part.grid.coordinates.items()}
        direct = evaluate(SCENE, at=at)
        assert part.values == pytest.approx(direct.norm_um, abs=1e-6)
        expected = direct.nominal_mm + picture.exaggeration * 1e-3 * direct.error_um
        assert part.drawn_mm == pytest.approx(expected, abs=1e-6)


def test_colour_ranges():
    fixed = LIVE.evaluate(replace(looking(range_mode="fixed", range_top=33.0), component="x")).scale
    assert (fixed.low, fixed.high, fixed.diverging) == (-33.0, 33.0, True)
    # one range for all components, however little of the errors is left
    less = {key: value / 10.0 for key, value in START.amplitudes.items()}
    tops = {
        LIVE.evaluate(replace(looking(range_mode="shared"), component=c, amplitudes=a)).scale.high
        for c in ("norm", "x", "y", "z")
        for a in (START.amplitudes, less)
    }
    assert len(tops) <= 2  # round ends of the signed and the unsigned scale
    auto = LIVE.evaluate(replace(START, amplitudes=less)).scale.high
    assert auto < 0.2 * min(tops)


def test_tool_point_lies_in_the_deformed_grid_and_the_tool_ends_in_it():
    state = put(START, "machine.shown", "1")
    for axis, node in (("X", 5), ("Y", 12), ("Z", 17)):
        low, high = SCENE.workspace.ranges[axis]
        state = put(state, f"machine.linear_mm.{axis}", repr(low + node * (high - low) / 20.0))
    picture = LIVE.evaluate(state)
    drawn_mm, error_um = machine_bodies.tool_point(picture)
    assert drawn_mm == pytest.approx(picture.drawn_mm[5, 12, 17], abs=1e-9)
    assert np.linalg.norm(error_um) == pytest.approx(picture.values[5, 12, 17], abs=1e-9)
    tool = next(part for part in machine_bodies.drawn_bodies(picture) if part.body.name == "t_tool")
    tip = tool.vertices_mm[np.argmin(tool.body.vertices_mm[:, 2])]
    assert np.linalg.norm(tip - drawn_mm) < 9.0  # the rim of the tool's end, 8 mm


def seen(pose, points):
    """Where points are in a picture: to the right and up, in halves of its height, and how deep."""
    sight = np.subtract(pose.position, pose.look_at)
    back = sight / np.linalg.norm(sight)
    right = np.cross((0, 0, 1), back) / np.linalg.norm(np.cross((0, 0, 1), back))
    away = SCENE_PER_MM * points - pose.position
    depth = -(away @ back)
    half = depth * np.tan(pose.fov_rad / 2.0)
    return away @ right / half, away @ np.cross(back, right) / half, depth, back


def test_played_points_stay_on_their_circles():
    assert machine_bodies.played_axis(START) == "C"
    (lines, *_) = LIVE.evaluate(START).traces
    turned = [number for number, trace in enumerate(lines.group.traces) if trace.axis == "C"]
    for points, of_lines in zip(
        machine_bodies.points_on_traces(LIVE.evaluate(START), {"C": 90.0}),
        (lines.nominal_mm, lines.actual_mm),
        strict=True,
    ):
        quarter = (of_lines.shape[1] - 1) // 4  # of the turn
        np.testing.assert_allclose(points, of_lines[turned, quarter], atol=1e-9)


@given(
    st.sampled_from([*VIEWS]),
    st.booleans(),
    st.floats(min_value=0.3, max_value=4.0),
    st.tuples(*[st.floats(min_value=0.0, max_value=most) for most in (0.45, 0.3, 0.4)]),
    st.lists(st.tuples(*[st.floats(min_value=-500, max_value=500)] * 3), min_size=2, max_size=12),
)
def test_named_views_show_every_point_beside_what_is_written(view, far, aspect, edges, points):
    box = np.diag([600.0, 600.0, 600.0])  # as wide as deep: what is a line to the eye has no size
    spread, fov = np.concatenate([points, box, -box]), 3.0 if far else 22.0
    right, top, bottom = edges
    pose = fit_camera(spread, aspect, VIEWS[view], fov, margins=(0.1, right, top, bottom))
    x, y, depth, back = seen(pose, spread)
    assert back == pytest.approx(np.array(VIEWS[view]) / np.linalg.norm(VIEWS[view]), abs=1e-9)
    assert x.min() >= (-1.02 + 2 * 0.1) * aspect
    assert x.max() <= (1.02 - 2 * right) * aspect
    assert y.min() >= -1.02 + 2 * bottom
    assert y.max() <= 1.02 - 2 * top
    near, farthest = clipping(pose.position, SCENE_PER_MM * spread, orthographic=far)
    assert near < depth.min() <= depth.max() < farthest


def test_arrows_run_from_foot_to_tip_and_shrink_to_a_point():
    foot = np.array([[1.0, 2.0, 3.0], [5.0, 5.0, 5.0], [0.0, 0.0, 0.0]])
    tip = foot + np.array([[30.0, 0.0, 0.0], [0.1, 0.2, 0.0], [0.0, 0.0, 0.0]])
    found = arrows(foot, tip, 10.0).reshape(-1, 3, 2, 3)  # shafts, and strokes of heads
    np.testing.assert_array_equal(found[0], np.stack([foot, tip], axis=1))
    assert (found[1:, :, 1] == tip).all()
    length, back = (np.linalg.norm(tip - at, axis=-1) for at in (foot, found[1:, :, 0]))
    assert back[:, 0] == pytest.approx(np.hypot(10.0, 3.0))
    assert (back[:, 1] < length[1]).all()
    assert (found[:, 2] == 0.0).all()


def test_labels_of_isolines_stand_on_lines_of_their_value():
    picture = LIVE.evaluate(replace(START, nodes=9))
    labels = isoline_labels(picture)
    assert {label.value for label in labels} <= set(isoline_levels(picture.scale))
    assert len({label.value for label in labels}) >= 3
    low, high = picture.grid.bounds_mm
    seen: set[tuple[float, ...]] = set()
    for label in labels:
        # the field there, computed from the nodes around it: the nominal point by undoing the bend
        nearest = np.linalg.norm(picture.drawn_mm - label.at_mm, axis=-1)
        index = np.unravel_index(np.argsort(nearest, axis=None)[:8], picture.shape)
        assert picture.values[index].min() - 3.0 <= label.value <= picture.values[index].max() + 3.0
        face = (*label.outward, label.value)
        assert face not in seen
        seen.add(face)
        axis = int(np.abs(label.outward).argmax())
        side = high if label.outward[axis] > 0 else low
        assert abs(label.at_mm[axis] - side[axis]) < 0.12 * picture.size_mm


def test_a_drag_sends_points_and_colours_only():
    scripts: list[str] = []
    layer = BoxLayer(MagicMock(), Mock(run_script=scripts.append), LIVE.evaluate(START))
    for value in (3.0, 6.0, 9.0):
        layer.show(LIVE.evaluate(START.with_amplitude("EAY", value)))
    assert [script.partition("(")[0] for script in scripts] == [
        "warpspaceMesh.open", *["warpspaceMesh.bend"] * 3
    ]  # fmt: skip
    assert max(map(len, scripts[1:])) < 60_000


@pytest.mark.parametrize("surface", ["surface", "cut", "slices"])
def test_the_surface_is_hatched_where_the_error_is_above_the_limit(surface):
    start = replace(START, nodes=9)
    assert limit_shapes(LIVE.evaluate(start)) == {}  # no limit is set
    limited = put(put(start, "look.surface", surface), "specification.limit_um", "30")
    picture = LIVE.evaluate(limited)
    line, hatching = (limit_shapes(picture)[name].assigned["points"] for name in LIMIT_NODES)
    nodes = np.concatenate([part.drawn_mm.reshape(-1, 3) for part in picture.slices or [picture]])
    values = np.concatenate([part.values.ravel() for part in picture.slices or [picture]])
    at_line, at_hatching = (
        values[np.linalg.norm(nodes[:, None] - points.mean(axis=1), axis=-1).argmin(axis=0)]
        for points in (line, hatching)
    )
    assert np.abs(at_line - 30.0).max() < 4.0  # of the node next to it
    assert at_hatching.min() > 26.0
    for path, value in (("look.pass_fail", "1"), ("component", "x"), ("look.drawing", "rotary"),
                        ("look.surface", "grid"), ("look.quantity", "orientation")):  # fmt: skip
        assert limit_shapes(LIVE.evaluate(put(limited, path, value))) == {}


class _Scene:
    """A scene of viser that has nodes, and no page."""

    def __getattr__(self, _):
        return lambda *_, **__: SimpleNamespace(visible=True)


def test_the_hatching_does_not_follow_a_drag():
    pictures = [
        LIVE.evaluate(put(put(START, "specification.limit_um", "30"), "amplitudes.EA0Z", value))
        for value in ("33.9", "36", "38")
    ]
    page = SimpleNamespace(run_script=lambda _: None)
    layer = BoxLayer(_Scene(), page, pictures[0])
    drawn = layer._nodes._drawn

    def are_visible():
        return {drawn[name][0].visible for name in LIMIT_NODES}

    assert are_visible() == {True}
    for picture in pictures[1:]:
        layer.show(picture)
        assert are_visible() == {False}
    layer.synchronise(pictures[-1])
    assert are_visible() == {True}
    points = limit_shapes(pictures[-1])[LIMIT_NODES[0]].assigned["points"]
    assert np.array_equal(drawn[LIMIT_NODES[0]][0].points, points)


def test_only_bodies_that_move_are_sent_again_and_the_ghost_is_small():
    picture = LIVE.evaluate(put(START, "machine.shown", "1"))
    still, again, turned = (machine(picture, at) for at in ({}, {}, {"C": 30.0}))
    assert {"/machine/R_bed", "/machine/C_table", "/machine/C_table_lines"} < still.keys()

    def changed(shapes):
        return {
            name
            for name, node in still.items()
            if "glb_data" in node.assigned
            and node.assigned["glb_data"] is not shapes[name].assigned["glb_data"]
        }

    assert changed(again) == set()
    assert changed(turned) == {"/machine/C_table"}
    ghost = ghost_machine(LIVE.evaluate(START))["/ghost_machine"]
    assert len(ghost.assigned["glb_data"]) < 93_000, "1.1 × its plain meshes and edges"


def test_the_shadow_lies_on_the_floor_and_fades_out_beyond_the_machine():
    picture = LIVE.evaluate(put(START, "machine.shown", "1"))
    data = machine(picture, {})["/machine/shadow"].assigned["glb_data"]
    attributes = opened(data)[0]["meshes"][0]["primitives"][0]["attributes"]
    points, colours = (values(data, attributes[name]) for name in ("POSITION", "COLOR_0"))
    vertices = np.concatenate([part.nominal_mm for part in machine_bodies.drawn_bodies(picture)])
    np.testing.assert_allclose(points[:, 2], vertices[:, 2].min(), atol=0.1)
    bed = next(p for p in machine_bodies.drawn_bodies(picture) if p.body.name == "R_bed").nominal_mm
    within = ((points > bed.min(axis=0)) & (points < bed.max(axis=0)))[:, :2].all(axis=1)
    assert (points[:, :2].min(axis=0) < bed[:, :2].min(axis=0) - 100.0).all()
    assert colours[within, 3].min() > colours[~within, 3].max()
    rim = (points[:, 0] == points[:, 0].min()) | (points[:, 1] == points[:, 1].max())
    np.testing.assert_allclose(colours[rim, 3], 0.0, atol=1e-6)


def test_the_arm_of_a_robot_is_not_hidden_by_the_volume_around_it():
    assert start_state(load_scene("ur10")).look.surface == "grid"
    assert start_state(load_scene("machine_scara")).look.surface == "surface"
