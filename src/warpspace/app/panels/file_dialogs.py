"""Dialogs that open and save files: scenes, measured data, links, pictures, exports, reports."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import msgspec
import numpy as np
from markupsafe import Markup

from warpspace.analysis.description import Result
from warpspace.app.browser import actions as do
from warpspace.app.browser.templates import Templates
from warpspace.app.documents import scene_file, transfers
from warpspace.app.documents.offline_page import build_offline_html, build_story_html
from warpspace.app.evaluation.compare import drawn_tables, without_table
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.panel import Context, Dialog, Job, Jobs, on, setting
from warpspace.app.state.app_state import AppState, Comparison
from warpspace.exceptions import OptionError
from warpspace.formats.registry import formats
from warpspace.parts.inspection_report import REPORT_ENDINGS, is_report
from warpspace.scene.notes import story
from warpspace.scene.text_files import decode_text

HTML = Templates("dialogs")
RENDER_TIMEOUT_S = 30.0
VIEW_PX = 64, 4096
CHANGED = (
    "The file on the server has changed since this scene was opened; the saved copy does not"
    " contain that change. Save it under another name; “warpspace merge” combines the notes."
)
Write = Callable[[LivePicture, Job], bytes]
PLAIN = LiveModel()  # evaluates the contents of files, for all tabs


def accepted_endings() -> str:
    """List the extensions of files that the page opens."""
    scene_endings = (".toml", ".urdf", *(end for ends in transfers.IN_BOX.values() for end in ends))
    file_formats = (end for file_format in formats() for end in file_format.endings)
    endings = dict.fromkeys((*scene_endings, *file_formats, *REPORT_ENDINGS))
    return ",".join((*endings, *(end.upper() for end in endings if end in (".com", ".cma"))))


class JobDialog(Dialog):
    """A dialog that writes files, one after the other, with progress and cancellation."""

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._jobs = Jobs(self, self.rerender, context.page.report)

    def make(self, name: str, ending: str, write: Write, *, as_drawn: bool = False) -> None:
        """Write a file of the current picture in a job, and have the browser save it."""
        current = self.context.picture
        if current is None:
            return

        def compute(job: Job) -> tuple[str, bytes]:
            picture = current
            if not as_drawn and drawn_tables(current.state):  # files do not contain tables
                picture = PLAIN.evaluate(without_table(current.state))
            return f"{transfers.file_stem(picture)}{ending}", write(picture, job)

        self._jobs.start(name, compute, lambda file: self.context.save_file(*file))

    @on(do.Cancel, later=True)
    def cancel(self, _: do.Cancel) -> None:
        self._jobs.cancel()


class FilesDialog(JobDialog):
    """Save and export; it also opens files and links."""

    name, title = "files", "Save and export"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._uploads = Jobs(self, self.rerender, context.page.report)

    def body(self, picture: LivePicture) -> Markup:
        services = self.context.services
        names = {name: name.replace("-", " ") for name, _ in services.figures}
        return HTML.files(
            picture.state, transfers.exported_words(picture), {"": "map as displayed", **names},
            services.exports, services.token, story(picture.state.review), self._jobs.html(),
        )  # fmt: skip

    @on(do.Share)
    def share(self, state: AppState, action: do.Share) -> AppState | None:
        if self.context.services.token and not action.kind:
            return replace(state, page=replace(state.page, window=self.name))
        self.context.call_soon(partial(self._share, with_token=action.kind == "with_token"))
        return None

    # --- open ------------------------------------------------------------------------------------

    @on(do.Upload, later=True)
    def open(self, upload: do.Upload) -> None:
        for panel, endings in transfers.IN_BOX.items():
            if upload.name.lower().endswith(endings):
                self.context.send(msgspec.structs.replace(upload, panel=panel))
                return
        self._uploads.start("Opening", lambda _: self._parse(upload), lambda show: show())

    def _parse(self, upload: do.Upload) -> Callable[[], None]:
        name, content = transfers.read_upload(upload)
        notes, is_robot = list[str](), b"<robot" in content[:4096]
        if is_robot:
            text, notes = transfers.robot_text(name, content)
        elif name.lower().endswith(".toml"):
            text = transfers.upload_text(content, name)
        elif is_report(decode_text(content, name, "replace")[0]):
            return partial(self.context.send, msgspec.structs.replace(upload, panel="part"))
        else:
            return partial(self.context.offer_import, name, content)
        opened, camera = scene_file.open_text(text, transfers.safe_name(name), name)
        replaces_all = is_robot or scene_file.settings_of(text) != ""

        def show() -> None:
            self.context.show_opened(opened, camera, keeps_comparison=not replaces_all)
            self.context.notify("Opened", "\n".join((name, *notes)), "stays" if notes else "done")

        return show

    @on(do.Input.FOLLOW_LINK, later=True)
    def follow(self, link: str) -> None:
        opened = scene_file.open_link(transfers.unpack(link), self.context.scenes.fixed)
        self.context.show_opened(*opened)

    # --- save ------------------------------------------------------------------------------------

    @on(do.Signal.SAVE_SCENE, later=True)
    def save(self) -> None:
        state, camera = self.context.state, self.context.camera.remember()
        text = self._alone_if_large(lambda state: scene_file.state_to_toml(state, camera))
        self.context.save_file(f"{transfers.safe_name(state.scene.name)}.toml", text)
        if not self.context.services.is_current(state.origin):
            self.context.notify("Scene file changed on the server", CHANGED, "stays")

    def _share(self, *, with_token: bool) -> None:
        context = self.context
        scenes, camera = context.scenes.fixed, context.camera.remember()

        def write(state: AppState) -> str:
            try:
                return scene_file.state_to_link(state, camera, scenes)
            except OptionError as error:
                if not state.review:
                    raise
                # a link is for the view; the scene file holds the notes
                link = scene_file.state_to_link(replace(state, review=()), camera, scenes)
                context.notify("Notes not included", str(error), "warning")
                return link

        link = self._alone_if_large(write)
        token = context.services.token if with_token else None
        edited = len(context.state.changed_keys)
        edits = f" {edited} changed error{'s' if edited > 1 else ''}," if edited else ""
        compared = " the comparison," if context.state.comparison.b is not None else ""
        contents = f"the scene {context.state.scene.title},{edits}{compared} view and camera"
        warning = " Everyone who has it can use this app." if token else ""
        context.page.call("share", transfers.pack(link), token, f"Contains {contents}.{warning}")
        context.client.flush()

    def _alone_if_large(self, write: Callable[[AppState], str]) -> str:
        state = without_table(self.context.state)
        try:
            return write(state)
        except OptionError as error:
            if state.comparison == Comparison():
                raise
            text = write(replace(state, comparison=Comparison()))
            self.context.notify("Comparison not included", str(error), "warning")
            return text

    @on(do.Signal.SAVE_FIGURE, later=True)
    def save_figure(self) -> None:
        draw, kind = self.context.services.draw_figure, self.context.state.page.figure
        kind = kind if kind in dict(self.context.services.figures) else ""
        ending = f"_{kind or 'figure'}.png"
        self.make("Figure", ending, lambda picture, job: draw(picture, kind, job))

    @on(do.SaveAnimation)
    def save_animation(self, state: AppState, action: do.SaveAnimation) -> AppState:
        draw, motion, ending = self.context.services.draw_animation, action.motion, action.ending
        review = self.context.store.state  # not the step of a story that is shown

        def write(picture: LivePicture, job: Job) -> bytes:
            if motion == "story":
                picture = PLAIN.evaluate(without_table(review))
            return draw(picture, motion, ending, job)

        self.context.call_soon(partial(self.make, "Animation", f"_{motion}{ending}", write))
        return replace(state, page=replace(state.page, window=self.name))  # its progress

    @on(do.Signal.SAVE_VIEW, later=True)
    def save_view(self) -> None:
        client, camera = self.context.client, self.context.camera

        def draw(picture: LivePicture, job: Job) -> bytes:
            view_camera = client.camera
            size = view_camera.image_height, view_camera.image_width
            size_px = np.clip(size, *VIEW_PX).tolist()
            settings: Any = {"transport_format": "png", "timeout": RENDER_TIMEOUT_S}
            pixels: Any = client.get_render(*size_px, **settings)
            return self.context.services.draw_view(picture, pixels, camera.remember(), job)

        self.make("Current view", "_view.png", draw, as_drawn=True)

    @on(do.Signal.SAVE_PAGE, do.Signal.SAVE_STORY, later=True)
    def save_page(self, signal: do.Signal) -> None:
        context = self.context
        toml = {"scene_toml": self._alone_if_large(scene_file.state_to_toml)}
        if signal is do.Signal.SAVE_PAGE:
            build = partial(build_offline_html, provenance=toml, camera=context.camera.remember())
            self.make("Page", ".html", lambda picture, _: build(picture).encode(), as_drawn=True)
        else:
            about = without_table(context.state), toml, context.scenes.fixed
            self.make("Story", "_story.html", lambda *_: build_story_html(*about).encode(),
                      as_drawn=True)  # fmt: skip

    @on(do.Input.EXPORT, later=True)
    def export(self, ending: str) -> None:
        services = self.context.services
        if ending in dict(services.exports):
            self.make(ending[1:].upper(), ending,
                      lambda picture, _: services.write_export(picture, ending))  # fmt: skip


# --- The report -----------------------------------------------------------------------------------


def limit_words(state: AppState) -> str:
    limit_um = state.specification.limit_um
    return "No limit is set" if limit_um is None else f"Limit: {limit_um:g} µm"


class ReportDialog(JobDialog):
    name, title = "report", "Report"

    def body(self, picture: LivePicture) -> Markup:
        compared = picture.compared
        subject = f"Subject: {picture.title}, as displayed."
        if compared is not None and transfers.has_sheet(picture):
            a, b = compared.titles
            subject = f"Comparison of A, {a}, with B, {b}."
        questions = setting(picture.state, "page.questions")
        return HTML.report(f"{subject} {limit_words(picture.state)}.", picture.state.page.author,
                           questions, self.context.report_results, self._jobs.html())  # fmt: skip

    @on(do.RemoveFromReport, later=True)
    def remove(self, action: do.RemoveFromReport) -> None:
        del self.context.report_results[action.index : action.index + 1]
        self.rerender()

    @on(do.WriteReport, later=True)
    def write(self, action: do.WriteReport) -> None:
        results: dict[str, Result] = {}
        for index, (title, added) in enumerate(self.context.report_results):
            results[f"{title} ({index + 1})" if title in results else title] = added
        page = self.context.state.page
        questions = tuple(filter(None, map(str.strip, page.questions.splitlines())))
        about = page.author.strip(), questions, results, action.ending

        def write(picture: LivePicture, job: Job) -> bytes:
            content, missing = self.context.services.write_report(picture, *about, job)
            if missing and not job.is_set():
                self.context.notify("Some figures are missing", "\n".join(missing), "warning")
            return content

        self.make("Report", f"_report{action.ending}", write)
