"""Names for screen readers, keys that act wherever the focus is, and what of viser is hidden."""

from functools import cache
from importlib.resources import files

from warpspace.app.browser.arrangement import front_script

PACKAGE = "warpspace.app.browser"


@cache
def access_style() -> str:
    """Give the style sheet of focus and tour, which also hides viser's developer panels."""
    return (files(PACKAGE) / "accessible.css").read_text("utf-8")


@cache
def access_script() -> str:
    """Give the script that names what viser leaves without a name, and passes keys on.

    Returns
    -------
    str
        JavaScript. It may be run again in the same page, which then changes nothing.
    """
    return (files(PACKAGE) / "accessible.js").read_text("utf-8")


def find_script() -> str:
    """Write the script that puts the cursor into the search box of the errors."""
    return "window.__warpspaceAccess?.find();"


def tab_script(name: str) -> str:
    """Write the script that brings a tab to the front and gives it the focus.

    Parameters
    ----------
    name : str
        The word on the tab.
    """
    return front_script(name, focus=True)
