"""What a plug-in adds is found everywhere: a curve, a convention, a test, a figure, a format."""

import io
import zipfile
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from app.parts import body_of
from chains import central_differences
from cli.conftest import warpspace
from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.panels import conventions
from warpspace.app.panels.error_list import kind_titles, read_curve, spell_rows
from warpspace.app.state.app_state import start_state
from warpspace.app.state.edits import with_curve
from warpspace.bench import base
from warpspace.bench.data import DataColumn
from warpspace.bench.plan import BenchQuantity, Outcome, build_plan
from warpspace.cli.services import build_services, write_export
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.kinematics import model as kinematics
from warpspace.kinematics.chain import jacobian, nominal_point
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.curves.curve import ErrorFunction, single_value
from warpspace.machine.curves.registry import register_curve, unregister_curve
from warpspace.machine.errors import Constant, Poly, TableCurve
from warpspace.outputs.drawing.sheet import Drawing, metadata, parameter_words
from warpspace.outputs.exports import formats
from warpspace.outputs.figures import registry as figures
from warpspace.outputs.processes import FigureWorker
from warpspace.outputs.report import ReportSettings, build_report, sections
from warpspace.picture.model import evaluate_picture
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import evaluate
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.units import spell, spell_short

__all__ = ["warpspace"]
FIRST = load_scene("dvf5000_first")
SPAN = (-275.0, 275.0)
CURVED = 'machine = "dvf5000"\n[errors]\nEYX = { half_sine = 4.0 }\n'
SPLIT = 'machine = "dvf5000"\n[convention]\ncomponent_errors = "split"\n[errors]\nEXC = 3.0\n'


@dataclass(frozen=True)
class HalfSine(ErrorFunction):
    """Zero at both ends of the span, the value in the middle."""

    name, title = "half_sine", "half sine"
    forms = (("half_sine",),)
    row_words = "one number: the value in the middle"
    value: float = 0.0

    def evaluate(self, position):
        low, high = self.span
        return self.value * np.sin(np.pi * (np.asarray(position, dtype=float) - low) / (high - low))

    def scaled(self, factor):
        return replace(self, value=factor * self.value)

    @classmethod
    def read(cls, raw, span, reader):
        return cls(span, reader.number(raw["half_sine"], ("half_sine",), -1e5, 1e5))

    def to_toml(self):
        return {"half_sine": self.value}

    def for_span(self, span):
        return self if span == self.span else TableCurve.from_curve(self, self.span)

    def describe(self, unit, value, position):
        return f"half sine of {value(self.value)} {unit} in the middle"

    @classmethod
    def from_rows(cls, span, rows):
        return cls(span, single_value(rows))

    def rows(self):
        return [[self.value]]

    @classmethod
    def from_curve(cls, present, span):
        return cls(span, present.amplitude)


class Split(kinematics.Convention):
    """``Trans(δ) · Motion · Rot(ε)``: shifts in fixed directions, turns on the moving body."""

    name, title = "split", "shifts before, turns after motion"
    place = "on both sides of the motion"
    meaning = "shift in fixed directions and turn with the moving body"

    def factors(self, constant, motion, component):
        if component is None:
            return constant, motion
        shift, turn = component.copy(), component.copy()
        shift[..., :3, :3] = np.eye(3)
        turn[..., :3, 3] = 0.0
        return constant, shift, motion, turn

    def frame(self, frames, row):
        after = row.is_rotation and not row.is_constant
        return frames.after if after else frames.before


@dataclass(frozen=True, kw_only=True)
class Corner(base.BenchTest):
    name, title, standard = "corner", "Corner", "our own"
    description = "A dial gauge looks along x."
    columns = (DataColumn("x_um"),)
    repeats: int = option(2, "Readings")

    def plan(self, scene):
        stand = self.axis_positions(scene)
        point = nominal_point(self.model(scene), Loop.TOOL, stand)
        points = np.broadcast_to(point, (self.repeats, 3))
        return build_plan(stand, points, np.eye(3)[0], place="in the middle")

    def plan_data(self, scene, table):
        return self.plan(scene), table["x_um"]

    def evaluate(self, plan, readings):
        return Outcome((BenchQuantity("x_um", "reading", float(readings.mean()), "µm"),))

    def charts(self, runs):
        number = np.arange(self.repeats) * 1.0
        curves = tuple(Curve(run.label("x"), number, run.readings) for run in runs)
        return (Lines("lines", "Readings", "number", "x [µm]", curves),)


def draw_names(scenes, settings, *, exact):
    title = f"Names of the errors: {scenes[0].title}"
    figure = Figure(figsize=(4.0, 3.0))
    figure.text(0.1, 0.5, " ".join(scenes[0].errors))
    return Drawing(figure, title, metadata(title, scenes, settings, 1.0, "names"))


def write_zip(picture, path, *, overwrite=True):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mean.txt", f"{picture.statistics.mean_um:.6f}")


NAMES = figures.FigureKind("names", "Names of the errors.", draw_names, evidence=True)
PACKED = formats.ExportFormat(".zip", "the mean, packed", write_zip)
ADDED = {
    "half_sine": (register_curve, unregister_curve, HalfSine),
    "split": (kinematics.register_convention, kinematics.unregister_convention, Split()),
    "corner": (base.register_test, base.unregister_test, Corner),
    "names": (figures.register_figure, figures.unregister_figure, NAMES),
    ".zip": (formats.register_format, formats.unregister_format, PACKED),
}


@pytest.fixture(autouse=True)
def added():
    for register, _, what in ADDED.values():
        register(what)
    yield
    for name, (_, unregister, _) in ADDED.items():
        unregister(name)


@pytest.mark.parametrize("name", [name for name in ADDED if name not in ("names", ".zip")])
def test_what_is_there_cannot_be_added_again(name):
    register, _, what = ADDED[name]
    with pytest.raises(OptionError, match=f"'{name}' is already registered"):
        register(what)


@pytest.mark.parametrize("text", [CURVED, SPLIT])
def test_a_scene_file_loads_evaluates_saves_and_reloads(text):
    scene = parse_scene(text, "mine")
    assert parse_scene(scene_to_toml(scene), "mine") == scene
    at = {"X": 0.0, "Y": 0.0, "Z": -280.0, "C": 90.0}
    for loop in Loop:
        first, exact = (evaluate(scene, at=at, loop=loop, exact=exact) for exact in (False, True))
        np.testing.assert_allclose(first.error_um, exact.error_um, atol=1e-6)
    if text == CURVED:
        assert evaluate(scene, at=at).error_um[1] == pytest.approx(4.0)
        assert "EYX = { half_sine = 4.0 }" in scene_to_toml(scene)
        # over another range it is saved as a curve with the same values
        narrow = {**scene.workspace.ranges, "X": (-100.0, 100.0)}
        moved = replace(scene, workspace=replace(scene.workspace, ranges=narrow))
        saved = parse_scene(scene_to_toml(moved), "mine").errors
        assert saved.evaluate("EYX", np.array([0.0])).tolist() == [4.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CURVED.replace("4.0", '"a"'), r'errors\.EYX\.half_sine = "a": expected a number'),
        (CURVED.replace("half_sine", "half"), r"\{ csv = , column = \}, .*\{ half_sine = \}"),
        (CURVED.replace("EYX", "EC0Y"), r"EC0Y = .*is constant along its axis"),
        (SPLIT.replace("split", "splt"), '"after_motion", "before_motion" or "split"'),
    ],
)
def test_a_misspelt_curve_or_convention_is_refused_with_all_names(text, message):
    with pytest.raises(SceneError, match=message):
        parse_scene(text, "mine")
    with pytest.raises(UnknownNameError, match="did you mean 'split'"):
        Model(FIRST.machine, "splt").convention("X")


@pytest.mark.parametrize("loop", Loop)
def test_first_order_of_a_convention_is_the_derivative_of_the_exact_chain(loop):
    model = replace(FIRST.model, component_errors="split")
    at = {"X": 120.0, "Y": -80.0, "Z": -200.0, "B": -35.0, "C": 70.0}
    coordinates = {axis: np.asarray(value) for axis, value in at.items()}
    point = nominal_point(model, loop, coordinates)
    keys = model.machine.allowed_keys
    found = jacobian(model, loop, keys, coordinates, point)
    expected = central_differences(model, loop, keys, coordinates, point)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6)
    # it is neither of the bundled ones: shifts as before the motion, turns as after it
    gains = {
        name: jacobian(replace(model, component_errors=name), Loop.WORKPIECE, ("EXC", "EAC"),
                       coordinates, np.array([100.0, 50.0, 200.0]))[0].tolist()
        for name in kinematics.convention_names()
    }  # fmt: skip
    assert gains["split"][0] == gains["before_motion"][0] != gains["after_motion"][0]
    assert gains["split"][1] == gains["after_motion"][1] != gains["before_motion"][1]


def test_the_app_offers_a_curve_reads_converts_and_stores_it():
    assert kind_titles()[-1] == "half sine"
    curve, _ = read_curve(HalfSine, "2.5  # in the middle", SPAN)
    assert curve == HalfSine(SPAN, 2.5)
    assert spell_rows(curve) == "2.5"
    with pytest.raises(OptionError, match="one number: the value in the middle"):
        read_curve(HalfSine, "", SPAN)
    assert HalfSine.from_curve(Constant(SPAN, 7.0), SPAN) == HalfSine(SPAN, 7.0)
    assert isinstance(Poly.from_curve(curve, SPAN), Poly)
    assert "half_sine along X" in curve.slider_words("X")
    state = with_curve(start_state(FIRST, nodes=3), "EYX", curve)
    back, _ = open_text(state_to_toml(state), "dvf5000_first", "x.toml")
    assert back.scene.errors.functions["EYX"] == curve


def test_the_app_offers_a_convention_says_what_it_changes_and_stores_it():
    fixed = scene_to_toml(FIRST).replace("after_motion", "before_motion")
    start = start_state(parse_scene(fixed, "dvf5000_first"), nodes=3)
    assert "component_errors=split" in conventions.choices(start.scene)
    state = conventions.with_choice(start, "component_errors=split")
    assert "component_errors=split" in conventions.chosen(state.scene)
    assert conventions.effects_of(state)["component_errors=split"][1] > 0.0
    text = body_of(conventions.ConventionsSection, state)
    assert 'value="component_errors=split" checked' in text
    assert "shifts before, turns after motion" in text
    back, _ = open_text(state_to_toml(state), "dvf5000_first", "x.toml")
    assert back.scene.model == state.scene.model


def test_a_test_is_a_command_and_in_the_app(warpspace, tmp_path):
    assert "corner" in base.bench_names()
    assert "corner" in warpspace("test", "--list").out
    assert "x_um" in warpspace("test", "corner", FIRST.name, "--json").json
    plot = tmp_path / "corner.svg"
    warpspace("test", "corner", FIRST.name, "--plot", plot)
    assert plot.stat().st_size > 1000
    state = replace(start_state(FIRST, nodes=3), forms={"test": "corner"})
    picture = LiveModel().evaluate(state).bench
    assert picture is not None
    assert picture.error_um.any()


def test_reports_and_figures_have_the_words_of_each(monkeypatch):
    curved, split = parse_scene(CURVED, "mine"), parse_scene(SPLIT, "mine")
    words = curved.errors.functions["EYX"].describe("µm", spell, spell_short)
    assert words == "half sine of 4.00 µm in the middle"
    assert parameter_words(curved) == ["EYX 4 µm half_sine"]
    reviewed = SimpleNamespace(scene=split, linearisation_um=0.0, letter="")
    settings = SimpleNamespace(loop="tool")
    review = SimpleNamespace(scenes=(reviewed,), settings=settings, exaggeration=1000.0)
    said = "Component errors shift in fixed directions and turn with the moving body (on both"
    assert said in str(sections.conventions(review))
    assert "names" in figures.figure_names()
    assert "EC0Y" in figures.draw_figure("names", [FIRST]).figure.texts[0].get_text()
    assert ("names", "Names of the errors.") in build_services().figures
    drawn: list[str] = []

    def begin(_self, name, *_):
        drawn.append(name)
        return lambda: b"<svg/>"

    monkeypatch.setattr(FigureWorker, "begin", begin)
    report = build_report([FIRST], ReportSettings(grid=3, samples=1000))
    assert "names" in drawn
    assert "Names of the errors." in [picture.caption for picture in report.pictures]


def test_a_format_is_written_by_the_command_and_for_the_app(warpspace, tmp_path):
    assert ".zip" in [form.ending for form in formats.export_formats()]
    assert (".zip", "the mean, packed") in build_services().exports
    target = tmp_path / "out.zip"
    result = warpspace("export", FIRST.name, "-o", target, "--grid", "3")
    assert result.status == 0, result.err
    wanted = f"{evaluate_picture(FIRST, grid=3).statistics.mean_um:.6f}"
    assert zipfile.ZipFile(target).read("mean.txt").decode() == wanted
    picture = LiveModel().evaluate(start_state(FIRST, nodes=3))
    content = write_export(picture, ".zip")
    found = float(zipfile.ZipFile(io.BytesIO(content)).read("mean.txt"))
    assert found == pytest.approx(picture.statistics.mean_um, abs=1e-6)
