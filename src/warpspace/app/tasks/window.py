"""A window over the page: one part each, which fills the page's one dialog while it is open."""

from collections.abc import Mapping
from dataclasses import replace

from markupsafe import Markup

from warpspace.app.browser.html import button, join, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.parts import Part


class Window(Part):
    """A window, open while `state.page.window` is its name."""

    title = ""

    def is_seen(self, state: AppState) -> bool:
        return state.page.window == self.name

    def closed(self, state: AppState) -> AppState:
        """Close it."""
        return replace(state, page=replace(state.page, window=""))

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (object(),)  # written anew each time; what stands there already is not sent

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
