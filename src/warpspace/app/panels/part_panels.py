"""The workpiece in the working volume: placement and inspection; and the NC program."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Table
from warpspace.analysis.description import Result
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, join, tag
from warpspace.app.browser.incoming import index_of
from warpspace.app.documents.transfers import IN_BOX, upload_text
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.scene_overlays import AT_LINE, moved_place, part_overlay
from warpspace.app.panels.analysis_panel import ResultKey
from warpspace.app.panels.block_html import block_html, details_html
from warpspace.app.panels.measurement import MOST_BYTES, FilesPanel, UploadedFile
from warpspace.app.panels.panel import actions, quiet, setting
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, PartLook
from warpspace.app.state.form_values import option_values
from warpspace.kinematics import transforms
from warpspace.machine.limits import MAX_SCENE_BYTES, MAX_UPLOAD_BYTES
from warpspace.parts.workpiece import load_workpiece, place_workpiece

MOST_LETTERS = 200  # of a displayed line


class SceneOverlayPanel(FilesPanel):
    """An uploaded file that is drawn in the working volume: a workpiece or a program."""

    runs_on_open = True
    most_bytes, what = MAX_UPLOAD_BYTES, "mesh or program"
    part_fields = ("", "")  # fields of `PartLook`: content and name of the file

    def about(self, state: AppState) -> Markup:
        """Render details and settings of the content."""
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
        upload = html.upload_button(
            f"Another {self.name} …" if content else f"{self.title} …", self.name, self.most_bytes,
            ",".join(IN_BOX[self.name]), kind="" if content else "main",
            hint=f"At most {self.most_bytes >> 20} MB; files can also be dropped on the page",
        )  # fmt: skip
        missing = (
            f"{name} is not loaded: links and saved scenes store only its name. Open it again."
        )
        about = quiet(missing) if name else EMPTY
        if content:
            remove = button("✕", f"{self.name}:remove", kind="link", aria_label=f"Remove {name}")
            about = tag("p", join((tag("b", name), " ", remove))) + self.about(state)
        return join((about, self.files_html(), actions(upload)))

    def show(self, content: object, name: str, **changes: Any) -> None:
        """Draw a content, and open the section."""

        def update(state: AppState) -> AppState:
            opened = state.page.open | {self.name}
            page = replace(state.page, task=self.task, open=opened, window="")
            state = replace(state, page=page)
            return self.with_content(state, content, name, shown=True, **changes)

        self.context.post(update)

    def with_content(self, state: AppState, content: object, name: str, **changes: Any) -> AppState:
        """Set or remove the content; the map becomes transparent for it."""
        self.outcome = None
        fields = dict(zip(self.part_fields, (content, name), strict=True))
        part = replace(state.part, **fields, **changes)
        return edits.with_sight(replace(state, part=part), inside=not part.is_empty)

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        if action == "remove" and not value:
            return self.with_content(state, None, "")
        return super().handle(state, action, value)


class PartPanel(SceneOverlayPanel):
    """A workpiece: its placement, and an inspection of it as machined."""

    part_fields = ("mesh", "name")
    unsupported = ("place", "predistorted")
    _sent: tuple[str, bytes] | None = None  # read again with another unit

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        (scene_part, _), part = PartLook.of_scene(state.scene), state.part
        features = state.scene.part.path("features") if part.mesh is scene_part.mesh else None
        tolerances = next(((file.name, file.content) for file in self.files), None)
        files = {"features": features, "tolerances": tolerances}
        return {"place": part.place, "mesh": part.mesh, **files}

    def about(self, state: AppState) -> Markup:
        turns = (button(f"{axis} 90°", f"{self.name}:turn", axis, kind="choice",
                        hint=f"Rotate by 90° about the workpiece axis {axis}, in place")
                 for axis in "xyz")  # fmt: skip
        return join((
            actions(tag("span", "Rotate about"), *turns),
            *(setting(state, f"part.{name}") for name in ("place", "shown", "normal", "moved")),
            html.upload_button("Tolerances …", self.name, MAX_SCENE_BYTES, ".toml",
                               hint="Names and tolerances of the features"),
        ))  # fmt: skip

    def result_html(self, result: Result) -> Markup:
        *_, features = (block for block in result.blocks() if isinstance(block, Table))
        verdicts = [(name, verdict) for name, *_, verdict, _ in features.rows if verdict]
        return html.rows(verdicts) + super().result_html(result)

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        part = part_overlay(state) if action == "turn" and value in ("x", "y", "z") else None
        if part is not None:
            turn = transforms.placed(part.of.middle_mm, 90.0 * np.eye(3)["xyz".index(value)])
            return replace(state, part=replace(state.part, place=moved_place(part.of, turn)))
        updated = super().handle(state, action, value)
        if action == "set.unit" and state.part.mesh and self._sent:
            sent = self._sent
            self.receive(lambda: sent)
        return updated

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        """Parse tolerances, or a mesh; a mesh of another name is placed at the centre."""
        if name.lower().endswith(".toml"):
            text = upload_text(content, name, "tolerance file")
            return partial(self.set_files, (UploadedFile(name, text),))
        self._sent, state = (name, content), self.context.state
        mesh = load_workpiece(name, option_values(state, self.name).get("unit") or None, content)
        present_place = state.part.place if name == state.part.name else None
        place = np.round(place_workpiece(mesh, state.standing, present_place).place, 3)
        return partial(self.show, mesh, name, place=tuple(place.tolist()))


class ProgramPanel(SceneOverlayPanel):
    """A program: its lines and its path in the drawing are linked."""

    most_bytes = MOST_BYTES  # longer programs would delay other tabs
    part_fields = ("program", "program_name")

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"file": state.part.program_name, "text": state.part.program}

    def about(self, state: AppState) -> Markup:
        line, text = state.forms.get(AT_LINE, ""), (state.part.program or "").splitlines()
        at = index_of(line, len(text) + 1)
        if not at:
            return EMPTY
        return tag("p", join((tag("b", line), " ", tag("code", text[at - 1][:MOST_LETTERS]))))

    def result_html(self, result: Result) -> Markup:
        def link(line: int) -> Markup:
            hint = "Show this line in the drawing; a click on the path selects its line"
            return button(line, f"{self.name}:set.at_line", line, kind="link", hint=hint)

        *tables, worst = (block for block in result.blocks() if isinstance(block, Table))
        line, *columns = worst.columns
        columns = (
            replace(block, shows=block.heading in ("|E|", "largest contributions"))
            for block in columns
        )
        narrow = replace(worst, columns=(replace(line, form=link), *columns))
        return block_html(narrow) + details_html((*tables, worst))

    def parse(self, name: str, content: bytes) -> Callable[[], None]:
        return partial(self.show, content.decode("utf-8-sig", "replace"), name)
