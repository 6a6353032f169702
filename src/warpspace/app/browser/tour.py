"""The tour of five steps: shown at the first visit, and again from the help and the palette."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files

STORAGE_KEY = "warpspace-visited"  # what a browser remembers once the tour was shown


@dataclass(frozen=True, slots=True)
class Stop:
    """One step of the tour."""

    title: str  # plain text
    text: str
    at: str = ""  # CSS selector of what it tells of; empty where the step stands by itself
    tab: str = ""  # the word on the tab it tells of, in place of a selector
    more: str = ""  # further text in small print


def tour_stops(scene: str, description: str, exaggeration: str) -> tuple[Stop, ...]:
    """List the steps for what is shown."""
    about = " ".join(description.split())
    return (
        Stop(
            "What this is",
            "The working volume of a machine tool, deformed by its small geometric errors. They are"
            f" drawn with the exaggeration {exaggeration}, so that micrometres can be seen; colours"
            " say how large the error is; the dashed box is the nominal volume.",
            at=".ws-heading",
            more=f"This scene: {scene}. {about}".rstrip(),
        ),
        Stop(
            "Drag",
            "Each slider is one error of one axis, in µm or µrad. Drag it or type a number: volume,"
            " colours and numbers follow at once. Ctrl+Z takes it back.",
            at="[data-dock-region=left]",
        ),
        Stop(
            "Click",
            "Click a point of the volume. The tab Error budget then shows how far this point is off"
            " and what each error adds to it.",
            at="canvas:not(.uplot-container canvas)",
        ),
        Stop(
            "Repair",
            "The tab Repair finds the adjustments that make the error of the whole volume least."
            " One click applies them, one takes them back.",
            tab="Repair",
        ),
        Stop(
            "Compare",
            "The tab Compare shows two states on one colour scale, such as before and after a"
            " repair, and what has changed. H lists all keys and brings back this tour; Ctrl+K"
            " finds every command by its name.",
            tab="Compare",
        ),
    )


@cache
def _source() -> str:
    return (files("warpspace.app.browser") / "tour.js").read_text("utf-8").rstrip()


def tour_script(stops: Sequence[Stop], *, asked: bool) -> str:
    """Write the script of the tour."""
    told = {"stops": [asdict(stop) for stop in stops], "asked": asked, "key": STORAGE_KEY}
    return f"{_source()}({json.dumps(told)});"
