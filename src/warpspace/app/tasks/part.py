"""The part in the box: its file, where it is clamped, what an inspector would measure."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from markupsafe import Markup

from warpspace.analysis.catalogue import Entry
from warpspace.analysis.description import Analysis
from warpspace.analysis.options import Option
from warpspace.app.browser.html import button, join, tag, text_box, upload_button
from warpspace.app.browser.html import field as labelled
from warpspace.app.documents.files import PART_ENDINGS, read_upload
from warpspace.app.evaluation.part import clamped_part, clamped_scene, turned_place
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, PartLook
from warpspace.app.state.forms import option_values
from warpspace.app.state.leaf import Identity
from warpspace.app.state.tree import leaves, spell
from warpspace.app.tasks.analysis import Question
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.forms import setting
from warpspace.app.tasks.measure import FilesPart
from warpspace.app.tasks.parts import actions
from warpspace.machine.limits import MAX_UPLOAD_BYTES
from warpspace.parts.part import find_place, parse_part
from warpspace.scene.model import Scene

OFFERED = (
    "A mesh of your part (STL, OBJ, PLY, GLB) stands in the box as this machine would cut it."
    " Files can also be dropped on the page."
)
SWITCHES = ("part.shown", "part.normal", "part.moved")
TURNS = {
    f"{axis} {angle}": f"{axis} {sign}90°"
    for axis in "xyz"
    for angle, sign in ((90, "+"), (-90, "−"))
}


class PartPart(FilesPart):
    """A part that a page has sent, or the scene's own: clamped, and measured as it is cut."""

    at_once = True

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context, entry)
        self._sent: tuple[str, bytes] | None = None  # read again with another unit
        for ending in PART_ENDINGS:
            context.offers[ending] = lambda name, data: self.attempt(
                partial(self.received, name, data)
            )

    def options(self) -> Sequence[Option]:
        return [one for one in super().options() if one.name != "place"]

    def question(self, state: AppState) -> Question:
        return (*super().question(state), Identity(state.part.mesh), state.part.place)

    def is_ready(self, state: AppState) -> bool:
        return state.part.mesh is not None

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        asked = super().ask(state, values, scenes)
        return replace(asked, place=state.part.place, mesh=state.part.mesh)

    def before_result(self, state: AppState) -> Markup:
        part, words = state.part, OFFERED
        upload = upload_button(
            "Another part …" if part.mesh else "Part …", self.name, MAX_UPLOAD_BYTES,
            ",".join(PART_ENDINGS), kind="" if part.mesh else "main", hint="A closed mesh",
        )  # fmt: skip
        if part.mesh is None:
            if part.name:
                words = f"The part {part.name} is not here: links and files hold only its name."
            said = tag("p", words, class_="ws-quiet")
            return join((said, self.files_html(), actions(upload)))
        turns = join(button(said, f"{self.name}:turn", value, kind="choice")
                     for value, said in TURNS.items())  # fmt: skip
        where = ",".join(f"{at:.6g}" for at in find_place(part.mesh, clamped_scene(state), None))
        leaf, name = leaves(state)["part.place"], "state:set.part.place"
        box = text_box(name, spell(state, "part.place"), placeholder=where)
        remove = button("✕", f"{self.name}:remove", kind="link", aria_label=f"Remove {part.name}")
        return join((
            tag("p", join((tag("b", part.name), " ", remove))), self.files_html(),
            *(tag("p", one, class_="ws-doubt") for one in part.mesh.warnings),
            labelled(leaf.label, box, name, "mm, °", leaf.hint),
            labelled("Turn", tag("div", turns, class_="ws-choices"), "part.turn",
                     hint="About an axis of the workpiece, in place"),
            *(setting(state, path) for path in SWITCHES), actions(upload),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "file":
            self.attempt(lambda: self.received(*read_upload(value)))
        elif word == "remove":
            self._sent, self._answer = None, None
            return edits.with_sight(replace(state, part=PartLook()), inside=False)
        elif word == "turn" and value in TURNS and (clamped := clamped_part(state)) is not None:
            axis, angle = value.split()
            place = turned_place(clamped, axis, float(angle))
            return replace(state, part=replace(state.part, place=place))
        elif word == "set.unit" and self._sent is not None:
            self.attempt(partial(self.received, *self._sent))
        else:
            return super().take(state, word, value)
        return super().take(state, word, value) if word == "set.unit" else state

    def received(self, name: str, content: bytes) -> None:
        """Take in a mesh; it is clamped at its usual place, and seen through the box."""
        self._sent = name, content
        unit = option_values(self.context.state, self.name).get("unit") or None
        mesh = parse_part(content, name, unit)

        def show(state: AppState) -> AppState:
            page = replace(
                state.page, task=self.task, open=state.page.open | {self.name}, window=""
            )
            part = replace(state.part, mesh=mesh, name=name, shown=True)
            if name != state.part.name:
                part = replace(part, place=None)
            return edits.with_sight(replace(state, part=part, page=page), inside=True)

        self.context.post(show)
