"""What a page answers to a script of ours, by way of a widget that nobody sees."""

import threading
from collections.abc import Callable

from viser import GuiApi

from warpspace.app.widgets import dom_id


class Answer:
    """One word that a page sends back.

    Parameters
    ----------
    gui : viser.GuiApi
        Of one tab.
    told : callable
        Called when a word has come; it must only take note.
    """

    def __init__(self, gui: GuiApi, told: Callable[[], None]) -> None:
        self._carrier = gui.add_text("", "", visible=False)
        self._there = threading.Event()

        async def note(_: object) -> None:
            self._there.set()
            told()

        self._carrier.on_update(note)

    @property
    def widget(self) -> str:
        """Identifier for the script."""
        return dom_id(self._carrier)

    @property
    def word(self) -> str:
        """What the page has sent last; it may be anything."""
        return str(self._carrier.value)

    @property
    def is_there(self) -> bool:
        """Whether a word has come."""
        return self._there.is_set()

    def wait(self, seconds: float) -> bool:
        """Wait for a word; tell whether it has come."""
        return self._there.wait(seconds)

    def give_up(self) -> None:
        """End a wait."""
        self._there.set()

    def remove(self) -> None:
        """Take the widget away."""
        self._carrier.remove()
