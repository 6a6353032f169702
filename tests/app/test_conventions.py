"""Conventions: every choice is applied, measured against the scene's own, and undone."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from markupsafe import Markup

from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.conventions import (
    Effects,
    choices,
    chosen,
    with_choice,
    with_own_conventions,
    with_reference,
)
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import conventions as panel_module
from warpspace.app.panels.conventions import ConventionsPanel
from warpspace.app.readouts.conventions import conventions_html
from warpspace.app.server import display as display_module
from warpspace.app.server.display import Display
from warpspace.app.state.app_state import AppState, start_state
from warpspace.picture.mesh import edge_pieces
from warpspace.scene.library import load_scene

LIVE = LiveModel()
START = start_state(load_scene("dvf5000_first"), nodes=7)
WEIGHTS = LIVE.evaluate(START).grid.weights


@pytest.mark.parametrize("choice", choices(START))
def test_every_choice_can_be_made_and_measures_its_change(choice: str) -> None:
    state = with_choice(START, choice)
    assert choice in chosen(state)
    effect = Effects().of(START)[choice]
    change = LIVE.evaluate(state).field.error_um - LIVE.evaluate(START).field.error_um
    length = np.linalg.norm(change, axis=-1)
    assert effect.mean_um == pytest.approx(float((WEIGHTS * length).sum()), abs=1e-9)
    assert effect.max_um == pytest.approx(float(length.max()), abs=1e-9)


@pytest.mark.parametrize("nodes", [5, 21])
def test_effects_are_those_of_the_nodes_of_the_result_whatever_was_moved_before(nodes: int) -> None:
    effects = Effects()
    state = START.with_nodes(nodes)
    effects.of(state)
    for key, value in (("EAX", 9.0), ("EAX", -4.0), ("EBZ", 3.0), ("EXX", 2.0)):
        state = state.with_amplitude(key, value)
        effects.of(state)
    state = state.reset().with_amplitude("EXC", 7.0)
    found = effects.of(state)
    for choice in ("loop=workpiece", "direction C=-1", "component_errors=before_motion"):
        own, other = LIVE.evaluate(state), LIVE.evaluate(with_choice(state, choice))
        length = np.linalg.norm(other.field.error_um - own.field.error_um, axis=-1)
        mean = float((own.grid.weights * length).sum())
        assert found[choice].mean_um == pytest.approx(mean, abs=1e-9)
        assert found[choice].max_um == pytest.approx(float(length.max()), abs=1e-9)
    assert f"{nodes}×{nodes}×{nodes} nodes" in conventions_html(state, found, lambda *_: Markup())
    assert all(effect.max_um == 0.0 for effect in effects.of(state.zeroed()).values())


def test_nonsense_changes_nothing() -> None:
    for word in ("", "loop=all", "direction Q=1", "direction C=2", "reference=<b>", "x" * 500):
        assert with_choice(START, word) is START


def test_a_reference_is_held_still_clamped_and_taken_back() -> None:
    state = with_reference(START, {"X": 0.0, "Y": 0.0, "Z": -280.0})
    picture = LIVE.evaluate(state)
    assert np.abs(picture.field.error_um[3, 3, 3]).max() < 1e-9
    assert with_own_conventions(state) == START
    wild = with_reference(START, {"X": 1e9, "Y": float("nan")})
    assert wild.scene.reference is not None
    assert wild.scene.reference["X"] == 275.0
    assert wild.scene.reference["Y"] == 0.0
    assert len(wild.notes) == 2


def test_reset_of_the_errors_keeps_the_conventions() -> None:
    state = with_choice(START, "component_errors=before_motion").with_amplitude("EAX", 1.0)
    assert "component_errors=before_motion" in chosen(state.reset())
    assert state.reset().amplitudes == START.amplitudes


def test_the_effect_of_all_choices_is_that_of_the_state() -> None:
    state = with_choice(with_choice(START, "component_errors=before_motion"), "loop=workpiece")
    change = LIVE.evaluate(state).field.error_um - LIVE.evaluate(START).field.error_um
    found = Effects().of(state)["all"]
    assert found.max_um == pytest.approx(float(np.linalg.norm(change, axis=-1).max()))


def test_the_switchboard_marks_what_is_in_force() -> None:
    state = with_choice(START, "loop=relative")
    text = conventions_html(state, {}, lambda word, role: Markup(f'role="{role}"'))
    assert 'data-choice="loop=relative" aria-checked="true"' in text
    assert 'data-choice="loop=tool" aria-checked="false"' in text


def test_linear_axes_have_a_direction_like_rotary_ones() -> None:
    text = conventions_html(START, {}, lambda word, role: Markup())
    table, linear = text.index("Table direction"), text.index("Direction of linear axes")
    for axis, begin, end in (
        ("B", table, linear),
        ("C", table, linear),
        ("X", linear, len(text)),
        ("Z", linear, len(text)),
    ):
        assert begin < text.index(f'data-choice="direction {axis}=-1"') < end
    turned = with_choice(START, "direction X=-1")
    assert turned.scene.machine.axes["X"].direction == -1
    along_x = LIVE.evaluate(turned).grid.nominal_mm[:, 0, 0, 0]
    assert along_x[0] > along_x[-1]
    assert Effects().of(START)["direction Z=-1"].max_um > 0.0
    assert with_own_conventions(turned) == START


def test_lines_stay_on_the_outside_of_a_mirrored_volume() -> None:
    picture = LIVE.evaluate(with_choice(START.zeroed(), "direction X=-1"))
    lines, nodes = edge_pieces(picture).reshape(-1, 3), picture.grid.nominal_mm.reshape(-1, 3)
    assert (lines.max(axis=0) > nodes.max(axis=0)).all()
    assert (lines.min(axis=0) < nodes.min(axis=0)).all()


def test_files_keep_the_direction_of_a_linear_axis() -> None:
    turned = with_choice(START, "direction Y=-1")
    back, _ = open_text(state_to_toml(turned), "dvf5000_first", "x.toml")
    assert back.scene.machine.axes["Y"].direction == -1
    assert back.scene.model == turned.scene.model


def test_the_panel_does_nothing_while_a_slider_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is shown on every slider move of every tab."""
    calls: list[str] = []
    monkeypatch.setattr(
        panel_module,
        "conventions_html",
        lambda *_: calls.append("written") or f"text {len(calls)}",
    )
    panel = object.__new__(ConventionsPanel)
    panel._built_for = panel_module._axes_of(START)
    panel._known, panel._at, panel._asked, panel._costs = {}, {}, None, ()
    panel._context = SimpleNamespace(act=lambda step: step())
    panel._effects, panel._text = Effects(), SimpleNamespace(content="")
    panel._clicks = SimpleNamespace(attributes=None)
    parts = Display()
    parts.add(LIVE.evaluate(START), panels=[panel])
    assert calls == ["written"]
    moved = START
    for value in (1.0, 2.0, 3.0):
        moved = moved.with_amplitude("EXX", value)
        parts.show(LIVE.evaluate(moved))
    assert calls == ["written"]
    panel.rest(LIVE.evaluate(moved))
    assert len(calls) == 2
    panel.rest(LIVE.evaluate(moved))
    assert len(calls) == 2
    parts.show(LIVE.evaluate(with_choice(moved, "loop=relative")))
    assert len(calls) == 3


def test_what_is_slowest_waits_until_a_drag_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worked out with every chart it took a third of what a drag costs the server."""
    clock, done = [100.0], []
    monkeypatch.setattr(display_module, "time", SimpleNamespace(monotonic=lambda: clock[0]))

    class Charts:
        """Follows in a drag now and then; its slow part does not."""

        def read(self, state: AppState) -> AppState:
            return state

        def show(self, picture: LivePicture) -> None:
            """Nothing at once."""

        def settle(self, picture: LivePicture) -> None:
            done.append("chart")

        def rest(self, picture: LivePicture) -> None:
            done.append("slow")

    def run(step: Callable[[], object]) -> None:
        step()

    picture, parts = LIVE.evaluate(START), Display()
    parts.add(picture, panels=[Charts()])
    for _ in range(40):  # two seconds of a drag
        parts.show(picture)
        clock[0] += 0.05
        while parts.is_due(paused=False):
            parts.settle(picture, run)
    assert set(done) == {"chart"}
    assert 3 <= len(done) <= 6
    clock[0] += 0.1
    while parts.is_due(paused=True):
        parts.settle(picture, run)
    assert "slow" not in done
    assert parts.pause_s == pytest.approx(0.35)
    clock[0] += 0.4
    while parts.is_due(paused=True):
        parts.settle(picture, run)
    assert done.count("slow") == 1
    assert parts.pause_s is None
