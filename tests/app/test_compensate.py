"""The app draws what a table of compensation leaves: the same numbers, honest about which."""

import io
import threading
import zipfile
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.parts import Alone, answer_of, lone_part, section
from still_scenes import still_scene
from warpspace.app.browser import actions as do
from warpspace.app.documents.legend import picture_conditions, subject_words
from warpspace.app.documents.offline_page import build_offline_html
from warpspace.app.documents.scene_file import state_to_toml
from warpspace.app.documents.transfers import exported_words
from warpspace.app.drawing.labels import point_labels
from warpspace.app.evaluation import point_explanation
from warpspace.app.evaluation.compare import with_pin, without_table, without_words
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.machine_bodies import tool_point
from warpspace.app.evaluation.machine_edits import with_changed_scene
from warpspace.app.evaluation.point_explanation import measure_distance, pick_worst, with_picked
from warpspace.app.panels import improve
from warpspace.app.panels.analysis_panel import AnalysisOutcome, AnalysisPanel
from warpspace.app.panels.conventions import with_reference
from warpspace.app.panels.measurement import TestsPanel
from warpspace.app.server.tab_keeper import NO_TABLE, page_copy_text, read_page_copy
from warpspace.app.state.app_state import PartLook, start_state
from warpspace.app.state.tree import put
from warpspace.cli.services import draw_compensation
from warpspace.exceptions import WarpspaceError
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.compensate import Compensate, compensate, read_points
from warpspace.formats.terms import Tables
from warpspace.kinematics.model import Loop
from warpspace.outputs.charts.result_charts import compensation_maps
from warpspace.parts.workpiece import Workpiece
from warpspace.scene.library import load_scene

SCENE = load_scene("dvf5000_first")
START = replace(start_state(SCENE), nodes=9)
LIVE = LiveModel()
WITH_TABLE = "with the table HEIDENHAIN .COM and .CMA (X 9, Y 9, Z 9 points)"
CHOICE = {"formats": "heidenhain", "points": "9"}


def asking(state=START, choice=CHOICE):
    """Give the part, and the state with what was chosen."""
    part = lone_part(improve.CompensatePanel, "compensate")
    part.context.store = SimpleNamespace(state=state)
    return part, replace(state, forms={f"compensate.{key}": one for key, one in choice.items()})


def computed(state=START, choice=CHOICE):
    """Compute what a choice leaves."""
    return answer_of(*asking(state, choice))


@pytest.fixture(scope="module")
def found():
    return computed()


@pytest.fixture(scope="module")
def controller(found):
    return found.controller


@pytest.fixture(scope="module")
def left(controller):
    """The machine with its table."""
    return improve.with_box(START, improve.RESIDUAL, controller)


@pytest.mark.parametrize(
    ("name", "points", "loop", "orientation"),
    [
        ("heidenhain", "9", "", False),
        ("sinumerik-cec", "X=5,Y=4", "relative", True),
        ("fanuc-3d", "", "", False),
        ("marlin", "", "", False),
        ("iso-text", "5", "", False),
    ],
)
def test_the_box_has_the_field_of_the_command(name, points, loop, orientation):
    choice = {"formats": name, "points": points, "loop": loop, "orientation": str(int(orientation))}
    given = computed(choice=choice)
    asked = Compensate(
        formats=(name,), points=read_points(points) if points else None, loop=loop or None,
        orientation=orientation,
    )  # fmt: skip
    command = compensate(SCENE, asked, 9)
    picture = LIVE.evaluate(improve.with_box(START, improve.RESIDUAL, given.controller))
    assert picture.state.loop == Loop(command.loop)
    assert np.abs(picture.field.error_um - command.after.error_um).max() < 1e-9
    tilts = picture.field.orientation_urad - command.after.orientation_urad
    assert np.abs(tilts).max() < 1e-9
    assert given.after_statistics == compensate(SCENE, asked).after_statistics


def test_before_and_residual_error_are_those_of_the_heading():
    found, start = compensate(SCENE, Compensate(formats=("fanuc-3d",))), start_state(SCENE)
    before = LIVE.evaluate(start).statistics.four
    assert found.before_statistics.four == pytest.approx(before, abs=5e-3)  # exact chain
    box = improve.with_box(start, improve.COMPARISON, found.controller)
    for state in (box, improve.with_box(start, improve.RESIDUAL, found.controller)):
        assert LIVE.evaluate(state).statistics.four == pytest.approx(found.after_statistics.four)


def test_an_uncompensated_test_is_not_drawn_in_a_compensated_box(left):
    test, bare = {"test": "circular"}, replace(START, forms={"test": "circular"})
    boxed, plain = LIVE.evaluate(replace(left, forms=test)), LIVE.evaluate(bare)
    assert plain.bench is not None
    assert boxed.bench is None
    shown = str(Alone(TestsPanel, boxed.state).part.body(boxed))
    assert without_words(left) in shown
    assert "path is not drawn" in shown
    assert "not drawn" not in str(Alone(TestsPanel, bare).part.body(plain))
    # so do other analyses
    analysis = lone_part(AnalysisPanel, "conformance")
    assert without_words(left) in str(analysis.body(LIVE.evaluate(left)))
    assert "compensation table" not in str(analysis.body(LIVE.evaluate(START)))


def test_the_machine_may_drift_under_its_table(left, controller):
    drifted = left.with_amplitude("EXX", 7.0).with_amplitude("EA0Z", -12.0)
    grid = build_grid(SCENE.model, SCENE.workspace, 9)
    wanted = controller.field(grid.coordinates, grid.nominal_mm, drifted.active_scene())
    picture = LIVE.evaluate(drifted)
    assert np.abs(picture.field.error_um - wanted.error_um).max() < 1e-9
    assert picture.statistics.max_um > 2.0 * LIVE.evaluate(left).statistics.max_um
    # and what is excluded counts no more
    without = put(drifted, "exclusions.excluded", "+EA0Z")
    assert np.abs(LIVE.evaluate(without).field.error_um - picture.field.error_um).max() > 1.0


def test_before_and_after_stand_side_by_side(left, controller):
    compared = LIVE.evaluate(improve.with_box(START, improve.COMPARISON, controller)).compared
    before, after = LIVE.evaluate(START), LIVE.evaluate(left)
    assert (compared.a, compared.b) == (before.statistics, after.statistics)
    assert WITH_TABLE in compared.titles[1]
    assert "table" not in compared.titles[0]


def test_slices_and_the_tool_point_have_the_table_too(controller):
    look = replace(START.look, surface="slices")
    left = improve.with_box(replace(START, look=look), improve.RESIDUAL, controller)
    bare, picture = LIVE.evaluate(replace(START, look=look)), LIVE.evaluate(left)
    for plain, cut in zip(bare.slices, picture.slices, strict=True):
        wanted = controller.field(cut.grid.coordinates, cut.grid.nominal_mm)
        assert np.abs(cut.field.error_um - wanted.error_um).max() < 1e-9
        assert cut.field.norm_um.max() < plain.field.norm_um.max()
    assert np.linalg.norm(tool_point(picture)[1]) < np.linalg.norm(tool_point(bare)[1])


def test_a_measured_distance_is_that_of_the_points_as_drawn(left):
    ends = {"distance.start": "X=-200,Y=0", "distance.end": "X=200,Y=0"}
    picture = LIVE.evaluate(replace(left, forms=ends, exaggeration=1.0))
    found, seen, drawn = measure_distance(picture)
    nominal, actual = (float(np.linalg.norm(at[1] - at[0])) for at in (seen, drawn))
    assert found.distance_mm == pytest.approx((nominal, actual), abs=1e-9)
    assert found.difference_um == pytest.approx(1e3 * (actual - nominal), abs=1e-6)


@pytest.mark.parametrize("loop", Loop)
def test_an_empty_table_leaves_what_is_drawn_without_one(controller, loop):
    held = put(with_reference(START, {"X": 100.0, "Y": -50.0, "Z": -280.0}), "positions.B", "20")
    look = replace(held.look, surface="slices", quantity="orientation")
    plain = replace(held, loop=loop, look=look)
    empty = replace(plain, controller=replace(controller, tables=Tables(())))
    bare, picture = map(LIVE.evaluate, (plain, empty))
    assert np.abs(picture.field.orientation_urad - bare.field.orientation_urad).max() < 0.01
    pairs = [(picture.field, bare.field), *zip(picture.traces, bare.traces, strict=True)]
    cuts = zip(picture.slices, bare.slices, strict=True)
    for one, other in (*pairs, *((cut.field, same.field) for cut, same in cuts)):
        assert np.abs(one.error_um - other.error_um).max() < 0.01


def test_what_changes_the_machine_ends_the_table(left, controller):
    assert left.with_scene(load_scene("dvf5000_second")).controller is None
    machine = replace(SCENE.model.machine, title="another")
    other = replace(SCENE, model=replace(SCENE.model, machine=machine))
    assert with_changed_scene(left, other).controller is None
    assert improve.is_applicable_to(START, controller)
    assert not improve.is_applicable_to(start_state(load_scene("fork_head_bc")), controller)
    assert left.reset().controller is controller
    assert left.with_amplitude("EXX", 3.0).controller is controller


def test_whatever_is_shown_says_which_machine_it_is_of(left, controller):
    both = improve.with_box(START, improve.COMPARISON, controller)
    picture = LIVE.evaluate(left)
    page = build_offline_html(picture)
    for shown in (subject_words(picture), picture_conditions(picture), page):
        assert WITH_TABLE in shown
    assert "first-order model" not in page
    assert WITH_TABLE not in build_offline_html(LIVE.evaluate(START))
    for state in (left, both, with_pin(left)):
        assert "without the compensation table" in without_words(state)
        assert "HEIDENHAIN .COM and .CMA (X 9" in exported_words(LIVE.evaluate(state))
        bare = without_table(state)
        assert bare.controller is None
        assert bare.comparison.b is None
        assert bare.comparison.pinned is None


def test_no_file_keeps_the_table_and_a_restored_tab_says_so(controller):
    both = improve.with_box(START, improve.COMPARISON, controller)
    assert state_to_toml(without_table(both), None) == state_to_toml(START, None)
    restored, _, missing = read_page_copy(page_copy_text(both, None, [SCENE]), [SCENE])
    assert restored.controller is None
    assert restored.comparison.b is None
    assert NO_TABLE in missing
    assert NO_TABLE not in read_page_copy(page_copy_text(START, None, [SCENE]), [SCENE])[2]


def shown(part, state, found):
    """Give what the section says of a table that was computed."""
    part.last_key = part.result_key(state)
    part.outcome = AnalysisOutcome(part.last_key, found)
    return section(part, state)


def test_words_of_others_are_escaped(found, controller):
    hostile = "<script>alert(1)</script>"
    worded = replace(controller, label=hostile, notes=(hostile,), assumed=(hostile,))
    given = replace(found, controller=worded)
    left = improve.with_box(START, improve.RESIDUAL, worded)
    page = build_offline_html(LIVE.evaluate(left)).partition("<iframe")[0]
    for text in (shown(*asking(), given), page):
        assert "<script>" not in text
        assert "&lt;script&gt;" in text


def test_a_table_is_saved_whole_and_the_box_then_shows_before_and_after(found):
    part, state = asking()
    html = shown(part, state, found)
    assert "SINUMERIK $AN_CEC" in html
    assert 'data-do="save_table"' in html
    after = part.handle(state, do.Signal.SAVE_TABLE)
    assert after.controller is found.controller
    assert after.comparison.b is not None
    ((name, content),) = part.context.told
    assert name == "compensation.zip"
    assert zipfile.ZipFile(io.BytesIO(content)).namelist() == [
        f"compensation{add or found.format.endings[0]}" for add in found.files
    ]
    assert improve.packed(found) == (name, content)  # the same table gives the same bytes
    assert part.handle(after, do.ShowBox("machine")).controller is None
    assert part.handle(state, do.ShowBox("<b>")) == state
    hostile = part.handle(state, do.SetOption("compensate", "formats", "<b>"))
    assert hostile.forms["compensate.formats"] == "<b>"


def test_what_is_left_of_rounding_is_said_and_not_drawn(found):
    # its largest error is below the step that was asked for
    words = shown(*asking(), replace(found, resolution=0.05))
    assert "below the resolution of the file" in words
    assert 'residual&quot;}" title="Residual below numerical resolution"' in words
    assert "resolution of the file" not in shown(*asking(), found)


def test_a_point_that_is_asked_about_lies_on_the_drawn_box(left):
    picture = LIVE.evaluate(left)
    asked = with_picked(left, pick_worst(picture))
    assert asked.picked is not None
    explained = point_explanation.explain_point(asked, asked.picked, picture.exaggeration)
    worst = np.unravel_index(int(np.argmax(picture.field.norm_um)), picture.shape)
    assert np.abs(explained.drawn_um - picture.field.error_um[worst]).max() < 1e-9
    assert np.abs(explained.drawn_mm - picture.drawn_mm[worst]).max() < 1e-6
    # what it is made of are the errors, of which the table is none
    bare = without_table(asked)
    plain = point_explanation.explain_point(bare, asked.picked, picture.exaggeration)
    assert np.array_equal(explained.explanation.error_um, plain.explanation.error_um)
    assert np.linalg.norm(plain.drawn_um) > 2.0 * np.linalg.norm(explained.drawn_um)
    assert explained.is_corrected
    assert not plain.is_corrected
    said = [label.text for label in point_labels(LIVE.evaluate(asked)) if label.kind == "asked"]
    assert f"{picture.statistics.max_um:.1f} µm" in said[0]


def test_maps_are_drawn_beside_the_page(found):
    assert draw_compensation(found, False, False, threading.Event()).startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["wFXt", "wXFt", "only Y moves", "only X stands still"])
def test_machines_with_few_moving_axes_have_box_and_maps_too(name):
    state = start_state(still_scene(name))
    given = computed(state, {**CHOICE, "points": "5"})
    picture = LIVE.evaluate(improve.with_box(state, improve.COMPARISON, given.controller))
    assert picture.compared.b.max_um <= picture.compared.a.max_um
    for narrow in (True, False):
        assert compensation_maps(given, False, narrow).axes


@pytest.mark.parametrize(
    ("name", "choice", "says"),
    [
        ("", {"formats": "<b>nonsense"}, "no controller selected"),
        ("", {**CHOICE, "points": "102"}, "at most 101"),
        ("", {**CHOICE, "resolution": "nan"}, "expected"),
        ("wCFt", CHOICE, "to correct"),
        ("nothing moves", CHOICE, "to correct"),
    ],
)
def test_nonsense_and_machines_with_nothing_to_correct_give_one_line(name, choice, says):
    with pytest.raises(WarpspaceError, match=says) as raised:
        computed(start_state(still_scene(name)) if name else START, choice)
    assert len(str(raised.value)) < 300
    assert "\n" not in str(raised.value)


def test_a_part_is_cut_with_the_table(left):
    corners = np.array([[x, y, z] for x in (0, 200) for y in (0, 150) for z in (0, 80)], float)
    mesh = Workpiece("box", corners, np.array([[0, 1, 2], [5, 6, 7]], "i4"))
    parts = (replace(state, part=PartLook(mesh, "box")) for state in (START, left))
    cut = [LIVE.evaluate(state).part.error_um for state in parts]
    before, after = (np.linalg.norm(error_um, axis=1).max() for error_um in cut)
    assert after < 0.1 * before
