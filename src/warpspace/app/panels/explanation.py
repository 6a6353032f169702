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
        found = self._answer(picture)
        return f"{kind}: why {number(found.length_um)}{length_words(found.uncertainty)} µm"

    def body(self, picture: LivePicture) -> Markup:
        if picture.is_difference:
            return tag("p", DIFFERENCE, class_="ws-quiet")
        found, asked = self._answer(picture), EMPTY
        if picture.state.picked is not None:
            back = button("Worst point", "worst:forget", kind="link",
                          hint="Back to the worst point")  # fmt: skip
            pin = button("Pin a note", "notes:pin", kind="link", hint="Pin a note here (N)")
            asked = tag("p", join((_axes(found), " ", back, " ", pin)))
        best = tag("div", "", data_piece="best")
        limit = picture.state.specification.limit_um
        details = tag("summary", "Details") + _details(found, picture.state.lever)
        details = tag("details", details, class_="ws-details", data_key="worst.details")
        return asked + _contributions(found) + _uncertainty(found, limit) + best + details

    def _answer(self, picture: LivePicture) -> PointExplanation:
        if self._found is None or self._found[0] is not picture:
            picked = picture.state.picked or pick_worst(picture)
            self._found = picture, answer(picture.drawn_state, picked, picture.exaggeration)
        return self._found[1]

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "set.at":
            return put(state, "picked", value)
        if word == "forget":
            return with_picked(state, None)
        if word == "lever" and value in state.amplitudes:
            shown = self.context.shown
            if state.picked is None and shown is not None:
                state = with_picked(state, pick_worst(shown))
            return replace(state, lever="" if value == state.lever else value)
        if word == "back":
            self.context.act(self._stand_back)
        return state

    def _stand_back(self) -> None:
        picture, camera = self.context.shown, self.context.camera.remember()
        if picture is None or picture.state.picked is None or picture.is_difference:
            return
        found = self._answer(picture)
        parts = found.explanation.contributions
        origins = [p.origin_mm + found.shift_mm for p in parts if p.key == picture.state.lever]
        if origins:
            points = np.concatenate([picture.drawn_mm.reshape(-1, 3), np.stack(origins)])
            room, fov_deg = self.context.camera.room, float(np.rad2deg(camera.fov_rad))
            pose = fit_camera(points, room.aspect, fov_deg=fov_deg, margins=room.margins)
            self.context.look_from(pose)


def _axes(found: PointExplanation) -> str:
    return spell_axes(found.at).removeprefix("axes ")


def _contributions(found: PointExplanation) -> Markup:
    first, others = found.ranked[:FIRST], len(found.ranked[FIRST:])
    left = found.length_um - sum(part.along_um for part in first)
    # their names stand in the column of errors
    lines = [(tag("b", part.key, title=f"{parameter(part.key).name}: {signed(part.along_um)} µm"),
              signed(part.along_um)) for part in first]  # fmt: skip
    if others or abs(left) >= 0.05:
        words = f"{others} more" if others else "second order"
        lines.append((tag("span", words, class_="ws-quiet"), signed(left)))
    if not lines:
        return tag("p", "No error acts at this point.", class_="ws-quiet")
    told = EMPTY
    if found.is_corrected:
        rest = number(float(np.linalg.norm(found.drawn_um)))
        told = tag("p", f"The table leaves {rest} µm of it, as drawn.")
    return rows(lines, "ws-rows ws-causes") + told


def _uncertainty(found: PointExplanation, limit_um: float) -> Markup:
    """Say what the uncertainty of |E| comes from, the largest share first, and if a limit is kept.

    Shares are below zero where correlations make it smaller; all of them add up to 100 %.
    """
    sure = found.uncertainty
    if sure is None or not sure.errors.is_known:
        words = [] if sure is None else sure.errors.remarks()
        return join(tag("p", said, class_="ws-tiny") for said in words)
    parts = sure.variance_shares(sure.response @ sure.direction)
    named = [(key, f"{number(100.0 * part, 0)} %") for key, part in parts.items()]
    named = [(key, share) for key, share in named if share != "0 %"]
    said = ", ".join(f"{key} {share}" for key, share in named[:FIRST])
    probability = float(sure.conformance_probability(limit_um))
    kept = f"|E| ≤ {limit_um:g} µm with {number(100.0 * probability, 1)} %"
    words = f"{kept}. U95{length_words(sure)} µm, share of its variance: {said}"
    rest = rows(named[FIRST:]) if len(named) > FIRST else EMPTY
    rest = rest and tag("details", tag("summary", "All shares") + rest, class_="ws-details",
                        data_key="worst.shares")  # fmt: skip
    return tag("p", words, class_="ws-tiny") + rest


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

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        return (*super().concerns(picture), id(picture))

    def before_result(self, state: AppState) -> Markup:
        point, drawn = awaited(state), self.context.shown and measured(self.context.shown)
        hint = "Click two points of the map, and a third for an angle"
        buttons = [button("Pick points", f"{self.name}:pick", kind="main", hint=hint)]
        if point:
            buttons = [button("Stop", f"{self.name}:stop")]
        if any(map(state.forms.get, POINTS)):
            buttons.append(button("Clear", f"{self.name}:clear", kind="quiet",
                                  hint="Take the points out of the drawing"))  # fmt: skip
        if drawn:
            buttons.append(button("Pin", "notes:pin", "\n".join(drawn[0].lines()),
                                  hint="Write a note with these numbers"))  # fmt: skip
        said = tag("p", POINTS[point], role="status") if point else EMPTY
        return actions(*buttons) + said + tag("p", without_words(state), class_="ws-tiny")

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word not in ("pick", "stop", "clear"):
            return super().take(state, word, value)
        picked = {one: text for one in POINTS if (text := state.forms.get(one))}
        points = {"pick": dict.fromkeys(POINTS, ""), "stop": picked, "clear": {}}[word]
        others = {one: text for one, text in state.forms.items() if one not in POINTS}
        return replace(state, forms={**others, **points})


class VolumePanel(Section):
    """Mean, RMS, P95 and max of the position error, and the tilt of the tool."""

    name, task, title = "volume", "understand", "Volume in numbers"
    sentence = "Mean, RMS, P95 and max of the position error, and of the tilt of the tool axis"

    def body(self, picture: LivePicture) -> Markup:
        found, state = picture.statistics, picture.drawn_state
        u95 = {} if picture.uncertainty is None else picture.uncertainty.statistics()
        sure = {NAMES[key]: u95_behind(value) for key, value in u95.items()}
        lines = [(name, f"{number(value, 2)}{sure.get(name, '')} µm")
                 for name, value in zip(NAMES.values(), found.four, strict=True)]  # fmt: skip
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
        at = spell_axes(found.max_at_axes).removeprefix("axes ")
        where = f"max at {at} · {spell_in_r(found.max_at_mm)} mm"
        return rows(lines) + tag("p", where, class_="ws-tiny")
