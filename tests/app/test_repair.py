"""Repairs of what the app shows: the question, the answer's words, preview, apply and undo."""

from dataclasses import replace

import pytest
from markupsafe import Markup

from app.wire import OPEN, Wire, dial
from warpspace.analysis.repair import Objective
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.repair import BEFORE, ask, with_adjusted, with_preview, with_repair
from warpspace.app.readouts.repair import offered, repair_html
from warpspace.app.server.viewer import Viewer
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.scene import repairs as scene_repairs
from warpspace.scene.library import load_scene

SCENE = load_scene("dvf5000_first")
START = replace(start_state(SCENE), nodes=7)
LIVE = LiveModel()
ADJUST = {"EA0Z": 20.2}


def found(state=START, objective=Objective.RMS, *, any_error=False, limit=200.0):
    return ask(state, objective, any_error=any_error, limit=limit).answer()


def test_the_answer_is_that_of_the_command():
    assert found() == scene_repairs.repair(SCENE, grid=7)


def test_a_question_is_new_only_where_the_answer_may_be():
    def question(state, limit=200.0):
        return ask(state, Objective.RMS, any_error=False, limit=limit)

    first = question(START)
    assert first == question(START.with_component("z").with_shown(dark=True))
    assert first == question(with_preview(START, ADJUST))
    assert first != question(START.with_amplitude("EAX", 3.0))
    assert first != question(START.with_loop("relative"))
    assert first != question(START, 10.0)
    assert first != question(edits.with_excluded(START, "EAX", True))


def test_excluded_errors_neither_act_nor_are_adjusted():
    state = edits.with_excluded(START, "EA0Z", True)
    answer = found(state)
    assert "EA0Z" not in answer.adjustable
    assert "EA0Z" not in [effect.key for effect in answer.effects]
    assert answer.before.max_um == pytest.approx(LIVE.evaluate(state).statistics.max_um)


def test_the_best_set_gives_what_it_promises():
    best = found().repairs[1]
    after = LIVE.evaluate(with_adjusted(START, best.adjust)).statistics
    assert after.mean_um == pytest.approx(best.outcome.mean_um)
    assert after.max_um == pytest.approx(best.outcome.max_um)


def test_sliders_grow_and_strangers_are_left_out():
    state = with_adjusted(START, {"EA0Z": 900.0, "EQ0": 1.0, "EXX": 1e9})
    assert state.amplitudes["EA0Z"] == 900.0
    assert state.spans["EA0Z"].high >= 900.0
    assert state.amplitudes["EXX"] == 1e5
    assert "EQ0" not in state.amplitudes


def test_preview_changes_no_error_and_draws_the_repaired_side():
    state = with_preview(START, ADJUST)
    assert state.amplitudes == START.amplitudes
    compared = LIVE.evaluate(state).compared
    assert compared is not None
    assert compared.shown == "b"
    assert compared.titles[1] == "after repair: EA0Z 20.2 µrad"
    assert compared.a.mean_um == pytest.approx(found().before.mean_um)
    assert compared.b.mean_um < compared.a.mean_um


def test_applied_is_compared_with_before_and_undone_at_once():
    store = StateStore(START)
    store.apply(lambda state: with_repair(state, ADJUST))
    assert store.state.amplitudes["EA0Z"] == 20.2
    compared = LIVE.evaluate(store.state).compared
    assert compared is not None
    assert compared.titles[0] == BEFORE
    assert compared.a.max_um == pytest.approx(found().before.max_um)
    assert compared.b.mean_um < compared.a.mean_um
    store.undo()
    assert store.state == START


def test_a_repair_on_top_of_a_repair_holds_no_comparison_within():
    state = with_repair(with_repair(START, ADJUST), {"EC0Y": 17.0})
    before = state.comparison.a.state
    assert before is not None
    assert before.comparison.b is None
    assert before.amplitudes["EA0Z"] == 20.2


def test_words_have_numbers_and_buttons():
    html = repair_html(found(), lambda word: Markup(f'data-word="{word}"'))
    assert 'data-word="show 1"' in html
    assert 'data-word="apply 2"' in html
    assert 'data-repair="EA0Z out max">63.59<' in html
    assert f'data-repair="now mean">{found().before.mean_um:.2f}<' in html
    assert "each by at most ±200 µm or µrad" in html
    assert "%" not in html


def test_sets_that_gain_nothing_are_not_offered():
    answer = found()
    assert [len(one.adjust) for one in answer.repairs] == [1, 2, 3]
    assert [len(one.adjust) for one in offered(answer)] == [1, 2]
    repaired = with_adjusted(START, answer.repairs[-1].adjust)
    done = found(repaired)
    assert offered(done) == ()
    assert "at their best values already" in repair_html(done, Markup)


def test_nothing_to_repair_is_said():
    assert "nothing to repair" in repair_html(found(START.zeroed()), Markup)


def test_a_page_gets_the_answer_and_takes_only_known_words():
    with Viewer(SCENE) as viewer, dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
        (session,) = viewer.sessions
        (panel,) = [p for p in session.display.panels if type(p).__name__ == "RepairPanel"]
        assert not wire.read_until(lambda: panel._looking or panel._answered, seconds=1.5)
        panel._clicked("seen")  # what the page says once somebody sees the panel
        assert wire.read_until(lambda: panel._answered is not None, seconds=30.0)
        for word in ("apply 9", "delete 1", "apply", "", "apply 1 1", "x" * 100, "seen"):
            panel._clicked(word)
        panel._clicked("apply 1")
        assert wire.read_until(lambda: session.state.amplitudes["EA0Z"] < 21.0)
        assert len(session.context.store.history.past) == 1
