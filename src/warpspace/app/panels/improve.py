"""The task "Improve": adjustments of errors, and compensation tables for controllers."""

import base64
import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

from markupsafe import Markup

from warpspace.analysis.adjustment_search import Objective
from warpspace.analysis.commands.adjust import ActSet, Adjust, AdjustResult
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option
from warpspace.analysis.registry import entries
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY
from warpspace.app.browser.templates import Templates
from warpspace.app.evaluation.compare import pinned_side, with_before, without_table
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.analysis_panel import AnalysisOutcome, AnalysisPanel, ResultKey
from warpspace.app.panels.block_html import details_html, result_html
from warpspace.app.panels.panel import Context, Refresh, on
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import Compensation
from warpspace.formats.compensation.controller import Controller
from warpspace.formats.registry import find_format, formats
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene

HTML = Templates("improve")


@dataclass(frozen=True, kw_only=True)
class AdjustIncluded(Adjust):
    """An adjustment of errors that are not excluded."""

    keys: tuple[str, ...] = ()

    def included(self, scene: Scene) -> Sequence[str]:
        return [key for key in scene.parameter_keys if key in self.keys]


class AdjustPanel(AnalysisPanel):
    """The best sets of adjustments, computed when the task is opened."""

    runs_on_open, own_kind, unsupported = True, AdjustIncluded, ("done", "log")

    def options(self) -> Sequence[Option]:
        changes = {"default": None, "choices": ("all",), "choice_labels": {"all": "any error"}}
        return [replace(o, **changes) if o.name == "adjustable" else o for o in super().options()]

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"keys": tuple(filter(state.exclusions.active, state.amplitudes))}

    def result_key(self, state: AppState) -> ResultKey:
        return (*super().result_key(state), state.exclusions)  # even if an excluded one is zero

    def headline(self, result: Any) -> Markup:
        criterion = "largest |E|" if result.objective is Objective.MAX else "RMS of |E|"
        return HTML.adjustments(result, self.offered_changes(result), criterion)

    def offered_changes(self, result: Any) -> Sequence[int]:
        return result.worthwhile

    def result_html(self, result: Result) -> Markup:
        blocks = (block for block in result.blocks() if not isinstance(block, str))
        return details_html(blocks, "Effect of each single error")

    def _accept_outcome(self, outcome: AnalysisOutcome) -> None:
        super()._accept_outcome(outcome)
        offered = self.offered_changes(outcome.result)
        self.context.post(lambda state: self._with_acts(state, offered[0] if offered else -1))

    def use_card(self, state: AppState, action: do.Preview | do.Apply) -> AppState | None:
        used = super().use_card(state, action)
        return used and self._with_acts(used, action.card)

    def _with_acts(self, state: AppState, card: int) -> AppState:
        """Select the plan whose acts are drawn."""
        if self.outcome is None or self.name != Adjust.name:
            return state
        sets = cast("AdjustResult", self.outcome.result).adjustments
        chosen = sets[card] if 0 <= card < len(sets) else None
        acts = chosen.acts if isinstance(chosen, ActSet) else ()
        return replace(state, page=replace(state.page, acts=acts))


class BestPanel(AdjustPanel):
    """The best adjustment of a single error, in the section of the worst point."""

    refresh = Refresh.IDLE

    def __init__(self, context: Context) -> None:
        super().__init__(context, next(entry for entry in entries() if entry.name == Adjust.name))
        self.name, self.title = "best", "One adjustment"

    def is_visible(self, state: AppState) -> bool:
        return state.page.task == "understand" and "worst" in state.page.open

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {**super().defaults(state), "count": "1"}

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (*self.body_dependencies(picture), _is_of_errors(picture))

    def render(self, picture: LivePicture) -> dict[str, str]:
        state, outcome = picture.state, self.outcome
        if not _is_of_errors(picture):
            return {self.name: EMPTY}
        key = self.result_key(state)
        self.run_if_stale(state)
        is_current = outcome is not None and outcome.key == key
        content = self.problem_html(state) or self.cards_html(key)
        return {self.name: HTML.best(content, is_current, key == self._applied_key)}


def _is_of_errors(picture: LivePicture) -> bool:
    return not picture.is_difference and picture.state.controller is None


# --- Compensate -----------------------------------------------------------------------------------

MOST_POINTS = 101  # per axis on the page; the command accepts as many as the controller
RESOLUTION_UM = 0.005  # a smaller residual, or one below the resolution of the file, is rounding
STEM, DATE = "compensation", (1980, 1, 1, 0, 0, 0)  # the same table gives the same bytes
MACHINE, COMPARISON, RESIDUAL = BOXES = ("machine", "comparison", "residual")
"""States of the map: uncompensated, before and after, residual error."""


class CompensatePanel(AnalysisPanel):
    """A compensation table: computed when a controller is chosen; applied to the map when saved."""

    runs_on_open = True
    _maps: tuple[Result, str] | None = None

    def shown_options(self, state: AppState) -> Sequence[Option]:
        if not self.is_ready(state):
            return ()
        kind = find_format(self.values(state)["formats"])
        has_rotary = any(not is_linear(axis) for axis in state.scene.machine.axes)
        unused = {"formats", "sweep"}
        unused |= set() if kind.tables else {"resolution", "sign"}
        unused |= set() if kind.orientation and has_rotary else {"orientation"}
        return [option for option in self.options() if option.name not in unused]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {}

    def is_ready(self, state: AppState) -> bool:
        return self.values(state).get("formats", "") in _writable()

    def build_analysis(self, state: AppState, values: Mapping[str, str], scene: Scene) -> Analysis:
        if not self.is_ready(state):
            raise OptionError("no controller selected; select one")
        analysis: Any = super().build_analysis(state, values, scene)
        points = analysis.points
        counts = dict(points).values() if isinstance(points, tuple) else [points]
        if max(count or 0 for count in counts) > MOST_POINTS:
            raise OptionError(f"{{points}} {max(counts)}; expected at most {MOST_POINTS}")
        return replace(analysis, formats=(values["formats"],))

    def before_result(self, state: AppState) -> Markup:
        chosen = self.values(state).get("formats", "")
        return HTML.controllers(self.name, chosen, _writable())

    def headline(self, result: Result) -> Markup:
        return EMPTY

    def result_html(self, result: Any) -> Markup:
        """Render before and after side by side; assumptions are folded away."""
        _, table, *assumptions = result.blocks()
        maps = self._maps[1] if self._maps is not None and self._maps[0] is result else ""
        folded = details_html(assumptions, "Points, loop, assumptions")
        return HTML.compensation(result_html([table]), _is_rounding(result), maps, folded)

    def actions(self, result: Any, *, stale: bool) -> Markup:
        state, draws = self.context.state, self.context.services.draw_compensation is not None
        is_applicable = is_applicable_to(state, result.controller)
        return HTML.buttons(self.name, draws, box_of(state), is_applicable, _is_rounding(result))

    @property
    def _compensation(self) -> Compensation | None:
        result = self.outcome.result if self.outcome is not None else None
        return result if isinstance(result, Compensation) else None

    def set_option(self, state: AppState, action: do.SetOption) -> AppState | None:
        if action.option == "formats":
            self.outcome = None  # a table for another controller
        return super().set_option(state, action)

    @on(do.DrawMaps)
    def draw_maps(self, state: AppState, action: do.DrawMaps) -> None:
        result, draw = self._compensation, self.context.services.draw_compensation
        if result is None or draw is None:
            return
        dark, saves = state.shown.dark, action.save
        save = partial(self.context.save_file, f"{STEM}.png")
        self._jobs.start(
            "Drawing the maps", lambda job: draw(result, dark, not saves, job),
            save if saves else partial(self._show_maps, result),
        )  # fmt: skip

    @on(do.Signal.SAVE_TABLE)
    def save_table(self, state: AppState) -> AppState | None:
        if (result := self._compensation) is not None:
            self.context.call_soon(partial(self.context.save_file, *packed(result)))
        return self.show_box(state, do.ShowBox("comparison"))

    @on(do.ShowBox)
    def show_box(self, state: AppState, action: do.ShowBox) -> AppState | None:
        result = self._compensation
        if result is None or not is_applicable_to(state, result.controller):
            return None
        description = f"maximum residual error {result.after_statistics.max_um:.1f} µm"
        self.context.last_decision = without_table(state), f"{self.title}: {description}"
        return with_box(state, action.box, result.controller)

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (self.result_key(picture.state), box_of(picture.state))

    def body(self, picture: LivePicture) -> Markup:
        return self._body(picture.state)  # with and without its table

    def _show_maps(self, result: Compensation, png: bytes) -> None:
        self._maps = result, f"data:image/png;base64,{base64.b64encode(png).decode()}"
        self.rerender()


def _writable() -> dict[str, str]:
    writable = sorted((f for f in formats() if f.can_write), key=lambda f: f.title)
    return {f.name: f.title for f in writable}


def _is_rounding(result: Compensation) -> bool:
    return result.after_statistics.max_um <= max(RESOLUTION_UM, 1000.0 * result.resolution)


def packed(result: Compensation) -> tuple[str, bytes]:
    """Return name and content of the file to save: a table, or a ZIP file of several."""
    ending = result.format.endings[0]
    files = {f"{STEM}{add or ending}": text.encode("utf-8") for add, text in result.files.items()}
    if len(files) == 1:
        return next(iter(files.items()))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in files.items():
            bundle.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)
    return f"{STEM}.zip", buffer.getvalue()


def with_box(state: AppState, box: str, controller: Controller) -> AppState:
    """Set the compensation state of the map: one of `BOXES`; others are ignored."""
    if box not in BOXES or (box == box_of(state) and state.controller in (None, controller)):
        return state
    bare = without_table(state)
    if box == MACHINE:
        return bare
    bare = replace(bare, loop=controller.loop, placed=bare.placed or controller.scene.placed)
    corrected = replace(bare, controller=controller)
    if box == COMPARISON:
        return with_before(corrected, pinned_side(bare))
    return replace(corrected, comparison=corrected.comparison.off())


def box_of(state: AppState) -> str:
    """Return the compensation state of the map, one of `BOXES`."""
    if state.controller is None:
        return MACHINE
    before = state.comparison.a.state
    is_uncompensated = before is not None and before.controller is None
    return COMPARISON if is_uncompensated and state.comparison.b is not None else RESIDUAL


def is_applicable_to(state: AppState, controller: Controller) -> bool:
    """Check if a table was computed for the machine of a state."""
    return controller.scene.machine == state.scene.machine
