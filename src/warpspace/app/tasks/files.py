"""Files of a page: scenes and data that are opened, scenes, links, pictures and exports."""

import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from markupsafe import Markup

from warpspace.app.browser.html import button, choice, field, join, tag
from warpspace.app.browser.page import error_words
from warpspace.app.documents import scene_file
from warpspace.app.documents.files import (
    build_request,
    exported_words,
    file_stem,
    pack,
    read_upload,
    robot_text,
    safe_name,
    unpack,
    upload_text,
)
from warpspace.app.documents.services import CancelledError
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import Comparison
from warpspace.app.state.table import drawn_tables, without_table
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.jobs import Jobs
from warpspace.app.tasks.window import Window, actions
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.formats.registry import formats

FIGURE_S, VIEW_S, EXPORT_S = 5.0, 1.5, 1.0  # what a file usually takes
RENDER_TIMEOUT_S = 30.0
LARGEST_VIEW_PX = 4096
AS_COLOURED = "as the drawing is coloured"
Make = Callable[[threading.Event], tuple[str, bytes]]
PLAIN = LiveModel()  # evaluates what files show, for all tabs and beside their sessions


def accepted_endings() -> str:
    """List the endings of files that can be given to the page."""
    endings = dict.fromkeys((".toml", ".urdf", *(end for one in formats() for end in one.endings)))
    return ",".join((*endings, *(end.upper() for end in endings if end in (".com", ".cma"))))


class JobWindow(Window):
    """A window that makes files, one at a time, with its progress and a way to cancel."""

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._jobs = Jobs(context, self.name, lambda: context.renew(self), self._failed)

    def make(self, name: str, ending: str, usual_s: float, make: Make) -> None:
        """Make a file beside the session, and have the browser save it."""

        def work(cancelled: threading.Event) -> None:
            stem, content = make(cancelled)
            if not cancelled.is_set():
                self.context.save_file(f"{stem}{ending}", content)

        if not self._jobs.start(name, work, usual_s):
            self.context.notify(
                "One file at a time", "Wait for the other one, or cancel it", "warning"
            )

    def attempt(self, action: Callable[[], None]) -> None:
        """Do something in the session; say what it raises."""

        def guarded() -> None:
            try:
                action()
            except WarpspaceError as error:
                self._failed(self.title, error)

        self.context.act(guarded)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Cancel what is being made."""
        if word == "cancel":
            self._jobs.cancel()
        return state

    def _failed(self, name: str, error: Exception) -> None:
        if isinstance(error, CancelledError):
            self.context.notify(str(error))
        else:
            self.context.notify(f"{name}: not done", error_words(error), "problem")


class FilesWindow(JobWindow):
    """Save and export; opening files and links goes this way too."""

    name, title = "files", "Save and export"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._figures = {name: name.replace("-", " ") for name, _ in context.services.figures}
        self._figure = ""

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow what exports show, and how far a file is."""
        return (object(),)

    def body(self, picture: LivePicture) -> Markup:
        """Offer the files."""
        services = self.context.services
        figure: list[Markup] = []
        if services.draw_figure is not None:
            kinds = choice("files:set.figure", self._figure, {"": AS_COLOURED, **self._figures})
            figure = [
                field("Figure", kinds, "files:set.figure"),
                actions(button("Save figure (PNG)", "files:figure")),
            ]
        exports = (
            button(f"{end[1:].upper()}", "files:export", end, hint=words)
            for end, words in (services.exports if services.write_export else ())
        )
        return join((
            tag("h3", "Scene"),
            tag("p", "Errors, tolerances and machine as they are now, with view and camera."),
            actions(button("Save scene (TOML)", "files:save", kind="main", hint="Ctrl+S")),
            tag("h3", "Picture"), tag("p", exported_words(picture), class_="ws-quiet"),
            actions(button("Save what is on the screen (PNG)", "files:view")), *figure,
            tag("h3", "Export"),
            actions(button("Interactive page (HTML)", "files:page",
                           hint="One file that needs no network"), *exports),
            self._jobs.html(),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Save, share, or make a file of what is drawn."""
        if word == "set.figure":
            self._figure = value if value in self._figures else ""
            self.context.act(partial(self.context.renew, self))
        elif word == "share" and self.context.services.token and not value:
            return replace(state, page=replace(state.page, window="share"))
        else:
            doing: dict[str, Callable[[], None]] = {
                "file": partial(self._open, value),
                "save": self._save,
                "share": partial(self._share, with_token=value == "token"),
                "link": partial(self._follow, value),
                "figure": self._draw,
                "view": self._view,
                "page": self._page,
                "export": partial(self._export, value),
            }
            if word in doing:
                self.attempt(doing[word])
        return super().take(state, word, value)

    # --- what is opened --------------------------------------------------------------------------

    def _open(self, value: str) -> None:
        """Open a scene or a machine, or show what a file of measured data would bring."""
        name, content = read_upload(value)
        if b"<robot" in content[:4096]:
            text, notes = robot_text(name, content)
            opened, camera = scene_file.open_text(text, safe_name(name), name)
            self._show(opened, camera)
            self.context.notify("Opened", "\n".join((name, *notes)), "stays" if notes else "done")
            return
        if not name.lower().endswith(".toml"):
            self.context.offer_import(name, content)
            return
        title = safe_name(name)
        text = upload_text(content, f"{title}.toml")
        opened, camera = scene_file.open_text(text, title, f"{title}.toml")
        self._show(opened, camera, whole=scene_file.is_looked_at(text))
        self.context.notify("Opened", f"{title}.toml")

    def _follow(self, word: str) -> None:
        self._show(*scene_file.open_link(unpack(word), self.context.scenes.fixed))

    def _show(self, opened: AppState, camera: CameraMemory | None, *, whole: bool = True) -> None:
        """Show an opened state from its camera; beside a plain scene the comparison stays."""
        if dropped := self.context.show_opened(opened, camera, whole=whole):
            self.context.notify("Scenes", scene_file.dropped_words(dropped))

    # --- what is saved ---------------------------------------------------------------------------

    def _save(self) -> None:
        state, camera = self.context.state, self.context.camera.remember()
        text = self._alone_if_large(lambda one: scene_file.state_to_toml(one, camera))
        self.context.save_file(f"{safe_name(state.scene.name)}.toml", text)

    def _share(self, *, with_token: bool) -> None:
        context = self.context
        scenes, camera = context.scenes.fixed, context.camera.remember()
        link = self._alone_if_large(lambda one: scene_file.state_to_link(one, camera, scenes))
        token = context.services.token if with_token else None
        held = ", ".join(_held(context.state))
        warned = " Whoever has it can use this app." if token else ""
        context.page.call("share", pack(link), token, f"It holds {held}.{warned}")
        context.client.flush()

    def _alone_if_large(self, write: Callable[[AppState], str]) -> str:
        state = without_table(self.context.state)
        try:
            return write(state)
        except OptionError as error:
            if state.comparison == Comparison():
                raise
            text = write(replace(state, comparison=Comparison()))
            self.context.notify("Without the comparison", str(error), "warning")
            return text

    def _draw(self) -> None:
        draw, picture, kind = self.context.services.draw_figure, self.context.shown, self._figure
        if draw is not None and picture is not None:

            def make(cancelled: threading.Event) -> tuple[str, bytes]:
                bare = without_tables(picture)
                request = replace(build_request(bare), figure=kind)
                return f"{file_stem(bare)}_{kind or 'figure'}", draw(request, cancelled)

            self.make("Figure", ".png", FIGURE_S, make)

    def _view(self) -> None:
        from warpspace.app.documents.view_image import view_png

        client, picture = self.context.client, self.context.shown
        if picture is None:
            return
        width = min(max(client.camera.image_width, 64), LARGEST_VIEW_PX)
        height = min(max(client.camera.image_height, 64), LARGEST_VIEW_PX)
        bars = self.context.camera.px_per_mm(picture, height)
        camera = self.context.camera.remember()

        def make(_: threading.Event) -> tuple[str, bytes]:
            pixels: Any = client.get_render(
                height, width, transport_format="png", timeout=RENDER_TIMEOUT_S
            )
            return f"{file_stem(picture)}_view", view_png(pixels, picture, bars, camera)

        self.make("Picture of the screen", ".png", VIEW_S, make)

    def _page(self) -> None:
        from warpspace.app.documents.offline_page import build_offline_html

        if (picture := self.context.shown) is not None:
            toml = {"scene_toml": self._alone_if_large(scene_file.state_to_toml)}
            page = partial(build_offline_html, picture, toml, self.context.camera.remember())
            self.make("Page", ".html", EXPORT_S, lambda _: (file_stem(picture), page().encode()))

    def _export(self, ending: str) -> None:
        write, picture = self.context.services.write_export, self.context.shown
        known = {end for end, _ in self.context.services.exports}
        if write is not None and picture is not None and ending in known:

            def make(_: threading.Event) -> tuple[str, bytes]:
                bare = without_tables(picture)
                return file_stem(bare), write(build_request(bare), ending)

            self.make(ending[1:].upper(), ending, EXPORT_S, make)


def _held(state: AppState) -> list[str]:
    edited = len(state.changed_keys)
    return [
        f"the scene {state.scene.title}",
        *([f"{edited} changed {'error' if edited == 1 else 'errors'}"] if edited else []),
        *(["the comparison"] if state.comparison.b is not None else []),
        "view and camera",
    ]


def without_tables(picture: LivePicture) -> LivePicture:
    """Give a picture without the tables of a controller, which files do not hold."""
    if not drawn_tables(picture.state):
        return picture
    return PLAIN.evaluate(without_table(picture.state))


class ShareWindow(Window):
    """Asks whether a link is to hold the token, where the app asks for one."""

    name, title = "share", "Share a link"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Depend on nothing: it says the same every time."""
        return ()

    def body(self, picture: LivePicture) -> Markup:
        """Offer both."""
        words = (
            "This app asks for a token. A link without it opens for those who have the token;"
            " a link with it lets whoever has the link use this app."
        )
        return tag("p", words) + actions(
            button("Copy link", "files:share", "plain", kind="main"),
            button("Copy link with token", "files:share", "token"),
        )
