"""The task "Improve": which errors to adjust, and a table of compensation for the control."""

import base64
import io
import threading
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from markupsafe import Markup

from warpspace.analysis.adjusting import Objective
from warpspace.analysis.catalogue import entries
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option
from warpspace.analysis.repair import Repair, RepairResult
from warpspace.app.browser.html import EMPTY, button, choice, join, number, tag
from warpspace.app.evaluation.compare import pinned_side, with_before
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.table import without_table
from warpspace.app.tasks.analysis import AnalysisPart, Question, details_html
from warpspace.app.tasks.context import Context
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import Compensation
from warpspace.formats.compensation.controller import Controller
from warpspace.formats.registry import find_format, formats
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import REPAIR_NODES
from warpspace.scene.model import Scene

NO_GAIN_UM = 0.005  # what improves by less is not offered


@dataclass(frozen=True, kw_only=True)
class IncludedRepair(Repair):
    """A repair that leaves alone what is excluded."""

    keys: tuple[str, ...]

    def included(self, scene: Scene) -> Sequence[str]:
        """List the errors that take part."""
        return [key for key in scene.parameter_keys if key in self.keys]


class RepairPart(AnalysisPart):
    """The best sets of adjustments, found as soon as the task is open."""

    at_once = True

    def options(self) -> Sequence[Option]:
        """Ask which errors may be adjusted in words."""
        return [
            replace(one, default=None, choices=("all",), words={"all": "any error"})
            if one.name == "adjustable"
            else one
            for one in super().options()
        ]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Look for the smallest largest error, in the loop that is drawn."""
        return {**super().defaults(state), "objective": Objective.MAX}

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        """Leave alone what is excluded."""
        asked: Any = super().ask(state, values, scenes)
        keys = tuple(key for key in state.amplitudes if state.exclusions.active(key))
        return IncludedRepair(**vars(asked), keys=keys)

    def question(self, state: AppState) -> Question:
        """Depend on what is excluded, even where it is zero."""
        return (*super().question(state), state.exclusions)

    def headline(self, found: Result) -> Markup:
        """Say only why there is nothing to adjust."""
        assert isinstance(found, RepairResult)  # noqa: S101 - of this analysis
        if not found.before.max_um:
            return tag("p", "The error is zero everywhere: there is nothing to repair.")
        if not found.adjustable:
            return tag("p", "No squareness or alignment acts in this loop; choose any error below.")
        if not self.offered(found):
            return tag("p", f"{', '.join(found.adjustable)}: at their best values already.")
        smallest = "largest |E|" if found.objective is Objective.MAX else "RMS of |E|"
        return tag("p", f"Adjustments that minimise the {smallest}.", class_="ws-quiet")

    def offered(self, found: Result) -> Sequence[int]:
        """Offer the sets that gain something over the smaller ones, which come first."""
        assert isinstance(found, RepairResult)  # noqa: S101 - of this analysis
        name, kept = f"{found.objective}_um", list[int]()
        least: float = getattr(found.before, name)
        for index, one in enumerate(found.repairs[: len(self._cards)]):
            if least - getattr(one, name) >= NO_GAIN_UM:
                kept.append(index)
                least = getattr(one, name)
        return kept

    def result_html(self, found: Result) -> Markup:
        """Fold what each error does alone."""
        blocks = [one for one in found.blocks() if not isinstance(one, str)]
        return details_html(blocks, "Each error alone")


class BestPart(RepairPart):
    """The best adjustment of one error for the largest one, below the worst point."""

    follows = "at rest"

    def __init__(self, context: Context) -> None:
        super().__init__(context, next(one for one in entries() if one.name == Repair.name))
        self.name, self.title = "best", "One adjustment"

    def is_seen(self, state: AppState) -> bool:
        """Only with the worst point."""
        return state.page.task == "understand" and "worst" in state.page.open

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Look for one, on the grid that is drawn."""
        low, high = REPAIR_NODES
        nodes = str(min(max(state.nodes, low), high))
        return {**super().defaults(state), "count": "1", "grid": nodes}

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the question and the answer."""
        corrected = picture.state.controller is not None
        return (*self.concerns(picture), picture.is_difference or corrected)

    def pieces(self, picture: LivePicture) -> dict[str, str]:
        """Write the card; where it is of another state, find a new one."""
        state, question = picture.state, self.question(picture.state)
        if picture.is_difference or state.controller is not None:
            return {self.name: EMPTY}
        if question != self._asked and not self._jobs.busy:
            self._run(state)
        words = "Searching …"
        if self._problem is not None and self._problem[0] == question:
            words = self._problem[1]
        body = tag("p", words, class_="ws-quiet")
        if self._answer is not None:
            stale = self._answer[0] != question
            cards = [self._cards[index].html(self.name, index, stale=stale)
                     for index in self.offered(self._answer[1])]  # fmt: skip
            helped = "Searching …" if stale else "No adjustment helps."
            body = join(cards) or tag("p", helped, class_="ws-quiet")
        return {self.name: tag("h4", "Best single adjustment") + body}


# --- Compensate -----------------------------------------------------------------------------------

FAMILIES = ("SINUMERIK", "HEIDENHAIN", "FANUC", "LinuxCNC")
OTHERS = "Others"
CONTROLLERS = {
    "sinumerik-enc": "SINUMERIK 840D ENC_COMP, each axis",
    "sinumerik-cec": "SINUMERIK 840D CEC, sag and angles",
    "heidenhain": "HEIDENHAIN TNC .COM, nonlinear axis",
    "fanuc-3d": "FANUC 3-D error compensation",
    "linuxcnc-comp": "LinuxCNC screw compensation",
    "linuxcnc-matrix": "LinuxCNC matrixkins",
    "isg-csv": "ISG kernel, TwinCAT CNC",
    "klipper": "Klipper skew and axis twist",
    "marlin": "Marlin skew",
    "iso-text": "Etalon exchange text, ISO names",
    "csv": "warpspace measurement table",
}
"""What formats are called on the page; others by their titles."""
LOOP = "chosen by the chain of the machine"
MOST_POINTS = 101
"""Points per axis that a page may ask for; the command takes as many as the controller."""
RESOLUTION_UM = 0.005
"""What is left below that, or below the step of the numbers, is rounding, no error of a machine."""
STEM, DATE = "compensation", (1980, 1, 1, 0, 0, 0)  # the same table gives the same bytes
MAPS_S = 8.0  # how long they usually take
MACHINE, BOTH, LEFT = "machine", "both", "left"
BOXES = {MACHINE: "as it is", BOTH: "before and after", LEFT: "what is left"}
ROWS = {"max": "max_um", "mean": "mean_um", "RMS": "rms_um", "P95": "p95_um"}


class CompensatePart(AnalysisPart):
    """A table for a control: computed when one is chosen; saved, the box is drawn with it."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._picture: tuple[Result, str] | None = None
        self._step_um = 0.0  # of the numbers of the table, where one was asked for

    def shown_options(self, state: AppState) -> Sequence[Option]:
        """List what the chosen format and the machine have a use for."""
        name = self.values(state).get("formats", "")
        if name not in _writable():
            return ()
        kind = find_format(name)
        turns = any(not is_linear(axis) for axis in state.scene.machine.axes)
        unused = {"formats"}
        unused |= set() if kind.tables else {"resolution", "sign"}
        unused |= set() if kind.orientation and turns else {"orientation"}
        return [
            replace(one, unset=LOOP) if one.name == "loop" else one
            for one in self.options()
            if one.name not in unused
        ]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Leave the loop to the format."""
        return {}

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        """Ask for a table of the chosen format."""
        name = values.get("formats", "")
        if name not in _writable():
            raise OptionError("choose a controller")
        asked: Any = super().ask(state, values, scenes)
        points = asked.points
        counts = (points,) if isinstance(points, int) else dict(points or ()).values()
        if max(counts, default=0) > MOST_POINTS:
            raise OptionError(f"{{points}} {max(counts)}; expected at most {MOST_POINTS} here")
        self._step_um = 1000.0 * asked.resolution
        return replace(asked, formats=(name,))

    def before_result(self, state: AppState) -> Markup:
        """Choose the control."""
        name = f"{self.name}:set.formats"
        groups = {family: dict[str, str]() for family in (*FAMILIES, OTHERS)}
        for key, words in _writable().items():
            family = words.partition(" ")[0]
            groups[family if family in FAMILIES else OTHERS][key] = words
        chosen = self.values(state).get("formats", "")
        table = choice(name, chosen, {"": "Choose your control …"}, groups=groups, label="Control")
        if chosen:
            return table
        return table + tag("p", "A compensation table for the control, and the error that would"
                           " remain.", class_="ws-quiet")  # fmt: skip

    def _run_row(self) -> Markup:
        return super()._run_row() if self._asked or self._jobs.busy else EMPTY

    def headline(self, found: Result) -> Markup:
        """Set before and after beside each other, and say what the box is drawn with."""
        if not isinstance(found, Compensation):
            return super().headline(found)
        before, after = found.before_statistics, found.after_statistics
        body = [
            (name, number(getattr(before, of), 1), _left(getattr(after, of)))
            for name, of in ROWS.items()
        ]
        tilts = zip(("mean tilt", "max tilt"), found.tilt_urad(found.before),
                    found.tilt_urad(found.after), strict=True)  # fmt: skip
        if any(not is_linear(axis) for axis in found.axes):
            body += [(f"{name}, µrad", number(was), number(now)) for name, was, now in tilts]
        cells = join(
            tag("tr", tag("th", name, scope="row") + tag("td", was, class_="number")
                + tag("td", tag("b", now), class_="number"))
            for name, was, now in body
        )  # fmt: skip
        heads = join(tag("th", one, scope="col", class_="number") for one in ("before", "left"))
        head = tag("thead", tag("tr", tag("th", "|E|, µm", scope="col") + heads))
        table = tag("table", head + tag("tbody", cells))
        if self._is_rounding(found):
            table += tag("p", "What is left is the resolution of the numbers in the file, not an"
                         " error of the machine.", class_="ws-kept")  # fmt: skip
        return table

    def _is_rounding(self, found: Compensation) -> bool:
        """Tell whether nothing but the rounding of the file is left."""
        return found.after_statistics.max_um <= max(RESOLUTION_UM, self._step_um)

    def result_html(self, found: Result) -> Markup:
        """Show maps where they were drawn, and fold away what was assumed."""
        if not isinstance(found, Compensation):
            return super().result_html(found)
        title = CONTROLLERS.get(found.format.name, found.format.title)
        size = f"{title}: {found.size} numbers, {found.points_words}; {found.loop} loop"
        words = (size, *(f"Assumed: {one}" for one in found.assumed), *found.notes)
        drawn = EMPTY
        if self._picture is not None and self._picture[0] is found:
            drawn = tag(
                "img", src=self._picture[1], alt="Maps of |E| before and after", width="100%"
            )
        return drawn + details_html(words, "Points, loop, what is assumed")

    def actions(self, found: Result, *, stale: bool) -> Markup:
        """Save the table first; then what the box shows, and maps."""
        if not isinstance(found, Compensation):
            return super().actions(found, stale=stale)
        state = self.context.state
        now, is_rounding = box_of(state), self._is_rounding(found)
        here = holds_for(state, found.controller)
        boxes = join(
            button(words, f"{self.name}:box", key, pressed=key == now, kind="chip",
                   disabled=not here or (key == LEFT and is_rounding),
                   hint="Nothing is left but rounding" if key == LEFT and is_rounding else "")
            for key, words in BOXES.items()
        )  # fmt: skip
        maps = EMPTY
        if self.context.services.draw_compensation is not None:
            maps = button(
                "Maps", f"{self.name}:maps", "show", hint="Before, after and what is left"
            )
            maps += button("Save maps", f"{self.name}:maps", "save", hint="One sheet for a report")
        hint = "Several files come as one ZIP; the box then shows before and after"
        save = button("Save table", f"{self.name}:table", kind="main", hint=hint)
        report = button("Add to report", f"{self.name}:report", kind="quiet")
        shown = tag("div", tag("span", "The box shows", class_="ws-quiet") + boxes,
                    class_="ws-actions", role="group", aria_label="The box shows")  # fmt: skip
        return tag("div", save + maps + report, class_="ws-actions") + shown

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Compute when a control is chosen; save; draw."""
        found = self._answer[1] if self._answer is not None else None
        if word == "set.formats" and value in _writable():
            state = self._set(state, "formats", value)
            self._run(state)
        elif word in ("table", "box") and isinstance(found, Compensation):
            if word == "table":
                self.context.act(partial(self.context.save_file, *packed(found)))
                value = BOTH
            if not holds_for(state, found.controller):
                return state
            self._again_soon()
            return with_box(state, value, found.controller)
        elif word == "maps" and isinstance(found, Compensation):
            self._draw(found, dark=state.shown.dark, saves=value == "save")
        else:
            return super().take(state, word, value)
        return state

    def concerns(self, picture: Any) -> tuple[object, ...]:
        """Follow what the box is drawn with, too."""
        return (*super().concerns(picture), box_of(picture.state))

    def _again_soon(self) -> None:
        self.context.act(self._again)

    def _draw(self, found: Compensation, *, dark: bool, saves: bool) -> None:
        draw = self.context.services.draw_compensation
        if draw is None:
            return

        def work(cancelled: threading.Event) -> None:
            png = draw(found, dark, not saves, cancelled)
            if cancelled.is_set():
                return
            if saves:
                self.context.act(partial(self.context.save_file, f"{STEM}.png", png))
            else:
                self.context.act(partial(self._take_picture, found, png))

        self._jobs.start("Drawing the maps", work, MAPS_S)

    def _take_picture(self, found: Compensation, png: bytes) -> None:
        self._picture = found, f"data:image/png;base64,{base64.b64encode(png).decode()}"
        self._again()


def _writable() -> dict[str, str]:
    return {one.name: CONTROLLERS.get(one.name, one.title) for one in formats() if one.can_write}


def _left(value_um: float) -> str:
    return "< 0.001" if value_um < 0.0005 else number(value_um, 3 if value_um < 1.0 else 1)


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
    same = box == box_of(state) and state.controller in (None, controller)
    if box not in BOXES or same:
        return state
    bare = without_table(state)
    if box == MACHINE:
        return bare
    placed = bare.placed or controller.scene.placed
    bare = replace(bare, loop=controller.loop, placed=placed)
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
