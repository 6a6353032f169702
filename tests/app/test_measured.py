"""Tests, Calibrate, imports: what is measured, read, fitted, drawn and applied."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from markupsafe import Markup

from app.wire import opened
from warpspace.app.documents.import_offer import (
    LONGEST_AXES,
    LONGEST_PROBLEM,
    Offer,
    Said,
    asking,
    offered,
    said_again,
)
from warpspace.app.documents.view_settings import settings_line, with_settings
from warpspace.app.evaluation import cache
from warpspace.app.evaluation.calibration import (
    AFTER,
    BEFORE,
    MOST_FILES,
    Measured,
    StoppedError,
    answer,
    ask,
    bundled,
    calibrated_state,
    is_applied,
    take,
    with_calibrated_beside,
)
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.readouts.bench import bench_html
from warpspace.app.readouts.calibration import arrows_of, calibration_html, files_html
from warpspace.app.readouts.html import message
from warpspace.app.readouts.import_preview import preview_html
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.bench.base import bench_names
from warpspace.calibration.calibrate import Calibrate
from warpspace.exceptions import OptionError, SceneError, UnsaidError, WarpspaceError
from warpspace.formats.compensation.compensate import Compensate, compensate
from warpspace.formats.registry import formats
from warpspace.formats.source import Source, source_of_text
from warpspace.scene.library import load_scene

STATE = start_state(load_scene("dvf5000_first"), nodes=5)
LIVE = LiveModel()


def chosen(name, state=STATE, **options):
    look = state.bench.with_test(name)
    for option, text in options.items():
        look = look.with_option(option, text)
    return replace(state, bench=look)


@pytest.mark.parametrize("name", bench_names())
def test_figure_and_path_follow_the_errors(name):
    found = LIVE.evaluate(chosen(name)).bench
    html = bench_html(found)
    assert "<svg" in html
    assert "nan" not in html
    for quantity in found.run.outcome.quantities:
        assert f'data-value="test {quantity.key}"' in html
    moved = LIVE.evaluate(chosen(name, STATE.with_amplitude("EC0Y", 150.0))).bench
    assert moved.prepared is found.prepared
    assert np.abs(moved.error_um - found.error_um).max() > 1.0
    ((nominal, actual), *_) = moved.lines_mm(1000.0)
    rows = moved.prepared.plan.path[0]
    np.testing.assert_allclose(actual - nominal, moved.error_um[rows], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("circular", {"radius_mm": "much"}, "Radius 'much'; expected a number"),
        ("circular", {"radius_mm": "900"}, "leaves the working volume"),
        ("circular", {"points": "20000"}, "expected at most 20,000 in the app"),
        ("sphere", {"at": "Q=1"}, "At 'Q=1': unknown axis Q; expected one of"),
    ],
)
def test_what_cannot_be_run_is_said_in_its_place(name, options, message):
    found = LIVE.evaluate(chosen(name, **options)).bench
    assert isinstance(found, str)
    assert message in found
    assert "test problem" in bench_html(found)
    other = start_state(load_scene("machine_c_frame_mill"), nodes=3)
    assert "no rotary axis" in str(LIVE.evaluate(chosen("sphere", other)).bench)


def test_tables_turn_where_the_axes_stand():
    there = LIVE.evaluate(chosen("sphere", STATE.with_position("B", -20.0))).bench
    assert there.prepared.plan.coordinates["B"][0] == -20.0


def test_link_keeps_test_and_options_and_refuses_others():
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


def test_compared_states_run_the_same_test():
    pinned = with_pin(chosen("circular"))
    changed = pinned.with_amplitude("EC0Y", 100.0)
    shown = {}
    for side in ("a", "b", "difference"):
        state = replace(changed, comparison=replace(changed.comparison, shown=side))
        shown[side] = LIVE.evaluate(state).bench
    assert shown["difference"] is None
    assert np.abs(shown["a"].readings - shown["b"].readings).max() > 1.0


SCENE = load_scene("fork_head_bc")
START = replace(start_state(SCENE), nodes=5)
HOSTILE = "<img src=x onerror=alert(1)>\"'&"
TABLE = """b_deg,c_deg,x_mm,y_mm,z_mm,session
0,0,1,2,3,{0}
30,0,1.1,2,3,{0}
-30,20,1.2,2.1,3,{0}
30,90,1.1,2.2,3.1,{0}
-30,180,1.1,2.3,3.1,{0}
10,270,1.1,2.2,3.2,{0}
"""


def plain(word):
    return Markup('data-word="%s"') % word


def asked(state=START, keys="auto", *, robust=False, text=None, name="tcp_on.csv"):
    file = take(SCENE, text or bundled("tcp_on.csv"), name, None, ())
    return ask(state, [file], keys, robust=robust)


@pytest.fixture(scope="module")
def given():
    return answer(asked(), threading.Event(), lambda _: None)


def test_the_numbers_are_those_of_the_analysis(given):
    said = Calibrate(data=("tcp_on.csv",), next_count=3).run(SCENE, lambda _: None).as_json()
    assert given.found.rms_before_mm == pytest.approx(0.2783, abs=5e-5)
    assert given.found.rms_after_mm == pytest.approx(0.0615, abs=5e-5)
    assert said["rms_after_mm"] == pytest.approx(given.found.rms_after_mm, rel=1e-9)
    for one, row in zip(given.found.parameters, said["parameters"], strict=True):
        assert (one.key, one.identifiable) == (row["key"], row["identifiable"])
        assert one.value == pytest.approx(row["value"], rel=1e-9)
    assert [one.candidate.name for one in given.found.steps] == [
        row["measurement"] for row in said["next"]
    ]


def test_apply_brings_constants_without_sliders_and_one_undo_takes_them_back(given):
    assert "EB0B" not in START.amplitudes
    store = StateStore(START)
    store.apply(lambda state: calibrated_state(state, given))
    found = {one.key: one.value for one in given.found.parameters}
    assert store.state.amplitudes["EB0B"] == found["EB0B"] != 0.0
    assert is_applied(store.state, given)
    assert not is_applied(store.state.with_amplitude("EXX", 5.0), given)
    compared = LiveModel().evaluate(store.state).compared
    assert compared.titles[0] == BEFORE
    assert compared.a.max_um == 0.0
    assert compared.b.max_um > 100.0
    store.undo()
    assert store.state == START
    # compared alone, no error changes
    beside = with_calibrated_beside(START, given)
    assert beside.amplitudes == START.amplitudes
    shown = LiveModel().evaluate(beside).compared
    assert (shown.shown, shown.titles[1]) == ("b", AFTER)
    assert shown.b.max_um == pytest.approx(compared.b.max_um)


def test_the_present_errors_are_what_a_fit_begins_with(given):
    again = answer(asked(calibrated_state(START, given)), threading.Event(), lambda _: None)
    assert again.found.rms_before_mm == pytest.approx(given.found.rms_after_mm, rel=1e-3)
    assert again.found.scene.title == given.found.scene.title


def test_a_question_is_new_only_where_the_answer_may_be():
    first = asked()
    assert first == asked(START.with_component("z").with_shown(dark=True))
    assert first != asked(START.with_amplitude("EXX", 3.0))
    assert first != asked(START.with_position("B", 10.0))
    assert first != asked(keys="EX0B")
    assert first != asked(robust=True)
    assert first != asked(name="other.csv")


def test_hostile_names_and_sessions_are_escaped():
    text = TABLE.format(HOSTILE.replace('"', "").replace("'", ""))
    file = take(SCENE, text, HOSTILE, None, ())
    assert HOSTILE not in files_html([file], HOSTILE, HOSTILE, plain)
    found = answer(ask(START, [file], "EX0B", robust=False), threading.Event(), lambda _: None)
    for standing in ("current", "stale", "applied"):
        html = calibration_html(found, standing, plain, HOSTILE)
        assert "<img" not in html
    off = take(SCENE, bundled("tcp_off.csv").replace("c1", "<img src=x>"), HOSTILE, None, ())
    found = answer(ask(START, [off], "auto", robust=False), threading.Event(), lambda _: None)
    html = calibration_html(found, "current", plain)
    assert "<img" not in html
    assert "&lt;img src=x&gt;" in html
    assert "308.9637" in html


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "expected those of a kind"),
        (
            "x_mm,y_mm,z_mm,b_deg,session\n" + "".join(f"1,1,1,{n},s{n}\n" for n in range(101)),
            "names 101 sessions",
        ),
        ("x_mm,y_mm,z_mm,b_deg\n" + "".join(f"1,1,{n},2\n" for n in range(5_001)), "at most 5,000"),
    ],
)
def test_bad_files_are_refused_with_one_message(text, words):
    with pytest.raises(WarpspaceError, match=words):
        take(SCENE, text, "bad.csv", None, ())


def test_nothing_of_a_browser_becomes_a_path(tmp_path, monkeypatch):
    secret = tmp_path / "secret.csv"
    secret.write_text(bundled("tcp_on.csv"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for kind in (None, "sphere-tcp", "positioning", "circular:plane=XY"):
        with pytest.raises(WarpspaceError, match="secret"):
            take(SCENE, "", str(secret), kind, ())
    for name in (str(secret), "secret.csv", "../secret.csv"):
        with pytest.raises(OptionError, match="expected one of"):
            bundled(name)


def test_files_have_names_of_their_own_and_are_few():
    files: tuple[Measured, ...] = ()
    for _ in range(MOST_FILES):
        files = (*files, take(SCENE, bundled("tcp_on.csv"), "a.csv", None, files))
    assert len({one.name for one in files}) == MOST_FILES
    with pytest.raises(OptionError, match="remove one first"):
        take(SCENE, bundled("tcp_on.csv"), "a.csv", None, files)


@pytest.mark.parametrize(
    ("keys", "words"), [("EQ0", "EQ0"), ("auto,EX0B", "auto"), ("EX0B," * 200, "500 characters")]
)
def test_bad_parameters_are_refused(keys, words):
    with pytest.raises(WarpspaceError, match=words):
        answer(asked(keys=keys), threading.Event(), lambda _: None)


def test_a_cancelled_fit_ends_and_leaves_room_for_the_next():
    cancelled = threading.Event()
    with pytest.raises(StoppedError):
        answer(asked(), cancelled, lambda words: cancelled.set() if "Fitting" in words else None)
    assert cache._TURN.acquire(timeout=1.0)
    cache._TURN.release()


def test_readings_of_another_machine_are_refused_at_the_fit():
    other = replace(asked(), start=load_scene("machine_gantry_mill"))
    with pytest.raises((OptionError, SceneError), match="tcp_on"):
        answer(other, threading.Event(), lambda _: None)


def test_a_page_fits_and_takes_only_known_words_and_files():
    with opened(SCENE) as (wire, session, panels):
        panel, act = panels["CalibratePanel"], session.context.act
        part = panel._readings
        act(lambda: part._add_upload("../../<b>.csv", b"\xff\xfe"))
        assert wire.read_until(lambda: "not UTF-8" in part._problem)
        assert "<" not in part._problem
        act(lambda: part._add_upload("../../etc/passwd", b"x" * (2 * 2**20 + 1)))
        assert wire.read_until(lambda: "2.0 MB" in part._problem)
        act(lambda: part._add_upload("../../tcp<b>.csv", bundled("tcp_on.csv").encode()))
        assert wire.read_until(lambda: [one.name for one in part.files] == ["tcp_b.csv"])
        assert part._problem == ""
        act(panel._fit)
        assert wire.read_until(lambda: panel._answer is not None, seconds=60.0)
        state = session.state
        for word in ("remove 9", "remove -1", "remove", "delete", "", "apply 1", "x" * 100):
            act(lambda word=word: part._do(word))
            act(lambda word=word: panel._do(word))
        act(lambda: panel._do("compare"))
        assert wire.read_until(lambda: session.state.comparison.b is not None)
        assert session.state.amplitudes == state.amplitudes
        assert len(part.files) == 1


def test_readings_of_a_standard_test_come_with_its_options():
    rows = [
        f"{run},{way},{target},{0.02 * (target - 350)}"
        for run in (1, 2)
        for way in "+-"
        for target in range(150, 551, 50)
    ]
    text = "run,direction,target_mm,deviation_um\n" + "\n".join(rows) + "\n"
    file = take(SCENE, text, "x.csv", "positioning:axis=X", ())
    assert file.count == len(rows)
    found = answer(ask(START, [file], "EXX", robust=False), threading.Event(), lambda _: None)
    assert found.found.rms_after_mm < 1e-9 < found.found.rms_before_mm
    assert "none of these" not in calibration_html(found, "current", plain)
    assert arrows_of(found, before=True)[0].shape == (0, 3)


NOMINAL = load_scene("dvf5000_nominal")
COMP = "-20 0.001 0.003\n0 0.002 0.004\n20 0.005 0.006\n"


def unsaid(text, name):
    """Offer a file that does not say enough."""
    source = source_of_text(text, name)
    with pytest.raises(UnsaidError) as caught:
        offered([source], NOMINAL)
    return asking([source], caught.value)


def test_a_format_that_is_not_recognised_is_asked_for():
    offer = unsaid("0\t0.001\t0.002\n", "data.dat")
    assert offer.kind is None
    assert "no format that is known" in offer.problem
    chosen = said_again(offer, Said(format="linuxcnc-comp"), NOMINAL)
    assert "which axis" in chosen.problem
    assert said_again(chosen, Said("linuxcnc-comp", "X"), NOMINAL).can_apply


def test_a_choice_that_does_not_fit_keeps_the_files_and_the_last_preview():
    good = offered([source_of_text("X [mm],EXX [um]\n-200,1\n200,2\n", "x.csv")], NOMINAL)
    assert good.can_apply
    bad = said_again(good, Said(format="heidenhain"), NOMINAL)
    assert bad.problem.startswith("x.csv: ")
    assert not bad.can_apply
    assert bad.sources == good.sources
    assert bad.reading is good.reading
    assert bad.made is good.made
    again = said_again(bad, Said(), NOMINAL)
    assert again.can_apply
    assert again.made.text == good.made.text


def test_only_what_a_choice_may_mend_is_asked_for():
    for text, name in (
        ("X [mm],EXX [um]\n0,1\n0,2\n", "bad.csv"),
        ("X [mm],EXX [um]\n0,1\n9000,2\n", "far.csv"),
        ("X [mm],EXX\n0,1\n", "unit.csv"),
    ):
        with pytest.raises(SceneError) as caught:
            offered([source_of_text(text, name)], NOMINAL)
        assert not isinstance(caught.value, UnsaidError)


def test_what_is_said_is_clamped_and_shown_escaped():
    long = said_again(unsaid(COMP, "joint.comp"), Said(axes=HOSTILE * 100_000), NOMINAL)
    assert 0 < len(long.problem) <= LONGEST_PROBLEM
    assert len(long.said.fitting(long.kind).axes) == LONGEST_AXES
    assert "<img" not in message(long.problem, "import-problem")
    found = offered([source_of_text("X [mm],EXX [um]\n-200,1\n200,2\n", "x.csv")], NOMINAL)
    assert found.reading is not None
    page = preview_html(found.reading, [HOSTILE], HOSTILE, [HOSTILE], stale=True)
    assert "<img" not in page
    assert "As it was last read" in page
    assert "As it was last read" not in preview_html(found.reading, ["x"], "m", [])


ENC = (
    "$AA_ENC_COMP[0,0,X]=0.001\n$AA_ENC_COMP[0,1,X]=0.002\n$AA_ENC_COMP_STEP[0,X]=10\n"
    "$AA_ENC_COMP_MIN[0,X]=0\n$AA_ENC_COMP_MAX[0,X]=10\n"
)


def files():
    """Give files of every format, and some of none."""
    scene = load_scene("dvf5000_first")
    found: list[list[Source]] = []
    for kind in formats():
        if kind.can_write:
            points = 3 if not kind.grid.startswith("none") else None
            made = compensate(scene, Compensate(formats=(kind.name,), points=points), 3)
            found.append(
                [
                    source_of_text(text, f"c{add or kind.endings[0]}")
                    for add, text in made.files.items()
                ]
            )
    return [*found, *([source_of_text(text, "x.txt")] for text in (COMP, ENC, "a b\n", "{}[]=\n#"))]


def test_any_files_as_any_format_are_read_or_refused_in_words():
    read = 0
    for sources in files():
        for kind in formats():
            start = Offer(tuple(sources))
            for axes in ("", "X", "AX1=X, Q=B"):
                found = said_again(start, Said(kind.name, axes), NOMINAL)
                assert found.can_apply == (not found.problem)
                read += found.can_apply
    assert read >= len(formats())
