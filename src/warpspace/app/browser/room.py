"""How large the drawing is, and how much of it lies under what is written at its edges.

The page says so (`room.js`) as soon as it is laid out and whenever that changes.
"""

from dataclasses import dataclass

TOP_PX = 46  # height of the bar at the top; the style sheet has it too
PHONE_PX, COLUMNS_PX = 700, 558  # width of a phone at most, and of both columns elsewhere
PHONE_SHARE = 0.52  # of a phone's height, that the drawing has
MOST_PX = 16_384
LEAST_PX = 120
LONGEST_WORD = 100
HEADING_PX, FOOT_PX, LEGEND_PX = 66, 80, 134
"""What heading, controls and colour bar take, until the page has said so."""
WORDS_PX, PHONE_WORDS_PX = 46, 22
"""Kept free at the sides, for the words at axes and corners."""
MOST_SHARE, LEAST_SHARE = 0.4, 0.3
"""Parts that what is written keeps free at most, and that the drawing has at least."""


@dataclass(frozen=True, slots=True)
class Room:
    """How large the drawing is, CSS pixels."""

    width: float
    height: float
    top: float = HEADING_PX
    bottom: float = FOOT_PX
    right: float = LEGEND_PX

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.width / self.height

    @property
    def margins(self) -> tuple[float, float, float, float]:
        """Parts of width and height that are kept free: left, right, top, bottom."""
        words = WORDS_PX if self.width > PHONE_PX else PHONE_WORDS_PX
        right = min((self.right + words / 2.0) / self.width, MOST_SHARE)
        top = min((self.top + words / 2.0) / self.height, MOST_SHARE)
        bottom = min((self.bottom + words / 2.0) / self.height, 1.0 - LEAST_SHARE - top)
        return min(words / self.width, MOST_SHARE), right, top, bottom


def first_room(page_width: float, page_height: float) -> Room:
    """Guess it, until the page has said it."""
    phone = page_width <= PHONE_PX
    width = page_width - (0 if phone else COLUMNS_PX)
    height = page_height * (PHONE_SHARE if phone else 1.0) - TOP_PX
    return Room(max(width, LEAST_PX), max(height, LEAST_PX))


def read_room(text: str) -> Room | None:
    """Read what a page says of its room; None where it says nothing that can be."""
    words = text[:LONGEST_WORD].split(",")
    if len(words) != 6 or not all(word.isascii() and word.isdigit() for word in words):
        return None
    width, height, top, bottom, right = (float(word[:6]) for word in words[1:])
    if not (LEAST_PX <= width <= MOST_PX and LEAST_PX <= height <= MOST_PX):
        return None
    return Room(width, height, top, bottom, right)
