"""Whatever scene `check` accepts: it is evaluated, laid out, described and exported, all finite."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
import viser
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import glb
from app.parts import lone_part
from random_scenes import scenes
from warpspace import to_pyvista
from warpspace.app.documents import legend
from warpspace.app.drawing.around import draw_labels, draw_surroundings
from warpspace.app.drawing.box import box, ghost_dashes
from warpspace.app.drawing.camera import VIEWS, fit_camera
from warpspace.app.drawing.labels import axes_room_mm
from warpspace.app.drawing.moving import machine
from warpspace.app.drawing.shapes import Nodes
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.point_explanation import pick, with_picked
from warpspace.app.panels.conventions import ConventionsSection
from warpspace.app.panels.explanation import WorstPanel
from warpspace.app.panels.machine_editor import RotarySection
from warpspace.app.state.app_state import Picked, start_state
from warpspace.app.state.look import QUANTITIES, SURFACES
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear
from warpspace.outputs.exports.fields import build_vts
from warpspace.outputs.exports.meshes import build_glb
from warpspace.picture.map_mesh import edge_pieces, grid_pieces, isoline_pieces, line_mesh, map_mesh
from warpspace.picture.model import evaluate_picture

SLOW = settings(
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
SIDE_NODES = 3
EXAMPLES = settings.default.max_examples  # of the profile


@pytest.fixture(scope="module")
def server():
    """A server that nobody looks at; what is drawn replaces what was drawn before."""
    running = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield running
    running.stop()


@st.composite
def states(draw):
    state = replace(start_state(draw(scenes())), nodes=SIDE_NODES)
    surface, quantity = draw(st.sampled_from([*SURFACES])), draw(st.sampled_from([*QUANTITIES]))
    look = replace(state.look, surface=surface, quantity=quantity, isolines=True, arrows=True)
    loop, component = draw(st.sampled_from(Loop)), draw(st.sampled_from(("norm", "z")))
    shown = replace(state.machine, shown=draw(st.booleans()))
    state = replace(state, look=look, loop=loop, component=component, machine=shown)
    if draw(st.booleans()):
        pinned = with_pin(state)
        shown = draw(st.sampled_from(("a", "b", "difference")))
        state = replace(pinned, comparison=replace(pinned.comparison, shown=shown, ghost=True))
    return state


@settings(SLOW, max_examples=min(60, EXAMPLES))
@given(state=states())
def test_every_state_has_a_finite_picture(server, state):
    picture = LiveModel().evaluate(state)
    _check_finite(picture)
    shapes = box(picture) | draw_surroundings(picture) | draw_labels(picture)
    Nodes(server.scene).draw(shapes | machine(picture, {}))
    for view in VIEWS.values():
        place = fit_camera(axes_room_mm(picture), 1.6, view)
        assert np.isfinite(place.position).all()
        assert math.dist(place.position, place.look_at) > 0.0


def _check_finite(picture):
    assert math.isfinite(picture.exaggeration)
    assert picture.size_mm > 0.0
    for field in fields(picture.statistics):
        value = getattr(picture.statistics, field.name)
        numbers = list(value.values()) if isinstance(value, dict) else value
        assert np.isfinite(numbers).all(), field.name
    for mesh in (map_mesh(picture), line_mesh(picture)):
        assert len(mesh.vertices_mm) > 1
        assert len(mesh.triangles) > 0
        assert np.isfinite(mesh.vertices_mm).all()
        assert np.isfinite(mesh.values).all()
    for build in (grid_pieces, edge_pieces, isoline_pieces, ghost_dashes):
        pieces = build(picture)
        assert pieces.shape[1:] == (2, 3)
        assert np.isfinite(pieces).all()


@settings(SLOW, max_examples=min(25, EXAMPLES))
@given(state=states())
def test_every_panel_has_words_for_it(state):
    picture = LiveModel().evaluate(state)
    at = {name: 0.0 for name in state.scene.machine.axes if is_linear(name)}
    asked = replace(picture, state=with_picked(state, Picked(at)))
    said = [
        legend.legend_html(picture),
        legend.numbers_words(picture),
        legend.within_limit_words(picture)[0],
        *legend.subject_words(picture),
        lone_part(RotarySection).body(picture),
        lone_part(ConventionsSection).body(picture),
        *WorstPanel(None).render(asked).values(),
    ]
    for html in said:
        assert not {"nan", "inf"} & set(html.replace("<", " ").replace(">", " ").split())


@settings(SLOW, max_examples=min(25, EXAMPLES))
@given(scene=scenes())
def test_what_is_drawn_can_be_picked(scene):
    state = replace(start_state(scene), nodes=SIDE_NODES)
    picture = LiveModel().evaluate(state)
    mesh = map_mesh(picture)
    middle = mesh.vertices_mm[mesh.triangles[0]].mean(axis=0)
    eye = middle + 20.0 * picture.size_mm * np.array([0.3, -0.8, 0.5])
    found = pick(picture, eye, middle - eye)
    assert found is not None
    assert LiveModel().evaluate(with_picked(state, found[0])).state.picked == found[0]


@settings(SLOW, max_examples=min(15, EXAMPLES))
@given(scene=scenes())
def test_every_scene_is_exported(scene):
    picture = evaluate_picture(scene, grid=SIDE_NODES)
    assert glb.opened(build_glb(picture))[0]["meshes"]
    assert build_vts(picture)
    blocks = to_pyvista(scene, grid=SIDE_NODES)
    assert np.isfinite(blocks["surface"].points).all()
    assert blocks["surface"].n_cells > 0
