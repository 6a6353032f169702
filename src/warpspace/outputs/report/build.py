"""The design review from scenes to a file: numbers, then sections, then one of two templates."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from warpspace import __version__
from warpspace.exceptions import OptionError
from warpspace.outputs.files import check_target, write_atomically
from warpspace.outputs.report import sections as parts
from warpspace.outputs.report.blocks import (
    Block,
    Embedded,
    Report,
    Section,
    Text,
)
from warpspace.outputs.report.clock import report_time
from warpspace.outputs.report.closing import conventions, provenance
from warpspace.outputs.report.concepts import compare_with, concept_section
from warpspace.outputs.report.figures import ReportFigures
from warpspace.outputs.report.promises import sampling_blocks
from warpspace.outputs.report.repair import repair_section
from warpspace.outputs.report.review import ReportSettings, Review, Reviewed, build_review
from warpspace.outputs.report.wording import volume
from warpspace.picture.words import reference_words
from warpspace.scene.model import Scene

ENDINGS = (".html", ".pdf")
OVERLINE = "Design review · volumetric error"


class Embed(Protocol):
    """Builds a page with the interactive scene; handed in, since that needs a server."""

    def __call__(
        self, scene: Scene, *, exaggeration: float, nodes: int, loop: str, largest: float
    ) -> str:
        """Give the page as HTML that requests nothing."""
        ...


def write_report(
    scenes: Sequence[Scene],
    path: str | Path,
    settings: ReportSettings | None = None,
    *,
    embed: Embed | None = None,
    concepts: Sequence[Scene] = (),
    files: Sequence[Path] = (),
    overwrite: bool = True,
) -> Report:
    """Write the design review of one scene or two.

    Parameters
    ----------
    scenes : sequence of Scene
        One or two.
    path : str or Path
        Ends in .html or .pdf.
    settings : ReportSettings, optional
    embed : callable, optional
        Builds the interactive view of a scene; without it the page has none.
    concepts : sequence of Scene, optional
        Other machines, set beside those of the scenes within the tolerances of the first one.
    files : sequence of Path, optional
        Files the scenes were read from; their hashes are printed.
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Returns
    -------
    Report
        What was written.

    Raises
    ------
    OutputError
        If the file cannot be written.
    RenderError
        If this system cannot draw.
    OptionError
        If there are none or more than two scenes, or a setting is out of range.
    SceneError
        If machines are to be compared and tolerances are missing.
    """
    target = check_target(path, ENDINGS, overwrite=overwrite)
    page = target.suffix.lower() == ".html"
    report = build_report(
        scenes,
        settings,
        form="svg" if page else "pdf",
        embed=embed if page else None,
        concepts=concepts,
        files=files,
    )
    if page:
        from warpspace.outputs.report.page import render_html

        content = render_html(report).encode()
    else:
        from warpspace.outputs.report.paper import render_pdf

        content = render_pdf(report)
    with write_atomically(target, overwrite=overwrite) as temporary:
        temporary.write_bytes(content)
    return report


def build_report(
    scenes: Sequence[Scene],
    settings: ReportSettings | None = None,
    *,
    form: str = "svg",
    embed: Embed | None = None,
    concepts: Sequence[Scene] = (),
    files: Sequence[Path] = (),
) -> Report:
    """Put the report of one scene or two together; see `write_report` for the parameters.

    Parameters
    ----------
    scenes : sequence of Scene
    settings : ReportSettings, optional
    form : str, optional
        Format of the figures: "svg" or "pdf".
    embed : callable, optional
    concepts : sequence of Scene, optional
    files : sequence of Path, optional

    Returns
    -------
    Report
    """
    from warpspace.outputs.worker import FigureWorker

    if form not in ("svg", "pdf"):
        raise OptionError(f"figures of a report as {form!r}; expected svg or pdf")
    settings = settings or ReportSettings()
    review = build_review(tuple(scenes), settings)
    compared = compare_with(scenes, concepts, settings)
    with FigureWorker() as worker:
        painter = ReportFigures(worker, review, form)
        found = [
            parts.section("", [*parts.summary_blocks(review), painter.first()]),
            _where(review, painter, embed),
            _why(review),
            repair_section(review, painter),
            *([_differences(review)] if len(review.scenes) == 2 else []),
            _errors(review),
            _gains(review, painter),
            _samplings(review, painter),
            *([concept_section(compared, painter, settings)] if compared else []),
            conventions(review),
            provenance(review, files),
        ]
    return Report(_title(review), "", OVERLINE, _facts(review), tuple(found))


def _title(review: Review) -> str:
    """Heading of the whole."""
    return " and ".join(
        f"{letter}: {reviewed.scene.title}" if letter else reviewed.scene.title
        for letter, reviewed in parts.letters(review)
    )


def _facts(review: Review) -> tuple[str, ...]:
    """Line below the title."""
    machines = dict.fromkeys(
        f"{reviewed.scene.machine.title}, chain {reviewed.scene.machine.chain}"
        for reviewed in review.scenes
    )
    volumes = dict.fromkeys(volume(reviewed) for reviewed in review.scenes)
    return (
        *machines,
        *volumes,
        f"{review.settings.loop} loop",
        *dict.fromkeys(reference_words(reviewed.scene) for reviewed in review.scenes),
        report_time().strftime("%Y-%m-%d"),
        f"warpspace {__version__}",
    )


def _where(review: Review, painter: ReportFigures, embed: Embed | None) -> Section:
    """Where the error is: interactive view, statistics, maps."""
    blocks: list[Block | None] = [parts.statistics_table(review), parts.places_table(review)]
    for letter, reviewed in parts.letters(review):
        if embed is not None:
            page = embed(
                reviewed.scene,
                exaggeration=review.exaggeration,
                nodes=min(max(reviewed.picture.grid.shape), 21),
                loop=review.settings.loop,
                largest=review.largest_um,
            )
            title = parts.prefixed(letter, f"{reviewed.scene.title}: turn it with the mouse")
            blocks.append(Embedded(title, page))
        blocks += painter.evidence(reviewed)
    return parts.section("Where the error is", blocks)


def _why(review: Review) -> Section:
    """Contributions at the worst point of each scene."""
    blocks = [
        block
        for letter, reviewed in parts.letters(review)
        for block in parts.explanation_blocks(letter, reviewed)
    ]
    return parts.section("Error budget at the worst point", blocks)


def _differences(review: Review) -> Section:
    """Tell what distinguishes two scenes."""
    blocks: list[Block] = [parts.difference_table(review)]
    if review.difference is None:
        blocks.append(
            Text("A and B have different working volumes: no difference is formed.", "note")
        )
    return parts.section("What differs", blocks)


def _errors(review: Review) -> Section:
    """Parameters and tolerances."""
    tables = [parts.parameters_table(letter, scene) for letter, scene in parts.letters(review)]
    return parts.section("Errors and tolerances", tables)


def _once(review: Review) -> list[tuple[str, Reviewed]]:
    """Scenes whose machines differ: gains and tolerances of the same machine are printed once."""
    found: list[tuple[str, Reviewed]] = []
    for letter, reviewed in parts.letters(review):
        if not any(reviewed.gains == other.gains for _, other in found):
            found.append((letter, reviewed))
    return found if len(found) > 1 else [("", found[0][1])]


def _gains(review: Review, painter: ReportFigures) -> Section:
    """Gains of each machine."""
    blocks: list[Block | None] = []
    for letter, reviewed in _once(review):
        if not reviewed.gains:
            blocks.append(Text("The loop has no axis: no error arrives at the point.", "note"))
            continue
        blocks += [
            painter.gains(reviewed, f"{letter}: " if letter else ""),
            parts.gains_table(letter, reviewed.gains),
        ]
    return parts.section("How errors arrive at the point", blocks)


def _samplings(review: Review, painter: ReportFigures) -> Section:
    """Tell what the tolerances promise; once where they are the same."""
    blocks: list[Block] = []
    shown: list[Scene] = []
    for letter, reviewed in parts.letters(review):
        scene = reviewed.scene
        if any(
            scene.tolerances == other.tolerances and scene.model == other.model for other in shown
        ):
            blocks.append(Text(f"{letter}: the same tolerances, the same machines.", "note"))
            continue
        shown.append(scene)
        blocks += sampling_blocks(letter, reviewed)
        blocks += painter.sampling(reviewed, f"{letter}: " if letter else "")
    return parts.section("What the tolerances promise", blocks)
