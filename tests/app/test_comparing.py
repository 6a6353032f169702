"""Compare, repair, concepts: two states or machines beside each other, applied and undone."""

import io
import threading
from dataclasses import replace

import numpy as np
import pytest
from markupsafe import Markup
from PIL import Image

from app.wire import opened
from warpspace.analysis.adjusting import Objective
from warpspace.analysis.allocating import SAMPLES
from warpspace.analysis.concepts import Concepts, compare_concepts
from warpspace.analysis.repair import Repair
from warpspace.app.documents.services import ConceptRequest, Services
from warpspace.app.evaluation import concepts, repair
from warpspace.app.evaluation.compare import pinned_side, scene_side, with_pin, with_sides
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine_edits import with_word
from warpspace.app.evaluation.repair import with_adjusted, with_preview
from warpspace.app.readouts.repair import offered, repair_html
from warpspace.app.readouts.summary import comparison_html
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.comparison import Side
from warpspace.app.state.concept_choice import LIMIT_UM, Chosen, ConceptChoice
from warpspace.app.state.ranges import Span
from warpspace.exceptions import SceneError
from warpspace.geometry.colour import component_values
from warpspace.geometry.surfaces import deform
from warpspace.machine.errors import ToleranceSet
from warpspace.picture.mesh import map_mesh
from warpspace.scene.library import load_scene

LIVE = LiveModel()
FIRST, SECOND = (load_scene(f"dvf5000_{name}") for name in ("first", "second"))
START = start_state(FIRST, nodes=9)


def picture_of(state, shown):
    return LIVE.evaluate(replace(state, comparison=state.comparison.with_shown(shown)))


def test_a_and_b_share_colours_and_all_three_factor_and_numbers():
    state = with_sides(START, Side(), scene_side(SECOND))
    a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
    alone = [LIVE.evaluate(start_state(scene, nodes=9)) for scene in (FIRST, SECOND)]
    np.testing.assert_array_equal(a.field.error_um, alone[0].field.error_um)
    np.testing.assert_array_equal(b.field.error_um, alone[1].field.error_um)
    np.testing.assert_allclose(
        difference.field.error_um, b.field.error_um - a.field.error_um, atol=1e-12
    )
    assert a.scale == b.scale
    assert a.exaggeration == b.exaggeration == difference.exaggeration
    assert a.compared.a == alone[0].statistics
    assert a.compared.b == alone[1].statistics
    assert a.compared.difference == difference.statistics
    np.testing.assert_array_equal(a.compared.other_mm, b.drawn_mm)


@pytest.mark.parametrize(("component", "label"), [("norm", "|E_B − E_A|"), ("y", "E_y, B − A")])
def test_a_change_has_colours_of_its_own(component, label):
    state = with_pin(START.with_component(component))
    for key in ("EXX", "EYY"):
        state = state.with_amplitude(key, state.amplitudes[key] + 0.3)
    change = picture_of(state, "difference")
    largest = float(np.abs(change.values).max())
    assert change.scale.label == label
    assert largest <= change.scale.high + 1e-9
    assert change.scale.high <= 2.5 * largest < 0.1 * picture_of(state, "b").scale.high
    fixed = replace(state, look=state.look.with_choice(range_mode="fixed").with_top(7.5))
    assert picture_of(fixed, "difference").scale.high == 7.5


def test_what_is_steered_moves_while_the_state_before_stays():
    state = with_pin(START).with_amplitude("EXX", 8.0)
    difference = picture_of(state, "difference")
    alone = LIVE.evaluate(
        start_state(load_scene("dvf5000_nominal"), nodes=9).with_amplitude("EXX", 8.0)
    )
    np.testing.assert_allclose(difference.field.error_um, alone.field.error_um, atol=1e-9)
    assert picture_of(with_pin(START), "difference").statistics.max_um == 0.0


def test_titles_are_escaped():
    evil = replace(SECOND, title="<img src=x onerror=alert(1)>")
    text = comparison_html(LIVE.evaluate(with_sides(START, Side(), scene_side(evil))))
    assert "<img" not in text
    assert "&lt;img" in text


def test_a_pinned_state_holds_no_comparison_and_unknown_words_draw_nothing_else():
    state = with_pin(START)
    twice = pinned_side(state).state
    assert twice.comparison.b is None
    assert twice.comparison.pinned is None
    for word in ("", "c", "<script>"):
        assert state.comparison.with_shown(word) is state.comparison


def test_the_difference_is_cut_into_slices_evaluated_where_they_lie():
    look = START.look.with_choice(surface="slices").with_slice("X", 31.0, Span(-275.0, 275.0, 1.0))
    for component, quantity in (("norm", "position"), ("y", "position"), ("norm", "orientation")):
        state = replace(
            START, look=look.with_choice(quantity=quantity), component=component
        ).with_amplitude("EAX", 9.0)
        state = with_sides(state, Side(), scene_side(SECOND))
        a, b, difference = (picture_of(state, shown) for shown in ("a", "b", "difference"))
        assert [part.axis for part in difference.slices] == [part.axis for part in a.slices]
        assert difference.slices[0].position_mm == 31.0
        for one, two, part in zip(a.slices, b.slices, difference.slices, strict=True):
            np.testing.assert_array_equal(one.grid.nominal_mm, two.grid.nominal_mm)
            error = two.field.error_um - one.field.error_um
            np.testing.assert_allclose(part.field.error_um, error, atol=1e-12)
            drawn = deform(one.grid.nominal_mm, error, difference.exaggeration)
            np.testing.assert_allclose(part.drawn_mm, drawn, atol=1e-9)
            coloured = error
            if quantity == "orientation":
                coloured = two.field.orientation_urad - one.field.orientation_urad
            np.testing.assert_allclose(
                part.values, component_values(coloured, component), atol=1e-12
            )
        # what is drawn are the slices, on the shared scale
        mesh = map_mesh(difference)
        assert len(mesh.values) == sum(part.values.size for part in difference.slices)


ADJUST = {"EA0Z": 20.2}


def found(state=START, objective=Objective.RMS, *, any_error=False, limit=200.0):
    return repair.ask(state, objective, any_error=any_error, limit=limit).answer()


def test_the_answer_is_that_of_the_command():
    answer, said = found(), Repair(grid=9).run(FIRST)
    assert (answer.before, answer.errors) == (said.before, said.errors)
    assert [one.adjust for one in answer.repairs] == [one.adjust for one in said.repairs]


def test_a_question_is_new_only_where_the_answer_may_be():
    def question(state, limit=200.0):
        return repair.ask(state, Objective.RMS, any_error=False, limit=limit)

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
    assert "EA0Z" not in [effect.key for effect in answer.errors]
    assert answer.before.max_um == pytest.approx(LIVE.evaluate(state).statistics.max_um)


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
    assert compared.shown == "b"
    assert compared.titles[1] == "after repair: EA0Z 20.2 µrad"
    assert compared.a.mean_um == pytest.approx(found().before.mean_um)
    assert compared.b.mean_um < compared.a.mean_um


def test_sets_that_gain_nothing_are_not_offered():
    answer = found()
    assert [len(one.adjust) for one in answer.repairs] == [1, 2, 3]
    assert [len(one.adjust) for one in offered(answer)] == [1, 2]
    repaired = with_adjusted(START, answer.repairs[-1].adjust)
    done = found(repaired)
    assert offered(done) == ()
    assert "at their best values already" in repair_html(done, Markup)


def test_a_page_gets_the_answer_and_takes_only_known_words():
    with opened(FIRST) as (wire, session, panels):
        panel = panels["RepairPanel"]
        assert not wire.read_until(lambda: panel._looking or panel._answered, seconds=1.5)
        panel._clicked("seen")  # what the page says once somebody sees the panel
        assert wire.read_until(lambda: panel._answered is not None, seconds=30.0)
        for word in ("apply 9", "delete 1", "apply", "", "apply 1 1", "x" * 100, "seen"):
            panel._clicked(word)
        panel._clicked("apply 1")
        assert wire.read_until(lambda: session.state.amplitudes["EA0Z"] < 21.0)
        assert len(session.context.store.history.past) == 1


OTHERS = [load_scene(name) for name in ("machine_trunnion_ac", "machine_scara")]
CHOICE = ConceptChoice(
    (ConceptChoice().machines[0], *(Chosen(scene.title, scene) for scene in OTHERS)), limit_um=45.0
)


def concepts_found(choice=CHOICE, state=START):
    known = concepts.answer(concepts.ask(state, choice), threading.Event(), lambda _: None)
    assert known is not None
    return known


@pytest.fixture(scope="module")
def compared():
    return concepts_found()


def numbers(concepts):
    return [
        (
            *(one.sampled.mean_um, one.sampled.p95_um, one.sampled.max_um),
            one.sampled.probability.probability,
            [(row.key, row.share) for row in one.leading],
        )
        for one in concepts
    ]


@pytest.mark.parametrize(
    "changes", [{}, {"own_tolerances": True, "loop": "tool", "over": "sampled"}], ids=str
)
def test_the_numbers_are_those_of_the_analysis(changes):
    plan = Concepts(limit_um=45.0, samples=SAMPLES, **changes)
    expected = compare_concepts([FIRST, *OTHERS], plan)
    assert numbers(concepts_found(replace(CHOICE, **changes)).concepts) == numbers(expected)


def test_an_answer_holds_until_what_it_depends_on_changes(compared):
    def holds(state=START, choice=CHOICE):
        return compared.question.covers(concepts.ask(state, choice))

    assert holds()
    assert holds(START.with_amplitude("EAX", 30.0))
    assert holds(choice=CHOICE.toggled(CHOICE.machines[2]))
    assert not holds(choice=CHOICE.toggled(CHOICE.machines[0]))  # other tolerances for all
    assert not holds(choice=CHOICE.with_limit(46.0))
    assert not holds(choice=replace(CHOICE, loop="tool"))
    assert not holds(edits.with_scaled_tolerances(START, ["EXX"], 2.0))
    assert not holds(with_word(START, "offset X 2 150"))
    assert not holds(choice=CHOICE.toggled(Chosen("", load_scene("machine_printer_3d"))))


def test_choices_are_clamped():
    choice = ConceptChoice()
    assert choice.with_limit(float("nan")) == choice
    assert choice.with_limit(-1.0).limit_um == LIMIT_UM.low
    assert choice.with_limit(float("inf")).limit_um == LIMIT_UM.high
    assert choice.with_words("", "everywhere\0", "<b>") == choice
    for number in range(20):
        choice = choice.toggled(Chosen("", replace(FIRST, title=str(number))))
    assert len(choice.machines) == 8
    for chosen in choice.machines:
        choice = choice.toggled(chosen)
    assert choice.machines == ()


def test_missing_tolerances_are_said_and_a_comparison_can_be_cancelled():
    state = replace(START, tolerances=ToleranceSet({"translation": 10.0}))
    with pytest.raises(SceneError, match=r"tolerances\.default has no rotation"):
        concepts_found(state=state)
    cancelled = threading.Event()
    cancelled.set()
    assert concepts.answer(concepts.ask(START, CHOICE), cancelled, lambda _: None) is None


def test_a_page_compares_and_takes_only_known_words():
    asked: list[ConceptRequest] = []

    def draw(request, _):
        asked.append(request)
        assert request.strip_px is not None
        width, height = request.strip_px
        buffer = io.BytesIO()
        Image.new("RGB", (width, height * len(request.scenes))).save(buffer, "PNG")
        return buffer.getvalue()

    services = Services(draw_concepts=draw)
    with opened(FIRST, services=services) as (wire, session, panels):
        panel, act = panels["ConceptsPanel"], session.context.act
        for word in ("open 0", "open 9", "remove -1", "choose 1", "remove ", "x" * 100, "remove ²"):
            act(lambda word=word: panel._do(word))
        act(panel._compare)  # one machine alone is refused
        act(lambda: panel._window.toggle(panel._choice))
        act(lambda: panel._do("choose 1"))
        act(lambda: panel._do("choose 2"))
        act(lambda: panel._do("choose 99999"))
        act(panel._compare)
        assert wire.read_until(lambda: bool(panel._pictures), seconds=60.0)
        assert len(panel._pictures) == len(panel._choice.machines) == 3
        assert asked[0].scenes[0].machine.name == "dvf5000"
        second = panel._choice.machines[1].scene
        act(lambda: panel._do("open 1"))
        assert wire.read_until(lambda: session.state.origin is second)
        assert len(session.context.store.history.past) == 1
