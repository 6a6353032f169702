"""What is written over the drawing, as HTML: heading, the strip of a phone, the buttons."""

from markupsafe import Markup

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.readouts.html import render
from warpspace.app.readouts.summary import colour_stops
from warpspace.picture.coordinates import spell_point
from warpspace.picture.words import spell_short


def strip(picture: LivePicture) -> str:
    """Put colours, mean and max into a strip: what a phone shows below the drawing.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    str
        HTML.
    """
    scale, found = picture.scale, picture.statistics
    span = scale.high - scale.low
    return render(
        "strip",
        label=scale.label.partition("_"),
        unit=scale.unit,
        colours=colour_stops(diverging=scale.diverging),
        ticks=[(100.0 * (tick - scale.low) / span, spell_short(tick)) for tick in scale.ticks],
        mean=found.mean_um,
        max=found.max_um,
        worst_place=spell_point(found.max_at_axes, found.max_at_mm),
    )


def buttons(*, ghost: bool, there: bool, attributes: Markup) -> str:
    """Spell the switch of the machine's ghost.

    Parameters
    ----------
    ghost : bool
        Whether it is on.
    there : bool
        Whether there is anything to be shown.
    attributes : Markup
        Make a button of it.
    """
    return render("buttons", ghost=ghost, there=there, attributes=attributes)
