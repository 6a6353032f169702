"""The window that shows what files of measured data would bring."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from viser import GuiApi

from warpspace.app.browser.handles import Handle, Input
from warpspace.app.documents.files import safe_file_name
from warpspace.app.documents.import_offer import Offer, Said, asking, offered, said_again
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.html import message
from warpspace.app.readouts.import_preview import preview_html
from warpspace.app.state.app_state import start_state
from warpspace.exceptions import UnsaidError, WarpspaceError
from warpspace.formats.registry import CORRECTION, ERROR, Format, formats, open_upload
from warpspace.formats.source import Source

# --- Widgets of what the files of an import do not say: format, axis, sign and variant ------------

TITLE = "What the files do not say"
SIGNS = {
    "as the manual says": "",
    "errors, which the controller takes back": ERROR,
    "corrections, which it adds": CORRECTION,
}


class ImportChoices:
    """A group of widgets, folded unless the files cannot be read without them."""

    def __init__(self, gui: GuiApi, offer: Offer, changed: Callable[[], None]) -> None:
        self._said = said = offer.said
        self._formats = _format_words(offer.recognised)
        self._variants = _variant_words(offer.kind)

        def choice(label: str, words: Mapping[str, str], chosen: str, hint: str) -> Any:
            first = next((word for word, meant in words.items() if meant == chosen), None)
            return gui.add_dropdown(label, tuple(words), initial_value=first, hint=hint)

        with gui.add_folder(TITLE, expand_by_default=bool(offer.problem)):
            kind = choice(
                "Format",
                self._formats,
                said.format,
                "Structure of the files, where it is recognised wrongly or not at all.",
            )
            axes = gui.add_text(
                "Axis",
                said.axes,
                hint="X: the axis of files that name none. AX1=X: what a name in the files means;"
                " several with blanks between.",
            )
            self._sign = choice(
                "Sign", SIGNS, said.sign, "What the numbers of a controller's table are."
            )
            self._variant = choice(
                "Variant", self._variants, said.variant, "Published variant of the format."
            )
        self._kind: Input[str] = Input(kind, changed)
        self._axes: Input[str] = Input(axes, changed)
        self._signs: Input[str] = Input(self._sign, changed)
        self._chosen: Input[str] = Input(self._variant, changed)
        self.show(offer)

    def read(self) -> Said | None:
        """Give what is said now; None where nothing has changed since the last call."""
        said = self._said
        if (kind := self._kind.poll()) is not None:
            said = replace(said, format=self._formats.get(kind, ""))
        if (axes := self._axes.poll()) is not None:
            said = replace(said, axes=axes)
        if (sign := self._signs.poll()) is not None:
            said = replace(said, sign=SIGNS.get(sign, ""))
        if (variant := self._chosen.poll()) is not None:
            said = replace(said, variant=self._variants.get(variant, ""))
        if said == self._said:
            return None
        self._said = said
        return said

    def show(self, offer: Offer) -> None:
        """Offer what the format of the files has a choice of, and take back all else."""
        kind = offer.kind
        self._said = offer.said.fitting(kind)
        self._sign.visible = kind is not None and kind.tables is not None
        if not self._said.sign:
            self._signs.show(next(iter(SIGNS)))
        words = _variant_words(kind)
        self._variant.visible = len(words) > 1
        if words != self._variants:
            self._variants = words
            self._variant.options = tuple(words)
            self._chosen.show(next(iter(words)))


def _format_words(recognised: Format | None) -> dict[str, str]:
    first = recognised.title if recognised is not None else "none, choose one"
    words = {f"recognised: {first}": ""}
    return words | {f"{one.name}: {one.title}": one.name for one in formats()}


def _variant_words(kind: Format | None) -> dict[str, str]:
    names = kind.variants if kind is not None else ()
    return {"not told": ""} | {name: name for name in names}


# --- The window that shows what files of measured data would bring, to apply or to cancel ---------

MOST_FILES = 16  # files that are read together


def accepted_endings() -> str:
    """List the endings of files that can be given to the page."""
    endings = dict.fromkeys((".toml", *(end for one in formats() for end in one.endings)))
    return ",".join((*endings, *(end.upper() for end in endings if end in (".com", ".cma"))))


class ImportWindow:
    """Reads files as they come, shows what they hold, and changes nothing before it is applied."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._offer: Offer | None = None
        self._refused: list[Source] = []
        self._window: Any = None

    def offer(self, name: str, content: bytes) -> None:
        """Take a file; with those shown, or the one refused before it, where they belong together.

        A file that does not say enough to be read opens the window with the question, unless it
        shows other files already.
        """
        source = open_upload(safe_file_name(name), content)
        shown = [] if self._offer is None else list(self._offer.sources)
        for others in (shown, self._refused):
            together = [one for one in others if one.name != source.name]
            if together and len(together) < MOST_FILES:
                with suppress(WarpspaceError):
                    self._open(self._read([*together, source]))
                    return
        try:
            self._open(self._read([source]))
        except UnsaidError as error:
            if any(one.name != source.name for one in shown):
                raise
            self._open(asking([source], error))
        except WarpspaceError:
            self._refused = [source]  # such as a list of tables that come after it
            raise

    def _read(self, sources: Sequence[Source]) -> Offer:
        base = scene_of(self._context.store.state)
        if self._offer is not None and len(sources) > 1:
            with suppress(WarpspaceError):
                return offered(sources, base, self._offer.said)
        return offered(sources, base)

    def _open(self, offer: Offer) -> None:
        """Show what files would bring in a window of their own."""
        context, gui = self._context, self._context.gui
        left = [] if self._offer is None else self._offer.names
        self._close()
        self._offer, self._refused = offer, []
        self._window = gui.add_modal("Import errors")
        with self._window:
            self._problem = Handle(gui.add_html("", visible=False))
            apply = gui.add_button("Apply", hint="Take these errors over; undo goes back.")
            apply.on_click(lambda _: context.act(self._apply))
            self._button = Handle(apply)
            cancel = gui.add_button("Cancel", color="gray", hint="Close this; nothing is changed.")
            cancel.on_click(lambda _: context.act(self._cancel))
            self._choices = ImportChoices(gui, offer, lambda: context.act(self._follow))
            self._preview = Handle(gui.add_html(""))
        self._show(offer)
        if gone := [name for name in left if name not in offer.names]:
            context.notify("No longer shown", ", ".join(gone), "gray")

    def _follow(self) -> None:
        if self._offer is None or (said := self._choices.read()) is None:
            return
        self._offer = said_again(self._offer, said, scene_of(self._context.store.state))
        self._choices.show(self._offer)
        self._show(self._offer)

    def _show(self, offer: Offer) -> None:
        """Show what the files would bring, or why they cannot be read as a user says now."""
        problem = offer.problem and message(offer.problem, "import-problem", small=True)
        self._problem.put(content=problem, visible=bool(problem))
        self._button.put(disabled=not offer.can_apply)
        if offer.reading is not None and offer.made is not None:
            machine, stale = offer.made.scene.machine.title, bool(problem)
            notes = offer.made.notes
            self._preview.put(
                content=preview_html(offer.reading, offer.names, machine, notes, stale=stale)
            )
        self._context.client.flush()

    def _apply(self) -> None:
        offer = self._offer
        if offer is None or offer.made is None or not offer.can_apply:
            return
        self._cancel()
        scene = replace(offer.made.scene, name=f"{offer.made.scene.name}_imported"[:60])
        self._context.show_opened(start_state(scene), None, whole=False)
        self._context.notify("Imported", ", ".join(offer.names), "green")

    def _cancel(self) -> None:
        self._close()
        self._offer, self._refused = None, []
        self._context.client.flush()

    def _close(self) -> None:
        window, self._window = self._window, None
        if window is not None:
            window.close()
