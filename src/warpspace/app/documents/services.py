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
    # frames what a page has drawn, [height, width, 4], as a camera saw it
    draw_view: Callable[[LivePicture, NDArray[np.uint8], CameraMemory, threading.Event], bytes] = (
        _nobody
    )
    # takes a picture and an ending (".glb", ".csv"); gives the file's content
    write_export: Callable[[LivePicture, str], bytes] = _nobody
    # draws machines side by side: how they are sampled, and whether in dark colours
    draw_concepts: Callable[[Sequence[Scene], "Concepts", bool, threading.Event], bytes] | None = (
        None
    )
    # draws the maps of a compensation: whether in dark colours, and whether for a column of the
    # page, without title and numbers
    draw_compensation: Callable[["Compensation", bool, bool, threading.Event], bytes] | None = None
    # takes a picture, author, open questions, results by heading, and the ending (".html", ".pdf");
    # gives a report, and what is missing of it
    write_report: Callable[
        [LivePicture, str, Sequence[str], Mapping[str, "Result"], str, threading.Event],
        tuple[bytes, tuple[str, ...]],
    ] = _nobody
    # names of the figures of one scene, and what each shows
    figures: tuple[tuple[str, str], ...] = ()
    exports: tuple[tuple[str, str], ...] = ()  # endings of the formats, and what each is for
    token: str | None = None  # what the app asks for; it goes into a link where that is asked for
