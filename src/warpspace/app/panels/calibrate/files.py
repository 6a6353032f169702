"""The readings that are fitted: uploaded files and bundled ones, their kind, and their list."""

from collections.abc import Callable
from functools import partial
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle, Input
from warpspace.app.browser.page import error_words
from warpspace.app.documents.received_files import safe_name, upload_text
from warpspace.app.evaluation.calibration import MOST_FILES, Measured, bundled, take
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.uploading import add_upload
from warpspace.app.readouts.calibration import files_html
from warpspace.calibration.kinds.bench import test_kinds
from warpspace.calibration.kinds.registry import KINDS
from warpspace.calibration.readings import bundled_data
from warpspace.exceptions import WarpspaceError

MOST_BYTES = 2 * 2**20
WHAT = "CSV file of readings"
NOT_CHOSEN, BY_COLUMNS = "choose …", "told by its columns"
LONGEST_OPTIONS = 200
EMPTY = (
    "Measured data give the errors of this machine. Add a CSV file of readings (probed sphere"
    " centres, error vectors, lengths, a standard test) or choose bundled ones, then press Fit."
)
READY = "Press Fit: it takes a few seconds and changes nothing yet."


class ReadingsPart:
    """Buttons that add files, and the list of those that are there.

    Parameters
    ----------
    context : PanelContext
    changed : callable
        Called on the session when other files are there.
    """

    def __init__(self, context: PanelContext, changed: Callable[[], None]) -> None:
        gui = context.gui
        self._context, self._changed = context, changed
        self._files: tuple[Measured, ...] = ()
        self._problem = ""
        self._fitted = False
        self._clicks = Clicks(gui, lambda word: context.act(partial(self._do, word)))
        add_upload(
            context,
            "Add readings …",
            self._add_upload,
            self._refuse,
            _spell,
            endings=".csv",
            hint=f"A CSV file with a header, UTF-8, at most 2 MB; up to {MOST_FILES} files.",
            most_bytes=MOST_BYTES,
            what=WHAT,
        )
        self._bundled: Input[str] = Input(
            gui.add_dropdown(
                "Bundled readings",
                (NOT_CHOSEN, *bundled_data()),
                hint="Readings of a real machine that come with warpspace; fork_head_bc is its"
                " scene.",
            ),
            lambda: context.act(self._add_bundled),
        )
        self._kind: Input[str] = Input(
            gui.add_dropdown(
                "Kind of what is added",
                (BY_COLUMNS, *KINDS, *test_kinds()),
                hint="; ".join(f"{kind.name}: {kind.words}" for kind in KINDS.values())
                + "; else a standard test, with its options below.",
            ),
            lambda: context.act(self._show_options),
        )
        self._options: Any = gui.add_text(
            "Options of the test",
            "",
            visible=False,
            hint="Those of its command with colons between, for instance plane=XZ:radius=150.",
        )
        self._text = Handle(gui.add_html(""))
        self._write()

    @property
    def files(self) -> tuple[Measured, ...]:
        """What is to be fitted."""
        return self._files

    def say(self, problem: str) -> None:
        """Say what went wrong; empty for nothing."""
        self._problem = problem
        self._write()

    def note_fit(self) -> None:
        """Take note that a fit has ended well."""
        self._fitted, self._problem = True, ""
        self._write()

    def _show_options(self) -> None:
        """Show the box for options where a test is chosen."""
        visible = str(self._kind.handle.value) in test_kinds()
        if self._options.visible != visible:
            self._options.visible = visible
            self._context.client.flush()

    def _chosen_kind(self) -> str | None:
        """Give the kind of what is added, with options where it is a test."""
        kind = str(self._kind.handle.value)
        if kind in KINDS:
            return kind
        if kind not in test_kinds():
            return None
        options = str(self._options.value).strip()[:LONGEST_OPTIONS]
        return f"{kind}:{options}" if options else kind

    def _add_upload(self, name: str, content: bytes) -> None:
        """Take in a file that a browser has sent."""
        spelled = _spell(name)
        self._add(spelled, lambda: upload_text(content, spelled, MOST_BYTES, WHAT))

    def _add_bundled(self) -> None:
        """Take in the bundled file that was chosen."""
        name = self._bundled.poll()
        self._bundled.show(NOT_CHOSEN)
        if name is not None and name != NOT_CHOSEN:
            self._add(name, lambda: bundled(name))

    def _add(self, name: str, read: Callable[[], str]) -> None:
        """Take in a file; what was there stays where it cannot be read."""
        scene = scene_of(self._context.store.state)
        try:
            measured = take(scene, read(), name, self._chosen_kind(), self._files)
        except WarpspaceError as error:
            self._refuse(error_words(error))
            return
        self._files = (*self._files, measured)
        self._problem = ""
        self._update()

    def _refuse(self, text: str) -> None:
        """Say why a file was not added."""
        self.say(text)
        self._context.client.flush()

    def _do(self, word: str) -> None:
        """Remove a file; the word comes from a browser and may be anything."""
        verb, _, number = word.partition(" ")
        if verb == "remove" and number in map(str, range(len(self._files))):
            at = int(number)
            self._files = (*self._files[:at], *self._files[at + 1 :])
            self._problem = ""
            self._update()

    def _update(self) -> None:
        """Show other files."""
        self._write()
        self._changed()
        self._context.client.flush()

    def _write(self) -> None:
        """Write the list; what is the same already is not sent."""
        note = ("" if self._fitted else READY) if self._files else EMPTY
        self._text.put(content=files_html(self._files, note, self._problem, self._clicks.button))


def _spell(name: str) -> str:
    """Make a name of what a browser calls a file."""
    return f"{safe_name(name, 'readings')}.csv"
