"""The app draws what a table of compensation leaves: the same numbers, honest about which."""

import io
import threading
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from warpspace.analysis.statistics import volume_statistics
from warpspace.app.documents.compensation_files import packed
from warpspace.app.documents.conditions import picture_conditions
from warpspace.app.documents.export_request import exported_words
from warpspace.app.documents.kept_tab import NO_TABLE, kept_text, read_kept
from warpspace.app.documents.scene_file import state_to_toml
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.compensation import (
    BOTH,
    LEFT,
    MACHINE,
    Answer,
    StoppedError,
    answer,
    ask,
    box_of,
    with_box,
)
from warpspace.app.evaluation.conventions import with_reference
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.machine import tool_point
from warpspace.app.evaluation.machine_edits.updates import with_changed_scene
from warpspace.app.panels.commands import spell_change
from warpspace.app.readouts.compensation import box_words, compensation_html, note_html
from warpspace.app.readouts.summary import heading, summary
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.compensation_choice import CompensationChoice
from warpspace.app.state.history import History, describe_change
from warpspace.app.state.table import without_table, without_words
from warpspace.exceptions import WarpspaceError
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.compensate import Plan, compensate
from warpspace.kinematics.model import Loop
from warpspace.machine.travel import TravelDirection
from warpspace.scene.library import load_scene

SCENE = load_scene("dvf5000_first")
START = replace(start_state(SCENE), nodes=9)
LIVE = LiveModel()
CHOICE = CompensationChoice("heidenhain", "9")


def computed(state: AppState = START, choice: CompensationChoice = CHOICE) -> Answer:
    """Compute what a choice leaves."""
    return answer(ask(state, choice), threading.Event(), lambda _: None)


@pytest.fixture(scope="module")
def found() -> Answer:
    return computed()


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
def test_the_box_has_the_field_of_the_command(
    name: str, points: str, loop: str, orientation: bool
) -> None:
    choice = CompensationChoice(name, points, loop=loop, orientation=orientation)
    given = computed(choice=choice).found
    command = compensate(SCENE, replace(choice.plan()), 9)
    picture = LIVE.evaluate(with_box(START, LEFT, given.controller))
    assert picture.state.loop == Loop(command.loop)
    assert np.abs(picture.field.error_um - command.after.error_um).max() < 1e-9
    tilts = picture.field.orientation_urad - command.after.orientation_urad
    assert np.abs(tilts).max() < 1e-9
    assert given.after_statistics == compensate(SCENE, choice.plan()).after_statistics


def test_the_machine_may_drift_under_its_table(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    drifted = left.with_amplitude("EXX", 7.0).with_amplitude("EA0Z", -12.0)
    grid = build_grid(SCENE.model, SCENE.workspace, 9)
    shifted = ask(drifted, CHOICE).start
    wanted = found.found.controller.field(grid.coordinates, grid.nominal_mm, shifted)
    picture = LIVE.evaluate(drifted)
    assert np.abs(picture.field.error_um - wanted.error_um).max() < 1e-9
    assert picture.statistics.max_um > 2.0 * LIVE.evaluate(left).statistics.max_um
    # and what is excluded counts no more
    without = replace(drifted, exclusions=drifted.exclusions.with_excluded("EA0Z", True))
    assert np.abs(LIVE.evaluate(without).field.error_um - picture.field.error_um).max() > 1.0


def test_a_machine_without_errors_needs_no_table() -> None:
    zero = START.zeroed()
    given = computed(zero)
    picture = LIVE.evaluate(with_box(zero, LEFT, given.found.controller))
    assert picture.field.norm_um.max() < 1e-9
    assert given.found.after_statistics.max_um < 1e-9
    assert "0.000" in compensation_html(given.found, "", "", current=True)


def test_before_and_after_stand_side_by_side(found: Answer) -> None:
    both = with_box(START, BOTH, found.found.controller)
    picture = LIVE.evaluate(both)
    assert picture.compared is not None
    assert picture.compared.a == LIVE.evaluate(START).statistics
    left = LIVE.evaluate(with_box(START, LEFT, found.found.controller))
    assert picture.compared.b == left.statistics
    assert "with the table heidenhain (X 9, Y 9, Z 9 points)" in picture.compared.titles[1]
    assert "table" not in picture.compared.titles[0]
    change = volume_statistics(
        replace(left.field, error_um=left.field.error_um - LIVE.evaluate(START).field.error_um),
        left.grid,
    )
    assert picture.compared.difference is not None
    assert picture.compared.difference.max_um == pytest.approx(change.max_um)


def test_slices_traces_and_the_tool_point_have_the_table_too(found: Answer) -> None:
    controller = found.found.controller
    look = replace(START.look, surface="slices")
    left = with_box(replace(START, look=look), LEFT, controller)
    bare, picture = LIVE.evaluate(replace(START, look=look)), LIVE.evaluate(left)
    for plain, cut in zip(bare.slices, picture.slices, strict=True):
        wanted = controller.field(cut.grid.coordinates, cut.grid.nominal_mm)
        assert np.abs(cut.field.error_um - wanted.error_um).max() < 1e-9
        assert cut.field.norm_um.max() < plain.field.norm_um.max()
    # the table moves linear axes on the tool side: points of the turning table stay where they are
    for plain, line in zip(bare.traces, picture.traces, strict=True):
        assert np.abs(plain.error_um - line.error_um).max() < 0.01
    assert np.linalg.norm(tool_point(picture).error_um) < np.linalg.norm(tool_point(bare).error_um)


def test_other_loops_and_directions_of_travel_are_evaluated_as_they_are(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    tool, workpiece, relative = (
        LIVE.evaluate(replace(left, loop=loop)).field.error_um
        for loop in (Loop.TOOL, Loop.WORKPIECE, Loop.RELATIVE)
    )
    assert np.abs(relative - (tool - workpiece)).max() < 1e-3
    plain = LIVE.evaluate(replace(START, loop=Loop.WORKPIECE)).field.error_um
    assert np.abs(workpiece - plain).max() < 0.01  # no axis on that side is corrected
    model = replace(SCENE.model, direction=TravelDirection.DIFFERENCE)
    turned = replace(left, scene=replace(SCENE, model=model))
    assert LIVE.evaluate(turned).field.norm_um.max() < 1e-9  # nothing depends on the direction


def test_an_empty_table_leaves_what_is_drawn_without_one(found: Answer) -> None:
    held = with_reference(START, {"X": 100.0, "Y": -50.0, "Z": -280.0}).with_position("B", 20.0)
    empty = found.found.controller.without()
    for loop in Loop:
        plain = replace(
            held, loop=loop, look=replace(held.look, surface="slices", quantity="orientation")
        )
        bare, picture = LIVE.evaluate(plain), LIVE.evaluate(replace(plain, controller=empty))
        assert np.abs(picture.field.error_um - bare.field.error_um).max() < 0.01
        assert np.abs(picture.field.orientation_urad - bare.field.orientation_urad).max() < 0.01
        for one, other in zip(picture.slices, bare.slices, strict=True):
            assert np.abs(one.field.error_um - other.field.error_um).max() < 0.01
        for one, other in zip(picture.traces, bare.traces, strict=True):
            assert np.abs(one.error_um - other.error_um).max() < 0.01


def test_what_changes_the_machine_ends_the_table(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    assert left.with_scene(load_scene("dvf5000_second")).controller is None
    machine = replace(SCENE.model.machine, title="another")
    other = replace(SCENE, model=replace(SCENE.model, machine=machine))
    assert with_changed_scene(left, other).controller is None
    assert left.reset().controller is found.found.controller
    assert left.with_amplitude("EXX", 3.0).controller is found.found.controller


def test_the_table_can_be_undone_and_is_one_word(found: Answer) -> None:
    left = with_box(START, LEFT, found.found.controller)
    both = with_box(left, BOTH, found.found.controller)
    history = History(START).push(left, 0.0).push(both, 10.0)
    assert describe_change(START, left) == "controller"
    assert spell_change(describe_change(START, both)) == "table of compensation"
    assert history.undo().undo().present == START
    assert history.undo().undo().redo().present.controller is found.found.controller
    assert [box_of(one) for one in (START, left, both)] == [MACHINE, LEFT, BOTH]
    assert with_box(both, MACHINE, found.found.controller).comparison.b is None
    assert with_box(both, "nonsense", found.found.controller) is both
    again = computed().found.controller
    assert describe_change(left, with_box(left, LEFT, again)) == "controller"


def test_whatever_is_shown_says_which_machine_it_is_of(found: Answer) -> None:
    words = "with the table heidenhain (X 9, Y 9, Z 9 points)"
    left = with_box(START, LEFT, found.found.controller)
    both = with_box(START, BOTH, found.found.controller)
    picture = LIVE.evaluate(left)
    assert words in heading(picture)
    assert words in summary(picture)
    assert words in picture_conditions(picture)
    assert words not in heading(LIVE.evaluate(START))
    assert without_words(START) == ""
    for state in (left, both, with_pin(left)):
        assert "without the table" in without_words(state)
        assert "heidenhain (X 9" in exported_words(LIVE.evaluate(state))
        bare = without_table(state)
        assert bare.controller is None
        assert bare.comparison.b is None
        assert bare.comparison.pinned is None
    assert "earlier table" in box_words(left, computed().found)
    assert "this table" in box_words(left, found.found)
    assert "relative loop" in box_words(replace(left, loop=Loop.RELATIVE), found.found)


def test_no_file_keeps_the_table_and_a_restored_tab_says_so(found: Answer) -> None:
    both = with_box(START, BOTH, found.found.controller)
    assert state_to_toml(without_table(both), None) == state_to_toml(START, None)
    restored = read_kept(kept_text(both, None, [SCENE]), [SCENE])
    assert restored.state.controller is None
    assert restored.state.comparison.b is None
    assert NO_TABLE in restored.missing
    assert NO_TABLE not in read_kept(kept_text(START, None, [SCENE]), [SCENE]).missing


def test_words_of_others_are_escaped(found: Answer) -> None:
    hostile = "<script>alert(1)</script>"
    controller = replace(
        found.found.controller, label=hostile, notes=(hostile,), assumed=(hostile,)
    )
    given = replace(found.found, controller=controller)
    left = with_box(START, LEFT, controller)
    for text in (
        compensation_html(given, "", box_words(left, given), current=False),
        note_html(hostile, known=True),
        heading(LIVE.evaluate(left)),
        summary(LIVE.evaluate(left)),
    ):
        assert "<script>" not in text
        assert "&lt;script&gt;" in text


@pytest.mark.parametrize(
    ("choice", "says"),
    [
        (CompensationChoice("<b>nonsense"), "format"),
        (CompensationChoice("rtl"), "read only"),
        (CompensationChoice("heidenhain", "9" * 5000), "at most 100 characters"),
        (CompensationChoice("heidenhain", "99999"), "at most 101"),
        (CompensationChoice("csv", "X=5,Y=1000000"), "at most 101"),
        (CompensationChoice("fanuc-3d", "101"), "2 to 25 points"),
        (CompensationChoice("heidenhain", "many"), "expected a number of points"),
        (CompensationChoice("heidenhain", "X=2,,"), "expected a number of points"),
        (CompensationChoice("heidenhain", "Q=5"), "expected one of X, Y, Z"),
        (CompensationChoice("heidenhain", "-4"), "points an axis"),
        (CompensationChoice("heidenhain", resolution=float("nan")), "expected 0"),
        (CompensationChoice("heidenhain", loop="workpiece"), "expected tool or relative"),
        (CompensationChoice("heidenhain", orientation=True), "position only"),
        (CompensationChoice("iso-text", sign="error"), "expected error or correction"),
    ],
)
def test_nonsense_gives_one_message(choice: CompensationChoice, says: str) -> None:
    with pytest.raises(WarpspaceError) as raised:
        computed(choice=choice)
    assert says in str(raised.value)
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 300


def test_nothing_and_zero_are_what_suits_the_format() -> None:
    plans = [CompensationChoice("heidenhain", text).plan() for text in ("", "  ", "0")]
    assert len({compensate(SCENE, plan).points["X"] for plan in plans}) == 1


def test_cancelled_work_ends_and_leaves_the_turn_to_others() -> None:
    cancelled = threading.Event()
    cancelled.set()
    with pytest.raises(StoppedError):
        answer(ask(START, CHOICE), cancelled, lambda _: None)
    assert computed().found.after_statistics.max_um > 0.0


def test_several_files_come_as_one_archive(found: Answer) -> None:
    name, content = packed(found.found)
    assert name == "compensation.zip"
    with zipfile.ZipFile(io.BytesIO(content)) as bundle:
        texts = {one: bundle.read(one).decode() for one in bundle.namelist()}
    files = compensate(SCENE, Plan("heidenhain", 9)).files
    assert texts == {f"compensation{add or '.cma'}": text for add, text in files.items()}
    assert packed(found.found) == packed(found.found)
    single = compensate(SCENE, Plan("sinumerik-cec", 5))
    assert packed(single) == ("compensation.ini", single.files[""].encode())
