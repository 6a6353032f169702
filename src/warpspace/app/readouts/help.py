"""The help: what the picture means, what the mouse does, and all keys, as HTML."""

from collections.abc import Sequence

from warpspace.app.readouts.html import render

MEANINGS = (
    (
        "Colours",
        "what is chosen as quantity and component, in the unit of the colour bar",
    ),
    (
        "Component",
        "the length of the error, or its signed part along x, y or z",
    ),
    (
        "Quantity",
        "the position error [µm], or the tilt of the tool axis [µrad]",
    ),
    (
        "Deformed box",
        "the working volume with its errors, each point displaced by its error × exaggeration",
    ),
    ("Dashed box", "the nominal working volume, as it was without any error"),
    (
        "Exaggeration",
        "how much larger than true the errors are drawn; ×1 is true scale; numbers stay true",
    ),
    ("Error", "actual − nominal, so that a correction has the other sign"),
    ("Mean, RMS, P95, max", "of the length of the error over the whole working volume"),
)
"""What is drawn and what it means."""
FIXED_KEYS = (
    ("Ctrl + K", "Command palette", "All of this, and every tab, by name"),
    ("/", "Find an error", "Cursor into the search box; Enter: to its number box"),
    ("Esc", "Leave a text box", "Closes this window, too"),
    ("Tab, Shift + Tab", "Next, previous control", "Enter or Space presses it, opens a folder"),
    ("← →", "Slider or tab with the focus", "One step; the next tab"),
    ("A S D Q E", "Camera", "Fly through the scene"),
    ("W", "Worst point", "What its error consists of"),
    ("N", "Forget the point", "End the question"),
)
"""Keys that are no commands of the palette: key, what it does, remark."""


def spell_help(keys: Sequence[tuple[str, str, str]], title: str, description: str) -> str:
    """Write the help."""
    return render(
        "help",
        title=title,
        description=description.strip(),
        meanings=MEANINGS,
        keys=(*FIXED_KEYS, *keys),
    )


def about_scene(description: str) -> str:
    """Write what a scene says of itself, to be unfolded."""
    return render("about", description=description.strip()) if description.strip() else ""
