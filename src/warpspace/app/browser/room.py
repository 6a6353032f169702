"""The room between the panels: what is written over the 3-D view, and how large the view is.

Heading, scale bars and the values on isolines lie on the screen and not in the drawing. The page
places them by itself as the camera moves (`room.js`) and says how much room the drawing has.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

PHONE_PX = 576  # width up to which viser puts all panels into one sheet at the bottom of the page
NARROW_PX, WIDE_PX = 1200, 2400
MOST_PX = 16_384
LEAST_PX = 120
LONGEST_WORD = 100
HEADING_PX, FOOT_PX = 84, 52
"""Heights of heading and scale bars, taken until the page has said how high they are."""
SIDE_PX = 16  # kept free at either side, for words at the ends of axes
MOST_SHARE, LEAST_SHARE = 0.4, 0.2
"""Parts of the height: what the heading keeps free at most, what the drawing has at least."""


def column_widths(page_width: float) -> tuple[int, int]:
    """Choose the widths of the docked columns, left and right, for a page, CSS pixels."""
    if page_width <= PHONE_PX:
        return 0, 0
    if page_width < NARROW_PX:
        return 300, 292
    return (350, 340) if page_width < WIDE_PX else (480, 450)


@dataclass(frozen=True, slots=True)
class Room:
    """How large the drawing is, CSS pixels."""

    width: float  # of the picture
    height: float
    # of it, what heading and scale bars (on a phone the sheet of panels) cover
    top: float = HEADING_PX
    bottom: float = FOOT_PX

    @property
    def aspect(self) -> float:
        """Width over height, without what is kept free at the sides."""
        return (self.width - 2.0 * SIDE_PX) / self.height

    @property
    def top_share(self) -> float:
        """Part of the height that is kept free at the top."""
        return min(self.top / self.height, MOST_SHARE)

    @property
    def bottom_share(self) -> float:
        """Part of the height that is kept free at the bottom."""
        return min(self.bottom / self.height, 1.0 - LEAST_SHARE - self.top_share)


def read_room(text: str) -> Room | None:
    """Read what a page says of its room; None where it says nothing that can be."""
    words = text[:LONGEST_WORD].split(",")
    if len(words) != 5 or not all(word.isascii() and word.isdigit() for word in words):
        return None
    width, height, top, bottom = (float(word[:6]) for word in words[1:])
    if not (LEAST_PX <= width <= MOST_PX and LEAST_PX <= height <= MOST_PX):
        return None
    return Room(width, height, top, bottom)


@cache
def _source() -> str:
    return files("warpspace.app.browser").joinpath("room.js").read_text("utf-8")


def open_script(widget: str) -> str:
    """Write the script that lays the room over the drawing."""
    return f"{_source()}\nwarpspaceRoom.open({json.dumps(widget)});"


def show_script(changes: Mapping[str, Any]) -> str:
    """Write the script that shows what has changed."""
    return f"warpspaceRoom.show({json.dumps(changes)});"


def width_script() -> str:
    """Write the script that makes the docked columns as wide as suits the page.

    The server's width is the same for all pages. The script moves the borders of the columns as a
    hand would, so that they stay borders which can be moved; it gives up after ten seconds.
    """
    table = json.dumps([column_widths(width) for width in (NARROW_PX - 1, NARROW_PX, WIDE_PX)])
    return f"""(() => {{
  if (innerWidth <= {PHONE_PX} || window.__warpspaceWidths) return;
  const [narrow, usual, wide] = {table};
  const [left, right] = innerWidth < {NARROW_PX} ? narrow : innerWidth < {WIDE_PX} ? usual : wide;
  const drag = (edge, wanted, tries) => {{
    const region = document.querySelector(`[data-dock-region=${{edge}}]`);
    const border = document.querySelector(`[data-dock-region-resize=${{edge}}]`);
    if (!region?.offsetWidth || !border?.firstElementChild)
      return tries && setTimeout(drag, 50, edge, wanted, tries - 1);
    const by = (wanted - region.offsetWidth) * (edge === "left" ? 1 : -1);
    if (!by) return;
    const from = border.getBoundingClientRect().left + 2;
    const send = (target, type, clientX) => target.dispatchEvent(new PointerEvent(type, {{
      bubbles: true, button: 0, pointerId: 7008, isPrimary: true, clientX, clientY: 300 }}));
    send(border.firstElementChild, "pointerdown", from);
    send(window, "pointermove", from + by);
    send(window, "pointerup", from + by);
  }};
  window.__warpspaceWidths = true;
  drag("left", left, 200);
  setTimeout(drag, 60, "right", right, 200);
}})();"""
