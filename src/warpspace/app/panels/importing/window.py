"""The window that shows what files of measured data would bring, to apply or to cancel."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Handle
from warpspace.app.documents.import_offer import Offer, asking, offered, said_again
from warpspace.app.documents.received_files import safe_file_name
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.importing.choices import ImportChoices
from warpspace.app.readouts.html import message
from warpspace.app.readouts.import_preview import preview_html
from warpspace.app.state.app_state import start_state
from warpspace.exceptions import UnsaidError, WarpspaceError
from warpspace.formats.importing import open_upload
from warpspace.formats.registry import formats
from warpspace.formats.source import Source

MOST_FILES = 16
"""Files that are read together."""


def accepted_endings() -> str:
    """List the endings of files that can be given to the page."""
    endings = dict.fromkeys((".toml", *(end for one in formats() for end in one.endings)))
    return ",".join((*endings, *(end.upper() for end in endings if end in (".com", ".cma"))))


class ImportWindow:
    """Reads files as they come, shows what they hold, and changes nothing before it is applied.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._offer: Offer | None = None
        self._refused: list[Source] = []
        self._window: Any = None

    def offer(self, name: str, content: bytes) -> None:
        """Take a file; with those shown, or the one refused before it, where they belong together.

        A file that does not say enough to be read opens the window with the question, unless it
        shows other files already.

        Raises
        ------
        WarpspaceError
            If it cannot be read; what was shown before stays.
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
        """Read files into the present scene, with what is said of those shown."""
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
        """Read the files again as a browser says now."""
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
        """Show the scene with the imported errors."""
        offer = self._offer
        if offer is None or offer.made is None or not offer.can_apply:
            return
        self._cancel()
        scene = replace(offer.made.scene, name=f"{offer.made.scene.name}_imported"[:60])
        self._context.show_opened(start_state(scene), None, whole=False)
        self._context.notify("Imported", ", ".join(offer.names), "green")

    def _cancel(self) -> None:
        """Forget the files."""
        self._close()
        self._offer, self._refused = None, []
        self._context.client.flush()

    def _close(self) -> None:
        """Close the window where it is open."""
        window, self._window = self._window, None
        if window is not None:
            window.close()
