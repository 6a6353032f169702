"""What a page is sent beside its widgets: scripts of our own, its title, messages."""

import json
from functools import cache
from importlib.resources import files

from viser import ClientHandle, ViserServer

from warpspace.app.browser.viser_private import (
    release_tabs,
    send_script,
    wake_sender_on_its_thread,
)
from warpspace.exceptions import WarpspaceError

NOTE_SECONDS = 8.0


class Page:
    """The page of one tab; usable from any thread."""

    def __init__(self, server: ViserServer, client: ClientHandle) -> None:
        self._server, self._client = server, client
        wake_sender_on_its_thread(client)

    @property
    def is_open(self) -> bool:
        """Whether the page is connected; it ends before its session is stopped."""
        return self._client.client_id in self._server.get_clients()

    def leave(self) -> None:
        """Take out of the server's tabs what has been built since the connection ended."""
        release_tabs(self._client)

    def run_script(self, source: str) -> None:
        """Run JavaScript of our own in the page; no word of a user's may be in it unescaped."""
        send_script(self._client, source)

    def set_title(self, title: str) -> None:
        """Name the browser tab."""
        spelt = json.dumps(f"{title} · warpspace").replace("<", "\\u003c")
        self.run_script(f"document.title = {spelt};")

    def notify(self, title: str, text: str, colour: str) -> None:
        """Show a message in this tab."""
        self._client.add_notification(
            title,
            text,
            auto_close_seconds=NOTE_SECONDS,
            color=colour,  # type: ignore[arg-type]
        )

    def report(self, error: Exception) -> None:
        """Tell the user of this tab what went wrong."""
        self.notify("That did not work", error_words(error), "red")


def style_script(name: str, css: str) -> str:
    """Write the script that gives a page a style sheet.

    It goes into the page's head: what `add_html` puts into a panel is gone while the panel is
    collapsed.
    """
    return f"""(() => {{
  const id = {json.dumps(f"warpspace-{name}")};
  const sheet = document.getElementById(id) ?? document.createElement("style");
  sheet.id = id;
  sheet.textContent = {json.dumps(css)};
  document.head.append(sheet);
}})();"""


def error_words(error: Exception) -> str:
    """Say what went wrong; of what nobody foresaw its kind as well."""
    return str(error) if isinstance(error, WarpspaceError) else f"{type(error).__name__}: {error}"


# --- Scripts for the page's address ---------------------------------------------------------------
# They hand over the link it was opened with, and show another.

STORAGE_KEY = "warpspace-link"
PARAMETER = "view"


def listen_script(widget: str) -> str:
    """Write the script that hands over the link a page was opened with.

    A link is taken once per tab: a reload keeps what the tab shows.
    """
    return f"""(() => {{
  const key = {json.dumps(STORAGE_KEY)};
  const link = new URLSearchParams(location.search).get({json.dumps(PARAMETER)});
  if (!link) return;
  let taken = window.__warpspaceLink;
  try {{ taken = sessionStorage.getItem(key) || taken; }} catch {{}}
  if (taken === link) return;
  window.__warpspaceLink = link;
  try {{ sessionStorage.setItem(key, link); }} catch {{}}
  __viserMutable.sendMessage({{ type: "GuiUpdateMessage", uuid: {json.dumps(widget)},
    updates: {{ value: performance.now() + ":" + link }} }});
}})();"""


TIDY_ADDRESS = """(() => {
  const parameters = new URLSearchParams(location.search);
  if (!parameters.has("token")) return;
  parameters.delete("token");
  history.replaceState(null, "", location.pathname + (String(parameters) && "?" + parameters));
})();"""
"""Takes the token out of the address; it runs over the websocket, which has let the cookie in."""


def show_script(word: str, token: str | None = None) -> str:
    """Write the script that puts a link into the address bar and, where allowed, the clipboard."""
    return f"""(() => {{
  const link = {json.dumps(word)}, parameters = new URLSearchParams(location.search);
  window.__warpspaceLink = link;
  try {{ sessionStorage.setItem({json.dumps(STORAGE_KEY)}, link); }} catch {{}}
  parameters.set({json.dumps(PARAMETER)}, link);
  history.replaceState(null, "", location.pathname + "?" + parameters);
  const copy = document.createElement("button"), address = new URL(location.href);
  if ({json.dumps(token)}) address.searchParams.set("token", {json.dumps(token)});
  copy.dataset.copy = address.href;
  warpspaceCopy(copy);
}})();"""


# --- How the page is arranged beyond what viser can -----------------------------------------------
# Style sheet, split column, tab in front.

ERRORS_SHARE = 0.68
"""Share of the left column's height that the sliders have, the curve of one error below them."""


@cache
def page_style() -> str:
    """Give the style sheet of the page."""
    return files("warpspace.app.browser").joinpath("page.css").read_text("utf-8")


def split_script(share: float = ERRORS_SHARE) -> str:
    """Write the script that divides the left column between sliders and curve.

    The server can only halve a column. The script moves the divider as a hand would, so that it
    stays a divider which can be moved; one that has been moved already is left alone.
    """
    return f"""(() => {{
  const divide = tries => {{
    const divider = document.querySelector(
      "[data-dock-region=left] [data-dock-divider=column]");
    if (divider?.previousElementSibling?.style.flexGrow !== "0.5")
      return tries && setTimeout(divide, 50, tries - 1);
    const column = divider.parentElement.getBoundingClientRect();
    const send = (target, type, clientY) => target.dispatchEvent(new PointerEvent(type, {{
      bubbles: true, button: 0, pointerId: 7007, clientX: column.left + 1, clientY }}));
    const from = divider.getBoundingClientRect().top;
    send(divider, "pointerdown", from);
    send(window, "pointermove", from + ({share} - 0.5) * column.height);
    send(window, "pointerup", from + ({share} - 0.5) * column.height);
  }};
  divide(200);
}})();"""


def front_script(name: str, *, focus: bool = False) -> str:
    """Write the script that brings a tab of a panel to the front.

    viser has no call for it, and its tabs follow the pointer only.
    """
    give = "tab?.focus();" if focus else ""
    return f"""(() => {{
  const tab = [...document.querySelectorAll('[role="tab"]')]
    .find(tab => tab.textContent.trim() === {json.dumps(name)});
  {give}
  if (!tab || tab.getAttribute("aria-selected") === "true") return;
  const {{ x, y }} = tab.getBoundingClientRect();
  for (const what of ["pointerdown", "pointerup"])
    tab.dispatchEvent(new PointerEvent(what, {{ bubbles: true, cancelable: true, button: 0,
      clientX: x + 4, clientY: y + 4, pointerId: 1, isPrimary: true }}));
}})();"""


# --------------------------------------------------------------------------------------------------
# Names for screen readers, keys that act wherever the focus is, and what of viser is hidden.

PACKAGE = "warpspace.app.browser"


@cache
def access_style() -> str:
    """Give the style sheet of focus and tour, which also hides viser's developer panels."""
    return (files(PACKAGE) / "accessible.css").read_text("utf-8")


@cache
def access_script() -> str:
    """Give the script that names what viser leaves without a name, and passes keys on."""
    return (files(PACKAGE) / "accessible.js").read_text("utf-8")


def find_script() -> str:
    """Write the script that puts the cursor into the search box of the errors."""
    return "window.__warpspaceAccess?.find();"


def tab_script(name: str) -> str:
    """Write the script that brings a tab to the front and gives it the focus."""
    return front_script(name, focus=True)


# --- Scripts of a page that opens: how far it is, and what it has drawn ---------------------------


def stage_script(word: str) -> str:
    """Write the script that marks how far a page is, for whoever drives it from outside."""
    return f"document.documentElement.dataset.warpspace = {json.dumps(word)};"


def drawn_script(widget: str, number: int) -> str:
    """Write the script that makes a page say when it has drawn all before it."""
    return f"""(() => {{
  const tell = () => window.__viserMutable?.sendMessage({{
    type: "GuiUpdateMessage", uuid: {json.dumps(widget)}, updates: {{ value: "{number:d}" }}
  }});
  if (document.hidden) setTimeout(tell, 0);
  else requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(tell, 0)));
}})();"""


# --- Buttons that copy a text, and the way from an error to its slider ----------------------------

COPY_SCRIPT = """(() => {
  window.warpspaceCopy = button => {
    const text = button.dataset.copy, word = button.textContent;
    const done = () => {
      button.textContent = "copied";
      setTimeout(() => { button.textContent = word; }, 1500);
    };
    const byHand = () => {
      const area = document.createElement("textarea");
      area.value = text;
      area.style.position = "fixed";
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
      button.focus();
      done();
    };
    if (navigator.clipboard) navigator.clipboard.writeText(text).then(done, byHand);
    else byHand();
  };
  // viser flies through the scene with W: what gets through is the key without its place
  window.addEventListener("keydown", event => {
    const { target } = event;
    if (event.code !== "KeyW" || event.ctrlKey || event.metaKey || event.altKey) return;
    if (target instanceof Element && target.closest("input, textarea, select")) return;
    event.stopImmediatePropagation();
    if (!event.repeat)
      (target ?? document.body).dispatchEvent(new KeyboardEvent("keydown", {
        key: event.key, bubbles: true, cancelable: true }));
  }, true);
})();"""
"""Has to run in the page once; copies also where a page without TLS has no clipboard of its own."""


def reveal_script(label: str) -> str:
    """Write the script that opens the folder of a slider, brings it into view and focuses it."""
    return f"""(() => {{
  const reveal = tries => {{
    const labels = [...document.querySelectorAll("[data-dock-region=left] label[for]"),
      ...document.querySelectorAll("label[for]")];
    const label = labels.find(label => label.textContent.startsWith({json.dumps(label)}));
    if (!label) return tries && setTimeout(reveal, 50, tries - 1);
    for (let part = label; part; part = part.parentElement)
      if (part.previousElementSibling && getComputedStyle(part).display === "none")
        part.previousElementSibling.click();
    setTimeout(() => {{
      const slider = document.getElementById(label.htmlFor);
      label.scrollIntoView({{ block: "center" }});
      slider?.querySelector("[role=slider]")?.focus({{ preventScroll: true }});
    }}, 300);
  }};
  reveal(40);
}})();"""
