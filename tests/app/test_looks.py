"""Views, machine and traces as numbers, without a browser."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine import drawn_bodies, machine_room_mm, tool_point
from warpspace.app.evaluation.rotation import played_axis, played_position, points_on_traces
from warpspace.app.readouts.circles import circle_rows, circle_table
from warpspace.app.state.app_state import start_state
from warpspace.app.state.look import (
    SURFACES,
    Look,
    default_held,
    linear_positions,
    linear_spans,
    parse_positions,
    quarters,
    slice_positions,
    slice_spans,
)
from warpspace.app.state.ranges import Span
from warpspace.app.viewport.layers.annotations import carries_worst
from warpspace.app.viewport.named_views import VIEWS, CameraSetup, change_lens, clipping, view_pose
from warpspace.app.viewport.rotation_player import Player
from warpspace.geometry.surfaces import box_edges, outer_surface, segments
from warpspace.picture.marks import corner_arrows, worst_point
from warpspace.picture.mesh import (
    edge_pieces,
    grid_pieces,
    isoline_pieces,
    line_mesh,
    map_mesh,
)
from warpspace.picture.topology import topology
from warpspace.scene.library import load_scene
from warpspace.scene.pipeline import evaluate

LIVE = LiveModel()
SCENE = load_scene("dvf5000_first")
START = start_state(SCENE)


def looking(**changes):
    return replace(START, look=replace(START.look, **changes))


def test_whole_surface_is_the_outer_surface_with_its_edges():
    found, plain = topology((5, 7, 3)), outer_surface((5, 7, 3))
    assert np.array_equal(found.surface.nodes, plain.nodes)
    assert {frozenset(t) for t in found.surface.triangles.tolist()} == {
        frozenset(t) for t in plain.triangles.tolist()
    }
    edges = segments(box_edges((5, 7, 3)))
    assert {frozenset(e) for e in found.edge_segments.tolist()} == {
        frozenset(e) for e in edges.tolist()
    }
    at_corner = found.edge_outwards[found.edge_segments == 0]
    assert len(at_corner) == 3
    assert (at_corner == -1).all()


def test_cut_octant_opens_the_corner_towards_the_operator():
    picture = LIVE.evaluate(looking(surface="cut"))
    nodes = picture.grid.nominal_mm.reshape(-1, 3)[picture.topology.surface.nodes]
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    right_front_top = np.array([high[0], low[1], high[2]])
    assert np.linalg.norm(nodes - right_front_top, axis=-1).min() > 150.0
    middle = (low + high) / 2.0
    assert np.linalg.norm(nodes - middle, axis=-1).min() < 1e-9


@pytest.mark.parametrize("surface", SURFACES)
def test_every_way_of_drawing_stays_within_the_model(surface):
    picture = LIVE.evaluate(looking(surface=surface))
    mesh = line_mesh(picture) if surface == "grid" else map_mesh(picture)
    assert mesh.triangles.max() == len(mesh.vertices_mm) - 1 == len(mesh.values) - 1
    for pieces in (grid_pieces(picture), edge_pieces(picture), isoline_pieces(picture)):
        assert len(pieces) > 10
        near = np.linalg.norm(pieces[:, 0] - pieces[:, 1], axis=-1)
        assert near.max() < 60.0


def test_slices_lie_where_they_are_put_and_have_the_models_errors():
    state = looking(surface="slices", slices_mm={"X": 100.0, "Y": -50.5, "Z": -100.0})
    picture = LIVE.evaluate(state)
    assert {part.axis: part.position_mm for part in picture.slices} == {
        "X": 100.0, "Y": -50.5, "Z": -100.0,
    }  # fmt: skip
    for part in picture.slices:
        at = {k: np.broadcast_to(v, part.grid.shape) for k, v in part.grid.coordinates.items()}
        direct = evaluate(SCENE, at=at)
        assert part.values == pytest.approx(direct.norm_um, abs=1e-6)
        expected = direct.nominal_mm + picture.exaggeration * 1e-3 * direct.error_um
        assert part.drawn_mm == pytest.approx(expected, abs=1e-6)


def test_slices_follow_the_tool_point():
    state = looking(surface="slices", follow=True)
    machine = state.machine.with_linear("X", 120.0, linear_spans(SCENE)["X"])
    at = slice_positions(SCENE, state.look, machine)
    assert at == {"X": 120.0, "Y": 0.0, "Z": -280.0}


@pytest.mark.parametrize("value", [float("nan"), 1e9, -1e9, float("inf")])
def test_wild_numbers_are_brought_into_their_ranges(value):
    look = Look().with_slice("X", value, slice_spans(SCENE)["X"]).with_top(value)
    assert -275.0 <= look.slices_mm["X"] <= 275.0
    assert 0.001 <= look.range_top <= 1e6
    machine = START.machine.with_linear("Z", value, linear_spans(SCENE)["Z"])
    assert -480.0 <= linear_positions(SCENE, machine)["Z"] <= 0.0
    own = START.rotary.with_own((value, value, value)).own_mm
    assert own is not None
    assert np.abs(own).max() <= 2000.0


def test_unknown_words_change_nothing():
    assert Look().with_choice(surface="x", quantity="y", range_mode="z") == Look()


def test_tilt_is_coloured_in_microradians():
    picture = LIVE.evaluate(looking(quantity="orientation"))
    assert (picture.scale.label, picture.scale.unit) == ("|φ|", "µrad")
    assert picture.values == pytest.approx(np.linalg.norm(picture.field.orientation_urad, axis=-1))
    assert picture.statistics.max_um == LIVE.evaluate(START).statistics.max_um


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
    scene = load_scene("dvf5000_first")
    grid_state = start_state(scene)
    spans = linear_spans(scene)
    machine = grid_state.machine.switched(shown=True)
    for axis, node in (("X", 5), ("Y", 12), ("Z", 17)):
        low, high = scene.workspace.ranges[axis]
        machine = machine.with_linear(axis, low + node * (high - low) / 20.0, spans[axis])
    picture = LIVE.evaluate(replace(grid_state, machine=machine))
    found = tool_point(picture)
    assert found.drawn_mm == pytest.approx(picture.drawn_mm[5, 12, 17], abs=1e-9)
    assert found.value == pytest.approx(picture.values[5, 12, 17], abs=1e-9)
    tool = next(part for part in drawn_bodies(picture) if part.body.name == "t_tool")
    tip = tool.vertices_mm[np.argmin(tool.body.vertices_mm[:, 2])]
    assert np.linalg.norm(tip - found.drawn_mm) < 9.0  # the rim of the tool's end, 8 mm


def test_bodies_move_with_their_axes_and_bend_only_where_chosen():
    def vertices(**machine):
        state = replace(START, machine=replace(START.machine, shown=True, **machine))
        return {p.body.name: p.vertices_mm for p in drawn_bodies(LIVE.evaluate(state))}

    still = vertices(bent=False)
    moved = vertices(bent=False, linear_mm={"X": 100.0})
    for name in ("X_saddle", "Y_saddle", "Z_ram", "S_spindle", "t_tool"):
        assert moved[name] - still[name] == pytest.approx(
            np.broadcast_to((100.0, 0, 0), still[name].shape)
        )
    for name in ("R_bed", "R_column", "B_cradle", "C_table"):
        assert np.array_equal(moved[name], still[name])
    bent = vertices(bent=True)
    assert np.abs(bent["t_tool"] - still["t_tool"]).max() > 1.0
    assert np.array_equal(bent["R_bed"], still["R_bed"])
    room = machine_room_mm(LIVE.evaluate(START))
    assert np.ptp(room, axis=0).min() > 1000.0


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("orthographic", [False, True])
def test_named_views_show_everything_from_their_side(view, orthographic):
    points = np.random.default_rng(1).uniform((-3, -2, -1), (3, 2, 4), (50, 3))
    stand = CameraSetup(view, orthographic)
    pose = view_pose(points, 1.5, stand)
    back = pose.position - pose.look_at
    back /= np.linalg.norm(back)
    wanted = np.array(VIEWS[view]) / np.linalg.norm(VIEWS[view])
    assert back == pytest.approx(wanted, abs=1e-9)
    right = np.cross((0, 0, 1), back) / np.linalg.norm(np.cross((0, 0, 1), back))
    up = np.cross(back, right)
    seen = points - pose.position
    depth = -(seen @ back)
    half = np.tan(pose.fov_rad / 2.0)
    assert np.abs(seen @ up / depth).max() <= half
    assert np.abs(seen @ right / depth).max() <= 1.5 * half
    near, far = clipping(pose.position, points, orthographic=orthographic)
    assert near < depth.min() < depth.max() < far


def test_telephoto_keeps_what_is_looked_at_as_large():
    at, eye = np.array([1.0, 2.0, 3.0]), np.array([5.0, -6.0, 7.0])
    there = change_lens(eye, at, 0.4, 0.05)
    before = np.linalg.norm(eye - at) * np.tan(0.2)
    assert np.linalg.norm(there - at) * np.tan(0.025) == pytest.approx(before)
    assert change_lens(there, at, 0.05, 0.4) == pytest.approx(eye)


@pytest.mark.parametrize(
    ("text", "kept", "noted"),
    [
        ("", (), False),
        ("−30, 0; 30°", (-30.0, 0.0, 30.0), False),
        ("30 30 0", (0.0, 30.0), False),
        ("10, abc", (10.0,), True),
        ("500 nan inf", (), True),
        ("-", (), False),
        (" ".join(map(str, range(20))), tuple(map(float, range(8))), True),
    ],
)
def test_positions_are_read_as_people_type_them(text, kept, noted):
    found, note = parse_positions(text, Span(-120.0, 30.0, 1.0))
    assert found == kept
    assert bool(note) == noted


def test_traces_run_over_c_at_several_b_and_over_b_at_several_c():
    assert default_held(SCENE, START.rotary, {"B": 0.0, "C": 0.0}) == {
        "C": (0.0,), "B": (-30.0, 0.0, 30.0),
    }  # fmt: skip
    assert quarters(SCENE, "C") == (0.0, 90.0, 180.0, 270.0)
    rotary = START.rotary.with_held("C", (0.0, 90.0, 180.0)).with_held("B", (-60.0, 15.0))
    rows = circle_rows(LIVE.evaluate(replace(START, rotary=rotary.with_point(1, on=False))))
    assert [(row.trace.axis, *row.trace.at.items()) for row in rows] == [
        ("B", ("C", 0.0)), ("B", ("C", 90.0)), ("B", ("C", 180.0)),
        ("C", ("B", -60.0)), ("C", ("B", 15.0)),
    ]  # fmt: skip


def test_circle_numbers_are_those_of_a_tilted_axis():
    scene = load_scene("teach_tilted_c")
    state = replace(start_state(scene), rotary=START.rotary.with_own((100.0, 0.0, 50.0)))
    rows = [row for row in circle_rows(LIVE.evaluate(state)) if row.trace.axis == "C"]
    tilts = [row.deviation.tilt_urad for row in rows if row.deviation]
    wanted = np.hypot(scene.errors.amplitude("EA0C"), scene.errors.amplitude("EB0C"))
    assert tilts == pytest.approx([wanted] * len(tilts), rel=1e-6)
    text = circle_table(rows)
    for words in ("µrad", "µm", "C at B −30°", "point (100, 0, 50) mm"):
        assert words in text


def test_point_on_its_axis_has_no_circle():
    state = replace(START, rotary=START.rotary.with_own((0.0, 0.0, 80.0)))
    rows = circle_rows(LIVE.evaluate(state))
    assert any(row.deviation is None for row in rows)
    assert "on the axis" in circle_table(rows)


def test_played_points_stay_on_their_circles():
    picture = LIVE.evaluate(START)
    assert played_axis(START) == "C"
    assert played_position(START, 90.0) == {"C": 90.0}
    assert played_position(START.with_position("C", 350.0), 20.0) == {"C": 10.0}
    nominal, actual = points_on_traces(picture, {"C": 90.0})
    traces = [t for t in picture.traces[0].group.traces if t.axis == "C"]
    assert nominal.shape == actual.shape == (len(traces), 3)
    for trace, point in zip(traces, nominal, strict=True):
        # on the table a point is turned against the machine: Ry(B)·Rz(90°)
        x, y, z = trace.point_mm
        tilt = np.deg2rad(trace.at["B"])
        about = np.array([-y, x, z - 50.0])
        turned = [
            about[0] * np.cos(tilt) + about[2] * np.sin(tilt),
            about[1],
            50.0 - about[0] * np.sin(tilt) + about[2] * np.cos(tilt),
        ]
        assert point == pytest.approx(turned, abs=1e-6)


def test_player_turns_pauses_and_rewinds():
    asked = threading.Event()
    player = Player(asked.set)
    player.play()
    player.play()
    assert asked.wait(2.0)
    player.pause()
    angle = player.angle_deg
    assert 0.0 < angle < 60.0
    asked.clear()
    assert not asked.wait(0.4)
    assert player.angle_deg == angle
    assert player.rewind()
    assert not player.rewind()
    assert not player.playing
    time.sleep(0.2)
    assert not [t for t in threading.enumerate() if t.name == "warpspace-rotation"]


@pytest.mark.parametrize("name", ["teach_squareness", "dvf5000_nominal", "teach_wobbling_table"])
def test_other_scenes_can_be_looked_at_in_every_way(name):
    state = start_state(load_scene(name))
    for surface in SURFACES:
        picture = LIVE.evaluate(replace(state, look=replace(state.look, surface=surface)))
        assert np.isfinite(map_mesh(picture).vertices_mm).all()
        isoline_pieces(picture)
        tool_point(picture)
    assert np.isfinite(LIVE.evaluate(state.with_scene(SCENE)).drawn_mm).all()


@pytest.mark.parametrize(
    ("changes", "component", "hidden"),
    [
        ({}, "norm", 1),
        ({"worst": False}, "norm", 0),
        ({"quantity": "orientation"}, "norm", 0),  # the mark then says µrad
        ({}, "z", 0),
    ],
)
def test_a_corner_is_silent_only_where_the_worst_point_says_its_number(changes, component, hidden):
    picture = LIVE.evaluate(looking(arrows=True, **changes).with_component(component))
    grid = picture.grid
    arrows = corner_arrows(
        grid.shape, grid.nominal_mm, picture.field.error_um, picture.exaggeration
    )
    worst = worst_point(picture.values, grid.nominal_mm, picture.drawn_mm)
    silent = carries_worst(picture, arrows, worst)
    assert silent.sum() == hidden
    assert (arrows.norm_um[silent] == picture.statistics.max_um).all()
