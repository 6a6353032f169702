"""Where the panels stand: errors on the left, colour bar and view on the right.

The places are the server's, the same for every tab, and on their way as soon as a page connects;
what stands in them belongs to each tab.
"""

import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager

from viser import GuiApi, GuiTabHandle

from warpspace.app.browser.room import NARROW_PX, column_widths
from warpspace.app.server.tabs import tabs

BRAND = (38, 70, 112)
BRAND_ON_DARK = (122, 162, 214)


def apply_theme(gui: GuiApi, *, dark: bool) -> None:
    """Set the colours of the page."""
    gui.configure_theme(
        dark_mode=dark,
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND_ON_DARK if dark else BRAND,
    )


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

    def __contains__(self, name: str) -> bool:
        """Tell whether there is a tab of a name."""
        return name in self._tabs

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
    left, right = column_widths(NARROW_PX)  # a page that is narrower or wider changes them
    gui.main_panel.set_width(left)

    results, settings = gui.add_panel(), gui.add_panel()
    groups = {"results": results, "settings": settings}
    handles = {tab.name: groups[tab.place].add_tab(tab.name) for tab in tabs()}
    results.dock_right()
    results.set_width(right)
    settings.dock_below(results)
    return Places(handles, dark=dark)
