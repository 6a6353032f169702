"""What a user does on the page, as numbered events: ``part:word`` and a value.

One invisible text widget of viser carries them. A message holds the latest ones, should an earlier
message have got lost or been put together with a later one; each is passed on once, in order.
A file comes alone, as the value of ``part:file``: its size, its name, and what is in it in base64.
"""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
from viser import GuiApi

from warpspace.app.browser.viser_private import dom_id

LONGEST_NAME = 160
LONGEST_VALUE = 20_000
LONGEST_INDEX = 8  # digits
MOST_EVENTS = 16
FILE = ":file"  # what the name of an event ends with that brings a file
_READER = msgspec.json.Decoder(list[tuple[int, str, str]])


@dataclass(frozen=True, slots=True)
class Event:
    """Something a user did; all of it comes from a browser and may be anything."""

    part: str  # name of the part of the page
    word: str  # what is to be done, or the path of what is set behind ``set.``
    value: str


def index_of(value: str, count: int) -> int | None:
    """Read which of so many things an event means; None where it is none of them."""
    known = value.isdecimal() and len(value) < LONGEST_INDEX and int(value) < count
    return int(value) if known else None


class Events:
    """Listens to one page."""

    def __init__(self, gui: GuiApi, take: Callable[[Event], None]) -> None:
        self._carrier = gui.add_text("", "[]", visible=False)
        self._last = 0

        async def listen(event: object) -> None:  # in order, which a plain function would not be
            if getattr(event, "client", None) is not None:
                text = str(self._carrier.value)
                if len(text) > MOST_EVENTS * LONGEST_VALUE:
                    self._carrier.value = "[]"  # a file is not kept until the next event
                for number, found in read_events(text):
                    if number > self._last:
                        self._last = number
                        take(found)

        self._carrier.on_update(listen)

    @property
    def carrier(self) -> str:
        """The widget's name in the page."""
        return dom_id(self._carrier)


def event_of(name: str, value: str) -> Event:
    """Give the event of a name, ``part:word``."""
    part, _, word = name.partition(":")
    return Event(part, word, value)


def read_events(text: str) -> tuple[tuple[int, Event], ...]:
    """Read a message of a page; what cannot be read is left out."""
    try:
        found = _READER.decode(text)
    except ValueError:
        return ()
    return tuple(
        (number, event_of(name, value))
        for number, name, value in found[:MOST_EVENTS]
        if number > 0
        and ":" in name
        and len(name) <= LONGEST_NAME
        and (len(value) <= LONGEST_VALUE or name.endswith(FILE))
    )
