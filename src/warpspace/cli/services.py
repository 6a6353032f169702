"""What the app and the outputs do for each other: figures and exports of a page, pages of scenes.

Figures are drawn in a process of their own. All is imported when it is done, as for any command.
"""

import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from warpspace.cli.options import write_text
from warpspace.exceptions import OptionError, RenderError, WorkersLostError
from warpspace.outputs.exports.formats import ExportFormat, export_formats, register_format
from warpspace.outputs.exports.formats import write_export as write
from warpspace.outputs.figures.catalogue import figure_kinds

if TYPE_CHECKING:
    from concurrent.futures import Future
    from pathlib import Path

    from warpspace.analysis.concepts import Concepts
    from warpspace.app.documents.services import (
        ReportRequest,
        Request,
        Services,
    )
    from warpspace.formats.compensation.compensate import Compensation
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.picture.model import ScenePicture
    from warpspace.scene.model import Scene

MOST_RENDERERS = 2  # figures drawn at the same time for all tabs together
POLL_S = 0.1
_renderers = threading.Semaphore(MOST_RENDERERS)


def build_services() -> "Services":
    from warpspace.app.documents.services import Services

    return Services(
        draw_figure,
        write_export,
        draw_concepts,
        draw_compensation,
        write_report,
        figures=tuple((kind.name, kind.caption) for kind in figure_kinds() if kind.scenes == 1),
        exports=tuple((form.ending, form.about) for form in export_formats() if form.in_app),
    )


def draw_figure(request: "Request", cancelled: threading.Event) -> bytes:
    """Draw the map of a request as a PNG; of a comparison both sides and the difference."""
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


def draw_concepts(
    scenes: "Sequence[Scene]", plan: "Concepts", dark: bool, cancelled: threading.Event
) -> bytes:
    """Draw machines side by side as a PNG; otherwise as `draw_figure`."""
    from warpspace.outputs.drawing.settings import FigureSettings

    settings = FigureSettings(dark=dark, loop=str(plan.loop), concepts=plan)
    return _render("concepts", scenes, settings, cancelled)


def draw_compensation(
    found: "Compensation", dark: bool, narrow: bool, cancelled: threading.Event
) -> bytes:
    from warpspace.outputs.processes import ProcessPool
    from warpspace.outputs.save import draw_maps

    with _turn(cancelled):
        pool = ProcessPool(1)
        try:
            drawn = pool.submit(draw_maps, found, dark=dark, narrow=narrow)
            return _wait(drawn, cancelled, pool.kill, "maps were")
        except WorkersLostError:
            raise RenderError("the maps could not be drawn: their process has ended") from None
        finally:
            pool.kill()


def _render(
    name: str,
    scenes: "Sequence[Scene]",
    settings: "FigureSettings",
    cancelled: threading.Event,
) -> bytes:
    from concurrent.futures import ThreadPoolExecutor

    from warpspace.outputs.processes import FigureWorker

    with _turn(cancelled), FigureWorker() as worker, ThreadPoolExecutor(1) as caller:
        drawn = caller.submit(worker.render, name, scenes, settings, "png")
        return _wait(drawn, cancelled, lambda: worker.close(wait=False), "figure was")


@contextmanager
def _turn(cancelled: threading.Event) -> Generator[None]:
    from warpspace.app.documents.services import CancelledError

    while not _renderers.acquire(timeout=POLL_S):
        if cancelled.is_set():
            raise CancelledError("cancelled while waiting for a renderer")
    try:
        yield
    finally:
        _renderers.release()


def _wait(
    drawn: "Future[bytes]", cancelled: threading.Event, end: Callable[[], None], what: str
) -> bytes:
    from concurrent.futures import wait

    from warpspace.app.documents.services import CancelledError

    while not wait([drawn], POLL_S).done:
        if cancelled.is_set():
            end()
            wait([drawn])
            raise CancelledError(f"the {what} cancelled")
    return drawn.result()


def write_export(request: "Request", ending: str) -> bytes:
    from warpspace.outputs.files import temporary_folder
    from warpspace.picture.comparison import scene_change
    from warpspace.picture.model import evaluate_picture
    from warpspace.picture.words import range_words

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


def write_report(
    request: "ReportRequest", cancelled: threading.Event
) -> tuple[bytes, tuple[str, ...]]:
    """Write a report; give the file, and which figures are missing."""
    from warpspace.outputs.files import temporary_folder
    from warpspace.outputs.report import ReportSettings
    from warpspace.outputs.report import write_report as write

    settings = ReportSettings(
        loop=request.loop, grid=request.nodes, exaggeration=request.exaggeration,
        spec_um=request.limit_um, author=request.author, questions=request.questions,
    )  # fmt: skip
    with _turn(cancelled), temporary_folder() as folder:
        target = folder / f"report{request.ending}"
        written = write(request.scenes, target, settings, embed=embed_view, results=request.results)
        return target.read_bytes(), written.missing


# --- The offline page, which the app writes: outputs know nothing of the app ----------------------

BYTES_PER_RESPONSE = 48  # position and orientation error of one node to one parameter: six numbers


def write_page(picture: "ScenePicture", target: "Path", *, overwrite: bool) -> None:
    from warpspace.app.documents.offline_page import build_offline_html, offline_picture

    _check_size(picture)
    live = offline_picture(
        picture.scene,
        exaggeration=picture.exaggeration,
        nodes=max(picture.grid.shape),
        loop=picture.view.loop,
        component=picture.component,
    )
    write_text(target, build_offline_html(live, picture.provenance), force=overwrite)


def _check_size(picture: "ScenePicture") -> None:
    from warpspace.machine.limits import MAX_PAGE_BYTES

    nodes, keys = picture.values.size, len(picture.scene.parameter_keys)
    needed = nodes * keys * BYTES_PER_RESPONSE
    if needed > MAX_PAGE_BYTES:
        per_axis = max(picture.grid.shape)
        fits = int(per_axis * (MAX_PAGE_BYTES / needed) ** (1.0 / 3.0))
        raise OptionError(
            f"grid {per_axis}: the page needs about {needed / 1e9:.1f} GB of memory for"
            f" {keys} parameters at {nodes:,} nodes; expected at most {MAX_PAGE_BYTES / 1e9:.1f} GB"
            f" (--grid {fits}, or a .vts or .csv file, which hold any grid)"
        )


register_format(
    ExportFormat(
        ".html", "the interactive scene, one file that needs no network", write_page, in_app=False
    )
)


def embed_view(
    scene: "Scene", *, exaggeration: float, nodes: int, loop: str, largest: float
) -> str:
    from warpspace.app.documents.offline_page import build_offline_html, offline_picture
    from warpspace.kinematics.model import Loop

    live = offline_picture(
        scene, exaggeration=exaggeration, nodes=nodes, loop=Loop(loop), largest=largest
    )
    return build_offline_html(live)
