"""HTML whose parts can be clicked: one invisible text widget carries the words of the parts."""

from collections.abc import Callable

from markupsafe import Markup, escape
from viser import GuiApi

from warpspace.app.browser.viser_private import dom_id

LONGEST_WORD = 100
MOST_CLICKS = 8
"""Clicks that one message carries: the latest and those before it, should some have got lost."""
SCRIPT = f"""(() => {{
  const sent = {{}};
  window.warpspaceClick = (part, uuid, typed = "") => {{
    const word = part.dataset.word, clicks = (sent[uuid] ??= {{count: 0, latest: []}});
    clicks.latest = [...clicks.latest, `${{++clicks.count}}:${{word}}${{typed}}`]
      .slice(-{MOST_CLICKS});
    __viserMutable.sendMessage({{
      type: "GuiUpdateMessage", uuid, updates: {{value: clicks.latest.join("\\n")}},
    }});
    // the answer replaces the part: what had the focus keeps it, unless Esc has left it
    const watch = new MutationObserver(() => {{
      if (part.isConnected) return;
      watch.disconnect();
      if (document.activeElement === document.body && !part.dataset.left)
        document.querySelector(`[data-word="${{CSS.escape(word)}}"]`)?.focus({{
          preventScroll: true }});
    }});
    watch.observe(document.body, {{childList: true, subtree: true}});
    setTimeout(() => watch.disconnect(), 10000);
  }};
}})();"""
"""Has to run in the page before anything is clicked."""
KEYS = (
    'role="%s" tabindex="0" onkeydown="'
    "if(event.key==='Enter'||event.key===' '){event.preventDefault();this.click()}\" "
)
SENDS = 'data-word="%s" onclick="warpspaceClick(this,\'%s\')"'
"""Attributes of what is reached with Tab and Enter, and of what sends a word when clicked."""
TYPED = (
    'type="text" autocomplete="off" spellcheck="false" data-word="%s"'
    " onkeydown=\"if(event.key==='Escape')this.value=this.defaultValue\""
    ' onchange="const typed=this.value;this.value=this.defaultValue;'
    "warpspaceClick(this,'%s',' '+typed)\""
)
"""Attributes of a text box that sends its word, a blank and what was typed.

It shows the old text until the answer comes, which is none where what was typed meant nothing.
"""


class Clicks:
    """Makes pieces of HTML into buttons."""

    def __init__(self, gui: GuiApi, clicked: Callable[[str], None]) -> None:
        self._carrier = gui.add_text("", "", visible=False)
        self._clicked = clicked
        self._count = 0

        async def take(event: object) -> None:  # in order, which a plain function would not be
            if getattr(event, "client", None) is not None:
                self._take(str(self._carrier.value))

        self._carrier.on_update(take)

    def _take(self, text: str) -> None:
        """Pass on what has not been seen; a message may be read late, twice or not at all."""
        for number, word in read_clicks(text):
            if number > self._count:
                self._count = number
                self._clicked(word)

    def attributes(self, word: str, role: str = "button") -> Markup:
        """Spell the attributes of an element that is clicked, or reached with Tab and Enter."""
        return Markup(KEYS % escape(role)) + self._sends(word)  # noqa: S704 - escaped here

    def button(self, word: str) -> Markup:
        """Spell the attributes of a real button, which needs no more to be reached by key."""
        return Markup('type="button" ') + self._sends(word)

    def text_box(self, word: str) -> Markup:
        """Spell the attributes of a text box; `clicked` gets the word, a blank and what was typed.

        It sends once, on Enter or when it is left, and Escape takes back what was typed.
        """
        return Markup(TYPED % (escape(word), dom_id(self._carrier)))  # noqa: S704 - escaped here

    def _sends(self, word: str) -> Markup:
        return Markup(SENDS % (escape(word), dom_id(self._carrier)))  # noqa: S704 - escaped here


def read_clicks(text: str) -> tuple[tuple[int, str], ...]:
    """Read what a page has sent: its latest clicks, numbered."""
    found: list[tuple[int, str]] = []
    for line in text[: MOST_CLICKS * (LONGEST_WORD + 20)].split("\n")[:MOST_CLICKS]:
        number, colon, word = line.partition(":")
        if colon and number.isascii() and number.isdigit() and len(number) < 16:
            found.append((int(number), word[:LONGEST_WORD]))
    return tuple(found)
