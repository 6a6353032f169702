"""The figures of a report, drawn by name; one that cannot be drawn leaves a note in its place."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from warpspace.analysis.gains import DEFAULT_SHARE
from warpspace.exceptions import WarpspaceError
from warpspace.outputs.figures.catalogue import figure_kinds
from warpspace.outputs.report.blocks import Block, Picture, Text
from warpspace.outputs.report.review import Review, Reviewed
from warpspace.outputs.report.wording import factor_words
from warpspace.picture.traces import trace_lines
from warpspace.scene.concepts import ConceptPlan
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from warpspace.outputs.worker import FigureWorker

MOST_GAINS = 20
PAPER_SHARE = 0.87
"""Width of a map among the evidence: two of them then stand on a page."""


class ReportFigures:
    """Draws the figures of one report.

    Parameters
    ----------
    worker : FigureWorker
        Draws maps in a process of its own.
    review : Review
    form : str
        "svg" or "pdf".
    """

    def __init__(self, worker: "FigureWorker", review: Review, form: str) -> None:
        self._worker, self._review, self._form = worker, review, form

    def first(self) -> Block:
        """Draw the figure of the page read first; failing to draw it ends the report.

        Raises
        ------
        RenderError
            If nothing can be drawn on this system.
        """
        scenes = [reviewed.scene for reviewed in self._review.scenes]
        if self._compares:
            caption = f"A, B and their difference; {factor_words(self._review.exaggeration)}."
            return self._map("comparison", scenes, caption)
        return self._map("error-map", scenes[:1], self._map_caption(scenes[0]))

    @property
    def _compares(self) -> bool:
        """Whether two scenes are drawn beside each other on the page read first."""
        return len(self._review.scenes) == 2

    def evidence(self, reviewed: Reviewed) -> list[Block]:
        """Draw the maps of one scene: its error map and whatever else the catalogue has."""
        scene = reviewed.scene
        left_out = self._left_out(reviewed)
        wanted = [
            (kind.name, kind.caption)
            for kind in figure_kinds()
            if kind.evidence and kind.name not in left_out
        ]
        found: list[Block] = []
        if reviewed is not self._review.scenes[0] or self._compares:
            wanted.insert(0, ("error-map", self._map_caption(scene)))
        for name, caption in wanted:
            try:
                found.append(self._map(name, [scene], caption, PAPER_SHARE))
            except WarpspaceError as error:
                found.append(Text(f"{caption} {error}", "note"))
        return found

    def _left_out(self, reviewed: Reviewed) -> set[str]:
        """Name the figures that would tell nothing: no trace displaced, the same machine again."""
        left_out: set[str] = set()
        if not any(trace.error_um.any() for trace in trace_lines(reviewed.picture.traces)):
            left_out.add("traces")
        if reviewed is not self._review.scenes[0]:
            left_out.add("machine")
        return left_out

    def repair(self, reviewed: Reviewed, prefix: str) -> Block:
        """Draw the volume before and after the repair, with bars of what each error does."""
        caption = f"{prefix}Before and after the last set of the table; bars of the whole volume."
        try:
            return self._map("repair", [reviewed.scene], caption)
        except WarpspaceError as error:
            return Text(f"{caption} {error}", "note")

    def concepts(
        self, scenes: Sequence[Scene], plan: ConceptPlan, loop: str, caption: str
    ) -> Picture:
        """Draw machines side by side."""
        from warpspace.outputs.drawing.settings import FigureSettings

        grid = self._review.settings.grid
        settings = FigureSettings(loop=loop, grid=grid, concepts=plan)
        data = self._worker.render("concepts", scenes, settings, self._form)
        return Picture("concepts", caption, data, self._form)

    def gains(self, reviewed: Reviewed, prefix: str) -> Block | None:
        """Bars of the gains; none where the loop has no axis."""
        from warpspace.outputs.charts.gains import gains_chart

        if not reviewed.gains:
            return None
        shown = reviewed.gains[:MOST_GAINS]
        figure = gains_chart(
            shown, f"{prefix}Error gains", self._loop_words(reviewed), DEFAULT_SHARE
        )
        return self._chart("gains", figure, f"{prefix}Gains of the {len(shown)} largest errors.")

    def sampling(self, reviewed: Reviewed, prefix: str) -> list[Block]:
        """Histogram of sampled machines and bars of what their variance comes from."""
        from warpspace.outputs.charts.gains import contributions_chart
        from warpspace.outputs.charts.histogram import montecarlo_chart

        sampling = reviewed.sampling
        if sampling is None:
            return []
        machines = f"{sampling.sampled.plan.samples:,} machines".replace(",", " ")
        figure = montecarlo_chart(
            sampling.sampled,
            f"{prefix}{reviewed.scene.title}",
            f"{machines}, one random point each",
        )
        shares = replace(sampling.shares, rows=sampling.shares.rows[:MOST_GAINS])
        bars = contributions_chart(
            shares, f"{prefix}Which tolerances matter", self._loop_words(reviewed)
        )
        return [
            self._chart("montecarlo", figure, f"{prefix}Volumetric error of sampled machines."),
            self._chart("variance", bars, f"{prefix}Shares of the variance."),
        ]

    def _loop_words(self, reviewed: Reviewed) -> str:
        """Say what a chart is about."""
        return f"{reviewed.scene.machine.title}, {self._review.settings.loop} loop"

    def _map_caption(self, scene: Scene) -> str:
        """Caption of an error map."""
        own = "; colour scale of its own" if len(self._review.scenes) == 2 else ""
        return f"Error map of {scene.title}; {factor_words(self._review.exaggeration)}{own}."

    def _map(self, name: str, scenes: Sequence[Scene], caption: str, width: float = 1.0) -> Picture:
        """Draw a figure of the catalogue."""
        from warpspace.outputs.drawing.settings import FigureSettings

        settings = FigureSettings(
            # the lean of the tool axis has a factor of its own, at which it is seen
            exaggeration="auto" if name == "orientation-map" else self._review.exaggeration,
            loop=self._review.settings.loop,
            grid=self._review.settings.grid,
        )
        data = self._worker.render(name, scenes, settings, self._form)
        return Picture(name, caption, data, self._form, width)

    def _chart(self, name: str, figure: "Figure", caption: str) -> Picture:
        """Spell a chart as a file."""
        from warpspace.outputs.encoding import encode_figure

        return Picture(name, caption, encode_figure(figure, self._form), self._form)
