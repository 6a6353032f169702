"""Services that the command line passes to the app: drawing figures and writing exports."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.model import Scene

Draw = Callable[..., bytes]


class CancelledError(WarpspaceError):
    """A cancelled job."""


def _nobody(*_: object) -> Any:
    raise OptionError("this app was started without figures and exports")


@dataclass(frozen=True, slots=True)
class Services:
    """Functions of other packages; drawing functions return a PNG.

    Functions with an event raise `CancelledError` once it is set, and another `WarpspaceError` on
    failure.
    """

    # (picture, name of a figure or "" for that of the coloured quantity, event)
    draw_figure: Draw = _nobody
    # (picture, motion, ".webp" or ".mp4", progress callback)
    draw_animation: Draw = _nobody
    # (picture, pixels of a page [height, width, 4], its camera, event)
    draw_view: Draw = _nobody
    write_export: Draw = _nobody  # (picture, ending)
    # (picture, author, questions, results by heading, ending, event); also returns missing parts
    write_report: Callable[..., tuple[bytes, tuple[str, ...]]] = _nobody
    draw_concepts: Draw | None = None  # (machines, sampling, dark, event)
    # (compensation, dark, for a column of the page, event)
    draw_compensation: Draw | None = None
    figures: tuple[tuple[str, str], ...] = ()  # names and descriptions of figures of a scene
    exports: tuple[tuple[str, str], ...] = ()  # endings and purposes of the formats
    # whether the file of a scene is unchanged since it was opened
    is_current: Callable[[Scene], bool] = lambda _: True
    token: str | None = None  # required by the app; part of a link on request
