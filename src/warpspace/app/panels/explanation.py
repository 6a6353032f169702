"""Contributions to the error of a point, distances between points, and volume statistics."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.analysis.commands.contributions import PointContribution
from warpspace.analysis.statistics import volume_statistics
from warpspace.analysis.uncertainty.propagation import NAMES
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, join, number, tag
from warpspace.app.browser.templates import Templates
from warpspace.app.drawing.camera import fit_camera
from warpspace.app.evaluation import point_explanation
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import POINTS, explain_point, pick_worst
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.block_html import block_html
from warpspace.app.panels.panel import Section, on
from warpspace.app.state.app_state import AppState
from warpspace.app.state.tree import EXAMPLE
from warpspace.field.evaluate import placed_words
from warpspace.machine.axes import parameter
from warpspace.picture import formatting
from warpspace.picture.formatting import length_words
from warpspace.scene.model import evaluate_grid
from warpspace.units import spell_count

FIRST = 3  # contributions listed at first; Details lists all
NOMINAL = "No errors: every point is at its nominal position."
DIFFERENCE = "Contributions are not available for the difference B − A: show A or B."
HTML = Templates("explanation")


class WorstPanel(Section):
    """The contributions to the error at the worst point, or at a selected one."""

    name, task, title = "worst", "understand", "Worst point"
    sentence = "Contributions to the largest error of the volume"
    _explanation: tuple[LivePicture, point_explanation.PointExplanation] | None = None

    def heading(self, picture: LivePicture) -> str:
        if picture.is_difference or self._is_nominal(picture):
            return self.title
        kind = self.title if picture.state.picked is None else "This point"
        explanation = self._explain(picture)
        length_um = explanation.length_um
        if picture.state.picked is None and not explanation.is_corrected:
            length_um = picture.largest_um  # of first order, as in the heading of the page
        return f"{kind}: {number(length_um)}{length_words(explanation.uncertainty)} µm"

    def body(self, picture: LivePicture) -> Markup:
        if picture.is_difference:
            return tag("p", DIFFERENCE, class_="ws-quiet")
        if self._is_nominal(picture):
            return tag("p", NOMINAL, class_="ws-quiet")
        explanation, state = self._explain(picture), picture.state
        at = "" if state.picked is None else _spelt(explanation.at)
        residual_um = None
        if explanation.is_corrected:
            residual_um = float(np.linalg.norm(explanation.drawn_um))
        uncertainty = _uncertainty(explanation, state.specification.limit_um)
        details = _details(explanation, state.lever)
        return HTML.worst(explanation, at, FIRST, parameter, residual_um, uncertainty, details)

    def _is_nominal(self, picture: LivePicture) -> bool:
        return picture.state.picked is None and not picture.field.error_um.any()

    def _explain(self, picture: LivePicture) -> point_explanation.PointExplanation:
        if self._explanation is None or self._explanation[0] is not picture:
            picked = picture.state.picked or pick_worst(picture)
            explanation = explain_point(picture.drawn_state, picked, picture.exaggeration)
            self._explanation = picture, explanation
        return self._explanation[1]

    @on(do.Signal.FORGET_POINT)
    def forget(self, state: AppState) -> AppState:
        return point_explanation.with_picked(state, None)

    @on(do.Input.SHOW_LEVER_OF)
    def show_lever_of(self, state: AppState, key: str) -> AppState | None:
        if key not in state.amplitudes:
            return None
        picture = self.context.picture
        if state.picked is None and picture is not None:
            state = point_explanation.with_picked(state, pick_worst(picture))
        return replace(state, lever="" if key == state.lever else key)

    @on(do.Signal.SHOW_LEVER, later=True)
    def show_lever(self) -> None:
        picture, camera = self.context.picture, self.context.camera.remember()
        if picture is None or picture.state.picked is None or picture.is_difference:
            return
        explanation = self._explain(picture)
        origins = [c.origin_mm + explanation.shift_mm for c in explanation.explanation.contributions
                   if c.key == picture.state.lever]  # fmt: skip
        if origins:
            points = np.concatenate([picture.drawn_mm.reshape(-1, 3), np.stack(origins)])
            room, fov_deg = self.context.camera.room, float(np.rad2deg(camera.fov_rad))
            pose = fit_camera(points, room.aspect, fov_deg=fov_deg, margins=room.margins)
            self.context.move_camera(pose)


def _spelt(positions: Mapping[str, float]) -> str:
    return formatting.spell_axes(positions).removeprefix("axes ")


def _uncertainty(explanation: point_explanation.PointExplanation, limit_um: float | None) -> Markup:
    """Render the probability of meeting the limit and the variance shares of |E|, largest first.

    Negative correlations give negative shares; all shares add up to 100 %.
    """
    uncertainty = explanation.uncertainty
    if uncertainty is None:
        return EMPTY
    if not uncertainty.errors.is_known:
        return join(tag("p", text, class_="ws-tiny") for text in uncertainty.errors.remarks())
    variances = uncertainty.variance_shares(uncertainty.response @ uncertainty.direction)
    shares = [(key, f"{number(100.0 * share, 0)} %") for key, share in variances.items()]
    shares = [(key, share) for key, share in shares if share != "0 %"]
    probability = None
    if limit_um is not None:
        probability = 100.0 * float(uncertainty.conformance_probability(limit_um))
    return HTML.uncertainty(length_words(uncertainty), shares, FIRST, limit_um, probability)


def _details(explanation: point_explanation.PointExplanation, lever: str) -> Markup:
    point, ranked = explanation.explanation, explanation.ranked
    lines: list[tuple[object, ...]] = [
        (HTML.axis_lever(c.key, parameter(c.key), c.key == lever), c.along_um, *c.error_um)
        for c in ranked
    ]
    lines.append(("second order", None, *point.remainder_um))
    lines.append(("sum", explanation.length_um, *point.error_um))
    columns = (Column("µm"), *number_columns(("along E", "x", "y", "z"), "+z.1f"))
    copied = "\n".join(
        "\t".join((c.key, f"{c.along_um:.3f}", *(f"{v:.3f}" for v in c.error_um))) for c in ranked
    )
    place = formatting.spell_in_r(point.nominal_mm + explanation.shift_mm)
    tilt, loop = float(np.linalg.norm(point.orientation_urad)), explanation.loop
    levers = [(c, parameter(c.key), _arm_mm(c)) for c in ranked if c.key == lever]
    return HTML.details(
        _spelt(explanation.at), EXAMPLE, place, formatting.LOOP_WORDS[loop], tilt,
        block_html(Table(columns, lines)), levers, copied,
    )  # fmt: skip


def _arm_mm(contribution: PointContribution) -> float | None:
    if not parameter(contribution.key).is_rotation:
        return None
    return float(np.linalg.norm(np.cross(contribution.direction, contribution.lever_mm)))


class DistancePanel(AnalysisPanel):
    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().body_dependencies(picture), picture.serial)

    def before_result(self, state: AppState) -> Markup:
        point, picture = point_explanation.awaited_form(state), self.context.picture
        drawn = picture and point_explanation.measure_distance(picture)
        note = "\n".join(drawn[0].lines()) if drawn else ""
        return HTML.distance(POINTS.get(point), any(map(state.forms.get, POINTS)), note)

    @on(do.Signal.PICK_POINTS, do.Signal.STOP_PICKING, do.Signal.CLEAR_POINTS)
    def set_points(self, state: AppState, signal: do.Signal) -> AppState:
        """Await both points; or await none, and keep or remove the present ones."""
        stops, points = signal is do.Signal.STOP_PICKING, dict[str, str]()
        if signal is do.Signal.PICK_POINTS:
            points = dict.fromkeys(POINTS, "")
        forms = {k: v for k, v in state.forms.items() if k not in POINTS or (stops and v)}
        return replace(state, forms=forms | points)


class VolumePanel(Section):
    """Mean, RMS, P95 and max of the position error, and the tilt of the tool."""

    name, task, title = "volume", "understand", "Volume statistics"
    sentence = "Mean, RMS, P95 and max of the position error, and of the tilt of the tool axis"

    def body(self, picture: LivePicture) -> Markup:
        statistics, state, grid = picture.statistics, picture.drawn_state, picture.grid
        u95 = {} if picture.uncertainty is None else picture.uncertainty.statistics()
        intervals = {NAMES[key]: formatting.u95_behind(value) for key, value in u95.items()}
        values = dict(zip(NAMES.values(), statistics.four, strict=True))
        tilt = None
        if not picture.is_difference:
            # the picture holds it only if the map is coloured by it
            tilt = volume_statistics(
                evaluate_grid(state.active_scene(), grid, picture.view).tilts, grid
            )
        loop = ", ".join((formatting.LOOP_WORDS[state.loop], *placed_words(state.view())))
        at, at_mm = _spelt(statistics.max_at_axes), formatting.spell_in_r(statistics.max_at_mm)
        return HTML.volume(
            values, intervals, tilt, spell_count(picture.field.norm_um.size), grid.extent_mm, loop,
            at, at_mm,
        )  # fmt: skip
