"""The tab Calibrate: the command's numbers, compare, apply and undo, stale answers, bad files."""

import contextlib
import json
import sys
import threading
from dataclasses import replace

import pytest
from markupsafe import Markup

from app.wire import OPEN, Wire, dial
from warpspace.app.evaluation import calibration
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
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.readouts.calibration import arrows_of, calibration_html, files_html
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import start_state
from warpspace.app.state.store import StateStore
from warpspace.cli import main
from warpspace.exceptions import OptionError, SceneError, WarpspaceError
from warpspace.scene.library import load_scene

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


def plain(word: str) -> Markup:
    return Markup('data-word="%s"') % word


def asked(state=START, keys="auto", *, robust=False, text=None, name="tcp_on.csv"):
    file = take(SCENE, text or bundled("tcp_on.csv"), name, None, ())
    return ask(state, [file], keys, robust=robust)


@pytest.fixture(scope="module")
def given():
    return answer(asked(), threading.Event(), lambda _: None)


def test_the_numbers_are_those_of_the_command(given, capsys, monkeypatch):
    words = "warpspace calibrate fork_head_bc --data tcp_on.csv --next 3 --json"
    monkeypatch.setattr(sys, "argv", words.split())
    with contextlib.suppress(SystemExit):
        main()
    said = json.loads(capsys.readouterr().out)
    assert given.found.rms_before_mm == pytest.approx(0.2783, abs=5e-5)
    assert given.found.rms_after_mm == pytest.approx(0.0615, abs=5e-5)
    assert said["rms_after_mm"] == pytest.approx(given.found.rms_after_mm, rel=1e-9)
    for one, row in zip(given.found.parameters, said["parameters"], strict=True):
        assert (one.key, one.identifiable) == (row["key"], row["identifiable"])
        assert one.value == pytest.approx(row["value"], rel=1e-9)
    assert [one.candidate.name for one in given.steps] == [
        row["measurement"] for row in said["next"]
    ]


def test_words_and_table(given):
    html = calibration_html(given, "current", plain)
    assert '"calibration rms before">278.3<' in html
    assert '"calibration rms after">61.5<' in html
    assert html.count("<circle") == 2 * 23
    assert 'data-key="EB0B"' in html
    assert "339.3 ± 82.2" in html
    assert "175 … 504" in html
    assert "−14.4 … 87.7" in html
    assert "0.0 held" in html
    assert "EX0C" in html
    assert 'data-word="apply"' in html
    assert "error vector at" in html
    for standing, words in (("stale", "press Fit for new"), ("applied", "Undo takes them back")):
        html = calibration_html(given, standing, plain)
        assert words in html
        assert "data-word" not in html


def test_apply_brings_constants_without_sliders_and_one_undo_takes_them_back(given):
    assert "EB0B" not in START.amplitudes
    store = StateStore(START)
    store.apply(lambda state: calibrated_state(state, given))
    found = {one.key: one.value for one in given.found.parameters}
    assert store.state.amplitudes["EB0B"] == found["EB0B"] != 0.0
    assert is_applied(store.state, given)
    assert not is_applied(store.state.with_amplitude("EXX", 5.0), given)
    compared = LiveModel().evaluate(store.state).compared
    assert compared is not None
    assert compared.titles[0] == BEFORE
    assert compared.a.max_um == 0.0
    assert compared.b.max_um > 100.0
    store.undo()
    assert store.state == START


def test_compare_changes_no_error_and_draws_the_calibrated_scene(given):
    state = with_calibrated_beside(START, given)
    assert state.amplitudes == START.amplitudes
    compared = LiveModel().evaluate(state).compared
    assert compared is not None
    assert compared.shown == "b"
    assert compared.titles[1] == AFTER
    assert compared.a.max_um == 0.0
    applied = LiveModel().evaluate(calibrated_state(START, given)).compared
    assert applied is not None
    assert compared.b.max_um == pytest.approx(applied.b.max_um)


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


def test_residuals_as_arrows(given):
    foot, before = arrows_of(given, before=True)
    _, after = arrows_of(given, before=False)
    assert foot.shape == before.shape == after.shape == (23, 3)
    assert (before**2).sum() > 10 * (after**2).sum() > 0.0


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
        ("", "is empty"),
        ("a,b\n1,2\n", "expected those of a kind"),
        ("b_deg,c_deg,x_mm,y_mm,z_mm\n0,0,nan,1,1\n", "expected a finite number"),
        ("b_deg,c_deg,x_mm,y_mm,z_mm\n0,0,1,1,1\n0,0,1,1,1\n", "at one pose"),
        ("b_deg,a_deg,x_mm,y_mm,z_mm\n0,0,1,1,1\n9,0,1,1,1\n", "has no axis A"),
        (
            "x_mm,y_mm,z_mm,b_deg,session\n" + "".join(f"1,1,1,{n},s{n}\n" for n in range(101)),
            "names 101 sessions",
        ),
        ("x_mm,y_mm,z_mm,b_deg\n" + "1,1,1,2\n" * 5_001, "at most 5,000"),
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
    assert calibration._TURN.acquire(timeout=1.0)
    calibration._TURN.release()


def test_readings_of_another_machine_are_refused_at_the_fit():
    other = replace(asked(), start=load_scene("machine_gantry_mill"))
    with pytest.raises((OptionError, SceneError), match="tcp_on"):
        answer(other, threading.Event(), lambda _: None)


def test_a_page_fits_compares_applies_and_takes_only_known_words():
    with Viewer(SCENE) as viewer, dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
        (session,) = viewer.sessions
        (panel,) = [p for p in session.display.panels if type(p).__name__ == "CalibratePanel"]
        act, part = session.context.act, panel._readings
        act(panel._fit)
        assert wire.read_until(lambda: "no readings yet" in part._problem)
        act(lambda: part._add_upload("../../<b>.csv", b"\xff\xfe"))
        assert wire.read_until(lambda: "not UTF-8" in part._problem)
        assert "<" not in part._problem
        content = bundled("tcp_on.csv").encode()
        act(lambda: part._add_upload("../../etc/passwd", b"x" * (2 * 2**20 + 1)))
        assert wire.read_until(lambda: "2.0 MB" in part._problem)
        act(lambda: part._add_upload("../../tcp<b>.csv", content))
        assert wire.read_until(lambda: [one.name for one in part.files] == ["tcp_b.csv"])
        assert part._problem == ""
        for word in ("remove 9", "remove -1", "remove", "", "x" * 100):
            act(lambda word=word: part._do(word))
        act(panel._fit)
        assert wire.read_until(lambda: panel._answer is not None, seconds=60.0)
        for word in ("delete", "", "apply 1", "x" * 100):
            act(lambda word=word: panel._do(word))
        act(lambda: panel._do("compare"))
        assert wire.read_until(lambda: session.state.comparison.b is not None)
        assert session.state.amplitudes == start_state(SCENE).amplitudes
        act(lambda: panel._do("apply"))
        assert wire.read_until(lambda: "EB0B" in session.state.amplitudes)
        assert wire.read_until(lambda: "calibration applied" in panel._text.handle.content)
        assert any("calibrated" in title for title in session.context.scenes)
        session.context.post(lambda state: state.with_amplitude("EXX", 4.0))
        assert wire.read_until(lambda: "calibration stale" in panel._text.handle.content)
        act(lambda: panel._do("compare"))  # not offered: it would compare with another machine
        act(lambda: part._do("remove 0"))
        assert wire.read_until(lambda: not part.files)
        assert session.state.comparison.a.title == BEFORE


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
