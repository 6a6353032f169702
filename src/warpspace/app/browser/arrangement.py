"""How the page is arranged beyond what viser can: style sheet, split column, tab in front."""

import json
from functools import cache
from importlib.resources import files

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


def front_script(name: str, *, focus: bool = False) -> str:
    """Write the script that brings a tab of a panel to the front.

    viser has no call for it, and its tabs follow the pointer only.

    Parameters
    ----------
    name : str
        The word on the tab.
    focus : bool, optional
        Whether the tab is given the focus, too.
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
