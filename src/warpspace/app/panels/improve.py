"""The task "Improve": which errors to adjust, and a table of compensation for the control."""

import base64
import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from markupsafe import Markup

from warpspace.analysis.adjustment_search import Objective
from warpspace.analysis.commands.adjust import Adjust
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option
from warpspace.analysis.registry import entries
from warpspace.app.browser.html import EMPTY, button, choice, join, tag
from warpspace.app.evaluation.compare import pinned_side, with_before, without_table
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.analysis_panel import RECORD, AnalysisPanel, Question
from warpspace.app.panels.block_html import details_html, result_html
from warpspace.app.panels.panel import Context, Refresh
from warpspace.app.state.app_state import AppState
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import Compensation
from warpspace.formats.compensation.controller import Controller
from warpspace.formats.registry import find_format, formats
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import REPAIR_NODES
from warpspace.scene.model import Scene

NO_GAIN_UM = 0.005  # what improves by less is not offered


@dataclass(frozen=True, kw_only=True)
class IncludedRepair(Adjust):
    """A repair that leaves alone what is excluded."""

    keys: tuple[str, ...]

    def included(self, scene: Scene) -> Sequence[str]:
        return [key for key in scene.parameter_keys if key in self.keys]


class RepairPanel(AnalysisPanel):
    """The best sets of adjustments, found as soon as the task is open."""

    at_once = True

    def options(self) -> Sequence[Option]:
        words = {"default": None, "choices": ("all",), "words": {"all": "any error"}}
        return [
            replace(one, **words) if one.name == "adjustable" else one for one in super().options()
        ]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {**super().defaults(state), "objective": Objective.MAX}

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        asked = super().ask(state, values, scenes)
        keys = tuple(key for key in state.amplitudes if state.exclusions.active(key))
        return IncludedRepair(**vars(asked), keys=keys)

    def question(self, state: AppState) -> Question:
        return (*super().question(state), state.exclusions)  # even where an excluded one is zero

    def headline(self, found: Any) -> Markup:
        if not found.before.max_um:
            return tag("p", "The error is zero everywhere: there is nothing to repair.")
        if not found.adjustable:
            return tag("p", "No squareness or alignment acts in this loop; choose any error below.")
        if not self.offered(found):
            return tag("p", f"{', '.join(found.adjustable)}: at their best values already.")
        smallest = "largest |E|" if found.objective is Objective.MAX else "RMS of |E|"
        return tag("p", f"Adjustments that minimise the {smallest}.", class_="ws-quiet")

    def offered(self, found: Any) -> Sequence[int]:
        """Offer the sets that gain something over the smaller ones, which come first."""
        name, kept = f"{found.objective}_um", list[int]()
        least: float = getattr(found.before, name)
        for index, one in enumerate(found.adjustments):
            if least - getattr(one, name) >= NO_GAIN_UM:
                kept.append(index)
                least = getattr(one, name)
        return kept

    def result_html(self, found: Result) -> Markup:
        blocks = (one for one in found.blocks() if not isinstance(one, str))
        return details_html(blocks, "Each error alone")


class BestPanel(RepairPanel):
    """The best adjustment of one error for the largest one, below the worst point."""

    refresh = Refresh.IDLE

    def __init__(self, context: Context) -> None:
        super().__init__(context, next(one for one in entries() if one.name == Adjust.name))
        self.name, self.title = "best", "One adjustment"

    def is_seen(self, state: AppState) -> bool:
        return state.page.task == "understand" and "worst" in state.page.open

    def defaults(self, state: AppState) -> Mapping[str, str]:
        low, high = REPAIR_NODES
        nodes = str(min(max(state.nodes, low), high))
        return {**super().defaults(state), "count": "1", "grid": nodes}

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (*self.concerns(picture), _is_of_errors(picture))

    def pieces(self, picture: LivePicture) -> dict[str, str]:
        state, answer = picture.state, self._answer
        if not _is_of_errors(picture):
            return {self.name: EMPTY}
        question = self.question(state)
        self.keep_up(state)
        is_known = answer is not None and answer.question == question
        words = "No adjustment helps." if is_known else "Searching …"
        body = self.problem_html(state) or self.cards_html(question)
        body = body or tag("p", words, class_="ws-quiet")
        body += RECORD if question == self._applied else EMPTY
        return {self.name: tag("h4", "Best single adjustment") + body}


def _is_of_errors(picture: LivePicture) -> bool:
    return not picture.is_difference and picture.state.controller is None


# --- Compensate -----------------------------------------------------------------------------------

MOST_POINTS = 101
"""Points per axis that a page may ask for; the command takes as many as the controller."""
RESOLUTION_UM = 0.005
"""What is left below that, or below the step of the numbers, is rounding, no error of a machine."""
STEM, DATE = "compensation", (1980, 1, 1, 0, 0, 0)  # the same table gives the same bytes
MACHINE, BOTH, LEFT = "machine", "both", "left"
BOXES = {MACHINE: "as it is", BOTH: "before and after", LEFT: "what is left"}


class CompensatePanel(AnalysisPanel):
    """A table for a control: computed when one is chosen; saved, the box is drawn with it."""

    at_once = True
    _picture: tuple[Result, str] | None = None

    def shown_options(self, state: AppState) -> Sequence[Option]:
        """List what the chosen format and the machine have a use for."""
        if not self.is_ready(state):
            return ()
        kind = find_format(self.values(state)["formats"])
        turns = any(not is_linear(axis) for axis in state.scene.machine.axes)
        unused = {"formats", "sweep"}
        unused |= set() if kind.tables else {"resolution", "sign"}
        unused |= set() if kind.orientation and turns else {"orientation"}
        return [one for one in self.options() if one.name not in unused]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {}

    def is_ready(self, state: AppState) -> bool:
        return self.values(state).get("formats", "") in _writable()

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        if not self.is_ready(state):
            raise OptionError("choose a controller")
        asked: Any = super().ask(state, values, scenes)
        counts = dict(asked.points).values() if isinstance(asked.points, tuple) else [asked.points]
        if max(one or 0 for one in counts) > MOST_POINTS:
            raise OptionError(f"{{points}} {max(counts)}; expected at most {MOST_POINTS} here")
        return replace(asked, formats=(values["formats"],))

    def before_result(self, state: AppState) -> Markup:
        chosen, words = self.values(state).get("formats", ""), {"": "Choose your control …"}
        table = choice(f"{self.name}:set.formats", chosen, words | _writable(), label="Control")
        if chosen:
            return table
        return table + tag("p", "A compensation table for the control, and the error that would"
                           " remain.", class_="ws-quiet")  # fmt: skip

    def headline(self, found: Result) -> Markup:
        return EMPTY

    def result_html(self, found: Any) -> Markup:
        """Set before and after beside each other; what was assumed is folded away."""
        _, table, *said = found.blocks()
        drawn = [result_html([table])]
        if _is_rounding(found):
            drawn.append(tag("p", "What is left is the resolution of the numbers in the file, not"
                             " an error of the machine.", class_="ws-kept"))  # fmt: skip
        if self._picture is not None and self._picture[0] is found:
            drawn.append(tag("img", src=self._picture[1], alt="Maps of |E| before and after",
                             width="100%"))  # fmt: skip
        return join(drawn) + details_html(said, "Points, loop, what is assumed")

    def actions(self, found: Any, *, stale: bool) -> Markup:
        """Save the table first; then what the box shows, and maps."""
        state, hint = self.context.state, "Several files come as one ZIP; the box then shows both"
        here, unseen = holds_for(state, found.controller), {LEFT} if _is_rounding(found) else set()
        boxes = join(
            button(words, f"{self.name}:box", key, pressed=key == box_of(state), kind="chip",
                   disabled=not here or key in unseen,
                   hint="Nothing is left but rounding" if key in unseen else "")
            for key, words in BOXES.items()
        )  # fmt: skip
        row = [button("Save table", f"{self.name}:table", kind="main", hint=hint)]
        if self.context.services.draw_compensation is not None:
            row += [
                button("Maps", f"{self.name}:maps", "show", hint="Before, after and what is left"),
                button("Save maps", f"{self.name}:maps", "save", hint="One sheet for a report"),
            ]
        row.append(button("Add to report", f"{self.name}:report", kind="quiet"))
        row += [RECORD] if box_of(state) != MACHINE else []
        shown = tag("div", tag("span", "The box shows", class_="ws-quiet") + boxes,
                    class_="ws-actions", role="group", aria_label="The box shows")  # fmt: skip
        return tag("div", join(row), class_="ws-actions") + shown

    def take(self, state: AppState, word: str, value: str) -> AppState:
        found = self._answer.found if self._answer is not None else None
        if word == "set.formats":
            self._answer = None  # a table of another control says nothing of this one
        if not isinstance(found, Compensation) or word not in ("table", "box", "maps"):
            return super().take(state, word, value)
        if word == "maps":
            self._draw(found, dark=state.shown.dark, saves=value == "save")
            return state
        if word == "table":
            self.context.act(partial(self.context.save_file, *packed(found)))
        if not holds_for(state, found.controller):
            return state
        left = f"{found.after_statistics.max_um:.1f} µm"
        self.context.decided = without_table(state), f"{self.title}: a table leaves at most {left}"
        return with_box(state, BOTH if word == "table" else value, found.controller)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().concerns(picture), box_of(picture.state))

    def _draw(self, found: Compensation, *, dark: bool, saves: bool) -> None:
        draw = self.context.services.draw_compensation
        if draw is None:
            return
        save = partial(self.context.save_file, f"{STEM}.png")
        self._make(
            "Drawing the maps", lambda job: draw(found, dark, not saves, job),
            save if saves else partial(self._take_picture, found),
        )  # fmt: skip

    def _take_picture(self, found: Compensation, png: bytes) -> None:
        self._picture = found, f"data:image/png;base64,{base64.b64encode(png).decode()}"
        self.renew()


def _writable() -> dict[str, str]:
    found = sorted((one for one in formats() if one.can_write), key=lambda one: one.title)
    return {one.name: one.title for one in found}


def _is_rounding(found: Compensation) -> bool:
    return found.after_statistics.max_um <= max(RESOLUTION_UM, 1000.0 * found.resolution)


def packed(found: Compensation) -> tuple[str, bytes]:
    """Give name and content of what is saved: the file of the table, or a ZIP of several."""
    ending = found.format.endings[0]
    files = {f"{STEM}{add or ending}": text.encode("utf-8") for add, text in found.files.items()}
    if len(files) == 1:
        return next(iter(files.items()))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in files.items():
            bundle.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)
    return f"{STEM}.zip", buffer.getvalue()


def with_box(state: AppState, box: str, controller: Controller) -> AppState:
    """Choose what the box shows: a key of `BOXES`; nonsense changes nothing."""
    if box not in BOXES or (box == box_of(state) and state.controller in (None, controller)):
        return state
    bare = without_table(state)
    if box == MACHINE:
        return bare
    bare = replace(bare, loop=controller.loop, placed=bare.placed or controller.scene.placed)
    corrected = replace(bare, controller=controller)
    if box == BOTH:
        return with_before(corrected, pinned_side(bare))
    return replace(corrected, comparison=corrected.comparison.off())


def box_of(state: AppState) -> str:
    """Tell what the box shows."""
    if state.controller is None:
        return MACHINE
    before = state.comparison.a.state
    beside = state.comparison.b is not None and before is not None and before.controller is None
    return BOTH if beside else LEFT


def holds_for(state: AppState, controller: Controller) -> bool:
    """Tell whether a table was made for the machine that a state shows."""
    return controller.scene.machine == state.scene.machine
