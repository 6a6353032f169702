"""What the app has the outputs do: figures in a process of their own, exports in memory."""

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from typing import TYPE_CHECKING

from warpspace.app.documents.services import (
    CancelledError,
    CompensationRequest,
    ConceptRequest,
    Request,
    Services,
)
from warpspace.exceptions import OptionError, RenderError, WorkersLostError
from warpspace.outputs.exports.formats import export_formats
from warpspace.outputs.exports.formats import write_export as write
from warpspace.outputs.figures.catalogue import figure_kinds
from warpspace.picture.words import range_words
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.outputs.drawing.settings import FigureSettings

MOST_RENDERERS = 2
"""Figures drawn at the same time for all tabs together."""
POLL_S = 0.1
_renderers = threading.Semaphore(MOST_RENDERERS)


def build_services() -> Services:
    """Give the app its figures and exports."""
    return Services(
        draw_figure,
        write_export,
        draw_concepts,
        draw_compensation,
        figures=tuple((kind.name, kind.caption) for kind in figure_kinds() if kind.scenes == 1),
        exports=tuple((form.ending, form.about) for form in export_formats() if form.in_app),
    )


def draw_figure(request: Request, cancelled: threading.Event) -> bytes:
    """Draw the map of a request as a PNG; of a comparison both sides and the difference.

    Where tilts are coloured it is the orientation map; a comparison is always of position errors.
    """
    from warpspace.outputs.drawing.settings import FigureSettings

    settings = FigureSettings(
        component=request.component,
        exaggeration=request.exaggeration,
        dark=request.dark,
        loop=request.loop,
        grid=request.nodes,
        range_top=None if request.colours is None else request.colours.high,
        range_fixed=request.range_fixed,
        conditions=request.conditions,
    )
    name, scenes = request.figure or "error-map", [request.scene]
    if request.figure and request.beside is not None:
        raise OptionError(f"figure {name!r} is of one machine; show A or B in the tab Compare")
    if not request.figure and request.pair is not None:
        settings = replace(settings, conditions=request.pair_conditions)
        # the change has colours of its own, whichever of the three is drawn on the page
        if request.tilts or not request.range_fixed:
            settings = replace(settings, range_top=None)
        name, scenes = "comparison", list(request.pair)
    elif request.beside is not None:
        raise OptionError(
            f"A is seen through the {request.loop} loop, B through the {request.beside.loop} loop;"
            " a figure of both needs one loop. GLB, CSV and HTML show their difference."
        )
    elif request.tilts and not request.figure:
        name = "orientation-map"
    if name == "orientation-map":
        # the lean of the needles has a factor of its own
        settings = replace(settings, exaggeration="auto")
    return _render(name, scenes, settings, cancelled)


def draw_concepts(request: ConceptRequest, cancelled: threading.Event) -> bytes:
    """Draw machines side by side as a PNG; otherwise as `draw_figure`."""
    from warpspace.outputs.drawing.settings import FigureSettings

    settings = FigureSettings(dark=request.dark, loop=request.loop, concepts=request.plan)
    if request.strip_px is not None:
        width, height = request.strip_px
        size = (width, height * len(request.scenes))
        settings = replace(settings, size=size, strip=True)
    return _render("concepts", request.scenes, settings, cancelled)


def draw_compensation(request: CompensationRequest, cancelled: threading.Event) -> bytes:
    """Draw the maps of a compensation as a PNG."""
    from warpspace.outputs.charts.results import draw_maps
    from warpspace.outputs.processes import ProcessPool

    _take_turn(cancelled)
    pool = ProcessPool(1)
    try:
        drawn = pool.submit(draw_maps, request.found, dark=request.dark, narrow=request.narrow)
        while not wait([drawn], POLL_S).done:
            if cancelled.is_set():
                raise CancelledError("the maps were cancelled")
        return drawn.result()
    except WorkersLostError:
        raise RenderError("the maps could not be drawn: their process has ended") from None
    finally:
        pool.kill()
        _renderers.release()


def _take_turn(cancelled: threading.Event) -> None:
    while not _renderers.acquire(timeout=POLL_S):
        if cancelled.is_set():
            raise CancelledError("cancelled while waiting for a renderer")


def _render(
    name: str,
    scenes: Sequence[Scene],
    settings: "FigureSettings",
    cancelled: threading.Event,
) -> bytes:
    from warpspace.outputs.worker import FigureWorker

    _take_turn(cancelled)
    try:
        with FigureWorker() as worker, ThreadPoolExecutor(1) as caller:
            drawn = caller.submit(worker.render, name, scenes, settings, "png")
            while not wait([drawn], POLL_S).done:
                if cancelled.is_set():
                    worker.close(wait=False)
                    wait([drawn])
                    raise CancelledError("the figure was cancelled")
            return drawn.result()
    finally:
        _renderers.release()


def write_export(request: Request, ending: str) -> bytes:
    """Write an export of a request."""
    from warpspace.outputs.files import temporary_folder
    from warpspace.picture.comparison import scene_change
    from warpspace.picture.model import evaluate_picture

    scale = request.colours
    fixed = (
        (range_words(scale.low, scale.high, scale.unit),)
        if request.range_fixed and scale is not None
        else ()
    )
    picture, *subtracted = (
        evaluate_picture(
            part.scene,
            exaggeration=request.exaggeration,
            grid=request.nodes,
            loop=part.loop,
            component=request.component,
            quantity="orientation" if request.tilts else "position",
            colours=request.colours,
            conditions=(*part.conditions, *fixed),
        )
        for part in (request, request.beside)
        if part is not None
    )
    if subtracted:
        picture = scene_change(picture, subtracted[0])
    with temporary_folder() as folder:
        target = folder / f"export{ending}"
        write(picture, target, overwrite=False)
        return target.read_bytes()
