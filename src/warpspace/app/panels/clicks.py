"""HTML whose parts can be clicked: one invisible text widget carries the word of the part."""

import html
from collections.abc import Callable

from viser import GuiApi

from warpspace.app.widgets import dom_id

LONGEST_WORD = 100


class Clicks:
    """Makes pieces of HTML into buttons.

    Parameters
    ----------
    gui : viser.GuiApi
    clicked : callable
        Gets the word of what was clicked. The word comes from a browser and may be anything, so it
        is to be looked up, never trusted; the callable must only take note.
    """

    def __init__(self, gui: GuiApi, clicked: Callable[[str], None]) -> None:
        self._carrier = gui.add_text("", "", visible=False)

        @self._carrier.on_update
        def _(event: object) -> None:
            if getattr(event, "client", None) is not None:
                # a number in front makes the same word twice two changes
                clicked(str(self._carrier.value).partition(":")[2][:LONGEST_WORD])

    def attributes(self, word: str, role: str = "button") -> str:
        """Spell the attributes of an element that is clicked, or reached with Tab and Enter.

        Parameters
        ----------
        word : str
            What `clicked` gets.
        role : str, optional
            ARIA role.
        """
        send = (
            "__viserMutable.sendMessage({type:'GuiUpdateMessage',"
            f"uuid:'{dom_id(self._carrier)}',"
            "updates:{value:performance.now()+':'+this.dataset.word}})"
        )
        keys = "if(event.key==='Enter'||event.key===' '){event.preventDefault();this.click()}"
        return (
            f'role="{role}" tabindex="0" data-word="{html.escape(word, quote=True)}" '
            f'onclick="{send}" onkeydown="{keys}"'
        )
