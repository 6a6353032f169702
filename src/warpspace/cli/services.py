"""What the app and the outputs do for each other: figures, exports, pages of scenes."""

import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from warpspace.cli.shared_options import write_text
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.outputs.exports.formats import ExportFormat, export_formats, register_format
from warpspace.outputs.exports.formats import write_export as write
from warpspace.outputs.figures.registry import figure_kinds

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from warpspace.analysis.commands.concepts import Concepts
    from warpspace.analysis.description import Result
    from warpspace.app.documents.output_services import Services
    from warpspace.app.drawing.camera import CameraMemory
    from warpspace.app.evaluation.live_picture import LivePicture
    from warpspace.formats.compensation.compensate import Compensation
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.outputs.processes import FigureWorker
    from warpspace.outputs.report.sections import Step
    from warpspace.picture.model import ScenePicture
    from warpspace.scene.model import Scene

MOST_RENDERERS = 2  # figures drawn at the same time for all tabs together
POLL_S = 0.1
MAPS = "warpspace.outputs.charts.result_charts:compensation_maps"
_renderers = threading.Semaphore(MOST_RENDERERS)


def build_services() -> "Services":
    from warpspace.app.documents.output_services import Services

    return Services(
        draw_figure,
        draw_view,
        write_export,
        write_report,
        draw_concepts,
        draw_compensation,
        figures=tuple((kind.name, kind.caption) for kind in figure_kinds() if kind.scenes == 1),
        exports=tuple((form.ending, form.about) for form in export_formats() if form.in_app),
    )


def draw_figure(picture: "LivePicture", figure: str, cancelled: threading.Event) -> bytes:
    """Draw a figure of what a page shows as a PNG."""
    return _render(*_figure_of(picture, figure), cancelled)


def _figure_of(
    picture: "LivePicture", figure: str = ""
) -> "tuple[str, Sequence[Scene], FigureSettings]":
    """Choose a figure of what a page shows; of a comparison both sides and the difference.

    Where tilts are coloured it is the orientation map; a comparison is always of position errors.
    """
    from warpspace.app.documents.legend import state_conditions
    from warpspace.app.documents.transfers import shown_sides
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.picture.comparison import conditions_of_both

    sides = shown_sides(picture, sheet=not figure)
    loops = [side.loop for side in sides]
    if figure and len(sides) == 2:
        raise OptionError(f"figure {figure!r} is of one machine; draw A or B, not their difference")
    if len(set(loops)) > 1:
        raise OptionError(
            f"A is seen through the {loops[0]} loop, B through the {loops[1]} loop;"
            " a figure of both needs one loop. GLB, CSV and HTML show their difference."
        )
    state, tilts = picture.state, picture.tilts
    name = figure or ("orientation-map" if tilts else "error-map")
    conditions, fixed = state_conditions(sides[0]), state.look.range_mode == "fixed"
    top: float | None = picture.scale.high
    if len(sides) == 2:
        name, conditions = "comparison", conditions_of_both(*map(state_conditions, sides))
        # the change has colours of its own, whichever of the three is drawn on the page
        top = top if fixed and not tilts else None
    settings = FigureSettings(
        component=state.component,
        # the lean of the needles has a factor of its own
        exaggeration="auto" if name == "orientation-map" else picture.exaggeration,
        dark=state.shown.dark,
        loop=loops[0],
        grid=state.nodes,
        range_top=top,
        range_fixed=fixed,
        conditions=conditions,
    )
    return name, [side.active_scene() for side in sides], settings


def draw_view(
    picture: "LivePicture",
    pixels: "NDArray[np.uint8]",
    camera: "CameraMemory",
    cancelled: threading.Event,
) -> bytes:
    """Draw what a page has drawn as a PNG that says what it shows."""
    from warpspace.app.documents.legend import look_words, marked, projected_labels
    from warpspace.outputs.view import draw_view as draw
    from warpspace.units import spell

    found = picture.statistics
    numbers = {"mean": found.mean_um, "P95": found.p95_um, "max": found.max_um}
    words, px_per_mm = projected_labels(picture, camera, *pixels.shape[:2])
    given = (
        pixels, picture.title, look_words(picture), picture.scale, marked(picture),
        [(f"{n} {picture.length_words}", f"{spell(v)} µm") for n, v in numbers.items()],
        None if px_per_mm is None else (px_per_mm, picture.exaggeration), words,
        picture.state.shown.dark,
    )  # fmt: skip
    return _drawn(lambda worker: worker.call("picture", draw, *given), cancelled)


def draw_concepts(
    scenes: "Sequence[Scene]", plan: "Concepts", dark: bool, cancelled: threading.Event
) -> bytes:
    from warpspace.outputs.drawing.settings import FigureSettings

    settings = FigureSettings(dark=dark, loop=str(plan.loop), concepts=plan)
    return _render("concepts", scenes, settings, cancelled)


def draw_compensation(
    found: "Compensation", dark: bool, narrow: bool, cancelled: threading.Event
) -> bytes:
    return _drawn(
        lambda worker: worker.begin_chart("maps", MAPS, "png", found, dark, narrow), cancelled
    )


def _render(
    name: str, scenes: "Sequence[Scene]", settings: "FigureSettings", cancelled: threading.Event
) -> bytes:
    return _drawn(lambda worker: worker.begin(name, scenes, settings, "png"), cancelled)


def _drawn(
    begin: "Callable[[FigureWorker], Callable[[], bytes]]", cancelled: threading.Event
) -> bytes:
    from concurrent.futures import ThreadPoolExecutor, wait

    from warpspace.app.documents.output_services import CancelledError
    from warpspace.outputs.processes import FigureWorker

    with _turn(cancelled), FigureWorker() as worker, ThreadPoolExecutor(1) as caller:
        drawn = caller.submit(begin(worker))
        while not wait([drawn], POLL_S).done:
            if cancelled.is_set():
                worker.close(wait=False)
                wait([drawn])
                raise CancelledError("the figure was cancelled")
        return drawn.result()


@contextmanager
def _turn(cancelled: threading.Event) -> Generator[None]:
    from warpspace.app.documents.output_services import CancelledError

    while not _renderers.acquire(timeout=POLL_S):
        if cancelled.is_set():
            raise CancelledError("cancelled while waiting for a renderer")
    try:
        yield
    finally:
        _renderers.release()


def write_export(picture: "LivePicture", ending: str) -> bytes:
    """Write an export of what a page shows."""
    from warpspace.app.documents.legend import range_conditions, state_conditions
    from warpspace.app.documents.transfers import shown_sides
    from warpspace.outputs.file_output import temporary_folder
    from warpspace.picture.comparison import scene_change
    from warpspace.picture.model import evaluate_picture

    found, *subtracted = (
        evaluate_picture(
            side.active_scene(),
            exaggeration=picture.exaggeration,
            grid=picture.state.nodes,
            loop=side.loop,
            component=picture.component,
            quantity=picture.quantity,
            colours=picture.scale,
            conditions=(*state_conditions(side), *range_conditions(picture)),
        )
        for side in shown_sides(picture)
    )
    if subtracted:
        found = scene_change(found, subtracted[0])
    with temporary_folder() as folder:
        target = folder / f"export{ending}"
        write(found, target, overwrite=False)
        return target.read_bytes()


def write_report(
    picture: "LivePicture",
    author: str,
    questions: Sequence[str],
    results: "Mapping[str, Result]",
    ending: str,
    cancelled: threading.Event,
) -> tuple[bytes, tuple[str, ...]]:
    """Write a report; give the file, and which figures are missing."""
    from warpspace.app.documents.scene_file import file_notes
    from warpspace.app.documents.transfers import shown_sides
    from warpspace.outputs.file_output import temporary_folder
    from warpspace.outputs.report import ReportSettings
    from warpspace.outputs.report import write_report as write

    state, sides = picture.state, shown_sides(picture, sheet=True)
    settings = ReportSettings(
        loop=sides[0].loop, grid=state.nodes, exaggeration=picture.exaggeration,
        spec_um=state.specification.limit_um, author=author, questions=tuple(questions),
    )  # fmt: skip
    alike = [one for one in sides if one.loop == sides[0].loop]
    scenes = [replace(one.active_scene(), review=file_notes(one)) for one in alike]
    with _turn(cancelled), temporary_folder() as folder:
        target = folder / f"report{ending}"
        written = write(
            scenes, target, settings, embed=embed_view, tell=tell_story, results=results
        )
        return target.read_bytes(), written.missing


BYTES_PER_RESPONSE = 48  # position and orientation error of one node to one parameter: six numbers


def write_page(picture: "ScenePicture", target: "Path", *, overwrite: bool) -> None:
    from warpspace.app.documents import offline_page
    from warpspace.scene.notes import story

    _check_size(picture)
    live = offline_page.offline_picture(
        picture.scene,
        exaggeration=picture.exaggeration,
        nodes=max(picture.grid.shape),
        loop=picture.view.loop,
        component=picture.component,
    )
    if story(live.state.review):
        page = offline_page.build_story_html(live.state, picture.provenance)
    else:
        page = offline_page.build_offline_html(live, picture.provenance)
    write_text(target, page, force=overwrite)


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


def tell_story(scene: "Scene", nodes: int) -> "list[Step]":
    """Give the steps of a story for a report; colours of the same thing end alike."""
    import numpy as np

    from warpspace.app.documents.legend import look_words, numbers_words, picture_conditions
    from warpspace.app.documents.scene_file import reopened
    from warpspace.app.evaluation.live_model import LiveModel
    from warpspace.app.state.app_state import START_NODES, start_state
    from warpspace.kinematics.model import Loop
    from warpspace.picture.model import VIEW_WORDS, VIEWS
    from warpspace.scene.notes import story

    notes, live = story(scene.review), LiveModel()
    steps: list[Step] = []
    ends: dict[tuple[str, str], float] = {}
    for note in notes:
        start = start_state(scene, loop=Loop(note.loop), nodes=min(nodes, START_NODES))
        try:
            state, camera = reopened(start, note)
            picture = live.evaluate(replace(state, nodes=start.nodes))
            name, scenes, settings = _figure_of(picture)
        except WarpspaceError as error:
            picture, camera = live.evaluate(start.noted(f"the scene as it is now: {error}")), None
            name, scenes, settings = _figure_of(picture)
        view = "iso"
        if camera is not None:
            towards = np.subtract(camera.position, camera.look_at)
            view = max(VIEWS, key=lambda one: towards @ VIEWS[one] / np.linalg.norm(VIEWS[one]))
        said = (
            picture.compared.title if picture.compared else "", picture.scale.label,
            *look_words(picture)[:2], VIEW_WORDS.get(view, "oblique view"),
            numbers_words(picture), *picture_conditions(picture), *picture.state.notes,
        )  # fmt: skip
        caption = f"Step {len(steps) + 1} of {len(notes)}: {' '.join(note.text.split())}"
        caption += f" (note {scene.review.index(note) + 1}; {' · '.join(filter(None, said))})"
        key, end = (name, settings.component), settings.range_top or 0.0
        ends[key] = max(ends.get(key, 0.0), end)
        steps.append((caption, name, scenes, replace(settings, view=view, dark=False, grid=nodes)))
    return [
        (caption, name, scenes, replace(one, range_top=ends[name, one.component] or None))
        for caption, name, scenes, one in steps
    ]
