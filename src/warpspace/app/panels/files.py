"""The panel "Files": open, save, link; pictures and exports, made beside the session."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from warpspace.app.browser.page import listen_script, show_script
from warpspace.app.browser.uploads import drop_script
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.documents import files
from warpspace.app.documents import files as incoming
from warpspace.app.documents import scene_file as document
from warpspace.app.documents.files import build_request, exported_words, file_stem
from warpspace.app.documents.scene_file import dropped_words
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.panels.importing import ImportWindow, accepted_endings
from warpspace.app.panels.job_part import JobPart, add_upload
from warpspace.app.readouts.html import message
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import Comparison
from warpspace.app.state.table import drawn_tables, without_table
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_SCENE_BYTES

FIGURE_S, VIEW_S, PAGE_S, EXPORT_S = 5.0, 1.5, 1.0, 1.0
RENDER_TIMEOUT_S = 30.0
LARGEST_VIEW_PX = 4096
AS_COLOURED = "what is coloured"  # the figure that suits the picture on the screen
Make = Callable[[threading.Event], tuple[str, bytes]]
WITHOUT_TABLES = LiveModel()  # evaluates what files show, for all tabs and beside their sessions


class FilesPanel:
    """Buttons for files, a progress bar and a way to cancel."""

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        self._context = context
        self._picture: LivePicture | None = None
        self._import = ImportWindow(context)
        self._add_scene_files()
        self._add_outputs()
        gui = context.gui
        self._shows: Any = gui.add_html("", visible=False)
        self._job = JobPart(
            context,
            self._failed,
            "Give up what is being made.",
            lambda progress: f"{progress.name} is being made …",
        )

    def _add_scene_files(self) -> None:
        context, gui = self._context, self._context.gui
        upload = add_upload(
            context,
            "Open a scene or data …",
            self._open,
            lambda text: context.notify("Not opened", text, "red"),
            incoming.safe_file_name,
            endings=accepted_endings(),
            hint="A scene file (TOML), or measured errors and tables of controllers, at most 4 MB;"
            " dropping files on the page does the same. Undo goes back.",
            most_bytes=MAX_SCENE_BYTES,
        )
        context.page.run_script(drop_script(upload))
        token = context.services.token
        with_token = {"Link with token": partial(self._link, token)} if token else {}
        self._group(
            "Keep scene, settings and camera",
            {"Save scene": self._save, "Link": self._link, **with_token},
            "Save: a scene file that opens to this very state. Link: into the page's address, and"
            " into the clipboard where the browser allows it; without the token, unless with it.",
        )
        link = gui.add_text("", "", visible=False)
        link.on_update(lambda _: self._context.act(lambda: self._follow(str(link.value))))
        context.page.run_script(listen_script(dom_id(link)))

    def _add_outputs(self) -> None:
        services = self._context.services
        pictures = {} if services.draw_figure is None else {"Figure": self._figure}
        self._figures = {AS_COLOURED: ""} | {name: name for name, _ in services.figures}
        self._kind: Any = self._context.gui.add_dropdown(
            "Figure shows",
            tuple(self._figures),
            visible=bool(pictures),
            hint=" ".join(f"{name}: {caption}" for name, caption in services.figures),
        )
        self._group(
            "Picture (PNG)",
            {**pictures, "View": self._view},
            "Figure: drawn for a report, as chosen above. View: what is on the screen now.",
        )
        exports = {end[1:].upper(): end for end, _ in services.exports}
        about = (f"{end[1:].upper()}: {words}." for end, words in services.exports)
        self._group(
            "Export",
            {"HTML": self._page}
            | {name: partial(self._export, name, end) for name, end in exports.items()},
            " ".join(("HTML: the interactive scene, one file that needs no network.", *about)),
        )

    def _group(self, label: str, actions: Mapping[str, Callable[[], None]], hint: str) -> None:
        group = self._context.gui.add_button_group(label, tuple(actions), hint=hint)

        @group.on_click
        def _(event: Any) -> None:
            name = str(event.target.value)
            if name in actions:
                self._context.act(partial(self._try, name, actions[name]))

    def _try(self, label: str, action: Callable[[], None]) -> None:
        """Do something and show what it raises, so that what waits behind it goes on."""
        try:
            action()
        except Exception as error:  # noqa: BLE001 - shown and logged
            self._job.fail(label, error)

    def _open(self, name: str, content: bytes) -> None:
        """Open an uploaded scene, or show what a file of measured data would bring."""

        def read() -> None:
            if not name.lower().endswith(".toml"):
                self._import.offer(name, content)
                return
            title = incoming.safe_name(name)
            text = incoming.upload_text(content, f"{title}.toml")
            opened, camera = document.open_text(text, title, f"{title}.toml")
            self._show(opened, camera, whole=document.is_looked_at(text))
            self._context.notify("Opened", f"{title}.toml", "green")

        self._try("Not opened", read)

    def _follow(self, message: str) -> None:
        word, scenes = message.partition(":")[2], self._context.scenes.fixed
        self._try("Link", lambda: self._show(*document.open_link(files.unpack(word), scenes)))

    def _show(self, opened: AppState, camera: CameraMemory | None, *, whole: bool = True) -> None:
        """Show an opened state from its camera; beside a plain scene the comparison stays."""
        # here, since not every opened scene is drawn where many follow each other
        dropped = self._context.show_opened(opened, camera, whole=whole)
        if dropped:
            self._context.notify("Scenes", dropped_words(dropped), "gray")

    def _save(self) -> None:
        state, camera = self._context.store.state, self._context.camera.remember()
        text = self._alone_if_large(lambda s: document.state_to_toml(s, camera))
        self._send(incoming.safe_name(state.scene.name), ".toml", text.encode())

    def _link(self, token: str | None = None) -> None:
        scenes, camera = self._context.scenes.fixed, self._context.camera.remember()
        link = self._alone_if_large(lambda s: document.state_to_link(s, camera, scenes))
        self._context.page.run_script(show_script(files.pack(link), token))
        self._context.client.flush()
        text = "It stands in the address bar, and in the clipboard where allowed."
        if token:
            text += " The copy carries the token: whoever has it can use this app."
        self._context.notify("Link", text, "green")

    def _alone_if_large(self, write: Callable[[AppState], str]) -> str:
        state = without_table(self._context.store.state)
        try:
            return write(state)
        except OptionError as error:
            if state.comparison == Comparison():
                raise
            text = write(replace(state, comparison=Comparison()))
            self._context.notify("Without the comparison", str(error), "yellow")
            return text

    def _figure(self) -> None:
        draw, picture = self._context.services.draw_figure, self._picture
        if draw is not None and picture is not None:
            kind = self._figures.get(self._kind.value, "")

            def make(cancelled: threading.Event) -> tuple[str, bytes]:
                bare = self._bare(picture)
                request = replace(build_request(bare), figure=kind)
                return f"{file_stem(bare)}_{kind or 'figure'}", draw(request, cancelled)

            self._make("Figure", ".png", FIGURE_S, make)

    def _bare(self, picture: LivePicture) -> LivePicture:
        if not drawn_tables(picture.state):
            return picture
        return WITHOUT_TABLES.evaluate(without_table(picture.state))

    def _view(self) -> None:
        from warpspace.app.documents.view_image import view_png

        client, picture = self._context.client, self._picture
        if picture is None:
            return
        width = min(max(client.camera.image_width, 64), LARGEST_VIEW_PX)
        height = min(max(client.camera.image_height, 64), LARGEST_VIEW_PX)
        bars = self._context.camera.px_per_mm(picture, height)

        def make(_: threading.Event) -> tuple[str, bytes]:
            pixels = client.get_render(
                height, width, transport_format="png", timeout=RENDER_TIMEOUT_S
            )
            return f"{file_stem(picture)}_view", view_png(pixels, picture, bars)

        self._make("View", ".png", VIEW_S, make)

    def _page(self) -> None:
        from warpspace.app.documents.offline_page import build_offline_html

        picture = self._picture
        if picture is not None:
            toml = {"scene_toml": self._alone_if_large(document.state_to_toml)}
            camera = self._context.camera.remember()
            page = partial(build_offline_html, picture, toml, camera)
            self._make("Page", ".html", PAGE_S, lambda _: (file_stem(picture), page().encode()))

    def _export(self, name: str, ending: str) -> None:
        write, picture = self._context.services.write_export, self._picture
        if write is not None and picture is not None:

            def make(_: threading.Event) -> tuple[str, bytes]:
                bare = self._bare(picture)
                return file_stem(bare), write(build_request(bare), ending)

            self._make(name, ending, EXPORT_S, make)

    def _make(self, name: str, ending: str, usual_s: float, make: Make) -> None:
        def work(cancelled: threading.Event) -> None:
            stem, content = make(cancelled)
            if not cancelled.is_set():
                self._send(stem, ending, content)

        if not self._job.start(name, work, usual_s):
            self._context.notify(
                "Busy", "One file at a time; wait for the other or cancel it", "gray"
            )

    def _send(self, stem: str, ending: str, content: bytes) -> None:
        client = self._context.client
        client.send_file_download(f"{stem}{ending}", content, save_immediately=True)
        client.flush()

    def _failed(self, name: str, words: str) -> None:
        title = name if name == "Not opened" else f"{name}: failed"
        self._context.notify(title, words, "red")

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Remember what is drawn, and say so where it is not what is steered."""
        self._picture = picture
        self._say_what_is_exported(exported_words(picture))

    def _say_what_is_exported(self, words: str) -> None:
        content = message(words, "exported", small=True) if words else ""
        if content != self._shows.content:
            self._shows.content = content
            self._shows.visible = bool(words)
