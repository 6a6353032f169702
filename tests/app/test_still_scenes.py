"""The app opens machines whose volume is a line or a point."""

from dataclasses import replace

import numpy as np
import pytest

from app.wire import OPEN, Wire, dial
from still_scenes import TEXTS, still_scene
from warpspace.app.evaluation.budget import pick
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.server import page_steps
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.layers.axes import axes_room_mm
from warpspace.picture.mesh import map_mesh, outline_pieces


def messages_until_open(viewer: Viewer) -> list[dict]:
    """Open a page that draws nothing and read what it is sent until all of it is there."""
    with dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
    return wire.messages


@pytest.mark.parametrize("name", TEXTS)
def test_a_page_opens_with_its_map_and_without_a_problem(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_steps, "ANSWER_S", 0.0)
    with Viewer(still_scene(name)) as viewer:
        found = messages_until_open(viewer)
    kinds = [message["type"] for message in found]
    assert "GlbMessage" in kinds
    assert "NotificationShowMessage" not in kinds


@pytest.mark.parametrize("name", [name for name in TEXTS if name != "only X stands still"])
def test_the_map_is_solid_coloured_by_its_nodes_and_can_be_picked(name: str) -> None:
    scene = still_scene(name)
    picture = LiveModel().evaluate(start_state(scene))
    mesh = map_mesh(picture)
    assert len(mesh.triangles) >= 12
    assert set(np.unique(mesh.values)) <= set(np.unique(picture.values))
    worst = picture.drawn_mm.reshape(-1, 3)[int(np.argmax(picture.field.norm_um))]
    eye = worst + picture.size_mm * np.array([3.0, -4.0, 2.0])
    found = pick(picture, eye, worst - eye)
    assert found is not None
    for axis, value in found.at.items():
        moves = scene.workspace.ranges[axis][0] != scene.workspace.ranges[axis][1]
        nodes = picture.grid.coordinates[axis].reshape(-1)
        step = abs(nodes[1] - nodes[0]) if moves else 1e-9
        assert np.abs(nodes - value).min() <= step


def test_the_room_of_a_point_holds_its_traces() -> None:
    picture = LiveModel().evaluate(start_state(still_scene("wCFt, traces")))
    room = axes_room_mm(picture)
    low, high = room.min(axis=0), room.max(axis=0)
    for lines in picture.traces:
        assert (lines.actual_mm >= low - 1e-9).all()
        assert (lines.actual_mm <= high + 1e-9).all()


@pytest.mark.parametrize("name", ["wFXt", "wCFt", "nothing moves"])
def test_two_states_of_a_line_and_of_a_point_are_compared(name: str) -> None:
    pinned = with_pin(start_state(still_scene(name)))
    state = replace(pinned, amplitudes=dict.fromkeys(pinned.amplitudes, 0.0))
    picture = LiveModel().evaluate(state)
    assert picture.compared is not None
    assert picture.compared.difference is not None
    assert picture.compared.other_mm is not None
    assert len(outline_pieces(picture, picture.compared.other_mm)) >= 12
