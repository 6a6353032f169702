"""What the app has others do: drawing figures and writing exports. The command line hands it in."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warpspace.exceptions import WarpspaceError
from warpspace.geometry.colour import ColourScale
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.analysis.concepts import Concepts
    from warpspace.analysis.description import Result
    from warpspace.formats.compensation.compensate import Compensation


class CancelledError(WarpspaceError):
    """Work that somebody has cancelled."""


@dataclass(frozen=True, slots=True)
class Beside:
    """The other side of a comparison."""

    scene: Scene
    loop: str
    conditions: tuple[str, ...] = ()  # errors that are excluded there, in words


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be drawn or written."""

    scene: Scene  # with all changes made in the app
    loop: str
    component: str
    nodes: int  # grid nodes per axis
    exaggeration: float  # display factor in force
    dark: bool  # light ink on a dark ground
    tilts: bool = False  # whether the tool-orientation error is coloured, not the position error
    # the colours that are shown, where they are not those of the request's own map: fixed by the
    # user, or shared with other maps
    colours: ColourScale | None = None
    beside: Beside | None = None  # B, where the change from the scene (A) to B is wanted: B − A
    # or None; both sides of a comparison where they can be drawn on one sheet, with their
    # difference
    pair: tuple[Scene, Scene] | None = None
    figure: str = ""  # name of the figure; empty for the one that suits what is coloured
    conditions: tuple[str, ...] = ()  # errors that are excluded, in words
    # the same of both sides of a pair, with the letter of the side
    pair_conditions: tuple[str, ...] = ()
    range_fixed: bool = False  # whether the user has fixed the range of the colours


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """The report that is to be written."""

    scenes: tuple[Scene, ...]  # one, or two that are compared
    loop: str
    nodes: int  # grid nodes per axis
    exaggeration: float
    limit_um: float
    author: str
    questions: tuple[str, ...]
    results: "Mapping[str, Result]"  # of analyses, by heading
    ending: str  # ".html" or ".pdf"


@dataclass(frozen=True, slots=True)
class Services:
    """Work the app cannot do itself; None where nobody does it."""

    # takes a request and an event that cancels; gives a PNG. Raises `CancelledError` when
    # cancelled, another `WarpspaceError` where it cannot be drawn.
    draw_figure: Callable[[Request, threading.Event], bytes] | None = None
    # takes a request and an ending (".glb", ".csv"); gives the file's content
    write_export: Callable[[Request, str], bytes] | None = None
    # as `draw_figure`, of machines side by side: how they are sampled, and whether in dark colours
    draw_concepts: Callable[[Sequence[Scene], "Concepts", bool, threading.Event], bytes] | None = (
        None
    )
    # as `draw_figure`, of the maps of a compensation: whether in dark colours, and whether for a
    # column of the page, without title and numbers
    draw_compensation: Callable[["Compensation", bool, bool, threading.Event], bytes] | None = None
    # gives a report, and what is missing of it
    write_report: (
        Callable[[ReportRequest, threading.Event], tuple[bytes, tuple[str, ...]]] | None
    ) = None
    # names of the figures of one scene, and what each shows
    figures: tuple[tuple[str, str], ...] = ()
    exports: tuple[tuple[str, str], ...] = ()  # endings of the formats, and what each is for
    token: str | None = None  # what the app asks for; it goes into a link where that is asked for
