"""The task "Measure": standard tests on the model, and calibration from uploaded readings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any, cast

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Lines, Table
from warpspace.analysis.description import Analysis, ProgressCallback, Result
from warpspace.analysis.options import Grammar, option
from warpspace.analysis.registry import Entry
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, join
from warpspace.app.browser.page import error_words
from warpspace.app.browser.templates import Templates
from warpspace.app.documents.transfers import read_upload
from warpspace.app.drawing.around import residuals
from warpspace.app.drawing.shapes import Nodes, Shapes
from warpspace.app.evaluation.compare import without_words
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.scene_overlays import chosen_test, plan_test
from warpspace.app.panels.analysis_panel import AnalysisPanel, ResultKey
from warpspace.app.panels.block_html import block_html, details_html, result_html
from warpspace.app.panels.panel import Context, Jobs, on, with_section
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.form_values import TEST, with_form
from warpspace.app.state.look import DiagnosedElement
from warpspace.bench.base import BenchTest, bench_names, find_test
from warpspace.bench.data import parse_table as parse_test
from warpspace.calibration.calibrate import Calibrate
from warpspace.calibration.calibration_result import Calibration
from warpspace.calibration.readings import bundled_data, parse_reading_table
from warpspace.calibration.registry import KINDS, parse_readings
from warpspace.diagnosis.diagnose import Diagnose, Diagnosis
from warpspace.diagnosis.symptoms import FORMS
from warpspace.exceptions import OptionError
from warpspace.parts.workpiece import place_part
from warpspace.resources import find_data
from warpspace.scene.model import Scene
from warpspace.scene.text_files import decode_text
from warpspace.units import Array

HTML = Templates("measurement")
MOST_BYTES = 2 * 2**20  # of a file of readings
WHAT = "CSV file of readings"


@dataclass(frozen=True, slots=True)
class UploadedFile:
    name: str  # never a path
    content: Any = field(repr=False)  # its text, or an object read from it
    description: str = ""  # kind and number of readings
    kind: str | None = None  # as selected; None: recognised by its columns
    count: int = 0  # readings


class FilesPanel(AnalysisPanel):
    most_bytes, what = MOST_BYTES, WHAT

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context, entry)
        self.files: tuple[UploadedFile, ...] = ()
        self._upload_problem = ""
        self._uploads = Jobs(self, self.rerender, self._refuse)

    def result_key(self, state: AppState) -> ResultKey:
        return (*super().result_key(state), self.files)

    def is_ready(self, state: AppState) -> bool:
        return bool(self.files)

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        """Parse a file in a job; return a callback for the session."""
        raise NotImplementedError

    def set_files(self, files: tuple[UploadedFile, ...]) -> None:
        self.files = files

    def files_html(self) -> Markup:
        return HTML.files(self.name, self.files, self._upload_problem, self._uploads.html())

    def receive(self, read: Callable[[], tuple[str, bytes]]) -> None:
        """Parse files in jobs, one after the other; errors are shown above the files."""
        self._uploads.start("Reading", lambda _: self.parse(*read()), self._accept)

    def _accept(self, accept: Callable[[], None]) -> None:
        self._upload_problem = ""
        accept()
        self.rerender()

    def _refuse(self, error: Exception) -> None:
        self._upload_problem = error_words(error)
        self.rerender()

    @on(do.Upload, later=True)
    def upload(self, action: do.Upload) -> None:
        self.receive(partial(read_upload, action, self.most_bytes, self.what))

    @on(do.RemoveFile, later=True)
    def remove_file(self, action: do.RemoveFile) -> None:
        self.files = (*self.files[: action.index], *self.files[action.index + 1 :])
        self.rerender()

    @on(do.Cancel, later=True)
    def cancel(self, _: do.Cancel) -> None:
        self._uploads.cancel()
        super().cancel(_)


# --- Standard tests -------------------------------------------------------------------------------


class TestsPanel(FilesPanel):
    """A standard test simulated on the model, with its path in the drawing."""

    __test__ = False
    runs_on_open = True

    def __init__(self, context: Context) -> None:
        sentence = "A standard test, simulated on the model of the machine"
        super().__init__(context, Entry(TEST, "measure", sentence))
        self.title = "Standard tests"

    @property
    def kind(self) -> type[BenchTest]:
        return chosen_test(self.context.state) or BenchTest

    def result_key(self, state: AppState) -> ResultKey:
        return (*super().result_key(state), state.forms.get(TEST))

    def is_ready(self, state: AppState) -> bool:
        return chosen_test(state) is not None

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        state = picture.drawn_state
        return (self.result_key(state), picture.is_difference, without_words(state))

    def build_analysis(self, state: AppState, values: Mapping[str, str], scene: Scene) -> Analysis:
        analysis: Any = super().build_analysis(state, values, scene)
        plan_test(analysis, scene)
        for file in self.files:
            table = parse_test(file.content, analysis.data_columns(scene), file.name)
            analysis = replace(analysis, data=table)
        return analysis

    def body(self, picture: LivePicture) -> Markup:
        state, kind = picture.drawn_state, chosen_test(picture.drawn_state)
        tests = [find_test(name) for name in bench_names()]
        titles = {test.name: f"{test.title} ({test.standard})" for test in tests}
        titles, chosen = {"": "Select a test …", **titles}, state.forms.get(TEST, "")
        if kind is None:
            return HTML.test(titles, chosen)
        remark = "" if state.controller is None else without_words(state)
        test = EMPTY if picture.is_difference else self._body(state)
        draws_path = state.forms.get("test.path") != "0"
        return HTML.test(titles, chosen, kind, test, remark, self.files_html(), not self.files,
                         MOST_BYTES, draws_path)  # fmt: skip

    def headline(self, result: Result) -> Markup:
        return HTML.deviations(result)

    def result_html(self, result: Result) -> Markup:
        return join(map(block_html, (*result.blocks_of(Lines), *result.blocks_of(Table))))

    @on(do.Input.CHOOSE_TEST)
    def choose(self, state: AppState, test: str) -> AppState | None:
        if test not in ("", *bench_names()):
            return None
        self.outcome, self.files, self._upload_problem = None, (), ""
        other_forms = {k: v for k, v in state.forms.items() if k.partition(".")[0] != TEST}
        state = with_section(state, self.task, TEST)
        state = replace(state, forms=other_forms | ({TEST: test} if test else {}))
        return edits.with_sight(state, inside=bool(test))

    def set_option(self, state: AppState, action: do.SetOption) -> AppState | None:
        if action.option == "path":
            return with_form(state, "test.path", action.value)
        return super().set_option(state, action)

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        return partial(self.set_files, (UploadedFile(name, decode_text(content, name)[0]),))


# --- Calibration ----------------------------------------------------------------------------------

MOST_FILES, MOST_READINGS = 6, 5_000  # per page; they limit the memory of a fit
LONGEST_KIND = 200
MOST_NAMED = 12  # errors and notes that are listed
ARROWS = {"": "none", "before": "before", "after": "after"}
ROTATED = "No arrows: a rotary axis carries the workpiece, and the drawing does not rotate with it."


@dataclass(frozen=True, kw_only=True)
class CalibrateTexts(Calibrate):
    files: tuple[UploadedFile, ...] = ()

    def run(self, scene: Scene, watch: ProgressCallback, /) -> Calibration:
        placed = place_part(scene, self.place)
        reading_sets = [
            parse_readings(file.content, file.name, placed, file.kind, self.frame)
            for file in self.files
        ]
        return self.fit_readings(scene, reading_sets, (), lambda: watch(0.0))


def read_uploaded(
    scene: Scene, text: str, name: str, kind: str | None, present: Sequence[UploadedFile]
) -> UploadedFile:
    """Read the text of a file; its name is made unique among the present files."""
    if len(present) >= MOST_FILES:
        raise OptionError(f"{name}: expected at most {MOST_FILES} files; remove one first")
    present_names = {file.name for file in present}
    numbered = (f"{name} {count}" for count in range(2, MOST_FILES + 2))
    unique_name = next(text for text in (name, *numbered) if text not in present_names)
    lines = text.count("\n")
    if kind is None or kind in KINDS:
        lines = len(parse_reading_table(text, unique_name))
    if lines > MOST_READINGS - sum(file.count for file in present):
        raise OptionError(
            f"{name} has {lines:,} readings; expected at most {MOST_READINGS:,} in all files"
        )
    readings = parse_readings(text, unique_name, scene, kind)
    description = f"{_kind_words(readings.kind)}, {len(readings)}"
    return UploadedFile(unique_name, text, description, kind, len(readings))


class ReadingsPanel(FilesPanel):
    """Files of readings, and what is computed of them."""

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"files": self.files}

    def kind_of_next(self, state: AppState) -> str | None:
        """Return the kind of the next file; None if it is recognised by its columns."""
        raise NotImplementedError

    def placed_scene(self) -> Scene:
        """Return the scene with its part where the option `place` states it."""
        state = self.context.state
        place = next(option for option in self.options() if option.name == "place")
        text = self.values(state).get(place.name, "")
        return place_part(state.active_scene(), place.read(text, state.scene) if text else None)

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        (text, _), files = decode_text(content, name), self.files
        kind = self.kind_of_next(self.context.state)
        uploaded = read_uploaded(self.placed_scene(), text, name, kind, files)
        return partial(self.set_files, (*files, uploaded))


class CalibratePanel(ReadingsPanel):
    """Uploaded readings, fitted errors, and residuals as arrows in the drawing."""

    own_kind, unsupported = CalibrateTexts, ("kinds",)  # set per file
    _next_kind, _arrows = "", ""
    _drawn: Nodes | None = None

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {**super().defaults(state), "next_count": "3"}

    def kind_of_next(self, state: AppState) -> str | None:
        return self._next_kind or None

    def before_result(self, state: AppState) -> Markup:
        bundled = {"": "Bundled readings …"} | {name: name for name in bundled_data()}
        kinds = {"": "recognised by its columns"}
        kinds |= {name: _kind_words(name) for name in (*KINDS, *bench_names())}
        kind, _, options = self._next_kind.partition(":")
        return HTML.readings(
            self.name, self.files_html(), not self.files, MOST_BYTES, bundled, kinds,
            kind, options if kind in bench_names() else None,
        )  # fmt: skip

    def headline(self, result: Result) -> Markup:
        return HTML.residuals(result, MOST_NAMED)

    def result_html(self, result: Result) -> Markup:
        blocks = list(result.blocks())
        visible = [next(block for block in blocks if isinstance(block, Lines))]
        visible += [b for b in blocks if isinstance(b, Table) and len(b.columns) == 4]
        folded = details_html(block for block in blocks if block not in visible)
        arrows = HTML.arrows(self._arrows, ARROWS, self._draw_arrows())
        return join((arrows, *map(block_html, visible), folded))

    @on(do.Input.SET_READING_KIND, do.Input.SET_TEST_OPTIONS, later=True)
    def set_kind(self, action: do.InputValue) -> None:
        name, options = action.value, ""
        if action.input is do.Input.SET_TEST_OPTIONS:
            name, options = self._next_kind.partition(":")[0], name.strip()[:LONGEST_KIND]
        is_known = name in (*KINDS, *bench_names())
        self._next_kind = f"{name}:{options}".strip(":") if is_known else ""
        self.rerender()

    @on(do.Input.ADD_READINGS, later=True)
    def add_bundled(self, name: str) -> None:
        if name in bundled_data():
            self.receive(lambda: (name, find_data(name).read_bytes()))

    @on(do.Input.SHOW_RESIDUALS)
    def show_residuals(self, state: AppState, arrows: str) -> AppState:
        self._arrows = arrows if arrows in ARROWS else ""
        self.context.call_soon(self.rerender)
        return edits.with_sight(state, inside=bool(self._arrows))

    # --- arrows ----------------------------------------------------------------------------------

    def _draw_arrows(self) -> str:
        """Draw the residuals of a current result; return a status."""
        picture, calibration, text = self.context.picture, None, ""
        shapes: Shapes = {}
        key = self.result_key(self.context.state)
        if self.outcome and key in (self.outcome.key, self._applied_key):
            calibration = self.outcome.result
        if self._arrows and picture is not None and isinstance(calibration, Calibration):
            text, before = ROTATED, self._arrows == "before"
            if all(axis.is_linear for axis in calibration.scene.machine.branch("workpiece")):
                feet, vectors = arrows_of(calibration, before=before)
                shapes, factor = residuals(feet, vectors, picture.size_mm, before=before)
                text = f"Residuals {self._arrows} calibration, exaggerated × {factor:g}"
                text = text if factor else "No arrows: none of the readings is a vector."
        if shapes or self._drawn is not None:
            self._drawn = self._drawn or Nodes(self.context.client.scene)
            self._drawn.draw(shapes)
        return text


def arrows_of(calibration: Calibration, *, before: bool) -> tuple[Array, Array]:
    """Return position and residual of each vector reading, [n, 3] mm and [n, 3] mm."""
    none = np.zeros((0, 3))
    groups = [group for group in calibration.fitted if group.before_mm.shape[1] == 3]
    residuals_mm = [group.before_mm if before else group.after_mm for group in groups]
    feet = [group.readings.nominal_mm for group in groups]
    return np.concatenate([none, *feet]), np.concatenate([none, *residuals_mm])


def _kind_words(kind: str) -> str:
    name, _, _ = kind.partition(":")
    if name in KINDS:
        return KINDS[name].description
    return find_test(name).title if name in bench_names() else name


# --- Diagnosis ------------------------------------------------------------------------------------


def _split_symptoms(text: str, _scene: Scene) -> tuple[str, ...]:
    return tuple(filter(None, (part.strip() for part in text.split(";"))))


@dataclass(frozen=True, kw_only=True)
class DiagnoseTexts(Diagnose):
    symptoms: Annotated[tuple[str, ...], Grammar("TEXT; TEXT", _split_symptoms)] = option(
        (), f"Symptoms, separated by semicolons: {', or '.join(FORMS)}"
    )
    files: tuple[UploadedFile, ...] = ()

    def run(self, scene: Scene, watch: ProgressCallback, /) -> Diagnosis:
        placed = place_part(scene, self.place)
        parsed = (parse_readings(f.content, f.name, placed, f.kind) for f in self.files)
        return self.diagnose(list(parsed), scene, watch)


class DiagnosePanel(ReadingsPanel):
    """Uploaded readings and typed symptoms, and their causes."""

    own_kind = DiagnoseTexts
    sentence = "The likeliest causes of readings and symptoms, and how to confirm them"
    run_label = "Diagnose"

    def is_ready(self, state: AppState) -> bool:
        return bool(self.files or self.values(state).get("symptoms"))

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().body_dependencies(picture), picture.state.page.element)

    def body(self, picture: LivePicture) -> Markup:
        if self._with_element(picture.state) is not picture.state:
            self.context.post(self._with_element)
        return super().body(picture)

    def _with_element(self, state: AppState) -> AppState:
        """Highlight the element of the likeliest cause while the result is current."""
        cause = None
        if self.outcome is not None and self.outcome.key == self.result_key(state):
            cause = cast("Diagnosis", self.outcome.result).likeliest
        element = DiagnosedElement(cause.element_words, cause.axes) if cause else None
        if element == state.page.element:
            return state
        return replace(state, page=replace(state.page, element=element))

    def before_result(self, state: AppState) -> Markup:
        return join((self.files_html(), HTML.upload("Add readings …", self.name, MOST_BYTES)))

    def headline(self, result: Result) -> Markup:
        return EMPTY

    def result_html(self, result: Result) -> Markup:
        """Render the causes first, then how to confirm and mend them."""
        _, *blocks = result.blocks()
        return result_html(blocks)

    def kind_of_next(self, state: AppState) -> str | None:
        """Return the kind stated at the place of the next file, or the last one."""
        kinds = self.values(state).get("kinds", "").split()
        return kinds[min(len(self.files), len(kinds) - 1)] if kinds else None
