"""What the app has others do: drawing figures and writing exports. The command line hands it in."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warpspace.exceptions import WarpspaceError
from warpspace.geometry.colour import ColourScale
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.formats.compensation.compensate import Compensation
    from warpspace.scene.concepts import ConceptPlan


class CancelledError(WarpspaceError):
    """Work that somebody has cancelled."""


@dataclass(frozen=True, slots=True)
class Beside:
    """The other side of a comparison.

    Attributes
    ----------
    scene : Scene
    loop : str
    conditions : tuple of str
        Errors that are excluded there, in words.
    """

    scene: Scene
    loop: str
    conditions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be drawn or written.

    Attributes
    ----------
    scene : Scene
        With all changes made in the app.
    loop, component : str
    nodes : int
        Grid nodes per axis.
    exaggeration : float
        Display factor in force.
    dark : bool
        Light ink on a dark ground.
    tilts : bool
        Whether the tool-orientation error is coloured, not the position error.
    colours : ColourScale or None
        The colours that are shown, where they are not those of the request's own map: fixed by the
        user, or shared with other maps.
    beside : Beside or None
        B, where the change from the scene (A) to B is wanted: B − A.
    pair : tuple of Scene, (2,), or None
        Both sides of a comparison where they can be drawn on one sheet, with their difference.
    figure : str
        Name of the figure; empty for the one that suits what is coloured.
    conditions : tuple of str
        Errors that are excluded, in words.
    pair_conditions : tuple of str
        The same of both sides of a pair, with the letter of the side.
    range_fixed : bool
        Whether the user has fixed the range of the colours.
    """

    scene: Scene
    loop: str
    component: str
    nodes: int
    exaggeration: float
    dark: bool
    tilts: bool = False
    colours: ColourScale | None = None
    beside: Beside | None = None
    pair: tuple[Scene, Scene] | None = None
    figure: str = ""
    conditions: tuple[str, ...] = ()
    pair_conditions: tuple[str, ...] = ()
    range_fixed: bool = False


@dataclass(frozen=True, slots=True)
class ConceptRequest:
    """Machines that are to be drawn side by side.

    Attributes
    ----------
    scenes : tuple of Scene
    plan : ConceptPlan
        How they are sampled.
    loop : str
    dark : bool
        Light ink on a dark ground.
    strip_px : tuple of int, (2,), or None
        Width and height of each picture where they are wanted alone, one below the other; None for
        a sheet with words and numbers.
    """

    scenes: tuple[Scene, ...]
    plan: "ConceptPlan"
    loop: str
    dark: bool
    strip_px: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class CompensationRequest:
    """Maps of a compensation that are to be drawn: before, after, and what is left.

    Attributes
    ----------
    found : Compensation
    dark : bool
        Light ink on a dark ground.
    narrow : bool
        Whether they are for a column of the page, without title and numbers; else a sheet.
    """

    found: "Compensation"
    dark: bool
    narrow: bool = False


@dataclass(frozen=True, slots=True)
class Services:
    """Work the app cannot do itself; None where nobody does it.

    Attributes
    ----------
    draw_figure : callable or None
        Takes a request and an event that cancels; gives a PNG. Raises `CancelledError` when
        cancelled, another `WarpspaceError` where it cannot be drawn.
    write_export : callable or None
        Takes a request and an ending (".glb", ".csv"); gives the file's content.
    draw_concepts : callable or None
        As `draw_figure`, of machines side by side.
    draw_compensation : callable or None
        As `draw_figure`, of the maps of a compensation.
    figures : tuple of (str, str)
        Names of the figures of one scene, and what each shows.
    exports : tuple of (str, str)
        Endings of the formats, and what each is for.
    """

    draw_figure: Callable[[Request, threading.Event], bytes] | None = None
    write_export: Callable[[Request, str], bytes] | None = None
    draw_concepts: Callable[[ConceptRequest, threading.Event], bytes] | None = None
    draw_compensation: Callable[[CompensationRequest, threading.Event], bytes] | None = None
    figures: tuple[tuple[str, str], ...] = ()
    exports: tuple[tuple[str, str], ...] = ()
