"""The task Measure: standard tests, calibrations and what imports ask; hostile files and words."""

import time
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from app.hostile import upload
from app.parts import Alone
from warpspace.analysis.registry import entries
from warpspace.app.browser import actions as do
from warpspace.app.documents.scene_file import settings_line, with_settings
from warpspace.app.drawing.around import draw_surroundings
from warpspace.app.drawing.labels import point_labels
from warpspace.app.evaluation.compare import with_pin
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels import measurement
from warpspace.app.panels.error_list import origin_words
from warpspace.app.panels.upload_panels import ImportPanel
from warpspace.app.state.app_state import start_state
from warpspace.app.state.look import DiagnosedElement
from warpspace.app.state.store import StateStore
from warpspace.app.state.tree import put
from warpspace.bench.base import bench_names
from warpspace.calibration.calibrate import Calibrate
from warpspace.diagnosis.causes import CauseSet
from warpspace.diagnosis.diagnose import Explanations
from warpspace.exceptions import OptionError, SceneError, WarpspaceError
from warpspace.resources import assets_dir, find_data
from warpspace.scene.library import load_scene

STATE = start_state(load_scene("dvf5000_first"), nodes=5)
LIVE = LiveModel()
SCENE = load_scene("fork_head_bc")
START = replace(start_state(SCENE), nodes=5)
HOSTILE = "<img src=x onerror=alert(1)>\"'&"
BUNDLED = find_data("tcp_on.csv").read_bytes()


class Column(Alone):
    """A section that is unfolded."""

    def __init__(self, kind, state, *more):
        super().__init__(kind, put(state, "page.task", "measure"), *more)
        self.store.apply(lambda now: put(now, "page.open", self.part.name))

    state = property(lambda self: self.store.state)

    def do(self, action):
        super().do(action)
        return self.html

    def give(self, name, content):
        """Send a file."""
        self.do(upload(name, content, self.part.name))

    def run(self):
        self.do(do.Run(self.part.name))
        return self.settle()

    def settle(self):
        """Wait until what is asked now is answered."""
        question, _ = self.part.result_key(self.state), self.html
        while self.part.context.jobs or not any(
            found and found[0] == question for found in (self.part.outcome, self.part.problem)
        ):
            time.sleep(0.01)
            _ = self.html
        return self.html


def calibrate():
    return Column(
        measurement.CalibratePanel, START, next(one for one in entries() if one.name == "calibrate")
    )


def positioned(targets):
    """Readings of a positioning test, whose error grows by 20 µm in a metre."""
    rows = (
        f"{run},{way},{at},{0.02 * (at - targets[0])}\n"
        for run in (1, 2)
        for way in "+-"
        for at in targets
    )
    return f"run,direction,target_mm,deviation_um\n{''.join(rows)}".encode()


@pytest.mark.parametrize("name", bench_names())
def test_figure_and_path_follow_the_errors(name):
    column = Column(measurement.TestsPanel, STATE)
    depends = column.part.dependencies(LIVE.evaluate(column.state))
    column.do(do.Input.CHOOSE_TEST(name))
    assert column.part.dependencies(LIVE.evaluate(column.state)) != depends
    html = column.settle()
    result = column.part.outcome.result
    assert "<svg" in html
    assert "nan" not in html
    for quantity in result.model.outcome.quantities:
        assert quantity.name in unescape(html)
    found = LIVE.evaluate(column.state).bench
    moved = LIVE.evaluate(column.state.with_amplitude("EC0Y", 150.0)).bench
    assert moved.nominal_mm is found.nominal_mm
    assert np.abs(moved.error_um - found.error_um).max() > 1.0
    np.testing.assert_allclose(moved.drawn_mm(1e3) - moved.nominal_mm, moved.error_um, atol=1e-9)
    column.do(do.SetOption("test", "path", "0"))
    assert LIVE.evaluate(column.state).bench is None


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("circular", {"radius_mm": "much"}, "“Radius” 'much'; expected a number"),
        ("circular", {"radius_mm": "900"}, "leaves the working volume"),
        ("circular", {"points": "20000"}, "expected at most 20,000 in the app"),
        ("r-test", {"at": "Q=1"}, "“At” 'Q=1': unknown axis Q; expected one of"),
    ],
)
def test_what_cannot_be_run_is_said_in_its_place(name, options, message):
    column = Column(measurement.TestsPanel, STATE)
    column.do(do.Input.CHOOSE_TEST(name))
    column.settle()
    for option, text in options.items():
        column.do(do.SetOption("test", option, text))
    html = column.settle()
    assert message in unescape(html)
    assert "ws-problem" in html
    assert LIVE.evaluate(column.state).bench is None


def test_a_test_runs_where_the_tables_stand_or_says_why_it_cannot():
    turned = put(replace(STATE, forms={"test": "r-test"}), "positions.B", "-20.0")
    column = Column(measurement.TestsPanel, turned)
    column.settle()
    assert column.part.outcome.result.model.plan.coordinates["B"][0] == -20.0
    column = Column(
        measurement.TestsPanel, start_state(load_scene("machine_c_frame_mill"), nodes=3)
    )
    column.do(do.Input.CHOOSE_TEST("r-test"))
    assert "no rotary axis" in column.settle()


def test_measured_readings_stand_beside_the_model_and_go_into_the_report():
    column = Column(measurement.TestsPanel, STATE)
    column.do(do.Input.CHOOSE_TEST("positioning"))
    column.do(do.Input.CHOOSE_TEST(HOSTILE))
    column.do(do.SetOption("test", "nothing", HOSTILE))
    assert column.state.forms == {"test": "positioning"}
    column.give(f"../{HOSTILE}.csv", positioned(range(-250, 251, 50)))
    html = column.settle()
    assert "RMS of measured − model" in html
    assert "<img" not in html
    column.do(do.AddToReport("test"))
    ((_, result),) = column.context.report_results
    assert result.rms_difference > 0.1
    column.do(do.RemoveFile(column.part.name, 0))
    assert "RMS of measured" not in column.settle()
    column.give("x.csv", b"a,b\n1,2\n")
    assert "ws-problem" in column.settle()


def test_what_forms_were_told_is_linked_and_kept_and_what_is_compared_runs_the_same_test():
    told = replace(STATE, forms={"test": "circular", "test.radius_mm": "120"})
    assert with_settings(STATE, settings_line(told)).forms == told.forms
    assert told.with_scene(SCENE).forms == told.forms
    assert settings_line(replace(STATE, forms={"import.axes": "X"})) == settings_line(STATE)
    line = "test=nothing&test.radius_mm=" + "9" * 5000 + "&test.F=1&nobody.x=1&gains.loop=tool"
    hostile = with_settings(STATE, line)
    assert hostile.forms == {"test.radius_mm": "9" * 1000, "gains.loop": "tool"}
    for name in ("test=nothing", "test.F", "nobody.x"):
        assert any(name in note for note in hostile.notes)
    many = "&".join(f"test.{'a' * (n % 40)}_{'b' * (n // 40)}=1" for n in range(1, 390))
    assert len(with_settings(STATE, many).forms) <= 100
    changed, shown = with_pin(told).with_amplitude("EC0Y", 100.0), {}
    for side in ("a", "b", "difference"):
        shown[side] = LIVE.evaluate(put(changed, "comparison.shown", side)).bench
    assert shown["difference"] is None
    assert np.abs(shown["a"].error_um - shown["b"].error_um).max() > 1.0


@pytest.fixture(scope="module")
def fitted():
    column = calibrate()
    column.do(do.Input.ADD_READINGS("tcp_on.csv"))
    return column, column.run()


def test_the_numbers_are_those_of_the_analysis(fitted):
    column, html = fitted
    found = column.part.outcome.result
    said = Calibrate(data=("tcp_on.csv",), next_count=3).run(SCENE, lambda _: None).as_json()
    assert "RMS of 23 residuals: 278.3 → <b>61.5 µm</b>" in html
    assert found.as_json()["next"] == said["next"]
    for one, row in zip(found.parameters, said["parameters"], strict=True):
        assert (one.key, one.identifiable) == (row["key"], row["identifiable"])
        assert one.value == pytest.approx(row["value"], rel=1e-9)
    assert "Confounded" in html
    assert measurement.arrows_of(found, before=True)[0].shape == (23, 3)


def test_an_applied_fit_gives_errors_that_had_no_row_and_one_undo_takes_it_back(fitted):
    column, _ = fitted
    state = column.state
    (found,) = [one for one in column.part.outcome.result.parameters if one.key == "EB0B"]
    store = StateStore(state)
    store.apply(lambda now: column.part.handle(now, do.Apply("calibrate", 0)))
    assert store.state.amplitudes["EB0B"] == round(found.value, 3) != 0.0
    compared = LIVE.evaluate(store.state).compared
    assert compared.a.max_um == 0.0
    assert compared.b.max_um > 100.0
    store.undo()
    assert store.state == state


def test_a_page_gives_only_known_words_and_small_readable_files():
    column = calibrate()
    receive = column.give
    receive("../../<b>.csv", b"\xff\xfe")
    assert "b.csv: is empty" in column.html
    receive("utf16.csv", BUNDLED.decode().encode("utf-16"))
    assert [file.name for file in column.part.files] == ["utf16.csv"]
    column.do(do.RemoveFile(column.part.name, 0))
    receive("../../etc/passwd", b"x" * (2 * 2**20 + 1))
    assert "2.0 MB" in column.html
    assert "9.5 MB" in column.do(do.Upload("calibrate", HOSTILE, 10_000_000, ""))
    receive("../../tcp<b>.csv", BUNDLED)
    assert [one.name for one in column.part.files] == ["tcp_b.csv"]
    for action in (
        do.RemoveFile("calibrate", 9), do.RemoveFile("part", 0), do.Upload("calibrate", "", 0, "²"),
        do.Preview("calibrate", 0), do.Input.ADD_READINGS("../tcp_on.csv"),
        do.Input.ADD_READINGS(HOSTILE), do.Input.SET_READING_KIND(HOSTILE),
        do.Input.SHOW_RESIDUALS(HOSTILE), do.Input.SET_TEST_OPTIONS(HOSTILE),
    ):  # fmt: skip
        assert "<img" not in column.do(action)
    assert len(column.part.files) == 1
    assert column.state.comparison.b is None
    assert "tcp_b.csv" not in column.do(do.RemoveFile(column.part.name, 0))


def test_nothing_of_a_browser_becomes_a_path(tmp_path, monkeypatch):
    secret = tmp_path / "secret.csv"
    secret.write_bytes(BUNDLED)
    monkeypatch.chdir(tmp_path)
    for kind in (None, "sphere-tcp", "positioning", "circular:plane=XY"):
        with pytest.raises(WarpspaceError, match="secret"):
            measurement.read_uploaded(SCENE, "", str(secret), kind, ())
    column = calibrate()
    for name in (str(secret), "secret.csv", "../secret.csv"):
        column.do(do.Input.ADD_READINGS(name))
        column.do(do.SetOption("calibrate", "data", name))
    assert column.part.files == ()
    assert "data" not in column.part.values(column.state)


def test_files_have_names_of_their_own_and_are_few():
    files: tuple[measurement.UploadedFile, ...] = ()
    for _ in range(measurement.MOST_FILES):
        files = (*files, measurement.read_uploaded(SCENE, BUNDLED.decode(), "a.csv", None, files))
    assert len({one.name for one in files}) == measurement.MOST_FILES
    with pytest.raises(OptionError, match="remove one first"):
        measurement.read_uploaded(SCENE, BUNDLED.decode(), "a.csv", None, files)
    rows = "".join(f"1,1,{n},2\n" for n in range(5_001))
    with pytest.raises(OptionError, match="at most 5,000"):
        measurement.read_uploaded(SCENE, f"x_mm,y_mm,z_mm,b_deg\n{rows}", "a.csv", None, ())


@pytest.mark.parametrize("keys", ["EQ0", "auto,EX0B", HOSTILE])
def test_bad_parameters_and_hostile_sessions_are_said_escaped(keys):
    column = calibrate()
    column.give("x.csv", BUNDLED.replace(b"c1", b"<img src=x>"))
    column.do(do.SetOption("calibrate", "fit", keys))
    column.part.problem = None
    html = column.run()
    assert "ws-problem" in html
    assert "<img" not in html


def test_readings_of_a_standard_test_come_with_its_options():
    column = calibrate()
    column.do(do.Input.SET_READING_KIND("positioning"))
    column.do(do.Input.SET_TEST_OPTIONS("axis=X"))
    column.give("x.csv", positioned(range(150, 551, 50)))
    column.do(do.SetOption("calibrate", "fit", "EXX"))
    column.run()
    found = column.part.outcome.result
    assert found.rms_after_mm < 1e-9 < found.rms_before_mm
    assert measurement.arrows_of(found, before=True)[0].shape == (0, 3)


COMP = "-20 0.001 0.003\n0 0.002 0.004\n20 0.005 0.006\n"
TABLE = b"X [mm],EXX [um]\n-275,0\n0,5\n275,10\n"


def test_a_file_says_what_it_adds_and_what_it_does_before_it_is_applied():
    column = Column(ImportPanel, replace(STATE, forms={"import.axis": "Y"}))
    column.part.parse(HOSTILE, TABLE)()
    assert (column.state.page.task, column.state.forms) == ("measure", {})
    html = column.settle()
    assert "<img" not in html
    assert "The import adds EXX." in html
    before = LIVE.evaluate(STATE).statistics
    assert f"{before.mean_um:.1f} → " in html
    Alone.do(column, do.Apply("import", 0))
    applied = column.state
    Alone.do(column, do.Apply("import", 0))  # a second click, before the page is drawn anew
    assert column.state is applied  # once: the answer is of the state before
    after = LIVE.evaluate(replace(applied, comparison=STATE.comparison)).statistics
    assert after.mean_um != pytest.approx(before.mean_um)
    assert applied.amplitudes["EXX"] == pytest.approx(10.0)
    assert applied.comparison.a.title == "before import"
    name = column.part.files[0].name
    assert origin_words(applied, "EXX")[0].strip() == f"measured, {name}"
    edited = applied.with_amplitude("EXX", 4.0)
    assert origin_words(edited, "EXX")[0].strip() == f"edited; before: measured, {name}"
    assert origin_words(applied.reset(), "EXX") == origin_words(STATE, "EXX")
    assert name not in origin_words(applied, "EAX")[0]
    assert "Applied" in column.html
    column.part.parse("y.csv", TABLE.replace(b"EXX", b"EYX"))()
    html = column.settle()
    assert "The import adds EYX." in html
    column.part.parse("x.csv", TABLE)()
    assert "The import replaces EXX and adds EYX." in column.settle()
    with pytest.raises(SceneError, match="does not state its axis"):
        column.part.parse("other.comp", COMP.encode())()
    assert [one.name for one in column.part.files] == ["y.csv", "x.csv"]


def test_a_file_that_does_not_say_its_axis_or_format_asks_in_the_words_of_the_page():
    column = Column(ImportPanel, STATE)
    column.part.parse("unnamed.comp", COMP.encode())()
    html = column.settle()
    assert 'role="alert"' in html
    assert 'class="ws-options" open' in html
    assert "--axis" not in html
    column.do(do.Apply("import", 0))
    assert column.state.comparison.b is None
    column.do(do.SetOption("import", "axis", HOSTILE * 100_000))
    assert "<img" not in column.settle()
    assert len(column.part.problem[1]) <= 1500
    column.do(do.RemoveFile(column.part.name, 0))
    column.part.parse("data.dat", b"0\t0.001\t0.002\n")()
    assert "matches no known format" in column.settle()
    for option, value, said in (
        ("format", "linuxcnc-comp", "its axis"),
        ("axis", "X", "The import adds EXX."),
        ("format", "heidenhain", "data.dat: "),
        ("format", HOSTILE, "expected one of"),
    ):
        column.do(do.SetOption("import", option, value))
        assert said in column.settle()
    column.do(do.RemoveFile(column.part.name, 0))
    assert "Files can also be dropped" in column.html
    with pytest.raises(SceneError):
        column.part.parse("nothing.bin", b"\0\1\2")()


def guides_of(column):
    """Return the ends of the highlighted guides, in mm, in the order of their places."""
    shape = draw_surroundings(LIVE.evaluate(column.state)).get("/diagnosis/guides")
    ends = [] if shape is None else np.round(shape.assigned["points"], 3)
    return {tuple(sorted(tuple(place) for place in pair)) for pair in np.array(ends).tolist()}


def labels_of(column):
    return {label.text for label in point_labels(LIVE.evaluate(column.state))}


def test_the_likeliest_element_is_drawn_while_its_result_is_current_and_the_section_open():
    column = diagnose()
    assert not guides_of(column)
    column.do(do.SetOption("diagnose", "symptoms", "taper 0.03 on 300 along Z across Y"))
    column.run()
    cause = column.part.outcome.result.likeliest
    assert cause is column.part.outcome.result.causes[0]
    assert cause.element_words in labels_of(column)
    assert len(guides_of(column)) == len(cause.axes) > 0
    current = column.state
    for elsewhere in ({"task": "design"}, {"open": frozenset()}):
        closed = replace(current, page=replace(current.page, **elsewhere))
        assert not draw_surroundings(LIVE.evaluate(closed)).get("/diagnosis/guides")
    again = diagnose()  # another run of the same readings selects an equal element
    again.do(do.SetOption("diagnose", "symptoms", "taper 0.03 on 300 along Z across Y"))
    again.run()
    assert again.state.page == current.page
    column.do(do.SetOption("diagnose", "symptoms", "taper 0.03 on 200 along Z across Y"))
    assert column.html
    assert column.state.page.element is None
    assert not guides_of(column)


@pytest.mark.parametrize(
    ("key", "axes"), [("EC0X", ("X", "Y")), ("EA0Z", ("Z",)), ("EAY", ("Y",)), ("bent plate", ())]
)
def test_a_joint_has_both_of_its_guides_and_an_artefact_has_none(key, axes):
    # X stands on Y, which stands on the bed as Z does; both bed joints have a single guide
    causes = CauseSet(load_scene("machine_c_frame_mill"))
    explanations = Explanations(causes, None, None, ())
    assert tuple(explanations._find_axes(key)) == axes


def test_guides_run_through_the_origins_of_their_frames():
    # Z: (0, 560, 560), travel −500 to 0; X: 280 − 100 mm below the origin of R, travel ±400
    column = diagnose()
    element = DiagnosedElement("joint", ("X", "Z"))
    column.store.apply(lambda now: replace(now, page=replace(now.page, element=element)))
    assert guides_of(column) == {
        ((-400.0, 0.0, -180.0), (400.0, 0.0, -180.0)),
        ((0.0, 560.0, 60.0), (0.0, 560.0, 560.0)),
    }


def diagnose():
    state = replace(start_state(load_scene("machine_c_frame_mill")), nodes=5)
    entry = next(one for one in entries() if one.name == "diagnose")
    return Column(measurement.DiagnosePanel, state, entry)


def test_a_symptom_and_a_file_are_diagnosed_on_the_page():
    column = diagnose()
    assert column.part.title == "What is wrong?"
    assert "Diagnose" not in column.html.partition("<details")[0]
    column.do(do.SetOption("diagnose", "symptoms", "step of 60 µm where Y reverses; oval"))
    assert "expected for instance" in unescape(column.run())
    column.do(do.SetOption("diagnose", "symptoms", "step of 60 µm where Y reverses"))
    html = unescape(column.run())
    assert "reversal of Y" in html
    # Y carries X: its frame stands 280 mm below the origin of R, its travel is ±250 mm
    assert guides_of(column) == {((0.0, -250.0, -280.0), (0.0, 250.0, -280.0))}
    assert "drive of Y" in labels_of(column)
    assert "drive of Y" in html
    assert "Apply" not in html
    # the file that only a stated kind can be read by
    scene, kind = column.state.scene, "positioning:axis=Y"
    rows = ["run,direction,target_mm,deviation_um"]
    for run in (1, 2):
        rows += [f"{run},{s},{t},{15 if s == '+' else -15}" for s in "+-" for t in (-250, 0, 250)]
    text = "\n".join(rows).encode()
    column.give("y.csv", text)
    assert "expected those of a kind" in unescape(column.html)
    column.do(do.SetOption("diagnose", "kinds", kind))
    column.give("y.csv", text)
    column.do(do.SetOption("diagnose", "symptoms", ""))
    column.run()
    found = column.part.outcome.result
    sets = [measurement.parse_readings(text.decode(), "y.csv", scene, kind)]
    said = measurement.Diagnose().diagnose(sets, scene, lambda _: None)
    assert found.as_json() == said.as_json()
    assert found.causes[0].causes == ("reversal of Y",)
    column.do(do.Upload("diagnose", HOSTILE, 10_000_000, ""))
    assert "9.5 MB" in column.html
    assert HOSTILE not in column.html


@pytest.mark.parametrize("name", ["calibrate", "diagnose"])
def test_a_report_is_read_at_the_place_that_the_form_states(name):
    kinds = {"calibrate": measurement.CalibratePanel, "diagnose": measurement.DiagnosePanel}
    state = replace(start_state(load_scene("dvf5000_nominal")), nodes=5)
    column = Column(kinds[name], state, next(one for one in entries() if one.name == name))
    report = (assets_dir() / "measurements/simulated_plates/plate_1.txt").read_bytes()
    with pytest.raises(OptionError, match="expected X,Y,Z where the part was clamped"):
        column.part.parse("plate_1.txt", report)
    column.do(do.SetOption(name, "place", "10,0,120"))
    assert column.part.placed_scene().part.place == (10.0, 0.0, 120.0, 0.0, 0.0, 0.0)
    column.part.parse("plate_1.txt", report)()
    assert [file.kind or file.count for file in column.part.files] == [60]
    if name == "calibrate":
        column.run()
        given = Calibrate(data=("plate_1.txt",), place=(10.0, 0.0, 120.0), next_count=3)
        expected = given.run(column.state.scene, lambda _: None)
        for ours, theirs in zip(
            column.part.outcome.result.parameters, expected.parameters, strict=True
        ):
            assert ours.value == pytest.approx(theirs.value, rel=1e-9)
