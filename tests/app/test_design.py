"""Improve and Design on the page: repair, tolerances and machines side by side."""

import re
from base64 import b64encode
from dataclasses import replace

import numpy as np
import pytest

import warpspace
from app.parts import LIVE, Alone, answer_of, lone_part, section, wait
from warpspace import load_scene
from warpspace.analysis.commands.adjust import Adjust
from warpspace.analysis.commands.concepts import Concepts, compare_concepts
from warpspace.analysis.registry import entries
from warpspace.app.browser import actions as do
from warpspace.app.documents.output_services import Services
from warpspace.app.drawing.around import STROKES, draw_surroundings
from warpspace.app.drawing.labels import point_labels
from warpspace.app.evaluation import live_model
from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.compare import applied
from warpspace.app.evaluation.scene_overlays import planned_adjusters
from warpspace.app.panels import design
from warpspace.app.panels.improve import AdjustPanel
from warpspace.app.state import edits
from warpspace.app.state.app_state import Specification, start_state
from warpspace.app.state.form_values import linked_forms
from warpspace.app.state.tree import put
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Constant, Covariance
from warpspace.outputs.report.review import ReportSettings, build_review

FIRST = load_scene("dvf5000_first")
START = start_state(FIRST)
PROPOSED = load_scene("dvf5000_proposed")
SCENE = replace(PROPOSED, reference=None)
OTHER = load_scene("machine_trunnion_ac")
HOSTILE = "<script>alert(1)</script>"
KEYS = ("EXX", "EYX", "EA0Z")


def ran(part, state):
    part.handle(state, do.Run(part.name))
    wait(part)
    return part


# --- Repair ---------------------------------------------------------------------------------------


def test_repair_offers_what_the_command_finds_and_nothing_that_gains_nothing():
    part = lone_part(AdjustPanel, "adjust")
    state = replace(START, forms={"adjust.objective": "rms", "adjust.grid": "9"})
    ran(part, state)
    found = part.outcome.result
    said = Adjust(grid=9).run(FIRST, lambda _: None)
    assert [one.adjust for one in found.adjustments] == [one.adjust for one in said.adjustments]
    assert part.offered_changes(found) == [0, 1]  # of sets of one, two and three
    shown = section(part, state)
    assert shown.count("&quot;Apply&quot;") == 2
    assert re.search(
        r"<b>front column bolts \+ 0\.015 mm \(15 µm\)</b>.*max</th><td>51\.7 → ", shown
    )
    applied = part.handle(state, do.Apply("adjust", 1))
    assert applied.comparison.a.title == "before adjustment"
    assert "&quot;Apply&quot;" not in section(part, applied)
    wait(part)
    ran(part, applied)
    assert "reduces the error by 1 % or more" in section(part, applied)
    assert part.handle(applied, do.Apply("adjust", 9)) is applied
    assert part.handle(state, do.Apply("best", 1)) is state


def test_cards_of_a_repair_show_what_is_drawn_and_leave_no_responses_in_the_cache(monkeypatch):
    part, built, build = lone_part(AdjustPanel, "adjust"), [], live_model._build
    monkeypatch.setattr(live_model, "CACHE", Cache(400_000_000))
    monkeypatch.setattr(live_model, "_build", lambda of: built.append(of) or build(of))
    LIVE.evaluate(START)
    ran(part, replace(START, forms={"adjust.grid": "5"}))
    assert len(part.outcome.cards) > 1
    assert len(built) == 1  # of what is drawn; one more for each bent guide would stay
    for change, card in part.outcome.cards:
        numbers = LIVE.evaluate(applied(START, change.scene)).statistics
        for name in ("mean_um", "rms_um", "max_um"):
            assert f" → {getattr(numbers, name):.1f}" in re.sub(r"<[^>]+>", "", card)


def test_the_selected_acts_are_drawn_at_their_adjusters_while_the_section_is_open():
    part = lone_part(AdjustPanel, "adjust")
    state = replace(START, forms={"adjust.objective": "max", "adjust.grid": "5"})
    state = replace(state, page=replace(state.page, task="improve"))
    ran(part, state)
    best = part.outcome.result.adjustments[part.offered_changes(part.outcome.result)[0]]
    for update in part.context.posted:
        state = update(state)
    assert state.page.acts == best.acts
    members = [member for act in best.acts for member in act.members]
    placed = planned_adjusters(state)
    assert [(text, tuple(at)) for text, at, _ in placed] == [
        (str(act) if member is act.members[0] else "", member.at_mm)
        for act in best.acts
        for member in act.members
    ]
    assert all(
        tuple(way) == member.direction for (*_, way), member in zip(placed, members, strict=True)
    )
    picture = LIVE.evaluate(state)
    assert {str(act) for act in best.acts} <= {label.text for label in point_labels(picture)}
    shapes = draw_surroundings(picture)
    assert len(shapes["/adjusters/arrows"].assigned["points"]) == len(members) * (1 + STROKES)
    last = len(part.outcome.result.adjustments) - 1
    previewed = part.handle(state, do.Preview("adjust", last))
    assert previewed.page.acts == part.outcome.result.adjustments[last].acts != best.acts
    for elsewhere in ({"task": "design"}, {"open": frozenset()}):
        assert not planned_adjusters(replace(state, page=replace(state.page, **elsewhere)))


# --- Tolerances -----------------------------------------------------------------------------------


def state_of(scene, loop=Loop.TOOL, limit_um=60.0, **wanted):
    return replace(
        start_state(scene), loop=loop, specification=Specification(limit_um=limit_um, **wanted)
    )


@pytest.mark.parametrize(
    ("loop", "over", "distribution"),
    [
        *((loop, "sampled", "uniform") for loop in Loop),
        (Loop.TOOL, "sampled", "normal"),
        *((loop, "max", "uniform") for loop in (Loop.TOOL, Loop.RELATIVE)),
    ],
)
def test_a_probability_is_that_of_the_command(loop, over, distribution):
    ensemble = design.sample_machines(state_of(SCENE, loop, over=over, distribution=distribution))
    live = ensemble.estimate(SCENE.tolerances, 60.0)
    kept = live.probability()
    asked = {"loop": loop, "over": over, "distribution": distribution}
    found = warpspace.montecarlo(SCENE, samples=design.SAMPLES, limit_um=60.0, **asked)
    assert live.mean_um == pytest.approx(found.mean_um, rel=1e-6)
    assert live.quantile(0.95) == pytest.approx(found.p95_um, rel=1e-6)
    assert kept.probability == pytest.approx(found.probability.probability, abs=1e-4)
    assert sum(ensemble.variance_shares(SCENE.tolerances).values()) == pytest.approx(1.0)


def test_the_worst_point_of_the_workpiece_loop_is_refused_with_a_way_out():
    part = lone_part(design.TolerancesPanel, "allocate")
    shown = section(part, state_of(PROPOSED, Loop.WORKPIECE))
    assert "one random point of each machine" in shown
    assert "expected “" in shown
    assert "Evaluated at" in shown


def test_an_allocation_reaches_what_was_wanted_and_is_one_change():
    part = lone_part(design.TolerancesPanel, "allocate")
    fixed = frozenset({"EA0Z", "EXA"})  # the latter of another machine
    state = state_of(FIRST, limit_um=40.0, percent=98.0, fixed=fixed, costs="EB0Z=9,EYA=3")
    ran(part, state)
    (update,) = part.context.posted
    after = update(state)
    # the machines of the page are those of the allocation, and the lower end of the interval counts
    shown = design.sample_machines(state).estimate(after.tolerances, 40.0).probability()
    found = part.outcome.result
    assert shown == found.after
    assert 0.98 <= shown.low < 0.983
    assert edits.half_width_of(after, "EA0Z") == 25.0
    assert edits.half_width_of(after, "EB0Z") > 1.3 * edits.half_width_of(after, "EC0Y")
    assert f'<span class="ws-pass">{design.percent(shown.probability)} %</span>' in section(
        part, after
    )
    assert f"{100.0 * found.after.probability:.2f} % of the machines" in section(part, after)
    assert "Applied" in section(part, after)
    # what was changed meanwhile is not overwritten; errors are none of its inputs
    moved = put(state, "tolerances.EXX", repr(3.0))
    assert update(moved).tolerances == moved.tolerances
    assert "allocate again" in update(moved).notes[0]
    assert update(state.with_amplitude("EXX", 2.0)).tolerances == after.tolerances


def test_tolerances_are_typed_fixed_scaled_and_reset():
    part = lone_part(design.TolerancesPanel, "allocate")
    section(part, START)  # lays out the rows
    state = put(START, "specification.fixed", "+EXX")
    assert "-EXX&quot;" in section(part, state)
    state = put(state, "tolerances.EYX", "0")
    scaled = part.handle(state, do.Input.SCALE_TOLERANCES("× 1.5"))
    assert [edits.half_width_of(scaled, key) for key in KEYS] == [10.0, 0.0, 37.5]
    for _ in range(20):
        scaled = part.handle(scaled, do.Input.SCALE_TOLERANCES("× 1.5"))
    assert edits.half_width_of(scaled, "EA0Z") == 1000.0
    assert part.handle(scaled, do.Signal.RESET_TOLERANCES).tolerances == FIRST.tolerances
    for action in (do.Input.SCALE_TOLERANCES("1e9"), do.SetOption("allocate", "x", "3")):
        assert part.handle(START, action) is START


# --- Machines side by side ------------------------------------------------------------------------


def concepts_part():
    part = lone_part(design.ConceptsPanel, "concepts")
    part.context.scenes = {"other": OTHER, HOSTILE: replace(OTHER, title=HOSTILE)}
    return part


def test_machines_are_compared_as_the_command_does_and_drawn():
    asked = []
    part = concepts_part()
    part.context.services = Services(draw_concepts=lambda scenes, *_: asked.append(scenes) or b"")
    key = next(key for key, scene in part.offers(START).items() if scene == OTHER)
    assert part.handle(START, do.Run("concepts")) is START  # one machine alone is not compared
    add = do.Input.ADD_CONCEPT(key)
    chosen = part.handle(part.handle(START, add), add)
    assert part.chosen(chosen) == [design.PRESENT, key]
    ran(part, chosen)
    found = part.outcome.result
    plan = Concepts(limit_um=chosen.specification.limit_um, samples=design.SAMPLES)
    expected = compare_concepts([FIRST, OTHER], plan)
    assert [one.json_fields for one in found.concepts] == [one.json_fields for one in expected]
    assert "largest contributions share of the variance" in section(part, chosen)
    part.handle(chosen, do.Signal.DRAW_CONCEPTS)
    wait(part)
    assert [one.title for one in asked[0]] == [FIRST.title, OTHER.title]
    assert ("concepts.png", b"") in part.context.told
    assert part.chosen(part.handle(chosen, do.Input.REMOVE_CONCEPT(design.PRESENT))) == [key]
    for kind in (do.Input.ADD_CONCEPT, do.Input.REMOVE_CONCEPT, do.Input.OPEN_CONCEPT):
        assert part.handle(chosen, kind("none of them")) == chosen


def test_titles_of_machines_are_escaped_and_there_is_a_most():
    part = concepts_part()
    hostile = replace(START, forms={"concepts.machines": f"{design.PRESENT}\n{HOSTILE}"})
    assert HOSTILE not in section(part, hostile)
    unknown = {"concepts.machines": f"{design.PRESENT}\nno such"}
    assert not part.is_ready(replace(START, forms=unknown))
    many = replace(START, forms={"concepts.machines": "\n".join([design.PRESENT] * 50)})
    assert len(part.chosen(many)) == 8


# --- One question, one figure ---------------------------------------------------------------------


def test_page_report_and_command_have_one_figure_for_one_question():
    plan = {"samples": design.SAMPLES, "over": "max", "limit_um": 50.0}
    wanted = warpspace.montecarlo(SCENE, **plan).probability
    settings = ReportSettings(grid=3, spec_um=50.0, samples=design.SAMPLES)
    (reviewed,) = build_review((SCENE,), settings).scenes
    assert reviewed.results["worst"].points[0].sampled.probability == wanted
    asked = state_of(SCENE, SCENE.default_loop, limit_um=50.0)
    assert answer_of(lone_part(design.TolerancesPanel, "allocate"), asked).before == wanted
    forms = {"concepts.loop": "relative", "concepts.own_tolerances": "1"}
    (found,) = answer_of(concepts_part(), replace(asked, forms=forms)).concepts
    assert found.sampled.probability == wanted


# --- Acceptance tests -----------------------------------------------------------------------------

PLAN = """[[acceptance]]
test = "circular"
plane = "XY"
radius_mm = 100
limit_um = {limit}
"""


PAGE = replace(START.page, task="design", open=frozenset({"acceptance"}))


def acceptance_panel():
    (entry,) = (one for one in entries() if one.name == "acceptance")
    return Alone(design.AcceptancePanel, replace(START, page=PAGE), entry)


def uploaded(content):
    text = b64encode(content).decode()
    return do.Upload("acceptance", name="plan.toml", size=len(content), content=text)


def test_a_plan_can_be_opened_or_chosen_and_the_worst_machine_passes_it():
    alone = acceptance_panel()
    part, state = alone.part, alone.do(uploaded(PLAN.format(limit=4).encode()))
    ran(part, state)
    result = part.outcome.result
    (test,) = result.tests
    assert (test.limit, test.unit) == (4.0, "µm")
    assert test.value <= 4.0 + 1e-6
    shown = section(part, state)
    assert "opened file" in shown
    assert "[[acceptance]]" not in shown
    worst = part.handle(state, do.Apply("acceptance", 0))
    largest = float(LIVE.evaluate(worst).field.norm_um.max())
    assert largest == pytest.approx(result.bound_um[0], rel=1e-3)
    chosen = part.handle(state, do.SetOption("acceptance", "plan", "iso_3_axes"))
    assert part.build_analysis(chosen, {}, chosen.scene).plan == "iso_3_axes"
    for hostile in (HOSTILE, "file", "/etc/passwd.toml"):
        assert part.handle(state, do.SetOption("acceptance", "plan", hostile)) is state


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (PLAN.format(limit=-1).encode(), r"plan\.toml.*circular: limit_um: -1; expected above 0"),
        (b"\xff\xfe", r"plan\.toml"),
        (b"<script>", r"plan\.toml"),
    ],
)
def test_a_refused_plan_is_named_and_changes_nothing(content, message):
    alone = acceptance_panel()
    before = alone.store.state
    assert alone.do(uploaded(content)).forms == before.forms
    shown = section(alone.part, before)
    assert re.search(message, shown, re.DOTALL)
    assert "<script>" not in shown


def test_a_calibrated_scene_is_a_measured_machine():
    alone = acceptance_panel()
    part = alone.part
    assert "measured" not in {option.name for option in part.shown_options(START)}
    constant = Constant((0.0, 1.0), 23.1)
    calibrated = replace(
        FIRST,
        errors=replace(FIRST.errors, functions={**FIRST.errors.functions, "EC0Y": constant}),
        covariance=Covariance(("EC0Y",), ((0.25,),)),
    )
    form = {"acceptance.plan": PLAN.format(limit=4), "acceptance.measured": "1"}
    state = replace(start_state(calibrated), page=PAGE, forms=form)
    assert "measured" in {option.name for option in part.shown_options(state)}
    ran(part, state)
    low, high = part.outcome.result.ranges["EC0Y"]
    half = 0.5 * 1.959964  # one estimate, 95 %
    assert (low, high) == pytest.approx((23.1 - half, 23.1 + half), abs=1e-4)
    assert "Errors that remain possible" in section(part, state)


def test_paths_of_the_tests_are_drawn_while_the_section_is_open():
    state = replace(START, forms={"acceptance.plan": PLAN.format(limit=4)})
    path = LIVE.evaluate(replace(state, page=PAGE)).bench
    ends = path.nominal_mm[path.at.ravel()]
    radius = np.linalg.norm(ends - ends.mean(axis=0), axis=1)
    np.testing.assert_allclose(radius, 100.0, rtol=0.01)
    assert LIVE.evaluate(state).bench is None
    three = replace(state, page=PAGE, forms={"acceptance.plan": "iso_3_axes"})
    assert len(np.unique(LIVE.evaluate(three).bench.nominal_mm[:, 2].round(3))) > 10
    assert not linked_forms(replace(START, forms={"acceptance.plan": "x\n" * 1000}))


def test_bounds_of_a_part_are_listed_on_request():
    scene = load_scene("part_on_dvf5000")
    (entry,) = (one for one in entries() if one.name == "acceptance")
    forms = {
        "acceptance.plan": PLAN.format(limit=8),
        "acceptance.part": "1",
        "acceptance.knots": "2",
    }
    state = replace(start_state(scene), page=PAGE, forms=forms)
    alone = Alone(design.AcceptancePanel, state, entry)
    assert "Measurands of the part" in section(alone.part, state)
    ran(alone.part, state)
    names = [each.name for each in alone.part.outcome.result.measurands]
    assert names == ["side", "bore", "circle", "back"]
    assert "back · squareness to side" in section(alone.part, state)
    bare = replace(state, scene=START.scene)
    ran(alone.part, bare)
    assert "expected a scene whose [part] has a file" in section(alone.part, bare)
