"""Numbers of a comparison side by side, as HTML."""

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.readouts.html import message, render
from warpspace.app.readouts.summary import colour_stops
from warpspace.app.state.comparison import SHOWN

NOTHING = message(
    "Choose a scene for B, or pin the present errors as before and go on changing them: both are"
    " drawn with the same colours, exaggeration and camera."
)
MARK = "▸ "
"""Before the name of what is drawn."""
ROWS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}
"""Word on a row to field of `Statistics`."""


def comparison_html(picture: LivePicture) -> str:
    """Spell the numbers of a comparison.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    str
        HTML.
    """
    found = picture.compared
    if found is None:
        return NOTHING
    return render(
        "comparison",
        titles=dict(zip("AB", found.titles, strict=True)),
        rows=ROWS,
        a=found.a,
        b=found.b,
        difference=found.difference,
        refused=found.refused,
        scale=picture.scale,
        colours=colour_stops(diverging=picture.scale.diverging),
    )


def marked(shown: str) -> tuple[str, ...]:
    """Name what can be drawn, with a mark before what is: a key of `SHOWN`."""
    return tuple(f"{MARK}{name}" if word == shown else name for word, name in SHOWN.items())
