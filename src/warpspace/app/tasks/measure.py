"""Measuring: standard tests that follow the errors, and calibrations out of uploaded readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Lines, Table
from warpspace.analysis.catalogue import Entry
from warpspace.analysis.description import Analysis, Result, Watch
from warpspace.analysis.options import Option
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    join,
    number,
    rows,
    switch,
    tag,
    text_box,
    upload_button,
)
from warpspace.app.browser.html import field as labelled
from warpspace.app.browser.page import error_words
from warpspace.app.documents.files import read_upload, upload_text
from warpspace.app.evaluation.bench import BenchPicture, standing
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.analysis import AnalysisPart, Question, details_html
from warpspace.app.tasks.charts import block_html
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.forms import form_html, read_form
from warpspace.app.tasks.parts import Section
from warpspace.app.viewport.around import residuals
from warpspace.app.viewport.shapes import Nodes
from warpspace.bench.base import BenchResult, bench_names, find_test, run_test
from warpspace.bench.data import parse_table as parse_test
from warpspace.calibration.calibrate import Calibrate
from warpspace.calibration.readings import bundled_data, find_data, parse_readings, parse_table
from warpspace.calibration.registry import KINDS, RENAMED, test_kinds
from warpspace.calibration.results import Calibration
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.limits import MAX_CSV_BYTES
from warpspace.scene.files import read_text
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, Array

MOST_BYTES = 2 * 2**20  # of a file of readings
WHAT = "CSV file of readings"


def _received(value: str) -> tuple[str, str]:
    """Give name and text of a file of readings; a page never says a path."""
    name, content = read_upload(value, MOST_BYTES, WHAT)
    return name, upload_text(content, name, WHAT)


def _upload_button(words: str, part: str) -> Markup:
    hint = f"A CSV file with a header, at most {MOST_BYTES >> 20} MB"
    return upload_button(words, part, MOST_BYTES, ".csv", hint=hint)


# --- Standard tests -------------------------------------------------------------------------------


class TestsPart(Section):
    """A standard test on the model as it would be on the machine, its path drawn in the box."""

    __test__ = False
    name, task, title = "bench", "measure", "Standard tests"
    sentence = "A test by its standard, on the model as it would be on the machine"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._file: tuple[str, str] | None = None
        self._problem = ""
        self._version = 0
        self._measured: tuple[tuple[object, ...], BenchResult | str] | None = None

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the errors, the test and the file."""
        return (*self._question(picture.drawn_state), picture.is_difference, self._version)

    def _question(self, state: AppState) -> tuple[object, ...]:
        return (
            Identity(state.scene), tuple(state.active.items()), tuple(state.positions.items()),
            Identity(state.bench), self._file,
        )  # fmt: skip

    def body(self, picture: LivePicture) -> Markup:
        """Write test, figure, numbers and options."""
        state, look = picture.state, picture.state.bench
        names = {"": "Choose a test …"} | {name: _title(name) for name in bench_names()}
        chosen = choice("bench:test", look.name, names, label="Standard test")
        if not look.name:
            return chosen
        kind, found = find_test(look.name), picture.bench
        if isinstance(found, BenchPicture):
            told = self._run_html(state, found)
        else:
            words = found or "A difference of two machines cannot be tested: show A or B."
            told = tag("p", words, class_="ws-problem", role="alert")
        options = form_html("bench", kind.settings(), look.options, state.scene)
        columns = ",".join(column.name for column in kind.columns)
        about = join(tag("p", one) for one in (kind.words, f"Columns of a file: {columns}"))
        return join((
            chosen, told, self._readings_html(),
            switch("bench:path", "Path in the box", on=look.path,
                   hint="Nominal in grey, actual in colour, exaggerated as the box is"),
            _folded("Options", options), _folded("Procedure", about),
        ))  # fmt: skip

    def _readings_html(self) -> Markup:
        if self._file is None:
            parts = [_upload_button("Measured readings …", self.name)]
        else:
            parts = [tag("span", self._file[0]),
                     button("✕", "bench:remove", kind="link",
                            aria_label=f"Remove {self._file[0]}")]  # fmt: skip
        parts.append(button("Add to report", "bench:report", kind="quiet"))
        problem = tag("p", self._problem, class_="ws-problem", role="alert")
        return (problem if self._problem else EMPTY) + tag("div", join(parts), class_="ws-actions")

    def _run_html(self, state: AppState, found: BenchPicture) -> Markup:
        if self._file is not None:
            measured = self._beside(state, found)
            if isinstance(measured, str):
                return tag("p", measured, class_="ws-problem", role="alert")
            apart = tag("p", f"RMS of measured − model: {number(measured.rms_difference or 0.0)}")
            blocks = [one for one in measured.blocks() if not isinstance(one, str)]
            notes = join(tag("p", note, class_="ws-doubt") for note in measured.doubts())
            return apart + join(map(block_html, blocks)) + notes
        numbers = rows(
            (one.name, f"{number(one.value, 2)} {one.unit}") for one in found.run.outcome.quantities
        )
        place = tag("p", found.prepared.plan.place, class_="ws-tiny")
        return join(map(block_html, found.charts)) + place + numbers

    def _beside(self, state: AppState, found: BenchPicture) -> BenchResult | str:
        question = self._question(state)
        if self._measured is None or self._measured[0] != question:
            try:
                told: BenchResult | str = self._result(state, found)
            except WarpspaceError as error:
                told = str(error)
            self._measured = (question, told)
        return self._measured[1]

    def _result(self, state: AppState, found: BenchPicture) -> BenchResult:
        """Run the test with the exact chain, readings beside it where there are any."""
        scene, test = replace(active_scene(state), workspace=standing(state)), found.prepared.test
        table = None
        if self._file is not None:
            name, text = self._file
            table = parse_test(text, test.data_columns(scene), name)
        return run_test(scene, test, table)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Choose a test, set an option, take or leave a file."""
        look = state.bench
        if word == "test":
            look = look.with_test(value)
            self._file, self._problem = None, ""
            state = edits.with_sight(state, inside=bool(look.name))
        elif word == "path":
            look = replace(look, path=value == "1")
        elif word.startswith("set.") and look.name:
            option = word.removeprefix("set.")
            if option in {one.name for one in find_test(look.name).settings()}:
                look = look.with_option(option, value)
        elif word == "remove":
            self._file = None
            self.context.act(self._again)
        elif word == "file":
            self.context.act(partial(self._receive, value))
        elif word == "report":
            self.context.act(self._into_report)
        return state if look == state.bench else replace(state, bench=look)

    def _receive(self, value: str) -> None:
        try:
            self._file, self._problem = _received(value), ""
        except WarpspaceError as error:
            self._problem = error_words(error)
        self._again()

    def _again(self) -> None:
        self._version += 1
        self.context.renew(self)

    def _into_report(self) -> None:
        picture = self.context.shown
        if picture is not None and isinstance(picture.bench, BenchPicture):
            found = self._result(picture.drawn_state, picture.bench)
            self.context.reported.append((found.test.title, found))
            self.context.notify("Added to the report", f"{found.test.title}; see Report at the top")


def _title(name: str) -> str:
    kind = find_test(name)
    return f"{kind.title} ({kind.standard})"


def _folded(words: str, body: Markup) -> Markup:
    return tag("details", tag("summary", words) + tag("div", body), class_="ws-details",
               data_key=f"folded.{words}")  # fmt: skip


# --- Calibration ----------------------------------------------------------------------------------

MOST_FILES, MOST_READINGS = 6, 5_000
"""Files of a page, and readings in all of them: what a fit needs of memory goes with it."""
LONGEST_OPTIONS = 200
MOST_NAMED = 12  # doubtful errors and notes that are listed
ARROWS = {"": "none", "before": "before", "after": "after"}
TURNED = "No arrows: a rotary axis carries the workpiece, which the box does not turn with."
BY_COLUMNS = "recognised from its columns"


@dataclass(frozen=True, slots=True)
class Measured:
    """A file of readings."""

    name: str  # unlike those of the other files of the page; never a path
    text: str = field(repr=False)
    kind: str | None  # as chosen; None for what its columns tell
    told: str  # the kind it was read as
    count: int  # readings


@dataclass(frozen=True, kw_only=True)
class CalibrateTexts(Calibrate):
    """A calibration out of texts of files."""

    files: tuple[Measured, ...] = ()

    def run(self, scene: Scene, watch: Watch, /) -> Calibration:
        """Read the texts and find the errors."""
        sets = [
            parse_readings(one.text, one.name, scene, one.kind, self.frame) for one in self.files
        ]
        return self.find(scene, sets, (), lambda: watch(0.0))


def take_file(
    scene: Scene, text: str, name: str, kind: str | None, others: Sequence[Measured]
) -> Measured:
    """Take in the text of a file beside those that are there."""
    if len(others) >= MOST_FILES:
        raise OptionError(f"{name}: expected at most {MOST_FILES} files; remove one first")
    unlike = name
    while any(one.name == unlike for one in others):
        count = 2 if unlike == name else int(unlike.rpartition(" ")[2]) + 1
        unlike = f"{name} {count}"
    lines = text.count("\n")
    if kind is None or kind in KINDS:
        lines = len(parse_table(text, unlike))
    if lines > MOST_READINGS - sum(one.count for one in others):
        raise OptionError(
            f"{name} has {lines:,} readings; expected at most {MOST_READINGS:,} in all files"
        )
    readings = parse_readings(text, unlike, scene, kind)
    return Measured(unlike, text, kind, readings.kind, len(readings))


class CalibratePart(AnalysisPart):
    """Readings of a page, what is fitted, and residuals as arrows in the box."""

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context, entry)
        self._files: tuple[Measured, ...] = ()
        self._trouble = ""
        self._kind_of_file, self._test_options, self._arrows = "", "", ""
        self._drawn: Nodes | None = None

    def options(self) -> Sequence[Option]:
        """List what is fitted; files and their kinds stand above."""
        return [one for one in super().options() if one.name != "kinds"]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Name the three measurements that would tell most."""
        return {**super().defaults(state), "next_count": "3"}

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        """Calibrate out of the files of the page."""
        del state
        if not self._files:
            raise OptionError("There are no readings yet: add a file, or choose bundled ones.")
        asked = read_form(CalibrateTexts, self.options(), values, scenes[0])
        return replace(asked, files=self._files)

    def question(self, state: AppState) -> Question:
        """Ask of the files, too."""
        return (*super().question(state), self._files)

    def before_result(self, state: AppState) -> Markup:
        """List the files, and offer to add some."""
        del state
        lines = [
            (tag("span", one.name) + tag("small", f" {_kind_words(one.told)}, {one.count}"),
             button("✕", "calibrate:remove", index, kind="link", aria_label=f"Remove {one.name}"))
            for index, one in enumerate(self._files)
        ]  # fmt: skip
        parts: list[Markup] = []
        if self._trouble:
            parts.append(tag("p", self._trouble, class_="ws-problem", role="alert"))
        parts.append(rows(lines) if lines else tag("p", "CSV files of readings give the errors of"
                     " this machine.", class_="ws-quiet"))  # fmt: skip
        bundled = {"": "Bundled readings …"} | {name: name for name in bundled_data()}
        kinds = {"": BY_COLUMNS} | {name: one.words for name, one in KINDS.items()}
        kinds |= {name: _kind_words(name) for name in test_kinds()}
        own = (
            text_box("calibrate:test-options", self._test_options, label="Options of the test",
                     placeholder="plane=XZ:radius=150")
            if self._kind_of_file in test_kinds() else EMPTY
        )  # fmt: skip
        kind = choice("calibrate:kind", self._kind_of_file, kinds)
        parts += [
            tag("div", _upload_button("Add readings …", self.name), class_="ws-actions"),
            choice("calibrate:bundled", "", bundled, label="Bundled readings"),
            labelled("Kind", kind, "calibrate:kind", hint="Kind of readings that are added next"),
            own,
        ]
        return join(parts)

    def headline(self, found: Result) -> Markup:
        """Say the residuals before and after, and which errors are doubtful."""
        if not isinstance(found, Calibration):
            return EMPTY
        before, after = UM_PER_MM * found.rms_before_mm, UM_PER_MM * found.rms_after_mm
        count = sum(len(one.readings) for one in found.fitted)
        parts = [tag("p", join((f"RMS of {count} residuals: {number(before)} → ",
                                tag("b", f"{number(after)} µm"))))]  # fmt: skip
        for told, words in (("in part", "Determined only in part"), ("no", "Not determined, kept")):
            keys = [one.key for one in found.parameters if one.told == told]
            if keys:
                more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
                names = ", ".join(keys[:MOST_NAMED])
                parts.append(tag("p", f"{words}: {names}{more}", class_="ws-quiet"))
        parts += [
            tag("p", note.replace("--", ""), class_="ws-doubt") for note in found.notes[:MOST_NAMED]
        ]
        return join(parts)

    def result_html(self, found: Result) -> Markup:
        """Draw the residuals; parameters and what they hold for are folded."""
        blocks = list(found.blocks())
        first = next(one for one in blocks if isinstance(one, Lines))
        narrow = [one for one in blocks if isinstance(one, Table) and len(one.columns) == 3]
        shown = [first, *narrow]
        arrows = choice("calibrate:arrows", self._arrows, ARROWS)
        words = join((
            labelled("Arrows in the box", arrows, "calibrate:arrows",
                     hint="Observed − predicted at each reading, exaggerated"),
            tag("p", self._arrow_words(), class_="ws-tiny"),
        ))  # fmt: skip
        rest = [one for one in blocks if one not in shown]
        return words + join(map(block_html, shown)) + details_html(rest)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Add and remove files, draw arrows."""
        again = partial(self.context.act, self._again)
        if word == "kind":
            self._kind_of_file = value if value in (*KINDS, *test_kinds()) else ""
            again()
        elif word == "test-options":
            self._test_options = value.strip()[:LONGEST_OPTIONS]
        elif word == "bundled" and value in bundled_data():
            self.context.act(partial(self._add_bundled, value))
        elif word == "remove" and value.isdecimal() and len(value) < 3:
            at = int(value)
            self._files = (*self._files[:at], *self._files[at + 1 :])
            again()
        elif word == "file":
            self.context.act(partial(self._receive, value))
        elif word == "arrows":
            self._arrows = value if value in ARROWS else ""
            again()
            return edits.with_sight(state, inside=bool(self._arrows))
        else:
            return super().take(state, word, value)
        return state

    def _add_bundled(self, name: str) -> None:
        self._add(name, read_text(find_data(name), MAX_CSV_BYTES))

    def _receive(self, value: str) -> None:
        try:
            self._add(*_received(value))
        except WarpspaceError as error:
            self._say(error_words(error))

    def _add(self, name: str, text: str) -> None:
        kind = self._kind_of_file or None
        if kind in test_kinds() and self._test_options:
            kind = f"{kind}:{self._test_options}"
        scene = active_scene(self.context.state)
        try:
            self._files = (*self._files, take_file(scene, text, name, kind, self._files))
            self._say("")
        except WarpspaceError as error:
            self._say(error_words(error))

    def _say(self, problem: str) -> None:
        self._trouble = problem
        self._again()

    # --- arrows ----------------------------------------------------------------------------------

    def _arrow_words(self) -> str:
        """Draw the arrows, or none, and say what is drawn."""
        picture = self.context.shown
        question = self.question(self.context.state)
        found = None
        if self._answer is not None and question in (self._answer[0], self._applied):
            found = self._answer[1]
        if not self._arrows or picture is None or not isinstance(found, Calibration):
            self._hide()
            return ""
        if any(not axis.is_linear for axis in found.scene.machine.branch("workpiece")):
            self._hide()
            return TURNED
        self._drawn = self._drawn or Nodes(self.context.client.scene)
        before = self._arrows == "before"
        shapes, factor = residuals(*arrows_of(found, before=before), picture.size_mm, before=before)
        self._drawn.draw(shapes)
        if not factor:
            return "No arrows: none of these readings is a vector."
        return f"Residuals {self._arrows}, drawn × {factor:g}"

    def _hide(self) -> None:
        if self._drawn is not None:
            self._drawn.draw({})


def arrows_of(found: Calibration, *, before: bool) -> tuple[Array, Array]:
    """Give foot and residual of each reading that is a vector, [n, 3] mm and [n, 3] mm."""
    feet: list[Array] = [np.zeros((0, 3))]
    vectors: list[Array] = [np.zeros((0, 3))]
    for group in found.fitted:
        lines = group.before_mm if before else group.after_mm
        if lines.shape[1] == 3:
            feet.append(group.readings.nominal_mm)
            vectors.append(lines)
    return np.concatenate(feet), np.concatenate(vectors)


def _kind_words(kind: str) -> str:
    name, _, _ = kind.partition(":")
    if name in KINDS:
        return KINDS[name].words
    return find_test(RENAMED.get(name, name)).title if name in test_kinds() else name
