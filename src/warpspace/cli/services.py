"""Services of the outputs to the app: figures, exports, reports, offline pages."""

import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.commands.concepts import Concepts
from warpspace.analysis.description import Result
from warpspace.app.documents import legend, offline_page
from warpspace.app.documents.output_services import CancelledError, Services
from warpspace.app.documents.scene_file import file_notes, reopened
from warpspace.app.documents.transfers import shown_sides
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.drawing.player import whole_factor
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.scene_overlays import program_of
from warpspace.app.panels.panel import Job
from warpspace.app.state.app_state import START_NODES, start_state
from warpspace.cli.shared_options import write_text
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.formats.compensation.compensate import Compensation
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import MAX_PAGE_BYTES
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.exports.formats import export_formats
from warpspace.outputs.exports.formats import write_export as write
from warpspace.outputs.figures.registry import figure_kinds
from warpspace.outputs.file_output import temporary_folder
from warpspace.outputs.processes import FigureWorker
from warpspace.parts.program import Program
from warpspace.picture.comparison import conditions_of_both, scene_change
from warpspace.picture.model import VIEW_WORDS, VIEWS, ScenePicture, evaluate_picture
from warpspace.scene.model import Scene
from warpspace.scene.notes import story
from warpspace.units import spell

if TYPE_CHECKING:
    from warpspace.outputs.drawing.settings import Step

MAX_RENDERERS = 2  # figures drawn at the same time, all tabs together
POLL_S = 0.1
ANIMATION_SIZE = (800, 600)
MAPS = "warpspace.outputs.charts.result_charts:compensation_maps"
_renderers = threading.Semaphore(MAX_RENDERERS)


def build_services() -> "Services":
    return Services(
        draw_figure,
        draw_animation,
        draw_view,
        write_export,
        write_report,
        draw_concepts,
        draw_compensation,
        figures=tuple((kind.name, kind.caption) for kind in figure_kinds() if kind.scenes == 1),
        exports=tuple((form.ending, form.about) for form in export_formats() if form.in_app),
    )


def draw_figure(picture: "LivePicture", figure: str, cancelled: threading.Event) -> bytes:
    """Draw a figure of the picture of a page as a PNG."""
    drawing = _figure_of(picture, figure)
    return _run_worker(lambda worker: worker.begin(*drawing), cancelled)


def _figure_of(
    picture: "LivePicture", figure: str = ""
) -> "tuple[str, Sequence[Scene], FigureSettings]":
    """Choose the figure of the picture of a page; of a comparison both sides and the difference.

    With tilts coloured it is the orientation map; a comparison always shows position errors.
    """
    sides = shown_sides(picture, sheet=not figure)
    loops = [side.loop for side in sides]
    if figure and len(sides) == 2:
        raise OptionError(f"figure {figure!r} shows one machine; draw A or B, not their difference")
    if len(set(loops)) > 1:
        raise OptionError(
            f"A uses the {loops[0]} loop, B the {loops[1]} loop; a figure of both needs the same"
            " loop. GLB, CSV and HTML show their difference."
        )
    state, tilts = picture.state, picture.tilts
    name = figure or ("orientation-map" if tilts else "error-map")
    conditions, fixed = legend.state_conditions(sides[0]), state.look.range_mode == "fixed"
    top: float | None = picture.scale.high
    if len(sides) == 2:
        name, conditions = "comparison", conditions_of_both(*map(legend.state_conditions, sides))
        # the change has its own colours, whichever of the three the page shows
        top = top if fixed and not tilts else None
    settings = FigureSettings(
        component=state.component,
        # the needles have their own display factor
        exaggeration="auto" if name == "orientation-map" else picture.exaggeration,
        dark=state.shown.dark,
        loop=loops[0],
        grid=state.nodes,
        range_top=top,
        range_fixed=fixed,
        conditions=conditions,
    )
    return name, [side.active_scene() for side in sides], settings


def draw_animation(picture: "LivePicture", motion: str, ending: str, job: "Job") -> bytes:
    """Draw the picture of a page with a motion, as an animated WebP or an MP4."""
    from warpspace.outputs.animation import AnimationSettings, default_frames, write_animation

    state, steps, program = picture.drawn_state, list["Step"](), Program()
    if motion == "story":
        state = picture.state
        scene = replace(state.active_scene(), review=file_notes(state))
        steps = build_story(scene, state.nodes)
    _, scenes, figure = _figure_of(picture, "error-map")
    if motion == "program":
        program = program_of(state, scenes[0])
    factor = whole_factor(picture)
    if motion == "rotation" and not picture.is_rotary:
        factor = picture.state.exaggeration or "auto"  # that of the traces, not of the volume
    figure = replace(figure, exaggeration=factor, size=ANIMATION_SIZE)
    frames, fps = default_frames(motion, len(steps))
    settings, count = AnimationSettings(motion, frames, fps, figure, program, steps), [0]

    def report_progress(n_frames: int) -> None:
        count[0] += n_frames
        job.report_progress(count[0] / frames)

    with _renderer_slot(job), temporary_folder() as folder:
        target = folder / f"animation{ending}"
        write_animation(scenes[0], target, settings, progress=report_progress)
        return target.read_bytes()


def draw_view(
    picture: "LivePicture",
    pixels: "NDArray[np.uint8]",
    camera: "CameraMemory",
    cancelled: threading.Event,
) -> bytes:
    """Draw the view of a page as a PNG with title, scale and statistics."""
    from warpspace.outputs.figure_files import draw_view as draw

    statistics = picture.statistics
    numbers = {"mean": statistics.mean_um, "P95": statistics.p95_um, "max": statistics.max_um}
    caption, px_per_mm = legend.projected_labels(picture, camera, *pixels.shape[:2])
    arguments = (
        pixels, picture.title, legend.look_words(picture), picture.scale, legend.marked(picture),
        [(f"{n} {picture.length_words}", f"{spell(v)} µm") for n, v in numbers.items()],
        None if px_per_mm is None else (px_per_mm, picture.exaggeration), caption,
        picture.state.shown.dark,
    )  # fmt: skip
    return _run_worker(lambda worker: worker.call("picture", draw, *arguments), cancelled)


def draw_concepts(
    scenes: "Sequence[Scene]", plan: "Concepts", dark: bool, cancelled: threading.Event
) -> bytes:
    settings = FigureSettings(dark=dark, loop=str(plan.loop), concepts=plan)
    return _run_worker(lambda worker: worker.begin("concepts", scenes, settings), cancelled)


def draw_compensation(
    compensation: "Compensation", dark: bool, narrow: bool, cancelled: threading.Event
) -> bytes:
    return _run_worker(
        lambda worker: worker.begin_chart("maps", MAPS, "png", compensation, dark, narrow),
        cancelled,
    )


def _run_worker(
    begin: "Callable[[FigureWorker], Callable[[], bytes]]", cancelled: threading.Event
) -> bytes:
    with _renderer_slot(cancelled), FigureWorker() as worker, ThreadPoolExecutor(1) as caller:
        drawn = caller.submit(begin(worker))
        while not wait([drawn], POLL_S).done:
            if cancelled.is_set():
                worker.close(wait=False)
                wait([drawn])
                raise CancelledError("the figure was cancelled")
        return drawn.result()


@contextmanager
def _renderer_slot(cancelled: threading.Event) -> Generator[None]:
    while not _renderers.acquire(timeout=POLL_S):
        if cancelled.is_set():
            raise CancelledError("cancelled while waiting for a renderer")
    try:
        yield
    finally:
        _renderers.release()


def write_export(picture: "LivePicture", ending: str) -> bytes:
    """Write an export of the picture of a page."""
    exported, *subtracted = (
        evaluate_picture(
            side.active_scene(),
            exaggeration=picture.exaggeration,
            grid=picture.state.nodes,
            loop=side.loop,
            component=picture.component,
            quantity=picture.quantity,
            colours=picture.scale,
            conditions=(*legend.state_conditions(side), *legend.range_conditions(picture)),
        )
        for side in shown_sides(picture)
    )
    if subtracted:
        exported = scene_change(exported, subtracted[0])
    with temporary_folder() as folder:
        target = folder / f"export{ending}"
        write(exported, target, overwrite=False)
        return target.read_bytes()


def write_report(
    picture: "LivePicture",
    author: str,
    questions: Sequence[str],
    results: "Mapping[str, Result]",
    ending: str,
    cancelled: threading.Event,
) -> tuple[bytes, tuple[str, ...]]:
    """Write a report; return the file and the missing figures."""
    from warpspace.outputs import report

    state, sides = picture.state, shown_sides(picture, sheet=True)
    settings = report.ReportSettings(
        loop=sides[0].loop, grid=state.nodes, exaggeration=picture.exaggeration,
        spec_um=state.specification.limit_um, author=author, questions=tuple(questions),
    )  # fmt: skip
    same_loop = [one for one in sides if one.loop == sides[0].loop]
    scenes = [replace(one.active_scene(), review=file_notes(one)) for one in same_loop]
    with _renderer_slot(cancelled), temporary_folder() as folder:
        target = folder / f"report{ending}"
        review = report.write_report(
            scenes, target, settings, embed=embed_view, story_steps=build_story, results=results
        )
        return target.read_bytes(), review.missing


BYTES_PER_RESPONSE = 48  # position and orientation error of one node to one parameter: six numbers


def write_page(picture: "ScenePicture", target: "Path", *, overwrite: bool) -> None:
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


def embed_view(
    scene: "Scene", *, exaggeration: float, nodes: int, loop: str, largest: float
) -> str:
    live = offline_page.offline_picture(
        scene, exaggeration=exaggeration, nodes=nodes, loop=Loop(loop), largest=largest
    )
    return offline_page.build_offline_html(live)


def build_story(scene: "Scene", nodes: int) -> "list[Step]":
    """Build the steps of a story for a report; equal maps share a colour range."""
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
            view = max(
                VIEWS, key=lambda variant: towards @ VIEWS[variant] / np.linalg.norm(VIEWS[variant])
            )
        conditions = (
            picture.compared.title if picture.compared else "", picture.scale.label,
            *legend.look_words(picture)[:2], VIEW_WORDS.get(view, "oblique view"),
            legend.numbers_words(picture), *legend.picture_conditions(picture),
            *picture.state.notes,
        )  # fmt: skip
        caption = f"Step {len(steps) + 1} of {len(notes)}: {' '.join(note.text.split())}"
        caption += (
            f"\n(note {scene.review.index(note) + 1}; {' · '.join(filter(None, conditions))})"
        )
        key, end = (name, settings.component), settings.range_top or 0.0
        ends[key] = max(ends.get(key, 0.0), end)
        steps.append((caption, name, scenes, replace(settings, view=view, dark=False, grid=nodes)))
    return [
        (caption, name, scenes, replace(variant, range_top=ends[name, variant.component] or None))
        for caption, name, scenes, variant in steps
    ]
