"""A part in the box, where it is clamped, what an inspector would measure; and a program."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from markupsafe import Markup

from warpspace.analysis.catalogue import Entry
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, join, number, tag
from warpspace.app.browser.incoming import index_of
from warpspace.app.documents.files import PART_ENDINGS, PROGRAM_ENDINGS, upload_text
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.part import (
    AT_LINE,
    clamped_part,
    clamped_scene,
    program_defaults,
    turned_place,
)
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, PartLook
from warpspace.app.state.forms import option_values, read_form
from warpspace.app.state.leaf import Identity
from warpspace.app.tasks.analysis import Question
from warpspace.app.tasks.charts import details_html
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.forms import setting
from warpspace.app.tasks.measure import MOST_BYTES, FilesPart, Held
from warpspace.app.tasks.parts import actions
from warpspace.machine.limits import MAX_SCENE_BYTES, MAX_UPLOAD_BYTES
from warpspace.parts.as_cut import Part, PartResult
from warpspace.parts.part import find_place, parse_part
from warpspace.parts.program import Program, ProgramResult
from warpspace.scene.model import Scene

SETTINGS = ("part.place", "part.shown", "part.normal", "part.moved")
MOST_LETTERS, MOST_SHARES = 200, 2  # of a line that is shown; errors that a block is split into


class InBoxPart(FilesPart):
    """Something to be made, which a page has sent: it stands in the box."""

    at_once = True
    most_bytes, what = MAX_UPLOAD_BYTES, "mesh or program"
    endings: tuple[str, ...] = ()
    invitation = ""

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context, entry)
        context.offers |= dict.fromkeys(self.endings, self.sent)

    def held(self, state: AppState) -> tuple[object, str]:
        """Give what is there, if anything, and the name of its file."""
        raise NotImplementedError

    def about(self, state: AppState) -> Markup:
        """Say what is to be known of it, and set."""
        raise NotImplementedError

    def question(self, state: AppState) -> Question:
        return (*super().question(state), Identity(self.held(state)[0]), state.part.place)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().concerns(picture), Identity(picture.state.part))

    def is_ready(self, state: AppState) -> bool:
        return self.held(state)[0] is not None

    def before_result(self, state: AppState) -> Markup:
        held, name = self.held(state)
        upload = html.upload_button(
            f"Another {self.name} …" if held else f"{self.title} …", self.name, self.most_bytes,
            ",".join(self.endings), kind="" if held else "main",
            hint=f"At most {self.most_bytes >> 20} MB; files can also be dropped on the page",
        )  # fmt: skip
        missing = f"{name} is not here: links and saved scenes hold only its name."
        about = tag("p", missing if name else self.invitation, class_="ws-quiet")
        if held:
            remove = button("✕", f"{self.name}:remove", kind="link", aria_label=f"Remove {name}")
            about = tag("p", join((tag("b", name), " ", remove))) + self.about(state)
        return join((about, self.files_html(), actions(upload)))

    def show(self, **held: Any) -> None:
        """Take something in, see it through the box, and unfold the section."""

        def shown(state: AppState) -> AppState:
            opened = state.page.open | {self.name}
            page = replace(state.page, task=self.task, open=opened, window="")
            found = replace(state, part=replace(state.part, shown=True, **held), page=page)
            return edits.with_sight(found, inside=True)

        self.context.post(shown)

    def removed(self, state: AppState, part: PartLook) -> AppState:
        """Take it out of the box."""
        self._answer = None
        found = replace(state, part=part)
        return edits.with_sight(found, inside=not part.is_empty)


class PartPart(InBoxPart):
    """A part: clamped, and measured as it is cut."""

    endings = PART_ENDINGS
    invitation = "A mesh of your part (STL, OBJ, PLY, GLB), as this machine would cut it."
    _sent: tuple[str, bytes] | None = None  # read again with another unit

    def options(self) -> Sequence[Option]:
        return [one for one in super().options() if one.name != "place"]

    def held(self, state: AppState) -> tuple[object, str]:
        return state.part.mesh, state.part.name

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        asked = read_form(Part, self.options(), values, scenes[0])
        if state.part.mesh is PartLook.of_scene(state.scene).mesh:
            asked = replace(asked, features=state.scene.part.path("features"))
        tolerances = next(((one.name, one.content) for one in self._files), None)
        place, mesh = state.part.place, state.part.mesh
        return replace(asked, place=place, mesh=mesh, tolerances=tolerances)

    def about(self, state: AppState) -> Markup:
        turns = (button(f"{axis} 90°", f"{self.name}:turn", axis, kind="choice",
                        hint=f"Turn it about {axis} of the workpiece, in place")
                 for axis in "xyz")  # fmt: skip
        return join((
            actions(tag("span", "Turn about"), *turns),
            *(setting(state, path) for path in SETTINGS),
            html.upload_button("Tolerances …", self.name, MAX_SCENE_BYTES, ".toml",
                               hint="Names and tolerances of its features"),
        ))  # fmt: skip

    def result_html(self, found: Result) -> Markup:
        assert isinstance(found, PartResult)  # noqa: S101 - of this analysis
        judged = [
            (f"{one.name} · {name.replace('_', ' ')}", measure["verdict"])
            for one in found.features
            for name, measure in one.measures.items()
            if "verdict" in measure
        ]
        return html.rows(judged) + super().result_html(found)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "remove" and not value:
            self._sent = None
            return self.removed(state, PartLook(program=state.part.program))
        if word == "turn" and value in ("x", "y", "z") and (part := clamped_part(state)):
            place = turned_place(part, value, 90.0)
            return replace(state, part=replace(state.part, place=place))
        if word == "set.unit" and self._sent is not None:
            self.attempt(partial(self.received, *self._sent))
        return super().take(state, word, value)

    def received(self, name: str, content: bytes) -> None:
        """Take in tolerances, or a mesh: of another name it is clamped in the middle."""
        if name.lower().endswith(".toml"):
            self._files = (Held(name, upload_text(content, name, "file of tolerances")),)
            return
        self._sent, state = (name, content), self.context.state
        mesh = parse_part(content, name, option_values(state, self.name).get("unit") or None)
        place = state.part.place if name == state.part.name else None
        if place is None:
            place = tuple(round(at, 3) for at in find_place(mesh, clamped_scene(state), None))
        self.show(mesh=mesh, name=name, place=place)


class ProgramPart(InBoxPart):
    """A program: a line and its place in the drawing find each other."""

    most_bytes = MOST_BYTES  # longer ones would hold up other tabs
    endings = PROGRAM_ENDINGS
    invitation = "A program (G-code): its path over the workpiece, and its worst blocks."

    def held(self, state: AppState) -> tuple[object, str]:
        return state.part.program, (state.part.program or ("",))[0]

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        name, text = state.part.program or ("", "")
        asked = read_form(Program, self.options(), values, scenes[0])
        return replace(asked, file=name, text=text)

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {**super().defaults(state), **program_defaults(state)}

    def about(self, state: AppState) -> Markup:
        line, text = state.forms.get(AT_LINE, ""), (state.part.program or ("", ""))[1].splitlines()
        if not (at := index_of(line, len(text) + 1)):
            return EMPTY
        return tag("p", join((tag("b", line), " ", tag("code", text[at - 1][:MOST_LETTERS]))))

    def result_html(self, found: Result) -> Markup:
        assert isinstance(found, ProgramResult)  # noqa: S101 - of this analysis
        worst: list[tuple[Markup, str]] = []
        for one in found.worst:
            line = button(f"line {one.line}", f"{self.name}:set.at_line", one.line, kind="link",
                          hint="Show it in the drawing")  # fmt: skip
            most = sorted(one.budget.items(), key=lambda share: -share[1])[:MOST_SHARES]
            shares = ", ".join(f"{key} {html.signed(um)}" for key, um in most)
            worst.append((line, f"{number(one.um)} µm: {shares}"))
        words = tag("p", "Click a line, or the path in the drawing.", class_="ws-tiny")
        rest = details_html(one for one in found.blocks() if not isinstance(one, str))
        return join((tag("h4", "Worst blocks"), words, html.rows(worst), rest))

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "remove":
            return self.removed(state, replace(state.part, program=None))
        return super().take(state, word, value)

    def received(self, name: str, content: bytes) -> None:
        """Take in a program, and run it."""
        self.show(program=(name, content.decode("utf-8-sig", "replace")))
