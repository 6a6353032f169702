"""What the app has others do: drawing figures and writing exports. The command line hands it in."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.model import Scene

Draw = Callable[..., bytes]


class CancelledError(WarpspaceError):
    """Work that somebody has cancelled."""


def _nobody(*_: object) -> Any:
    raise OptionError("this app was started without what draws figures and writes files")


@dataclass(frozen=True, slots=True)
class Services:
    """Work the app cannot do itself; what draws gives a PNG.

    What takes an event gives up once that is set, with `CancelledError`; it raises another
    `WarpspaceError` where it cannot be done.
    """

    # (picture, name of a figure or "" for the one that suits what is coloured, event)
    draw_figure: Draw = _nobody
    # (picture, pixels that a page has drawn [height, width, 4], camera that saw them, event)
    draw_view: Draw = _nobody
    write_export: Draw = _nobody  # (picture, ending)
    # (picture, author, questions, results by heading, ending, event); also gives what is missing
    write_report: Callable[..., tuple[bytes, tuple[str, ...]]] = _nobody
    draw_concepts: Draw | None = None  # (machines, how they are sampled, whether dark, event)
    # (what a table leaves, whether dark, whether for a column of the page, event)
    draw_compensation: Draw | None = None
    figures: tuple[tuple[str, str], ...] = ()  # names of the figures of one scene, what each shows
    exports: tuple[tuple[str, str], ...] = ()  # endings of the formats, and what each is for
    # whether the file of a scene is as it was when it was opened
    is_current: Callable[[Scene], bool] = lambda _: True
    token: str | None = None  # what the app asks for; it goes into a link where that is asked for
