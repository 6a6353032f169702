"""What the app has others do: drawing figures and writing exports. The command line hands it in."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.analysis.concepts import Concepts
    from warpspace.analysis.description import Result
    from warpspace.formats.compensation.compensate import Compensation


class CancelledError(WarpspaceError):
    """Work that somebody has cancelled."""


@dataclass(frozen=True, slots=True)
class Shot:
    """What a page has drawn: pixels, the camera that saw them, and its scale."""

    pixels: NDArray[np.uint8]  # [height, width, 4]
    camera: CameraMemory
    px_per_mm: float | None  # across the line of sight in the middle; None for no scale bars


@dataclass(frozen=True, slots=True)
class Report:
    """What stands in a report beside what is drawn."""

    author: str
    questions: tuple[str, ...]
    results: "Mapping[str, Result]"  # of analyses, by heading
    ending: str  # ".html" or ".pdf"


def _nobody(*_: object) -> Any:
    raise OptionError("this app was started without what draws figures and writes files")


@dataclass(frozen=True, slots=True)
class Services:
    """Work the app cannot do itself.

    What takes an event gives up once that is set, with `CancelledError`; it raises another
    `WarpspaceError` where it cannot be done. All but reports and exports give a PNG.
    """

    # takes a picture and the name of a figure, empty for the one that suits what is coloured
    draw_figure: Callable[[LivePicture, str, threading.Event], bytes] = _nobody
    draw_shot: Callable[[LivePicture, Shot, threading.Event], bytes] = _nobody
    # takes a picture and an ending (".glb", ".csv"); gives the file's content
    write_export: Callable[[LivePicture, str], bytes] = _nobody
    # draws machines side by side: how they are sampled, and whether in dark colours
    draw_concepts: Callable[[Sequence[Scene], "Concepts", bool, threading.Event], bytes] | None = (
        None
    )
    # draws the maps of a compensation: whether in dark colours, and whether for a column of the
    # page, without title and numbers
    draw_compensation: Callable[["Compensation", bool, bool, threading.Event], bytes] | None = None
    # gives a report, and what is missing of it
    write_report: Callable[
        [LivePicture, Report, threading.Event], tuple[bytes, tuple[str, ...]]
    ] = _nobody
    # names of the figures of one scene, and what each shows
    figures: tuple[tuple[str, str], ...] = ()
    exports: tuple[tuple[str, str], ...] = ()  # endings of the formats, and what each is for
    token: str | None = None  # what the app asks for; it goes into a link where that is asked for
