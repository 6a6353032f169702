"""Import of measured errors: what files bring and replace, and the error before and after."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Block, Curve, Lines, Style
from warpspace.analysis.description import (
    Analysis,
    Change,
    ProgressCallback,
    Result,
    ignore_progress,
)
from warpspace.analysis.options import Grammar, Option, option, typed_word
from warpspace.analysis.registry import Entry
from warpspace.app.browser.html import EMPTY, tag, upload_button
from warpspace.app.panels.block_html import details_html
from warpspace.app.panels.file_dialogs import accepted_endings
from warpspace.app.panels.measurement import FilesPanel, UploadedFile
from warpspace.app.panels.panel import Context
from warpspace.app.state.app_state import AppState
from warpspace.app.state.form_values import read_form
from warpspace.exceptions import WarpspaceError
from warpspace.formats import registry
from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, ErrorSeries, summary_table
from warpspace.formats.source import Source
from warpspace.formats.to_scene import ImportedScene, into_scene
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.limits import MAX_UPLOAD_BYTES
from warpspace.scene.model import Scene
from warpspace.units import Array

NAME = "import"
MOST_FILES = 16  # that are read together
MOST_CURVES, MOST_POINTS = 12, 400
SIGNS = {
    "error": "errors, which the controller subtracts",
    "correction": "corrections, which the controller adds",
}
WAYS = {FORWARD: "forward", BACKWARD: "backward", BOTH: "mean"}
OPTIONS = {"--axis": "“Axis”", "--sign": "“Sign”", "--variant": "“Variant”", "--format": "“Format”"}
OFFERED = (
    "Measured errors or a controller's table; what changes is shown before it is applied."
    " Files can also be dropped on the page."
)


@dataclass(frozen=True, kw_only=True)
class Import(Analysis):
    """Read measured errors, or a controller's table, into SCENE."""

    name = NAME
    task = "measure"
    doing = "reading"
    makes_scenes = True
    format: str | None = option(None, "To be chosen if it is recognised wrongly or not at all")
    axis: Annotated[str, Grammar("X, or AX1=X AX2=Y", typed_word)] = option(
        "",
        "X: the axis, if the files name none. AX1=X: what a name in the files means; several"
        " separated by blanks",
    )
    sign: Literal["error", "correction"] | None = option(
        None, "Whether a table holds errors or corrections", unset="as the manual says", words=SIGNS
    )
    variant: str | None = option(None, "Published variant of the format", unset="usual one")
    sources: tuple[Source, ...] = ()

    def run(self, scene: Scene, _watch: ProgressCallback, /) -> "ImportResult":
        axis, names = registry.parse_axis_options(
            [word for word in re.split(r"[\s,;]+", self.axis) if word]
        )
        options = registry.ReadOptions(
            scene.machine, axis, names, self.sign or "", self.variant or ""
        )
        reading = registry.read_errors(self.sources, options, self.format or "")
        files = ", ".join(source.name for source in self.sources)
        made = into_scene(reading, scene, scene.title, files)
        return ImportResult(files=files, before=scene, reading=reading, made=made)


@dataclass(frozen=True, kw_only=True)
class ImportResult(Result):
    """What files bring."""

    files: str
    before: Scene
    reading: registry.Reading
    made: ImportedScene

    def changes(self) -> Sequence[Change]:
        return (Change(self.files, self.made.scene),)

    def blocks(self) -> Iterator[Block]:
        errors = self.reading.found
        units = ", ".join(errors.units).replace("um", "µm").replace("urad", "µrad")
        yield f"{self.reading.format.title} from {self.files}, in {units}."
        replaced = [key for key in errors.keys if self.before.errors.amplitude(key)]
        added = [key for key in errors.keys if key not in replaced]
        effects = [f"replaces {', '.join(replaced)}"] if replaced else []
        effects += [f"adds {', '.join(added)}"] if added else []
        yield f"It {' and '.join(effects) or 'holds no errors'}."
        yield summary_table(errors)
        for series in errors.series[:MOST_CURVES]:
            row, place = (
                parameter(series.key),
                "mm" if is_linear(parameter(series.key).axis) else "°",
            )
            title, curves = f"{series.key} {row.name}", tuple(_curves(series))
            yield Lines("lines", title, f"{row.axis} [{place}]", f"[{row.unit}]", curves)

    def doubts(self) -> Iterator[str]:
        errors, unchanged = self.reading.found, f"kept from {self.before.name}:"
        for note in (*errors.assumed, *errors.notes, *self.made.notes):
            if not note.startswith("replaced: "):
                yield _without_options(note.replace(unchanged, "unchanged:"))
        if (n_hidden := len(errors.series) - MOST_CURVES) > 0:
            yield f"{n_hidden} more curves are not drawn"


def _curves(series: ErrorSeries) -> Iterator[Curve]:
    at = np.array(series.positions)
    thin = slice(None, None, max(1, len(at) // MOST_POINTS))

    def curve(name: str, values: Array, direction: int, style: Style) -> Curve:
        is_finite = np.isfinite(values)
        return Curve(
            name, at[is_finite][thin], values[is_finite][thin], list(WAYS).index(direction), style
        )

    means = [
        (direction, mean) for direction in WAYS if (mean := series.mean(direction)) is not None
    ]
    yield from (curve(WAYS[direction], mean, direction, "line") for direction, mean in means)
    if len(series.runs) > len(means):
        yield from (curve("", np.array(run.values), run.direction, "dots") for run in series.runs)


def _without_options(text: str) -> str:
    """Name the controls of the page in place of the options of a command."""
    for flag, label in OPTIONS.items():
        text = text.replace(flag, label)
    return text


# --- The section ----------------------------------------------------------------------------------


class ImportPanel(FilesPanel):
    """Files that are read together, what they do not say, and what they bring."""

    def __init__(self, context: Context) -> None:
        sentence = "Measured errors, or a controller's table"
        super().__init__(context, Entry(NAME, "measure", sentence, f"{__name__}:Import"))
        context.offer_import = lambda name, content: self.receive(lambda: (name, content))

    def shown_options(self, state: AppState) -> Sequence[Option]:
        return self._options(state, self._files)

    def _options(self, state: AppState, files: Sequence[UploadedFile]) -> Sequence[Option]:
        """Leave out what the format has no choice of."""
        if not files:
            return ()
        options = {option.name: option for option in self.options()}
        names = {option.name: option.title for option in registry.formats()}
        recognised = _recognised(files)
        first = recognised.title if recognised is not None else "none, choose one"
        options["format"] = replace(
            options["format"], choices=tuple(names), words=names, unset=f"recognised: {first}"
        )
        chosen = self.values(state).get("format")
        kind = registry.find_format(chosen) if chosen in names else recognised
        if kind is None or kind.tables is None:
            del options["sign"]
        if kind is None or not kind.variants:
            del options["variant"]
        else:
            options["variant"] = replace(options["variant"], choices=kind.variants)
        return list(options.values())

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        return self._ask(state, self._files, values, scenes[0])

    def _ask(
        self,
        state: AppState,
        files: Sequence[UploadedFile],
        values: Mapping[str, str],
        scene: Scene,
    ) -> Analysis:
        analysis = read_form(Import, self._options(state, files), values, scene)
        return replace(analysis, sources=tuple(file.content for file in files))

    def is_quick(self, state: AppState) -> bool:
        return True

    def before_result(self, state: AppState) -> Markup:
        kind = "" if self._files else "main"
        upload = upload_button(
            "Import a file", "files", MAX_UPLOAD_BYTES, accepted_endings(), kind=kind,
            hint="Several that belong together may follow each other",
        )  # fmt: skip
        introduction = EMPTY if self._files else tag("p", OFFERED)
        return introduction + self.files_html() + tag("div", upload, class_="ws-actions")

    def result_html(self, result: Result) -> Markup:
        return details_html(block for block in result.blocks() if not isinstance(block, str))

    def actions(self, result: Result, *, stale: bool) -> Markup:
        return EMPTY

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        """Parse a file, with those that are there where they belong together.

        Alone it is kept also where it cannot be read yet: the section asks for what it does not
        say, or another file comes to it.
        """
        uploaded, present, problem = (
            UploadedFile(name, registry.open_upload(name, content)),
            self._files,
            None,
        )
        is_applied = self._applied[-1:] == (present,)
        joined = () if is_applied else tuple(file for file in present if file.name != name)
        state, is_joined, files = self.context.state, False, present
        scene = state.active_scene()
        for is_joined in (True, False) if 0 < len(joined) < MOST_FILES else (False,):
            files = (*joined, uploaded) if is_joined else (uploaded,)
            try:
                values = self.values(state) if is_joined else {}
                self._ask(state, files, values, scene).run(scene, ignore_progress)
                break
            except WarpspaceError as error:
                problem = error
        else:
            if joined and problem is not None:
                raise problem
        return partial(self._show, files, keeps=is_joined)

    def _show(self, files: tuple[UploadedFile, ...], *, is_joined: bool) -> None:
        self._hold(files)
        self.context.post(partial(_unfolded, keeps=is_joined))

    def problem_html(self, state: AppState) -> Markup:
        return Markup(_without_options(super().problem_html(state)))  # noqa: S704 - escaped before


def _recognised(files: Sequence[UploadedFile]) -> registry.Format | None:
    try:
        return registry.recognise([file.content for file in files])
    except WarpspaceError:  # none that is known, or several
        return None


def _unfolded(state: AppState, *, keeps: bool) -> AppState:
    """Show the section; what was said of other files is forgotten."""
    page = replace(state.page, task="measure", open=state.page.open | {NAME}, window="")
    forms = {k: v for k, v in state.forms.items() if keeps or not k.startswith(f"{NAME}.")}
    return replace(state, page=page, forms=forms)
