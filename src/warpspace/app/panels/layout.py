"""Where the panels stand: errors on the left, colour bar and view on the right, heading on top.

The places are the server's, the same for every tab, and on their way as soon as a page connects;
what stands in them belongs to each tab.
"""

import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager

from viser import GuiApi, GuiTabHandle

BRAND = (38, 70, 112)
BRAND_ON_DARK = (122, 162, 214)
LEFT_WIDTH = 350
RIGHT_WIDTH = 320
ERRORS_SHARE = 0.68
"""Share of the left column's height that the sliders have, the curve of one error below them."""
STYLE = """<style>
/* labels above their controls, on a line of their own; check boxes stay beside theirs */
div:has(> div > p > label):not(:has(> div input[type="checkbox"])) { flex-wrap: wrap; }
div:has(> p > label) { width: 100% !important; padding-bottom: 2px; }
div:has(> p > label) + div { width: 100%; }
div:has(> div > p > label):has(> div input[type="checkbox"]) { flex-direction: row-reverse;
  justify-content: flex-end; }
div:has(> p > label):has(+ div input[type="checkbox"]) { width: auto !important; padding: 0; }
div:has(> p > label) + div:has(input[type="checkbox"]) { width: auto; flex-grow: 0 !important;
  padding-right: 8px; }
/* messages stand below the heading, not on it */
.mantine-Notifications-root[data-position^="top"] {
  top: auto !important; bottom: 1em !important; }
p:has(> label) { color: inherit !important; letter-spacing: 0 !important; }
.mantine-Slider-root:has(.mantine-Slider-markLabel) { margin-bottom: 4px; }
/* errors have signs: a track filled from its left end would make zero look like something */
[data-dock-region="left"] .mantine-Slider-bar { background: none; }
[data-dock-region="left"] .mantine-Slider-mark[data-filled] {
  border-color: var(--track-bg, var(--mantine-color-gray-3));
  background: var(--mantine-color-body); }
/* what is not the main thing to do is outlined */
.mantine-Button-root[style*="color-gray-filled"] { background: none;
  color: var(--mantine-color-text); border: 1px solid var(--mantine-color-default-border); }
/* all tabs of a panel on one line */
[data-dock-tab] { padding: 0 .52em !important; }
.mantine-ScrollArea-scrollbar[data-orientation="horizontal"] { display: none; }
</style>"""


def side_widths() -> tuple[int, int]:
    """Give the widths of the docked panels, CSS pixels."""
    return LEFT_WIDTH, RIGHT_WIDTH


def apply_theme(gui: GuiApi, *, dark: bool) -> None:
    """Set the colours of the page."""
    gui.configure_theme(
        dark_mode=dark,
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND_ON_DARK if dark else BRAND,
    )


def split_script(share: float = ERRORS_SHARE) -> str:
    """Write the script that divides the left column between sliders and curve.

    The server can only halve a column. The script moves the divider as a hand would, so that it
    stays a divider which can be moved; one that has been moved already is left alone.

    Parameters
    ----------
    share : float, optional
        Of the height that is to go to the upper panel.

    Returns
    -------
    str
        JavaScript that waits for a column in halves and gives up after ten seconds.
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


class Places:
    """Where a tab puts its panels.

    Parameters
    ----------
    tabs : mapping of str to viser.GuiTabHandle
        By the word on them. What has no tab stands in the main panel.
    dark : bool
        Whether a page starts dark.
    """

    def __init__(self, tabs: Mapping[str, GuiTabHandle], *, dark: bool) -> None:
        self._tabs = dict(tabs)
        self.dark = dark
        self._lock = threading.Lock()

    @contextmanager
    def at(self, name: str) -> Generator[None]:
        """Build within a tab; pages that open at once take turns, as viser's handles want it."""
        with self._lock, self._tabs[name]:
            yield


def lay_out(gui: GuiApi, *, dark: bool) -> Places:
    """Divide the page, for all tabs of a server.

    Parameters
    ----------
    gui : viser.GuiApi
        Of the server.
    dark : bool
        Whether pages start dark.

    Returns
    -------
    Places
    """
    apply_theme(gui, dark=dark)
    gui.set_panel_label("Errors")
    gui.main_panel.dock_left()
    gui.main_panel.set_width(LEFT_WIDTH)
    gui.add_html(STYLE)

    results = gui.add_panel()
    tabs = {
        "Result": results.add_tab("Result"),
        "Why": results.add_tab("Why"),
        "Gains": results.add_tab("Gains"),
        "Compare": results.add_tab("Compare"),
        "Files": results.add_tab("Files"),
    }
    results.dock_right()
    results.set_width(RIGHT_WIDTH)

    settings = gui.add_panel()
    tabs |= {
        "View": settings.add_tab("View"),
        "Machine": settings.add_tab("Machine"),
        "Table": settings.add_tab("Table"),
        "Chance": settings.add_tab("Chance"),
        "Conventions": settings.add_tab("Conventions"),
    }
    settings.dock_below(results)

    top = gui.add_panel()
    tabs["heading"] = top.add_tab("warpspace")
    top.float(x=12, y=12, width=520)
    return Places(tabs, dark=dark)
