"""What a part of the page is: pieces of HTML that follow the picture, and what its events do.

The server writes pieces into named places; the page sends back events, ``part:word`` with a value
(`browser/incoming.py`). A part knows neither widgets nor threads, and no other part.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal

from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, fold, join, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context

Follows = Literal["at once", "often", "in a pause", "at rest"]
"""With every picture of a drag; a few times a second, and where the first of what they depend on
has changed; when the hand pauses; when it has left."""


class Part:
    """A part of the page."""

    name: str = ""  # its events begin with it
    follows: ClassVar[Follows] = "in a pause"

    def __init__(self, context: Context) -> None:
        self.context = context

    def is_seen(self, state: AppState) -> bool:
        """Tell whether it is on the screen; what is not is neither computed nor sent."""
        return True

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what its pieces are made of; as long as that is equal they are not made anew."""
        return (id(picture),)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Give HTML by the name of its place."""
        return {}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Do what an event says; word and value come from a browser and may be anything."""
        return state

    def renew(self) -> None:
        """Have its pieces made anew, whatever they depend on. For the session."""
        self.context.renew(self)


class Section(Part):
    """A section of a task; folded it is neither computed nor sent."""

    task = ""
    title = ""
    sentence = ""  # what it is for: below the title where it is unfolded, else its hint

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what its body is made of."""
        return (id(picture),)

    def body(self, picture: LivePicture) -> Markup:
        """Write what stands below the title."""
        raise NotImplementedError

    def heading(self, picture: LivePicture) -> str:
        """Give the title of the unfolded section."""
        return self.title

    def is_open(self, state: AppState) -> bool:
        return self.name in state.page.open

    def is_seen(self, state: AppState) -> bool:
        return state.page.task == self.task

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (True, *self.concerns(picture)) if self.is_open(picture.state) else (False,)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        opened = self.is_open(picture.state)
        body = self.body(picture) if opened else EMPTY
        title = self.heading(picture) if opened else self.title
        section = fold(self.name, title, body, opens="page:fold", open_=opened, hint=self.sentence)
        return {f"section.{self.name}": section}


class Window(Part):
    """A window over the page, in its one dialog: open while `state.page.window` is its name."""

    title = ""

    def is_seen(self, state: AppState) -> bool:
        return state.page.window == self.name

    def closed(self, state: AppState) -> AppState:
        """Close it."""
        return replace(state, page=replace(state.page, window=""))

    def body(self, picture: LivePicture) -> Markup:
        """Give what stands in it."""
        raise NotImplementedError

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        cross = button("✕", "page:close", kind="quiet", hint="Close (Esc)", aria_label="Close")
        head = tag("header", tag("h2", self.title, id="ws-window-title") + cross)
        body = tag("div", self.body(picture), class_="ws-body", data_key=f"window-{self.name}")
        return {"window": head + body}


def actions(*buttons: Markup) -> Markup:
    """Put buttons into a row."""
    return tag("div", join(buttons), class_="ws-actions")
