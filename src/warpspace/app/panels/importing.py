"""The window that shows what files of measured data would bring, to apply or to cancel."""

from contextlib import suppress
from dataclasses import replace
from typing import Any

from warpspace.app.documents.received_files import safe_file_name
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.import_preview import preview_html
from warpspace.app.state.app_state import start_state
from warpspace.exceptions import WarpspaceError
from warpspace.formats.importing import open_upload, read_errors
from warpspace.formats.kind import ReadOptions
from warpspace.formats.registry import formats
from warpspace.formats.source import Source
from warpspace.formats.to_scene import ImportedScene, into_scene

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
        self._sources: list[Source] = []
        self._refused: list[Source] = []
        self._made: ImportedScene | None = None
        self._window: Any = None

    def offer(self, name: str, content: bytes) -> None:
        """Take a file; with those shown, or the one refused before it, where they belong together.

        Raises
        ------
        WarpspaceError
            If it cannot be read; what was shown before stays.
        """
        source = open_upload(safe_file_name(name), content)
        for others in (self._sources, self._refused):
            together = [one for one in others if one.name != source.name]
            if together and len(together) < MOST_FILES:
                with suppress(WarpspaceError):
                    self._show([*together, source])
                    return
        try:
            self._show([source])
        except WarpspaceError:
            self._refused = [source]  # such as a list of tables that come after it
            raise

    def _show(self, sources: list[Source]) -> None:
        """Read files into the present scene, and show what that brings."""
        gui, base = self._context.gui, scene_of(self._context.store.state)
        reading = read_errors(sources, ReadOptions(base.machine))
        names = [source.name for source in sources]
        made = into_scene(reading, base, base.title, ", ".join(names))
        self._close()
        self._sources, self._refused, self._made = sources, [], made
        self._window = gui.add_modal("Import errors")
        with self._window:
            apply = gui.add_button("Apply", hint="Take these errors over; undo goes back.")
            apply.on_click(lambda _: self._context.act(self._apply))
            cancel = gui.add_button("Cancel", color="gray", hint="Close this; nothing is changed.")
            cancel.on_click(lambda _: self._context.act(self._cancel))
            gui.add_html(preview_html(reading, names, base.machine.title, made.notes))
        self._context.client.flush()

    def _apply(self) -> None:
        """Show the scene with the imported errors."""
        made, names = self._made, [source.name for source in self._sources]
        self._cancel()
        if made is None:
            return
        scene = replace(made.scene, name=f"{made.scene.name}_imported"[:60])
        self._context.show_opened(start_state(scene), None, whole=False)
        self._context.notify("Imported", ", ".join(names), "green")

    def _cancel(self) -> None:
        """Forget the files."""
        self._close()
        self._sources, self._refused, self._made = [], [], None
        self._context.client.flush()

    def _close(self) -> None:
        """Close the window where it is open."""
        window, self._window = self._window, None
        if window is not None:
            window.close()
