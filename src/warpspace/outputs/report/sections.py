"""The design review from scenes to a file: numbers, then sections, then one of two templates."""

import hashlib
import platform
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.analysis.blocks import (
    Bars,
    Column,
    Histogram,
    Lines,
    Mark,
    Panel,
    Table,
    number_columns,
)
from warpspace.analysis.blocks import Block as AnyBlock
from warpspace.analysis.commands.adjust import AdjustResult
from warpspace.analysis.commands.concepts import Concepts
from warpspace.analysis.description import ProgressCallback, Result, ignore_progress
from warpspace.analysis.note_tables import notes_table
from warpspace.analysis.sampling.distribution import choose_distribution
from warpspace.analysis.uncertainty.propagation import u95_lines
from warpspace.bodies.placed import PlacedBody, place_bodies
from warpspace.exceptions import NoRendererError, OptionError, RenderError, WarpspaceError
from warpspace.machine.axes import parameter
from warpspace.machine.limits import MAX_CSV_BYTES, MOST_CONCEPTS
from warpspace.outputs.drawing.settings import PRINTED_PX, FigureSettings, Step
from warpspace.outputs.figures.registry import figure_kinds
from warpspace.outputs.file_output import check_target, write_content
from warpspace.outputs.processes import FigureWorker
from warpspace.outputs.report.review import (
    ReportSettings,
    Review,
    Reviewed,
    build_review,
    first_page,
    share_pictures,
    spell_setting,
)
from warpspace.outputs.report.templating import (
    Block,
    Embedded,
    Items,
    Report,
    ReportFigure,
    ReportSection,
    Text,
    render_html,
    render_pdf,
    report_time,
)
from warpspace.picture.comparison import statistics_blocks
from warpspace.picture.formatting import (
    convention_sentences,
    list_axes,
    point_axes,
    reference_words,
    spell_factor,
    spell_point,
)
from warpspace.picture.model import ScenePicture
from warpspace.picture.traces import trace_lines
from warpspace.resources import __version__
from warpspace.scene.model import Scene, common_loop
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import read_bytes
from warpspace.units import spell, spell_short, spell_signed

HEIGHT_PX, HIGH_PX = 400, 490
HIGH = ("comparison", "slices", "error-curves", "concepts", "adjust")  # figures of this height
CHART = "warpspace.outputs.charts.block_charts:chart_figure"
LINES_WIDTH = 0.72  # of the page, at which curves are printed as large as they are drawn
Chart = Bars | Lines | Histogram
Drawn = Callable[[], Block]
"""Waits for a figure; returns a replacement where it cannot be drawn."""
StorySteps = Callable[[Scene, int], Iterable[Step]]
"""Returns the steps of a scene's story for a number of nodes per axis, each as shown on the page:
caption, name of the figure, its scenes and settings. It needs the app."""


class ReportFigures:
    """The figures of one report; drawing of the maps begins at once."""

    def __init__(
        self,
        worker: FigureWorker,
        pictures: Sequence[ScenePicture],
        settings: ReportSettings,
        form: str,
        watch: ProgressCallback,
    ) -> None:
        self._worker, self._form, self._watch, self._settings = worker, form, watch, settings
        self._begun = self._done = 0
        self._factor = pictures[0].exaggeration
        self.missing: list[str] = []
        scenes = [picture.scene for picture in pictures]
        drawn = f"displacement drawn {spell_factor(self._factor)}"
        compares = len(scenes) == 2
        subject = "A, B and their difference" if compares else f"Error map of {scenes[0].title}"
        self.first = self.begin(
            "comparison" if compares else "error-map", scenes, f"{subject}; {drawn}."
        )
        self.evidence: list[list[Drawn]] = []
        for number, picture in enumerate(pictures):
            scene = picture.scene
            map_caption = f"Error map of {scene.title}; {drawn}; own colour scale."
            # without information: no trace displaced, the same machine again
            is_undisplaced = not any(trace.error_um.any() for trace in trace_lines(picture.traces))
            left_out = {"traces" if is_undisplaced else "", "machine" if number else ""}
            figures = [("error-map", map_caption)] if compares else []
            figures += [
                (kind.name, kind.caption)
                for kind in figure_kinds()
                if kind.evidence and kind.name not in left_out
            ]
            self.evidence.append(
                [
                    self.begin(name, [scene], caption, prepared=_prepared(name, picture))
                    for name, caption in figures
                ]
            )

    def chart(self, chart: Chart) -> Block:
        data = self._worker.begin_chart("chart", CHART, self._form, chart)()
        width = LINES_WIDTH if isinstance(chart, Lines) else 1.0
        named = isinstance(chart, Histogram)
        caption = f"Distribution: {chart.x_label}." if named else chart.title
        return ReportFigure("chart", caption, data, self._form, width)

    def begin(
        self,
        name: str,
        scenes: Sequence[Scene],
        caption: str,
        settings: FigureSettings | None = None,
        prepared: Any = None,
    ) -> Drawn:
        """Begin a figure; if drawing fails twice, the figure is missing."""
        # the lean of the tool axis needs a factor of its own to be visible
        factor = "auto" if name == "orientation-map" else self._factor
        loop, grid = self._settings.loop, self._settings.grid
        settings = settings or FigureSettings(exaggeration=factor, loop=loop, grid=grid)
        size = PRINTED_PX, HIGH_PX if name in HIGH else HEIGHT_PX
        settings = replace(settings, size=size, printed=True, prepared=prepared)
        begin = partial(self._worker.begin, name, scenes, settings, self._form)
        begun = begin()
        self._begun += 1

        def drawn() -> Block:
            self._watch(self._done / self._begun)
            self._done += 1
            for first_or_second in (lambda: begun, begin):
                try:
                    return ReportFigure(name, caption, first_or_second()(), self._form)
                except NoRendererError:
                    raise
                except RenderError as error:
                    failed = f"{name} ({error})"
                except WarpspaceError as error:
                    return Text(f"{caption} {error}", "note")
            self.missing.append(failed)
            return Text(f"{caption} This figure is missing: {failed}.", "note")

        return drawn


def _prepared(name: str, picture: ScenePicture) -> tuple[PlacedBody, ...] | None:
    """Place the bodies here, where the page needs their file, too."""
    try:
        if name == "machine":
            return place_bodies(picture.scene, picture.view, picture.exaggeration)
    except WarpspaceError:
        pass  # drawing gives the reason
    return None


ENDINGS = (".html", ".pdf")
OVERLINE = "Design review · volumetric error"
MOST_ROWS, MOST_BARS = 15, 20
TOLERANCE_ANALYSES = ("worst", "sampled", "shares")  # names in `ReportSettings.analyses`
LOOPS = {
    "tool": "The tool point, actual minus nominal.",
    "workpiece": "The workpiece point, actual minus nominal.",
    "relative": "The tool point minus the workpiece point that nominally coincides.",
}


Embed = Callable[..., str]
"""Builds a page of a scene for exaggeration, nodes, loop and largest |E|; it needs a server."""


def write_report(
    scenes: Sequence[Scene],
    path: str | Path,
    settings: ReportSettings | None = None,
    *,
    embed: Embed | None = None,
    overwrite: bool = True,
    **parts: Any,
) -> Report:
    """Write the report of one scene or two; `parts` are passed to `build_report`."""
    target = check_target(path, ENDINGS, overwrite=overwrite)
    page = target.suffix.lower() == ".html"
    form, embed = ("svg", embed) if page else ("pdf", None)
    report = build_report(scenes, settings, form=form, embed=embed, **parts)
    content = render_html(report).encode() if page else render_pdf(report)
    write_content(content, target, overwrite=overwrite)
    return report


def build_report(
    scenes: Sequence[Scene],
    settings: ReportSettings | None = None,
    *,
    form: str = "svg",
    embed: Embed | None = None,
    story_steps: StorySteps | None = None,
    concepts: Sequence[Scene] = (),
    results: Mapping[str, Result] | None = None,
    files: Sequence[Path] = (),
    watch: ProgressCallback = ignore_progress,
) -> Report:
    """Build a report; `watch` is called with the share of figures drawn."""
    if form not in ("svg", "pdf"):
        raise OptionError(f"figures of a report as {form!r}; expected svg or pdf")
    settings = settings or ReportSettings()
    settings = replace(settings, loop=common_loop(scenes, settings.loop))
    pictures = share_pictures(scenes, settings)
    with FigureWorker() as worker:
        figures = ReportFigures(worker, pictures, settings, form, watch)
        review = build_review(scenes, settings, pictures)
        extra = results or {}
        side_by_side = {"Comparison of concepts": concept_blocks(review, concepts, figures)}
        appendices = {
            "Distribution of the error": map_blocks(review, figures, embed),
            "Error budget at the worst point": map(explanation, review.scenes),
            "Adjustments": result_blocks(review, figures, "adjust"),
            **({"Differences between A and B": differences(review)} if len(scenes) == 2 else {}),
            "Errors and tolerances": map(parameters, review.scenes),
            "Error gains": result_blocks(review, figures, "gains"),
            "Errors within the tolerances": result_blocks(review, figures, *TOLERANCE_ANALYSES),
            **(side_by_side if concepts else {}),
            **{name: report_blocks(result.blocks(), figures) for name, result in extra.items()},
            "Conventions": [conventions(review)],
            "Provenance": provenance(review, files),
        }
        noted = tuple(notes(review, figures, story_steps))
        parts = (
            ReportSection("", tuple(first_page(review, figures.first()))),
            *([ReportSection("Findings and decisions", noted)] if noted else []),
            *(
                ReportSection(f"Appendix {_letters(number)} · {heading}", tuple(blocks))
                for number, (heading, blocks) in enumerate(appendices.items(), 1)
            ),
        )
    machines = [one.scene.machine for one in review.scenes]
    facts = (
        *dict.fromkeys(f"{machine.title}, chain {machine.chain}" for machine in machines),
        *dict.fromkeys(one.volume for one in review.scenes),
        f"{settings.loop} loop",
        *dict.fromkeys(reference_words(one.scene) for one in review.scenes),
        *(f"error set {one.scene.name}" for one in review.scenes),
        *([f"by {settings.author}"] if settings.author else []),
        report_time().strftime("%Y-%m-%d"),
        f"warpspace {__version__}",
    )
    title = " and ".join(one.titled(one.scene.title) for one in review.scenes)
    return Report(title, OVERLINE, facts, parts, tuple(figures.missing))


def _letters(number: int) -> str:
    prefix, last = divmod(number - 1, 26)
    return (chr(64 + prefix) if prefix else "") + chr(65 + last)


def report_blocks(
    blocks: Iterable[AnyBlock], figures: ReportFigures | None = None
) -> Iterator[Block]:
    """Convert the blocks of a result to blocks of the report; charts only with `figures`."""
    for block in blocks:
        if isinstance(block, str):
            yield Text(block.strip(), "note" if block.startswith(" ") else "body")
        elif isinstance(block, Table) and block.rows:
            nonzero = [i for i, row in enumerate(block.rows) if not _is_zero(block.columns, row)]
            zero, omitted = len(block.rows) - len(nonzero), len(nonzero) - MOST_ROWS
            title = block.title.strip()
            title += f" Rows of zeros omitted: {zero}." if zero else ""
            title += f" {omitted} more rows omitted." if omitted > 0 else ""
            rows = [block.rows[i] for i in nonzero[:MOST_ROWS]]
            marks = [block.marks[i] for i in nonzero[:MOST_ROWS] if block.marks]
            shortened = replace(block, title=title.strip(), rows=rows, marks=marks)
            yield shortened if rows else Text(title.strip(), "note")
        elif isinstance(block, Table):
            yield Text(f"{block.title} {block.empty.strip()}".strip(), "note")
        elif figures is not None:
            yield figures.chart(_first_bars(block) if isinstance(block, Bars) else block)


def _is_zero(columns: Sequence[Column], row: Sequence[object]) -> bool:
    cells = [
        column.spell(value)
        for column, value in zip(columns, row, strict=True)
        if column.shows and isinstance(value, int | float) and not isinstance(value, bool)
    ]
    return bool(cells) and not any(re.search("[1-9]", cell) for cell in cells)


def _first_bars(bars: Bars) -> Bars:
    first = slice(MOST_BARS)
    panels: list[Panel] = []
    for panel in bars.panels:
        pairs = ((one, one.values[first], one.spread[first]) for one in panel.series)
        series = tuple(replace(one, values=values, spread=spread) for one, values, spread in pairs)
        panels.append(replace(panel, series=series))
    return replace(bars, rows=bars.rows[first], keys=bars.keys[first], panels=tuple(panels))


def notes(review: Review, figures: ReportFigures, story: StorySteps | None) -> Iterator[Block]:
    """Build the notes of each scene, and the steps of its story, one figure each."""
    for reviewed in (one for one in review.scenes if one.scene.review):
        title = reviewed.titled("Red: numbers that have changed since the note was written.")
        yield notes_table(reviewed.scene, title)
        steps = story(reviewed.scene, review.settings.grid) if story else ()
        begun = [figures.begin(name, of, caption, drawn) for caption, name, of, drawn in steps]
        if begun:
            yield Text(reviewed.titled("The story"), "heading")
            yield from (figure() for figure in begun)


def result_blocks(review: Review, figures: ReportFigures, *names: str) -> Iterator[Block]:
    """Build the results of analyses for each scene, identical results once."""
    for name in names:
        before = None
        for reviewed in review.scenes:
            result = reviewed.results[name]
            if isinstance(result, str):
                yield Text(reviewed.titled(result), "note")
                continue
            numbers = result.as_json()
            if numbers == before:
                yield Text(reviewed.titled("identical results."), "note")
                continue
            before = numbers
            title, *blocks = result.blocks()
            yield Text(reviewed.titled(str(title)), "heading")
            if not isinstance(result, AdjustResult):
                yield from report_blocks(blocks, figures)
                continue
            yield from report_blocks(blocks)
            if result.worthwhile:
                caption = f"Before, after set {result.worthwhile[0] + 1}, and their difference."
                titled, scene = reviewed.titled(caption), reviewed.scene
                yield figures.begin("adjust", [scene], titled, prepared=result)()


def map_blocks(review: Review, figures: ReportFigures, embed: Embed | None) -> Iterator[Block]:
    """Build the statistics, the interactive views and the maps."""
    names = [one.letter or "|E|" for one in review.scenes]
    summaries = [one.statistics for one in review.scenes]
    if review.difference is not None:
        summaries.append(review.difference)
    yield Text("Each node is weighted by its share of the volume.")
    blocks = statistics_blocks(review.scenes[0].scene, names, summaries)
    yield from report_blocks(block for block in blocks if not str(block).startswith("  --at"))
    for reviewed in review.scenes:
        errors = reviewed.uncertainty and reviewed.uncertainty.errors
        yield from report_blocks(u95_lines(errors, {reviewed.letter: reviewed.statistics}))
    for number, reviewed in enumerate(review.scenes):
        if embed is not None:
            page = embed(
                reviewed.scene,
                exaggeration=review.exaggeration,
                nodes=min(max(reviewed.picture.grid.shape), 21),
                loop=review.settings.loop,
                largest=max(one.statistics.max_um for one in review.scenes),
            )
            title = reviewed.titled(f"{reviewed.scene.title}: interactive view, drag to turn")
            yield Embedded(title, page)
        yield from (drawn() for drawn in figures.evidence[number])


def explanation(reviewed: Reviewed) -> Table:
    terms = reviewed.explanation
    ranked = sorted(terms.contributions, key=lambda part: -abs(part.along_um))
    rows: list[tuple[str, ...]] = []
    for part in ranked[:MOST_ROWS]:
        row = parameter(part.key)
        value = f"{spell_setting(part.value)} {row.unit}"
        numbers = map(spell_signed, (*part.error_um, part.along_um))
        rows.append((part.key, row.name, value, *numbers))
    remaining = ranked[MOST_ROWS:]
    if remaining:
        total = np.sum([(*part.error_um, part.along_um) for part in remaining], axis=0)
        rows.append((f"{len(remaining)} more", "", "", *map(spell_signed, total)))
    remainder = (spell_signed(value, 2) for value in terms.remainder_um)
    rows.append(("remainder", "second order", "", *remainder, ""))
    rows.append(("total", "exact chain", "", *map(spell_signed, terms.error_um), ""))
    worst = reviewed.statistics
    place = spell_point(point_axes(reviewed.scene, worst.max_at_axes), worst.max_at_mm)
    title = (
        f"{reviewed.titled(reviewed.scene.title)}. Contribution of each error at the worst point,"
        f" {place} mm. The components along E add up to the length of the first-order error."
        " The largest contribution is not always the one to adjust, since it may compensate other"
        " errors elsewhere; see Adjustments."
    )
    columns = (
        *(Column("key"), Column("error"), Column("value there", "s")),
        *number_columns(("x", "y", "z", "along E"), "s", "µm"),
    )
    marks: list[Mark] = [*("" for _ in rows[1:]), "key"]
    return Table(columns, rows, title, marks=marks)


def parameters(reviewed: Reviewed) -> Block:
    scene = reviewed.scene
    rows: list[tuple[str, ...]] = []
    marks: list[Mark] = []
    zero = 0
    for key in scene.parameter_keys:
        row, tolerance = parameter(key), scene.tolerances.get(key)
        value = scene.errors.amplitude(key)
        limits, conforms = "", ""
        if tolerance is not None:
            centre = "" if tolerance.centre == 0.0 else f"{spell_setting(tolerance.centre)} "
            limits = f"{centre}± {spell_short(tolerance.half_width)}"
            conforms = "yes" if abs(value - tolerance.centre) <= tolerance.half_width else "no"
        if value == 0.0 and conforms != "no":
            zero += 1
            continue
        function = scene.errors.functions.get(key) if value else None
        curve = "" if function is None else function.describe(row.unit, spell, spell_short)
        number = spell_setting(value) if value else "0"
        rows.append((key, row.symbol, row.name, number, limits, row.unit, conforms, curve))
        marks.append("worse" if conforms == "no" else "key" if value else "")
    title = reviewed.titled(f"Errors and tolerances of {scene.title}.")
    if not rows:
        return Text(f"{title} All errors are zero and within tolerance.", "note")
    title += f" Errors equal to zero omitted: {zero}." if zero else ""
    columns = (
        *(Column("key"), Column("symbol"), Column("error"), Column("value", "s")),
        *(Column("tolerance", "s"), Column("unit"), Column("within"), Column("along the axis")),
    )
    return Table(columns, rows, title, marks=marks)


def differences(review: Review) -> Iterator[Block]:
    first, second = (reviewed.scene for reviewed in review.scenes)
    rows: list[tuple[str, ...]] = []
    for key in dict.fromkeys([*first.parameter_keys, *second.parameter_keys]):
        a, b = first.errors.amplitude(key), second.errors.amplitude(key)
        same = first.errors.functions.get(key) == second.errors.functions.get(key)
        if not (same or a == b == 0.0):
            row = parameter(key)
            rows.append((key, row.name, *map(spell_setting, (a, b, b - a)), row.unit))
    columns = (
        Column("key"), Column("error"), *number_columns(("A", "B", "B − A"), "s"), Column("unit")
    )  # fmt: skip
    title = "Errors in which A and B differ (largest values along the axis)."
    no_difference = Text("The error sets of A and B are the same.", "note")
    yield Table(columns, rows, title) if rows else no_difference
    if review.difference is None:
        yield Text("The working volumes of A and B differ: no difference is formed.", "note")


def concept_blocks(
    review: Review, concepts: Sequence[Scene], figures: ReportFigures
) -> Iterator[Block]:
    scenes, settings = (*(one.scene for one in review.scenes), *concepts), review.settings
    if len(scenes) > MOST_CONCEPTS:
        raise OptionError(
            f"{len(scenes)} machines side by side; expected at most {MOST_CONCEPTS}"
            f" with the {len(review.scenes)} of the report"
        )
    analysis = Concepts(
        limit_um=settings.spec_um, samples=settings.samples, seed=settings.seed,
        distribution=choose_distribution(settings.distribution),
    )  # fmt: skip
    comparison = analysis.run_all(scenes, ignore_progress)
    yield from report_blocks(comparison.blocks())
    caption = "The machines at one scale; colours: RMS of |E| within tolerance."
    drawn = FigureSettings(loop=str(analysis.loop), grid=settings.grid, concepts=analysis)
    machines = [concept.scene for concept in comparison.concepts]
    yield figures.begin("concepts", machines, caption, drawn)()


def conventions(review: Review) -> Items:
    second_order = ", ".join(
        f"{spell(max(one.linearisation_um, 0.0), 2)} µm" + (one.letter and f" in {one.letter}")
        for one in review.scenes
    )
    each = [(_reference(one.scene), *convention_sentences(one.scene)) for one in review.scenes]
    differ = len(set(each)) > 1
    sentences = [
        one.titled(text) if differ else text
        for one, words in zip(review.scenes, each if differ else each[:1], strict=False)
        for text in words
    ]
    loop = review.settings.loop or review.scenes[0].picture.view.loop
    factor = spell_factor(review.exaggeration)
    return Items(
        (
            "Error = actual − nominal. Lengths in mm, errors in µm, small angles in µrad.",
            (
                "Right-handed machine frame R with the axis directions of ISO 841; parameters as in"
                " ISO 230-1 (EAX: rotation about x of the X axis; EC0Y: squareness of Y to X)."
            ),
            f"Loop: {loop}. {LOOPS[loop]}",
            *sentences,
            (
                f"Displacement is drawn {factor} unless a figure states otherwise; the dashed box"
                " is nominal."
            ),
            (
                "First order in the errors; over a 5 × 5 × 5 grid the exact chain (full rotations,"
                f" all products) differs by at most {second_order}."
            ),
            "Sampled machines have one constant value per error and point, drawn independently.",
        )
    )


def _reference(scene: Scene) -> str:
    if scene.reference is None:
        return "Absolute: errors include the part common to all points."
    return f"Relative to the reference point {list_axes(scene.reference)}; its error is subtracted."


def provenance(review: Review, files: Sequence[Path]) -> Iterator[Block]:
    settings = review.settings
    sampling = f"{settings.samples} machines, {settings.distribution}, seed {settings.seed}"
    rows = [
        ("program", f"warpspace {__version__}"),
        ("made", report_time().strftime("%Y-%m-%d %H:%M UTC")),
        ("with", f"Python {platform.python_version()}, NumPy {np.__version__}"),
        ("grid", f"{settings.grid} nodes per axis"),
        ("sampling", sampling),
    ]
    texts = [scene_to_toml(one.scene).encode() for one in review.scenes]
    inputs = [
        *zip((one.titled(f"scene {one.scene.name}") for one in review.scenes), texts, strict=True),
        *((f"file {path.name}", read_bytes(path, MAX_CSV_BYTES)) for path in files),
    ]
    rows += [(name, f"SHA-256 {hashlib.sha256(data).hexdigest()}") for name, data in inputs]
    yield Table((Column("item"), Column("value")), rows, "Program, settings and input.")
    for reviewed, text in zip(review.scenes, texts, strict=True):
        heading = f"{reviewed.scene.name}.toml, complete; the scene of this report."
        yield Text(reviewed.titled(heading), "heading")
        yield Text(text.decode(), "code")
