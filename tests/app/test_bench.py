"""The tab Tests: a test follows every slider, in the box and in its figure, link and undo."""

from dataclasses import replace

import numpy as np
import pytest

from app.test_page_steps import OPEN, Wire, dial
from warpspace.app.documents.view_settings import settings_line, with_settings
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.readouts.bench import bench_html
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState, start_state
from warpspace.bench.registry import bench_names
from warpspace.scene.library import load_scene

STATE = start_state(load_scene("dvf5000_first"), nodes=5)
LIVE = LiveModel()


def chosen(name: str, state: AppState = STATE, **options: str) -> AppState:
    look = state.bench.with_test(name)
    for option, text in options.items():
        look = look.with_option(option, text)
    return replace(state, bench=look)


@pytest.mark.parametrize("name", bench_names())
def test_figure_and_path_follow_the_errors(name: str) -> None:
    found = LIVE.evaluate(chosen(name)).bench
    assert isinstance(found, BenchPicture)
    html = bench_html(found)
    assert "<svg" in html
    assert "nan" not in html
    for quantity in found.run.outcome.quantities:
        assert f'data-value="test {quantity.key}"' in html
    moved = LIVE.evaluate(chosen(name, STATE.with_amplitude("EC0Y", 150.0))).bench
    assert isinstance(moved, BenchPicture)
    assert moved.prepared is found.prepared
    assert np.abs(moved.error_um - found.error_um).max() > 1.0
    ((nominal, actual), *_) = moved.lines_mm(1000.0)
    rows = moved.prepared.plan.path[0]
    np.testing.assert_allclose(actual - nominal, moved.error_um[rows], atol=1e-9)


def test_numbers_are_those_of_the_scene() -> None:
    state = chosen("circular", plane="YZ", radius_mm="150")
    found = LIVE.evaluate(state).bench
    assert isinstance(found, BenchPicture)
    import warpspace

    known = warpspace.ballbar(state.scene, plane="YZ", radius_mm=150.0)
    outcome = found.run.outcome
    assert outcome["squareness_urad"] == pytest.approx(known.squareness_urad, abs=0.01)
    excluded = replace(state, exclusions=state.exclusions.with_only("EA0Z", only=True))
    found = LIVE.evaluate(excluded).bench
    assert isinstance(found, BenchPicture)
    assert found.run.outcome["squareness_urad"] == pytest.approx(33.9, abs=0.01)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("circular", {"radius_mm": "much"}, "--radius 'much'; expected a number"),
        ("circular", {"radius_mm": "900"}, "leaves the working volume"),
        ("circular", {"points": "20000"}, "expected at most 20,000 in the app"),
        ("circular", {"points": "7.5"}, "expected a whole number"),
        ("circular", {"plane": "AB"}, "expected one of XY, XZ, YZ"),
        ("sphere", {"ball": "1,2"}, "expected three numbers"),
        ("sphere", {"axis": "Q"}, "expected one of X, Y, Z, B, C"),
        ("sphere", {"at": "Q=1"}, "expected positions of"),
    ],
)
def test_what_cannot_be_run_is_said_in_its_place(name: str, options: dict, message: str) -> None:
    found = LIVE.evaluate(chosen(name, **options)).bench
    assert isinstance(found, str)
    assert message in found
    assert "test problem" in bench_html(found)


def test_a_test_that_the_machine_cannot_run() -> None:
    state = start_state(load_scene("machine_c_frame_mill"), nodes=3)
    assert "no rotary axis" in str(LIVE.evaluate(chosen("sphere", state)).bench)
    assert LIVE.evaluate(state).bench is None


def test_tables_turn_where_the_axes_stand() -> None:
    here = LIVE.evaluate(chosen("sphere")).bench
    there = LIVE.evaluate(chosen("sphere", STATE.with_position("B", -20.0))).bench
    assert isinstance(here, BenchPicture)
    assert isinstance(there, BenchPicture)
    assert there.prepared.plan.coordinates["B"][0] == -20.0


def test_link_keeps_test_and_options_and_refuses_others() -> None:
    state = chosen("sphere", axis="B", points="9")
    state = replace(state, bench=replace(state.bench, path=False))
    line = settings_line(state)
    again = with_settings(STATE, line)
    assert again.bench == state.bench
    assert not again.notes
    hostile = with_settings(STATE, "test=nothing&test.radius_mm=" + "9" * 500 + "&test.foo=1")
    assert hostile.bench.name == ""
    assert len(hostile.bench.options.get("radius_mm", "")) <= 80
    assert any("test.foo" in note for note in hostile.notes)


def test_compared_states_run_the_same_test() -> None:
    pinned = with_pin(chosen("circular"))
    changed = pinned.with_amplitude("EC0Y", 100.0)
    shown = {}
    for side in ("a", "b", "difference"):
        state = replace(changed, comparison=replace(changed.comparison, shown=side))
        shown[side] = LIVE.evaluate(state).bench
    assert isinstance(shown["a"], BenchPicture)
    assert isinstance(shown["b"], BenchPicture)
    assert shown["difference"] is None
    assert np.abs(shown["a"].readings - shown["b"].readings).max() > 1.0


def test_the_tab_draws_the_path_and_the_figure_of_a_chosen_test() -> None:
    with Viewer(load_scene("dvf5000_first")) as viewer, dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
        wire.update(wire.widgets["Test"], "sphere")
        assert wire.read_until(lambda: "Ball [mm]" in wire.labels, seconds=30.0)
