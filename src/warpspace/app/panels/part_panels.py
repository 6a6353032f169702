"""A part in the box, where it is clamped, what an inspector would measure; and a program."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Table
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, join, tag
from warpspace.app.browser.incoming import index_of
from warpspace.app.documents.transfers import IN_BOX, upload_text
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.scene_overlays import AT_LINE, moved_place, part_overlay
from warpspace.app.panels.analysis_panel import Question
from warpspace.app.panels.block_html import block_html, details_html
from warpspace.app.panels.form_controls import setting
from warpspace.app.panels.measurement import MOST_BYTES, FilesPanel, UploadedFile
from warpspace.app.panels.panel import actions
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, PartLook
from warpspace.app.state.form_values import option_values
from warpspace.kinematics import transforms
from warpspace.machine.limits import MAX_SCENE_BYTES, MAX_UPLOAD_BYTES
from warpspace.parts.workpiece import load_part, place_part
from warpspace.scene.model import Scene

MOST_LETTERS = 200  # of a line that is shown


class InBoxPanel(FilesPanel):
    """Something to be made, which a page has sent: it stands in the box."""

    at_once = True
    most_bytes, what = MAX_UPLOAD_BYTES, "mesh or program"
    holds = ("", "")  # fields of `PartLook`: what is there, if anything, and the name of its file

    def about(self, state: AppState) -> Markup:
        """Say what is to be known of it, and set."""
        raise NotImplementedError

    def question(self, state: AppState) -> Question:
        made = replace(state.part, shown=True, normal=False, moved=False)
        return (*super().question(state), made)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().concerns(picture), picture.state.part)

    def is_ready(self, state: AppState) -> bool:
        return getattr(state.part, self.holds[0]) is not None

    def before_result(self, state: AppState) -> Markup:
        held, name = (getattr(state.part, field) for field in self.holds)
        upload = html.upload_button(
            f"Another {self.name} …" if held else f"{self.title} …", self.name, self.most_bytes,
            ",".join(IN_BOX[self.name]), kind="" if held else "main",
            hint=f"At most {self.most_bytes >> 20} MB; files can also be dropped on the page",
        )  # fmt: skip
        missing = f"{name} is not here: links and saved scenes hold only its name."
        about = tag("p", missing, class_="ws-quiet") if name else EMPTY
        if held:
            remove = button("✕", f"{self.name}:remove", kind="link", aria_label=f"Remove {name}")
            about = tag("p", join((tag("b", name), " ", remove))) + self.about(state)
        return join((about, self.files_html(), actions(upload)))

    def show(self, held: object, name: str, **more: Any) -> None:
        """Take something in, and unfold the section."""

        def shown(state: AppState) -> AppState:
            opened = state.page.open | {self.name}
            page = replace(state.page, task=self.task, open=opened, window="")
            return self.hold(replace(state, page=page), held, name, shown=True, **more)

        self.context.post(shown)

    def hold(self, state: AppState, held: object, name: str, **more: Any) -> AppState:
        """Put something into the box, or nothing, and see it through the box."""
        self._answer = None
        part = replace(state.part, **dict(zip(self.holds, (held, name), strict=True)), **more)
        return edits.with_sight(replace(state, part=part), inside=not part.is_empty)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        is_removed = word == "remove" and not value
        return self.hold(state, None, "") if is_removed else super().take(state, word, value)


class PartPanel(InBoxPanel):
    """A part: clamped, and measured as it is cut."""

    holds = ("mesh", "name")
    _sent: tuple[str, bytes] | None = None  # read again with another unit

    def options(self) -> Sequence[Option]:
        return [one for one in super().options() if one.name not in ("place", "predistorted")]

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        asked: Any = super().ask(state, values, scenes)
        (own, _), part = PartLook.of_scene(state.scene), state.part
        beside = state.scene.part.path("features") if part.mesh is own.mesh else None
        told = next(((one.name, one.content) for one in self._files), None)
        return replace(asked, place=part.place, mesh=part.mesh, features=beside, tolerances=told)

    def about(self, state: AppState) -> Markup:
        turns = (button(f"{axis} 90°", f"{self.name}:turn", axis, kind="choice",
                        hint=f"Turn it about {axis} of the workpiece, in place")
                 for axis in "xyz")  # fmt: skip
        return join((
            actions(tag("span", "Turn about"), *turns),
            *(setting(state, f"part.{one}") for one in ("place", "shown", "normal", "moved")),
            html.upload_button("Tolerances …", self.name, MAX_SCENE_BYTES, ".toml",
                               hint="Names and tolerances of its features"),
        ))  # fmt: skip

    def result_html(self, found: Result) -> Markup:
        *_, features = (one for one in found.blocks() if isinstance(one, Table))
        judged = [(name, verdict) for name, *_, verdict, _ in features.rows if verdict]
        return html.rows(judged) + super().result_html(found)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "turn" and value in ("x", "y", "z") and (part := part_overlay(state)):
            turn = transforms.placed(part.of.middle_mm, 90.0 * np.eye(3)["xyz".index(value)])
            return replace(state, part=replace(state.part, place=moved_place(part.of, turn)))
        found = super().take(state, word, value)
        if word == "set.unit" and state.part.mesh and self._sent:
            sent = self._sent
            self.receive(lambda: sent)
        return found

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        """Parse tolerances, or a mesh: of another name it is clamped in the middle."""
        if name.lower().endswith(".toml"):
            text = upload_text(content, name, "file of tolerances")
            return partial(self._hold, (UploadedFile(name, text),))
        self._sent, state = (name, content), self.context.state
        mesh = load_part(name, option_values(state, self.name).get("unit") or None, content)
        kept = state.part.place if name == state.part.name else None
        place = np.round(place_part(mesh, state.standing, kept).place, 3)
        return partial(self.show, mesh, name, place=tuple(place.tolist()))


class ProgramPanel(InBoxPanel):
    """A program: a line and its place in the drawing find each other."""

    most_bytes = MOST_BYTES  # longer ones would hold up other tabs
    holds = ("program", "program_name")

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        asked: Any = super().ask(state, values, scenes)
        return replace(asked, file=state.part.program_name, text=state.part.program)

    def about(self, state: AppState) -> Markup:
        line, text = state.forms.get(AT_LINE, ""), (state.part.program or "").splitlines()
        if not (at := index_of(line, len(text) + 1)):
            return EMPTY
        return tag("p", join((tag("b", line), " ", tag("code", text[at - 1][:MOST_LETTERS]))))

    def result_html(self, found: Result) -> Markup:
        def link(line: int) -> Markup:
            words = "Show it in the drawing; a click on the path finds its line"
            return button(line, f"{self.name}:set.at_line", line, kind="link", hint=words)

        *rest, worst = (one for one in found.blocks() if isinstance(one, Table))
        line, *others = worst.columns
        others = (replace(one, shows=one.heading in ("|E|", "most of it")) for one in others)
        narrow = replace(worst, columns=(replace(line, form=link), *others))
        return block_html(narrow) + details_html((*rest, worst))

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        return partial(self.show, content.decode("utf-8-sig", "replace"), name)
