"""State of a session: pure updates, stores, undo, exclusions, edits."""

import gc
import threading
import weakref
from dataclasses import replace

import numpy as np
import pytest

from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.machine_edits import with_word
from warpspace.app.state import edits
from warpspace.app.state.app_state import Exclusions, start_state
from warpspace.app.state.store import SAME_STEP_S, STEPS, STEPS_BYTES, StateStore, changes
from warpspace.app.state.tree import put, spell
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Constant, Ramp, TableCurve
from warpspace.machine.limits import MAX_ERROR
from warpspace.parts.workpiece import Workpiece
from warpspace.scene.library import load_scene
from warpspace.scene.notes import Note, with_note

FIRST = start_state(load_scene("dvf5000_first"))


@pytest.fixture
def store():
    return StateStore(FIRST)


@pytest.fixture
def tabs():
    """Stores of two tabs of a shared review."""
    whole = StateStore(FIRST)
    return whole.joined(), whole.joined()


@pytest.mark.parametrize(
    ("path", "text", "kept", "note"),
    [
        ("amplitudes.EAX", " 12,5 µrad", "12.5", ""),
        ("amplitudes.EAX", "120", "120.0", ""),  # the range of the slider grows
        ("amplitudes.EAX", "abc", "5.5", "EAX = 'abc'; expected a number; unchanged"),
        ("amplitudes.EXX", "−1e9", repr(-MAX_ERROR), "EXX = -1e+09 is outside"),
        ("positions.B", "500°", "30.0", "B = 500 is outside -120 to 30 °; clamped to 30 °"),
        ("amplitudes.EXX", "nan", "0.0", "EXX = 'nan'; expected a number"),
        ("exaggeration", "×250", "250.0", ""),
        ("exaggeration", "auto", "auto", ""),
        ("nodes", "12", "13", ""),
        ("component", "w", "norm", "component = 'w'; expected one of norm, x, y, z; unch"),
        ("shown.ghost", "maybe", "1", "nominal box = 'maybe'; expected 0 or 1; unch"),
        ("exclusions.excluded", "EXX,EYX,?", "EXX,EYX", "excluded errors: ? ignored"),
        ("rotary.own_mm", "10; 20,5; -3e3", "10.0,20.5,-2000.0", "clamped to -2000 mm"),
        ("rotary.held.B", "-30 0 90", "-30.0,0.0", "B held at: 90 ignored"),
        ("rotary.held.B", "−30, 0; 30° 0", "-30.0,0.0,30.0", ""),
        ("rotary.held.B", "10, abc nan inf", "10.0", "ignored"),
        (
            "rotary.held.B",
            "0 1 2 3 4 5 6 7 8",
            "0.0,1.0,2.0,3.0,4.0,5.0,6.0,7.0",
            "only the first 8 are used",
        ),
        ("tolerances.EAX", "3", "3.0", ""),
        ("tolerances.EAX", "-1", "0.0", "tolerance of roll of X = -1 is outside 0 to 1000 µrad"),
        ("tolerances.EAX", "1e9", "1000.0", "clamped to 1000 µrad"),
        ("specification.costs", "EXX=4; EYX=1", "EXX=4", ""),
        *(
            ("specification.costs", text, "", f"costs of tolerances = '{text}'; ")
            for text in ("EXX", "EXX=2=3", "EXQ=2", "EXX=nan", "EXX=0", "EXX=-1", "EXX=9e9")
        ),
        ("picked", "X 1,5", "X 1.5 Y 0.0 Z -280.0", ""),
        ("page.open", "gains,budget", "budget,gains", ""),
        ("page.task", "improve", "improve", ""),
        ("page.row", "EAX", "EAX", ""),
    ],
)
def test_a_leaf_takes_what_people_type_and_says_what_it_does_not(path, text, kept, note):
    state = put(FIRST, path, text)
    assert spell(state, path) == kept
    assert note in "; ".join(state.notes)
    assert bool(note) is bool(state.notes)
    is_change = spell(FIRST, path) != kept and not path.startswith("page")
    assert bool(changes(FIRST, state.without_notes())) is is_change


def test_what_follows_a_leaf_follows_it_and_members_come_and_go():
    assert put(FIRST, "look.range_top", "33").look.range_mode == "fixed"
    assert not put(put(FIRST, "look.follow", "1"), "look.slices_mm.X", "1").look.follow
    some = put(put(FIRST, "exclusions.only", "EXX,EYX"), "exclusions.only", "-EXX,+EZX")
    assert some.exclusions.only == {"EYX", "EZX"}
    for path, text in (
        *(("look.evil", "1"), ("amplitudes.QQQ", "1"), ("positions.A", "1"), ("loop", "loop")),
        *(("tolerances.EXA", "1"), ("exclusions.excluded", "+EXA")),
    ):
        state = put(FIRST, path, text)
        assert state.notes
        assert state.without_notes() == FIRST
    assert put(FIRST, "page.row", "EAX").with_scene(FIRST.scene).page.row == "EAX"


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (put(FIRST, "amplitudes.EAX", "1"), "roll of X"),
        (FIRST.with_amplitude("EAX", 1.0).with_amplitude("EBX", 1.0), "roll of X and 1 more"),
        (put(FIRST, "positions.B", "1"), "position of B"),
        (put(FIRST, "exclusions.only", "+EAX"), "only roll of X"),
        (put(FIRST, "tolerances.EAX", "1"), "tolerance of roll of X"),
        (put(FIRST, "loop", "tool"), "structural loop"),
        (edits.with_curve(FIRST, "EAX", Constant((-275.0, 275.0), 3.0)), "roll of X"),
        (FIRST.with_scene(load_scene("teach_tilted_c")), "scene"),
        (with_word(FIRST, "travel X 0 -200"), "machine"),
        (replace(with_pin(FIRST), controller=object()), "compensation table"),
        (with_pin(FIRST), "comparison"),
    ],
)
def test_undo_says_what_it_takes_back(state, words, store):
    store.apply(lambda _: state)
    assert store.undo() == words


@pytest.mark.parametrize(
    ("path", "text"),
    [("look.surface", "cut"), ("rotary.held.B", "1"), ("picked", "X 1"), ("component", "z"),
     ("shown.dark", "1"), ("exaggeration", "50"), ("machine.shown", "1"), ("page.task", "improve"),
     ("nodes", "9"), ("lever", "EAX"), ("comparison.shown", "b")],
)  # fmt: skip
def test_a_change_of_the_view_is_no_step_and_stays(path, text, store):
    store.apply(moved("EAX", 1.0))
    store.undo()
    store.apply(lambda state: put(state, path, text))
    assert spell(store.state, path) != spell(FIRST, path)
    assert store.undo() == ""
    assert store.redo() == store.undo() == "roll of X"
    assert store.state == put(FIRST, path, text)
    # nor is a step that changed the same setting prevented from being undone
    store.apply(lambda state: put(moved("EAX", 2.0)(state), path, spell(FIRST, path)))
    store.apply(lambda state: put(state, path, text))
    assert store.undo() == "roll of X"
    assert store.state == put(FIRST, path, text)


def test_undo_of_another_scene_restores_its_view(store):
    at = put(FIRST, "picked", "X 1").picked
    store.apply(lambda state: replace(state, picked=at))
    store.apply(lambda state: state.with_scene(load_scene("ur10")))
    store.apply(lambda state: put(state, "picked", "J1 1"))
    store.apply(lambda state: put(state, "shown.dark", "1"))
    assert store.undo() == "scene"
    assert store.state.picked == at
    assert store.state.shown.dark


def test_another_side_of_a_comparison_is_drawn_and_the_comparison_undone(store):
    store.apply(with_pin)
    store.apply(lambda state: put(state, "comparison.ghost", "0"))
    assert store.undo() == "comparison"
    assert store.state.comparison.pinned is None


def test_a_machine_that_moves_its_workpiece_opens_in_the_relative_loop():
    assert FIRST.loop is Loop.RELATIVE
    assert start_state(load_scene("machine_scara")).loop is Loop.TOOL


def test_another_scene_keeps_how_it_is_looked_at():
    state = put(put(FIRST, "component", "z"), "shown.traces", "0")
    other = state.with_scene(load_scene("dvf5000_second"))
    assert (other.component, other.shown.traces) == ("z", False)
    assert other.amplitudes["EAY"] != FIRST.amplitudes["EAY"]


def moved(key, value):
    return lambda state: put(state, f"amplitudes.{key}", repr(value))


def test_undo_and_redo_name_what_they_do_and_notes_are_not_kept(store):
    assert "clamped" in store.apply(moved("EAX", 1e9))[0]
    assert store.state.notes == ()
    assert store.undo() == "roll of X"
    assert store.redo() == "roll of X"
    assert store.state == FIRST.with_amplitude("EAX", MAX_ERROR)
    assert store.redo() == ""


def test_everybody_else_is_told(store):
    told = []
    one, two = (lambda: told.append("one")), (lambda: told.append("two"))
    store.subscribe(one)
    store.subscribe(two)
    store.apply(moved("EAX", 1.0), by=one)
    assert told == ["two"]
    store.apply(lambda state: state, by=one)
    assert told == ["two"]
    store.undo()
    assert sorted(told) == ["one", "two", "two"]
    store.unsubscribe(two)
    store.redo()
    assert told.count("two") == 2


def test_what_raises_changes_nothing_and_blocks_nobody(store):
    with pytest.raises(ZeroDivisionError):
        store.apply(lambda _: 1 / 0)
    store.apply(moved("EAX", 1.0))
    assert store.state.amplitudes["EAX"] == 1.0


def test_many_steer_one_store_nothing_is_lost_and_the_past_is_bounded(store):
    keys = ("EXX", "EYX", "EZX", "EAX", "EBX", "ECX")

    def steer(key):
        for value in range(60):
            store.apply(moved(key, value / 10.0))

    threads = [threading.Thread(target=steer, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(store.state.amplitudes[key] == 5.9 for key in keys)
    for tick in range(STEPS + 20):
        pushed(store, "EAX", 0.1 * (tick + 1), 1e9 + 10.0 * tick)
    assert len(store.past) == STEPS


def test_a_copy_goes_its_own_way(store):
    store.apply(moved("EAX", 1.0))
    copy = store.copy()
    store.apply(moved("EAX", 2.0))
    assert copy.state.amplitudes["EAX"] == 1.0
    copy.undo()
    assert copy.state == FIRST


def pushed(store, key, value, at):
    store.apply(lambda _: store.state.with_amplitude(key, value), at=at)


def test_a_drag_is_one_step_and_a_pause_or_another_slider_begins_another(store):
    for tick in range(40):
        pushed(store, "EAX", 0.1 * (tick + 1), tick * 0.05)
    dragged = store.state
    assert len(store.past) == 1
    assert store.undo() == "roll of X"
    assert store.state == FIRST
    assert store.redo() == "roll of X"
    assert store.state == dragged
    pushed(store, "EAX", 2.0, 2.0)
    pushed(store, "EAX", 3.0, 2.1 + SAME_STEP_S)
    pushed(store, "EBX", 1.0, 2.1 + SAME_STEP_S)
    assert [step.label for step in store.past] == [*["roll of X"] * 3, "pitch of X"]


def test_a_change_after_undo_forgets_the_future_and_none_is_no_step(store):
    store.apply(replace, at=1.0)
    assert store.state is FIRST
    assert (store.past, store.undo(), store.redo()) == ([], "", "")
    pushed(store, "EAX", 1.0, 1.0)
    store.undo()
    assert store.redoes == "roll of X"
    pushed(store, "EAX", 3.0, 1.1)
    assert store.redo() == ""
    store.undo()
    assert store.state == FIRST


def test_what_is_excluded_is_zero_and_only_takes_part_alone():
    def left(*, excluded="", only=""):
        found = Exclusions(frozenset(excluded.split()), frozenset(only.split()))
        return {key for key, at in replace(FIRST, exclusions=found).active.items() if at}

    every = {key for key, at in FIRST.amplitudes.items() if at}
    assert FIRST.active is FIRST.amplitudes
    assert left(excluded="EAX") == every - {"EAX"}
    assert left(only="EAX EAY") == {"EAX", "EAY"}
    assert left(only="EAX", excluded="EAX") == set()
    lacking = Exclusions(frozenset({"EAX"}), frozenset({"EXA"}))
    assert lacking.within(FIRST.amplitudes) == Exclusions(frozenset({"EAX"}))


LIVE = LiveModel()
SPAN = (-275.0, 275.0)


def test_a_curve_moves_amplitude_slider_and_picture():
    curve = TableCurve(SPAN, ((-275.0, 0.0), (0.0, 30.0), (275.0, -4.0)))
    state = edits.with_curve(FIRST, "EXX", curve)
    assert state.amplitudes["EXX"] == 30.0
    assert state.curve("EXX") == curve
    before, after = LIVE.evaluate(FIRST), LIVE.evaluate(state)
    moved = (after.field.error_um - before.field.error_um)[:, 10, 10, 0]
    np.testing.assert_allclose(moved[[0, 10, 20]], [0.0, 30.0, -4.0], atol=1e-9)
    assert edits.with_curve(state, "EXX", curve) is state
    # and its slider scales it
    assert state.with_amplitude("EXX", 8.0).curve("EXX").amplitude == pytest.approx(8.0)


def test_the_centre_of_a_tolerance_stays_and_that_of_the_scene_comes_back():
    changed = edits.with_scene_tolerances(put(FIRST, "tolerances.EAX", "3"))
    assert changed.tolerances == FIRST.scene.tolerances
    proposed = start_state(load_scene("dvf5000_proposed"))
    assert put(proposed, "tolerances.EAX", "1").tolerances.get("EAX").centre == -8.0


def test_a_constant_parameter_takes_constants_only():
    state = edits.with_curve(FIRST, "EC0Y", Ramp((-225.0, 225.0), 3.0))
    assert state.amplitudes == FIRST.amplitudes
    assert "constant" in state.notes[0]
    assert edits.with_curve(FIRST, "EC0Y", Constant((-225.0, 225.0), 3.0)).amplitudes["EC0Y"] == 3.0
    assert edits.with_curve(FIRST, "EXA", Constant(SPAN, 1.0)).amplitudes == FIRST.amplitudes


def test_reset_brings_curves_back_and_forgets_that_any_was_edited():
    state = edits.with_curve(FIRST, "EAX", Constant(SPAN, 3.0))
    state = edits.with_curve(state, "EAY", Constant((-225.0, 225.0), 2.0))
    assert state.origin is FIRST.scene
    whole = state.reset()
    assert whole.curve("EAX") == FIRST.curve("EAX")
    assert whole.scene is FIRST.scene
    assert whole.loaded is None


def test_undo_takes_back_the_last_change_of_its_own_tab(tabs):
    mine, yours = tabs
    mine.apply(moved("EAX", 1.0))
    yours.apply(moved("EBX", 2.0))
    yours.apply(lambda state: put(state, "loop", "tool"))
    assert (mine.undoes, yours.undoes) == ("roll of X", "structural loop")
    assert mine.undo() == "roll of X"
    assert (mine.undoes, mine.redoes) == ("", "roll of X")
    assert yours.state.amplitudes == {**FIRST.amplitudes, "EBX": 2.0}
    assert [*yours.state.amplitudes] == [*FIRST.amplitudes]
    assert yours.state.loop is Loop.TOOL
    mine.redo()
    assert yours.undo() == "structural loop"
    assert yours.state == FIRST.with_amplitude("EAX", 1.0).with_amplitude("EBX", 2.0)


@pytest.mark.parametrize("back", [True, False])
def test_undo_and_redo_leave_what_somebody_else_has_changed_since_and_say_so(back, tabs):
    mine, yours = tabs
    mine.apply(moved("EBX", 1.0))
    mine.apply(moved("EAX", 1.0))
    if not back:
        mine.undo()
    yours.apply(moved("EAX", 2.0))
    with pytest.raises(OptionError, match="roll of X: somebody else has changed"):
        mine.undo() if back else mine.redo()
    assert mine.state.amplitudes["EAX"] == 2.0
    assert mine.undo() == "pitch of X"  # the step that holds no more is forgotten
    assert mine.state == FIRST.with_amplitude("EAX", 2.0)


def test_two_tabs_that_exclude_errors_and_write_notes_undo_their_own(tabs):
    mine, yours = tabs
    for number, store in enumerate((mine, yours)):
        note = Note(text=f"{number}", author="", id=f"n{number}")
        excluded = put(store.state, "exclusions.excluded", f"+E{'AB'[number]}X")
        store.apply(lambda _, state=excluded: state)
        store.apply(lambda state, note=note: replace(state, review=with_note(state.review, note)))
    for _ in range(2):
        mine.undo()
    assert mine.state.exclusions.excluded == {"EBX"}
    assert [note.id for note in mine.state.review] == ["n1"]


def test_a_drag_beside_another_drag_is_one_step_without_the_other(tabs):
    mine, yours = tabs
    for tick in range(10):
        pushed(mine, "EAX", tick + 1.0, 0.1 * tick)
        pushed(yours, "EBX", tick + 2.0, 0.1 * tick)
    assert (len(mine.past), len(yours.past)) == (1, 1)
    mine.undo()
    assert mine.state == FIRST.with_amplitude("EBX", 11.0)


def with_mesh(number):
    mesh = Workpiece("x", np.full((1_000_000, 3), float(number)), np.zeros((1, 3), "i4"))
    return lambda state: replace(state, part=replace(state.part, mesh=mesh, name=f"{number}"))


def test_the_past_is_bounded_in_memory_and_what_it_forgets_is_released():
    store, meshes = StateStore(FIRST), []
    for number in range(14):  # of 24 MB each
        store.apply(with_mesh(number))
        meshes.append(weakref.ref(store.state.part.mesh))
    gc.collect()
    alive = sum(mesh() is not None for mesh in meshes)
    assert alive <= STEPS_BYTES // 24_000_000 + 2
    assert store.size_bytes <= STEPS_BYTES
    assert store.undo() != ""
    del store
    gc.collect()
    assert [mesh() for mesh in meshes] == [None] * 14
