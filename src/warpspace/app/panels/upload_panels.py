"""Sections for uploaded files: import of measured errors, the workpiece, the NC program."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from markupsafe import Markup

from warpspace.analysis import description
from warpspace.analysis.blocks import Block, Curve, Lines, Style, Table
from warpspace.analysis.options import Grammar, Option, option, typed_word
from warpspace.analysis.registry import Entry
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY
from warpspace.app.browser.incoming import index_of
from warpspace.app.browser.templates import Templates
from warpspace.app.documents.transfers import IN_BOX, upload_text
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.scene_overlays import AT_LINE, moved_place, part_overlay
from warpspace.app.panels.analysis_panel import ResultKey
from warpspace.app.panels.block_html import block_html, details_html
from warpspace.app.panels.file_dialogs import accepted_endings
from warpspace.app.panels.measurement import MOST_BYTES, FilesPanel, UploadedFile
from warpspace.app.panels.panel import Context, on, setting, with_section
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, PartLook
from warpspace.app.state.form_values import option_values, read_form
from warpspace.exceptions import WarpspaceError
from warpspace.formats import registry
from warpspace.formats.measured import BACKWARD, FORWARD, UNDIRECTED, ErrorSeries, summary_table
from warpspace.formats.source import Source
from warpspace.formats.to_scene import ImportedScene, build_imported_scene
from warpspace.kinematics import transforms
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.limits import MAX_SCENE_BYTES, MAX_UPLOAD_BYTES
from warpspace.parts.inspection_report import REPORT_ENDINGS, InspectionReport, parse_report
from warpspace.parts.part import PartResult
from warpspace.parts.workpiece import load_workpiece, place_workpiece
from warpspace.scene.model import Scene
from warpspace.scene.text_files import decode_text
from warpspace.units import Array

HTML = Templates("uploads")
NAME = "import"
MOST_FILES = 16  # read together
MOST_CURVES, MOST_POINTS = 12, 400
SIGNS = {
    "error": "errors (subtracted by the controller)",
    "correction": "corrections (added by the controller)",
}
DIRECTIONS = {FORWARD: "forward", BACKWARD: "backward", UNDIRECTED: "mean"}


@dataclass(frozen=True, kw_only=True)
class Import(description.Analysis):
    """Import measured errors, or a compensation table of a controller, into SCENE."""

    name = NAME
    task = "measure"
    doing = "reading"
    makes_scenes = True
    format: str | None = option(None, "File format, if it is not recognised correctly")
    axis: Annotated[str, Grammar("X, or AX1=X AX2=Y", typed_word)] = option(
        "",
        "X: the axis, if the files do not name it. AX1=X: the axis that a name in the files stands"
        " for; separate several with blanks",
    )
    sign: Literal["error", "correction"] | None = option(
        None,
        "Errors or corrections in the table",
        unset="according to the manual",
        choice_labels=SIGNS,
    )
    variant: str | None = option(None, "Published variant of the format", unset="default")
    sources: tuple[Source, ...] = ()

    def run(self, scene: Scene, _watch: description.ProgressCallback, /) -> "ImportResult":
        texts = filter(None, re.split(r"[\s,;]+", self.axis))
        axis, names = registry.parse_axis_options([*texts])
        sign_and_variant = self.sign or "", self.variant or ""
        options = registry.ReadOptions(scene.machine, axis, names, *sign_and_variant)
        reading = registry.read_errors(self.sources, options, self.format or "")
        files = ", ".join(source.name for source in self.sources)
        imported = build_imported_scene(reading, scene, scene.title, files)
        return ImportResult(files=files, before=scene, reading=reading, imported=imported)


@dataclass(frozen=True, kw_only=True)
class ImportResult(description.Result):
    files: str
    before: Scene
    reading: registry.Reading
    imported: ImportedScene

    def changes(self) -> Sequence[description.Change]:
        return (description.Change(self.files, self.imported.scene),)

    def blocks(self) -> Iterator[Block]:
        errors = self.reading.imported
        units = ", ".join(errors.units).replace("um", "µm").replace("urad", "µrad")
        yield f"{self.reading.format.title} from {self.files}, in {units}."
        replaced = [key for key in errors.keys if self.before.errors.amplitude(key)]
        added = [key for key in errors.keys if key not in replaced]
        effects = [f"replaces {', '.join(replaced)}"] if replaced else []
        effects += [f"adds {', '.join(added)}"] if added else []
        yield f"The import {' and '.join(effects) or 'contains no errors'}."
        yield summary_table(errors)
        for series in errors.series[:MOST_CURVES]:
            row = parameter(series.key)
            unit = "mm" if is_linear(row.axis) else "°"
            title, curves = f"{series.key} {row.name}", tuple(_curves(series))
            yield Lines("lines", title, f"{row.axis} [{unit}]", f"[{row.unit}]", curves)

    def caveats(self) -> Iterator[str]:
        errors, unchanged = self.reading.imported, f"kept from {self.before.name}:"
        for note in (*errors.assumed, *errors.notes, *self.imported.notes):
            if not note.startswith("replaced: "):
                yield note.replace(unchanged, "unchanged:")
        n_hidden = len(errors.series) - MOST_CURVES
        if n_hidden > 0:
            yield f"{n_hidden} more curves are not displayed"


def _curves(series: ErrorSeries) -> Iterator[Curve]:
    at = np.array(series.positions)
    thin = slice(None, None, max(1, len(at) // MOST_POINTS))

    def curve(name: str, readings: Array, direction: int, style: Style) -> Curve:
        is_finite, colour = np.isfinite(readings), list(DIRECTIONS).index(direction)
        return Curve(name, at[is_finite][thin], readings[is_finite][thin], colour, style)

    n_means = 0
    for direction, name in DIRECTIONS.items():
        mean = series.mean(direction)
        if mean is not None:
            n_means += 1
            yield curve(name, mean, direction, "line")
    if len(series.runs) > n_means:
        yield from (curve("", np.array(run.values), run.direction, "dots") for run in series.runs)


# --- The section ----------------------------------------------------------------------------------


class ImportPanel(FilesPanel):
    """Files that are read together, their options, and the imported errors."""

    def __init__(self, context: Context) -> None:
        sentence = "Measured errors, or a compensation table of a controller"
        super().__init__(context, Entry(NAME, "measure", sentence, f"{__name__}:Import"))
        context.offer_import = lambda name, content: self.receive(lambda: (name, content))

    def shown_options(self, state: AppState) -> Sequence[Option]:
        return self._options(state, self.files)

    def _options(self, state: AppState, files: Sequence[UploadedFile]) -> Sequence[Option]:
        if not files:
            return ()
        options = {option.name: option for option in self.options()}
        names = {option.name: option.title for option in registry.formats()}
        recognised = _recognised(files)
        first = recognised.title if recognised is not None else "none, select one"
        labels = {"choices": tuple(names), "choice_labels": names}
        options["format"] = replace(options["format"], **labels, unset=f"recognised: {first}")
        chosen = self.values(state).get("format")
        kind = registry.find_format(chosen) if chosen in names else recognised
        if kind is None or kind.tables is None:
            del options["sign"]
        if kind is None or not kind.variants:
            del options["variant"]
        else:
            options["variant"] = replace(options["variant"], choices=kind.variants)
        return list(options.values())

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"sources": tuple(file.content for file in self.files)}

    def is_automatic(self, state: AppState) -> bool:
        return True

    def before_result(self, state: AppState) -> Markup:
        is_empty = not self.files
        return HTML.errors(self.files_html(), is_empty, accepted_endings(), MAX_UPLOAD_BYTES)

    def result_html(self, result: description.Result) -> Markup:
        return details_html(block for block in result.blocks() if not isinstance(block, str))

    def actions(self, result: description.Result, *, stale: bool) -> Markup:
        return EMPTY

    def applied(self, state: AppState, change: description.Change) -> AppState:
        """Apply an import, and record the file of each error that it changes."""
        changed = super().applied(state, change)
        names = ", ".join(file.name for file in self.files)
        curves = {key: changed.curve(key) for key in changed.amplitudes}
        imported = {
            key: (names, curve)
            for key, curve in curves.items()
            if key not in state.amplitudes or curve != state.curve(key)
        }
        return replace(changed, imported={**changed.imported, **imported})

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        """Parse a file, together with the present ones if they belong together.

        A single file is accepted even if it cannot be read yet: the section offers the missing
        options, or another file completes it.
        """
        uploaded = UploadedFile(name, registry.open_upload(name, content))
        present, problem = self.files, None
        is_applied = self._applied_key[-1:] == (present,)
        joined = () if is_applied else tuple(file for file in present if file.name != name)
        state, is_joined, files = self.context.state, False, present
        scene = state.active_scene()
        for is_joined in (True, False) if 0 < len(joined) < MOST_FILES else (False,):
            files = (*joined, uploaded) if is_joined else (uploaded,)
            try:
                values = self.values(state) if is_joined else {}
                analysis = read_form(Import, self._options(state, files), values, scene)
                sources = tuple(file.content for file in files)
                replace(analysis, sources=sources).run(scene, description.ignore_progress)
                break
            except WarpspaceError as error:
                problem = error
        else:
            if joined and problem is not None:
                raise problem
        return partial(self._show, files, keeps_forms=is_joined)

    def _show(self, files: tuple[UploadedFile, ...], *, keeps_forms: bool) -> None:
        def update(state: AppState) -> AppState:
            forms = {name: value for name, value in state.forms.items()
                     if keeps_forms or not name.startswith(f"{NAME}.")}  # fmt: skip
            return replace(with_section(state, self.task, NAME), forms=forms)

        self.set_files(files)
        self.context.post(update)


def _recognised(files: Sequence[UploadedFile]) -> registry.Format | None:
    try:
        return registry.recognise([file.content for file in files])
    except WarpspaceError:  # no format, or several
        return None


# --- The workpiece and the NC program in the working volume ---------------------------------------

MOST_LETTERS = 200  # of a displayed line


class SceneOverlayPanel(FilesPanel):
    """An uploaded file that is drawn in the working volume: a workpiece or a program."""

    runs_on_open = True
    most_bytes, what = MAX_UPLOAD_BYTES, "mesh or program"
    endings: tuple[str, ...] = ()  # of its files, where not those of `IN_BOX`
    part_fields = ("", "")  # fields of `PartLook`: content and name of the file

    def about(self, state: AppState) -> Markup:
        raise NotImplementedError

    def result_key(self, state: AppState) -> ResultKey:
        part = replace(state.part, shown=True, normal=False, moved=False)
        return (*super().result_key(state), part)

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().body_dependencies(picture), picture.state.part)

    def is_ready(self, state: AppState) -> bool:
        return getattr(state.part, self.part_fields[0]) is not None

    def before_result(self, state: AppState) -> Markup:
        content, name = (getattr(state.part, field) for field in self.part_fields)
        about = EMPTY if content is None else self.about(state)
        endings = ",".join(self.endings or IN_BOX[self.name])
        return HTML.overlay(self.name, self.title, content, name, about, self.files_html(),
                            self.most_bytes, endings)  # fmt: skip

    def show(self, content: object, name: str, **changes: Any) -> None:
        def update(state: AppState) -> AppState:
            state = with_section(state, self.task, self.name)
            return self.with_content(state, content, name, shown=True, **changes)

        self.context.post(update)

    def with_content(self, state: AppState, content: object, name: str, **changes: Any) -> AppState:
        """Set or remove the content; the map becomes transparent for it."""
        self.outcome = None
        fields = dict(zip(self.part_fields, (content, name), strict=True))
        part = replace(state.part, **fields, **changes)
        return edits.with_sight(replace(state, part=part), inside=not part.is_empty)

    @on(do.RemoveOverlay)
    def remove_overlay(self, state: AppState, action: do.RemoveOverlay) -> AppState:
        return self.with_content(state, None, "")


class PartPanel(SceneOverlayPanel):
    """A workpiece: its placement, and an inspection of it as machined."""

    part_fields = ("mesh", "name")
    unsupported = ("predistorted", "seal")
    endings = (*IN_BOX["part"], *REPORT_ENDINGS)
    _sent: tuple[str, bytes] | None = None  # read again with another unit

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        (scene_part, _), part = PartLook.of_scene(state.scene), state.part
        features = state.scene.part.path("features") if part.mesh is scene_part.mesh else None
        texts = [(file.name, file.content) for file in self.files if isinstance(file.content, str)]
        files: dict[str, Any] = {"features": features, "tolerances": next(iter(texts), None)}
        files["report"] = next(iter(self.reports), None)
        return files if part.mesh is None else {"place": part.place, "mesh": part.mesh, **files}

    @property
    def reports(self) -> list[InspectionReport]:
        contents = (file.content for file in self.files)
        return [content for content in contents if isinstance(content, InspectionReport)]

    def shown_options(self, state: AppState) -> Sequence[Option]:
        """List the options; a mesh is placed in the drawing, a report alone by its option."""
        is_placed = state.part.mesh is not None or not self.reports
        return [option for option in self.options() if option.name != "place" or not is_placed]

    def is_ready(self, state: AppState) -> bool:
        return super().is_ready(state) or bool(self.reports)

    def about(self, state: AppState) -> Markup:
        return HTML.part(partial(setting, state), MAX_SCENE_BYTES)

    def result_html(self, result: description.Result) -> Markup:
        *_, features = result.blocks_of(Table)
        if not isinstance(result, PartResult):
            return super().result_html(result)
        verdicts = [(name, verdict) for name, *_, verdict, _ in features.rows if verdict]
        return HTML.verdicts(verdicts) + super().result_html(result)

    @on(do.TurnPart)
    def turn(self, state: AppState, action: do.TurnPart) -> AppState | None:
        part = part_overlay(state)
        if part is None:
            return None
        turn = transforms.placed(part.of.middle_mm, 90.0 * np.eye(3)["xyz".index(action.axis)])
        return replace(state, part=replace(state.part, place=moved_place(part.of, turn)))

    def set_option(self, state: AppState, action: do.SetOption) -> AppState | None:
        if action.option == "unit" and state.part.mesh and self._sent:
            sent = self._sent
            self.receive(lambda: sent)
        return super().set_option(state, action)

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        """Parse tolerances, a report, or a mesh; a mesh of another name is placed at the centre."""
        if not name.lower().endswith((".toml", *IN_BOX[self.name])):
            text, notes = decode_text(content, name)
            return partial(self._show_report, name, parse_report(text, name, notes))
        if name.lower().endswith(".toml"):
            text = upload_text(content, name, "tolerance file")
            return partial(self._set_file, UploadedFile(name, text))
        self._sent, state = (name, content), self.context.state
        mesh = load_workpiece(name, option_values(state, self.name).get("unit") or None, content)
        present_place = state.part.place if name == state.part.name else None
        place = np.round(place_workpiece(mesh, state.standing, present_place).place, 3)
        return partial(self.show, mesh, name, place=tuple(place.tolist()))

    def _set_file(self, uploaded: UploadedFile) -> None:
        kind = type(uploaded.content)  # tolerances and a report are used together
        different = (file for file in self.files if not isinstance(file.content, kind))
        self.set_files((*different, uploaded))

    def _show_report(self, name: str, report: InspectionReport) -> None:
        self._set_file(UploadedFile(name, report, f"{len(report.names)} holes"))
        self.context.post(lambda state: with_section(state, self.task, self.name))


class ProgramPanel(SceneOverlayPanel):
    """A program: its lines and its path in the drawing are linked."""

    most_bytes = MOST_BYTES  # longer programs would delay other tabs
    part_fields = ("program", "program_name")

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"file": state.part.program_name, "text": state.part.program}

    def about(self, state: AppState) -> Markup:
        line, text = state.forms.get(AT_LINE, ""), (state.part.program or "").splitlines()
        at = index_of(line, len(text) + 1)
        return HTML.line(line, text[at - 1][:MOST_LETTERS]) if at else EMPTY

    def result_html(self, result: description.Result) -> Markup:
        *tables, worst = (block for block in result.blocks() if isinstance(block, Table))
        line, *columns = worst.columns
        headings = ("|E|", "largest contributions")
        columns = (replace(column, shows=column.heading in headings) for column in columns)
        narrow = replace(worst, columns=(replace(line, form=HTML.line_link), *columns))
        return block_html(narrow) + details_html((*tables, worst))

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        return partial(self.show, decode_text(content, name, "replace")[0], name)
