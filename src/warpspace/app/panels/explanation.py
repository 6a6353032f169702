"""Why a point is off, and the volume in numbers."""

from dataclasses import replace

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Column, Table, number_columns
from warpspace.analysis.commands.contributions import PointContribution
from warpspace.analysis.statistics import volume_statistics
from warpspace.analysis.uncertainty.propagation import NAMES
from warpspace.app.browser.html import (
    EMPTY,
    button,
    field,
    join,
    number,
    rows,
    signed,
    tag,
    text_box,
)
from warpspace.app.drawing.camera import fit_camera
from warpspace.app.evaluation.compare import without_words
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import (
    POINTS,
    PointExplanation,
    answer,
    awaited,
    measured,
    pick_worst,
    with_picked,
)
from warpspace.app.panels.analysis_panel import AnalysisPanel
from warpspace.app.panels.block_html import block_html
from warpspace.app.panels.panel import Section, actions
from warpspace.app.state.app_state import AppState
from warpspace.app.state.tree import EXAMPLE, put
from warpspace.field.evaluate import placed_words
from warpspace.machine.axes import parameter
from warpspace.picture.formatting import (
    LOOP_WORDS,
    length_words,
    spell_axes,
    spell_in_r,
    u95_behind,
)
from warpspace.scene.model import evaluate_grid
from warpspace.units import spell_count

FIRST = 3  # contributions in sight at once; all of them stand under Details
DIFFERENCE = "B − A is a difference: show A or B to see what the error of a point consists of."
ELSEWHERE = (
    "The largest contribution here may compensate others elsewhere: it is not always the one to"
    " adjust."
)


class WorstPanel(Section):
    """The error of the worst point, or of the one that was asked about, taken apart."""

    name, task, title = "worst", "understand", "Worst point"
    sentence = "What the largest error of the volume is made of"
    _found: tuple[LivePicture, PointExplanation] | None = None

    def heading(self, picture: LivePicture) -> str:
        if picture.is_difference:
            return self.title
        kind = self.title if picture.state.picked is None else "This point"
        explanation = self._answer(picture)
        return (
            f"{kind}: why {number(explanation.length_um)}{length_words(explanation.uncertainty)} µm"
        )

    def body(self, picture: LivePicture) -> Markup:
        if picture.is_difference:
            return tag("p", DIFFERENCE, class_="ws-quiet")
        explanation, controls = self._answer(picture), EMPTY
        if picture.state.picked is not None:
            reset = button("Worst point", "worst:forget", kind="link",
                          hint="Back to the worst point")  # fmt: skip
            pin = button("Pin a note", "notes:pin", kind="link", hint="Pin a note here (N)")
            controls = tag("p", join((_axes(explanation), " ", reset, " ", pin)))
        best = tag("div", "", data_piece="best")
        limit = picture.state.specification.limit_um
        details = tag("summary", "Details") + _details(explanation, picture.state.lever)
        details = tag("details", details, class_="ws-details", data_key="worst.details")
        return (
            controls
            + _contributions(explanation)
            + _uncertainty(explanation, limit)
            + best
            + details
        )

    def _answer(self, picture: LivePicture) -> PointExplanation:
        if self._found is None or self._found[0] is not picture:
            picked = picture.state.picked or pick_worst(picture)
            self._found = picture, answer(picture.drawn_state, picked, picture.exaggeration)
        return self._found[1]

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        if action == "set.at":
            return put(state, "picked", value)
        if action == "forget":
            return with_picked(state, None)
        if action == "lever" and value in state.amplitudes:
            picture = self.context.picture
            if state.picked is None and picture is not None:
                state = with_picked(state, pick_worst(picture))
            return replace(state, lever="" if value == state.lever else value)
        if action == "back":
            self.context.call_soon(self._stand_back)
        return state

    def _stand_back(self) -> None:
        picture, camera = self.context.picture, self.context.camera.remember()
        if picture is None or picture.state.picked is None or picture.is_difference:
            return
        explanation = self._answer(picture)
        contributions = explanation.explanation.contributions
        origins = [
            contribution.origin_mm + explanation.shift_mm
            for contribution in contributions
            if contribution.key == picture.state.lever
        ]
        if origins:
            points = np.concatenate([picture.drawn_mm.reshape(-1, 3), np.stack(origins)])
            room, fov_deg = self.context.camera.room, float(np.rad2deg(camera.fov_rad))
            pose = fit_camera(points, room.aspect, fov_deg=fov_deg, margins=room.margins)
            self.context.move_camera(pose)


def _axes(explanation: PointExplanation) -> str:
    return spell_axes(explanation.at).removeprefix("axes ")


def _contributions(explanation: PointExplanation) -> Markup:
    largest, n_others = explanation.ranked[:FIRST], len(explanation.ranked[FIRST:])
    remainder_um = explanation.length_um - sum(contribution.along_um for contribution in largest)
    # their names stand in the column of errors
    lines = [(tag("b", contribution.key, title=f"{parameter(contribution.key).name}: {signed(contribution.along_um)} µm"),
              signed(contribution.along_um)) for contribution in largest]  # fmt: skip
    if n_others or abs(remainder_um) >= 0.05:
        label = f"{n_others} more" if n_others else "second order"
        lines.append((tag("span", label, class_="ws-quiet"), signed(remainder_um)))
    if not lines:
        return tag("p", "No error acts at this point.", class_="ws-quiet")
    note = EMPTY
    if explanation.is_corrected:
        residual = number(float(np.linalg.norm(explanation.drawn_um)))
        note = tag("p", f"The table leaves {residual} µm of it, as drawn.")
    return rows(lines, "ws-rows ws-causes") + note


def _uncertainty(found: PointExplanation, limit_um: float) -> Markup:
    """Say what the uncertainty of |E| comes from, the largest share first, and if a limit is kept.

    Shares are below zero where correlations make it smaller; all of them add up to 100 %.
    """
    uncertainty = found.uncertainty
    if uncertainty is None or not uncertainty.errors.is_known:
        remarks = [] if uncertainty is None else uncertainty.errors.remarks()
        return join(tag("p", shares_text, class_="ws-tiny") for shares_text in remarks)
    parts = uncertainty.variance_shares(uncertainty.response @ uncertainty.direction)
    named = [(key, f"{number(100.0 * part, 0)} %") for key, part in parts.items()]
    named = [(key, share) for key, share in named if share != "0 %"]
    shares_text = ", ".join(f"{key} {share}" for key, share in named[:FIRST])
    probability_text = (
        f"|E| ≤ {limit_um:g} µm with {number(100.0 * float(uncertainty.keeps(limit_um)), 1)} %"
    )
    remarks = f"{probability_text}. U95{length_words(uncertainty)} µm, share of its variance: {shares_text}"
    others = rows(named[FIRST:]) if len(named) > FIRST else EMPTY
    others = others and tag("details", tag("summary", "All shares") + others, class_="ws-details",
                        data_key="worst.shares")  # fmt: skip
    return tag("p", remarks, class_="ws-tiny") + others


def _details(found: PointExplanation, lever: str) -> Markup:
    explained, parts = found.explanation, found.ranked
    lines: list[tuple[object, ...]] = [
        (button(part.key, "worst:lever", part.key, kind="link", pressed=part.key == lever,
                hint=f"{parameter(part.key).name}: draw its axis and lever"),
         part.along_um, *part.error_um)
        for part in parts
    ]  # fmt: skip
    lines.append(("second order", None, *explained.remainder_um))
    lines.append(("sum", found.length_um, *explained.error_um))
    columns = (Column("µm"), *number_columns(("along E", "x", "y", "z"), "+z.1f"))
    copied = "\n".join(
        "\t".join((part.key, f"{part.along_um:.3f}", *(f"{v:.3f}" for v in part.error_um)))
        for part in parts
    )
    where = spell_in_r(explained.nominal_mm + found.shift_mm)
    tilt = number(float(np.linalg.norm(explained.orientation_urad)))
    return tag("div", join((
        field("Point", text_box("worst:set.at", _axes(found), placeholder=EXAMPLE), "worst:set.at",
              hint="Positions of the axes; or click a point of the map or of a trace"),
        tag("p", f"{where} mm · {LOOP_WORDS[found.loop]} · tilt {tilt} µrad", class_="ws-tiny"),
        block_html(Table(columns, lines)), *(_lever(one) for one in parts if one.key == lever),
        tag("p", ELSEWHERE, class_="ws-tiny"),
        button("Copy", "worst:copied", kind="quiet", data_copy=f"key\talong\tx\ty\tz\n{copied}",
               hint="Copy the table, to be pasted into a spreadsheet"),
    )))  # fmt: skip


def _lever(part: PointContribution) -> Markup:
    row, how = parameter(part.key), "along the direction drawn"
    if row.is_rotation:
        arm = float(np.linalg.norm(np.cross(part.direction, part.lever_mm)))
        how = f"× {number(arm, 0)} mm across the axis"
    look = button("Show the whole lever", "worst:back", kind="link",
                  hint="Move the camera back until axis, lever and box are in view")  # fmt: skip
    return tag("p", join((f"{part.key}: {signed(part.value)} {row.unit} {how} ", look)))


class DistancePanel(AnalysisPanel):
    """Distance and angle between points that are picked on the map."""

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().body_dependencies(picture), id(picture))

    def before_result(self, state: AppState) -> Markup:
        point, drawn = awaited(state), self.context.picture and measured(self.context.picture)
        hint = "Click two points of the map, and a third for an angle"
        buttons = [button("Pick points", f"{self.name}:pick", kind="main", hint=hint)]
        if point:
            buttons = [button("Stop", f"{self.name}:stop")]
        if any(map(state.forms.get, POINTS)):
            buttons.append(button("Clear", f"{self.name}:clear", kind="quiet",
                                  hint="Take the points out of the drawing"))  # fmt: skip
        if drawn:
            buttons.append(button("Pin", "notes:pin", "\n".join(drawn[0].words()),
                                  hint="Write a note with these numbers"))  # fmt: skip
        status = tag("p", POINTS[point], role="status") if point else EMPTY
        return actions(*buttons) + status + tag("p", without_words(state), class_="ws-tiny")

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        if action not in ("pick", "stop", "clear"):
            return super().handle(state, action, value)
        picked = {name: text for name in POINTS if (text := state.forms.get(name))}
        points = {"pick": dict.fromkeys(POINTS, ""), "stop": picked, "clear": {}}[action]
        other_forms = {name: text for name, text in state.forms.items() if name not in POINTS}
        return replace(state, forms={**other_forms, **points})


class VolumePanel(Section):
    """Mean, RMS, P95 and max of the position error, and the tilt of the tool."""

    name, task, title = "volume", "understand", "Volume in numbers"
    sentence = "Mean, RMS, P95 and max of the position error, and of the tilt of the tool axis"

    def body(self, picture: LivePicture) -> Markup:
        statistics, state = picture.statistics, picture.drawn_state
        u95 = {} if picture.uncertainty is None else picture.uncertainty.statistics()
        intervals = {NAMES[key]: u95_behind(value) for key, value in u95.items()}
        lines = [(name, f"{number(value, 2)}{intervals.get(name, '')} µm")
                 for name, value in zip(NAMES.values(), statistics.four, strict=True)]  # fmt: skip
        if not picture.is_difference:
            # the picture has it only where it is coloured
            errors = evaluate_grid(state.active_scene(), picture.grid, picture.view)
            tilt = volume_statistics(errors.tilts, picture.grid)
            lines += [("tilt, mean", f"{number(tilt.mean_um)} µrad"),
                      ("tilt, max", f"{number(tilt.max_um)} µrad")]  # fmt: skip
        size = " × ".join(number(float(edge), 0) for edge in picture.grid.extent_mm)
        lines += [
            ("nodes", spell_count(picture.field.norm_um.size)),
            ("volume", f"{size} mm"),
            ("loop", ", ".join((LOOP_WORDS[state.loop], *placed_words(state.view())))),
        ]
        at = spell_axes(statistics.max_at_axes).removeprefix("axes ")
        where = f"max at {at} · {spell_in_r(statistics.max_at_mm)} mm"
        return rows(lines) + tag("p", where, class_="ws-tiny")
