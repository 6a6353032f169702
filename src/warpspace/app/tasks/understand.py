"""Why a point is off, the volume in numbers, and gains."""

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from warpspace.analysis.contributions import Contribution
from warpspace.analysis.description import Result
from warpspace.analysis.gains import GainsResult
from warpspace.app.browser.html import (
    EMPTY,
    button,
    field,
    fill,
    join,
    number,
    rows,
    signed,
    tag,
    text_box,
    thousands,
)
from warpspace.app.evaluation.budget import Answer, answer, pick_worst, with_lever, with_picked
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.tree import EXAMPLE, put
from warpspace.app.tasks.analysis import AnalysisPart, details_html
from warpspace.app.tasks.parts import Section
from warpspace.app.viewport.camera import fit_camera
from warpspace.field.evaluate import placed_words
from warpspace.machine.axes import parameter
from warpspace.picture.words import LOOP_WORDS, spell_at, spell_axes, spell_in_r
from warpspace.scene.model import evaluate_grid
from warpspace.units import MINUS

SHOWN_GAINS = 10
FIRST = 3  # contributions in sight at once; all of them stand under Details
DIFFERENCE = "B − A is a difference: show A or B to see what the error of a point consists of."


class WorstPart(Section):
    """The error of the worst point, or of the one that was asked about, taken apart."""

    name, task, title = "worst", "understand", "Worst point"
    sentence = "What the largest error of the volume is made of"
    _found: tuple[LivePicture, Answer] | None = None

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow every picture, as far as the drawing does."""
        return (id(picture), picture.state.picked, picture.state.lever)

    def heading(self, picture: LivePicture) -> str:
        """Say whose error it is."""
        if picture.is_difference:
            return self.title
        found = self._answer(picture)
        kind = "Worst point" if picture.state.picked is None else "This point"
        return f"{kind}: why {number(_length(found))} µm"

    def body(self, picture: LivePicture) -> Markup:
        """Write the largest contributions, the best adjustment, and the details."""
        if picture.is_difference:
            return tag("p", DIFFERENCE, class_="ws-quiet")
        found = self._answer(picture)
        state = picture.state
        asked = EMPTY
        if state.picked is not None:
            back = button(
                "Worst point", "worst:forget", kind="link", hint="Back to the worst point"
            )
            asked = tag("p", join((spell_axes(found.at).removeprefix("axes "), " ", back)))
        more = _details(found, state.lever)
        return join((
            asked,
            _contributions(found),
            tag("div", "", data_piece="best"),
            tag("details", tag("summary", "Details") + more, class_="ws-details",
                data_key="worst.details"),
        ))  # fmt: skip

    def _answer(self, picture: LivePicture) -> Answer:
        if self._found is None or self._found[0] is not picture:
            picked = picture.state.picked or pick_worst(picture)
            self._found = picture, answer(picture.drawn_state, picked, picture.exaggeration)
        return self._found[1]

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Ask about another point, draw a lever, or look at all of it."""
        if word == "set.at":
            return put(state, "picked", value)
        if word == "forget":
            return with_picked(state, None)
        if word == "lever" and value in state.amplitudes:
            shown = self.context.shown
            if state.picked is None and shown is not None:
                state = with_picked(state, pick_worst(shown))
            return with_lever(state, value)
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
        if not origins:
            return
        points = np.concatenate([picture.drawn_mm.reshape(-1, 3), np.stack(origins)])
        room = self.context.camera.room
        fov = float(np.rad2deg(camera.fov_rad))
        self.context.look_from(fit_camera(points, room.aspect, fov_deg=fov, margins=room.margins))


def _length(found: Answer) -> float:
    return float(np.linalg.norm(found.explanation.error_um))


def _ranked(found: Answer) -> list[Contribution]:
    return sorted(found.explanation.contributions, key=lambda part: -abs(part.along_um))


def _contributions(found: Answer) -> Markup:
    """Say the largest, and what all else comes to; together they are the error."""
    ranked = _ranked(found)
    first = ranked[:FIRST]
    left = _length(found) - sum(part.along_um for part in first)
    lines = [_line(part) for part in first]
    if others := len(ranked) - len(first):
        words = f"{others} more" if others > 1 else "1 more"
        lines.append((tag("span", words, class_="ws-quiet"), signed(left)))
    elif abs(left) >= 0.05:
        lines.append((tag("span", "second order", class_="ws-quiet"), signed(left)))
    if not lines:
        return tag("p", "No error acts at this point.", class_="ws-quiet")
    told = EMPTY
    if found.is_corrected:
        rest = number(float(np.linalg.norm(found.drawn_um)))
        told = tag("p", f"The table leaves {rest} µm of it, as drawn.")
    return rows(lines, "ws-rows ws-causes") + told


def _line(part: Contribution) -> tuple[Markup, str]:
    row = parameter(part.key)
    # its name stands in the column of errors
    return tag("b", part.key, title=f"{row.name}: {signed(part.along_um)} µm"), signed(
        part.along_um
    )


def _details(found: Answer, lever: str) -> Markup:
    explained = found.explanation
    at = spell_axes(found.at).removeprefix("axes ")
    where = spell_in_r(explained.nominal_mm + found.shift_mm)
    parts = _ranked(found)
    lines: list[tuple[object, ...]] = [
        (button(part.key, "worst:lever", part.key, kind="link", pressed=part.key == lever,
                hint=f"{parameter(part.key).name}: draw its axis and lever"),
         signed(part.along_um), *map(signed, part.error_um))
        for part in parts
    ]  # fmt: skip
    lines.append(("second order", "", *map(signed, explained.remainder_um)))
    lines.append((tag("b", "sum"), number(_length(found)), *map(signed, explained.error_um)))
    body = join(
        tag("tr", tag("th", one[0]) + join(tag("td", v, class_="number") for v in one[1:]))
        for one in lines
    )
    heads = join(tag("th", one, class_="number") for one in ("along E", "x", "y", "z"))
    table = tag("table", tag("thead", tag("tr", tag("th", "µm") + heads)) + tag("tbody", body))
    copied = "\n".join(
        "\t".join((part.key, f"{part.along_um:.3f}", *(f"{v:.3f}" for v in part.error_um)))
        for part in parts
    )
    chosen = [_lever(part) for part in parts if part.key == lever]
    return tag("div", join((
        field("Point", text_box("worst:set.at", at, placeholder=EXAMPLE), "worst:set.at",
              hint="Positions of the axes; or click a point of the map or of a trace"),
        tag("p", f"{where} mm · {LOOP_WORDS[found.loop]} · tilt"
            f" {number(float(np.linalg.norm(explained.orientation_urad)))} µrad",
            class_="ws-tiny"),
        table, *chosen,
        tag("p", "The largest contribution here may compensate others elsewhere: it is not always"
            " the one to adjust.", class_="ws-tiny"),
        button("Copy", "worst:copied", kind="quiet", data_copy=f"key\talong\tx\ty\tz\n{copied}",
               hint="Copy the table, to be pasted into a spreadsheet"),
    )))  # fmt: skip


def _lever(part: Contribution) -> Markup:
    row = parameter(part.key)
    if row.is_rotation:
        arm = float(np.linalg.norm(np.cross(part.direction, part.lever_mm)))
        words = f"{signed(part.value)} {row.unit} × {number(arm, 0)} mm across the axis"
    else:
        words = f"{signed(part.value)} {row.unit} along the direction drawn"
    look = button("Show the whole lever", "worst:back", kind="link",
                  hint="Move the camera back until axis, lever and box are in view")  # fmt: skip
    return tag("p", join((f"{part.key}: {words} ", look)))


# --- The volume in numbers ------------------------------------------------------------------------


class VolumePart(Section):
    """Mean, RMS, P95 and max of the position error, and the tilt of the tool."""

    name, task, title = "volume", "understand", "Volume in numbers"
    sentence = "Mean, RMS, P95 and max of the position error, and of the tilt of the tool axis"

    def body(self, picture: LivePicture) -> Markup:
        """Write the table."""
        found, state = picture.statistics, picture.drawn_state
        weights = picture.grid.weights
        lines: list[tuple[object, object]] = [
            (name, f"{number(value, 2)} µm")
            for name, value in (("mean", found.mean_um), ("RMS", found.rms_um),
                                ("P95", found.p95_um), ("max", found.max_um))
        ]  # fmt: skip
        if not picture.is_difference:
            # the picture has it only where it is coloured
            errors = evaluate_grid(state.active_scene(), picture.grid, picture.view)
            tilt = np.linalg.norm(errors.orientation_urad, axis=-1).reshape(picture.shape)
            lines += [
                ("tilt, mean", f"{number(float(np.sum(weights * tilt)))} µrad"),
                ("tilt, max", f"{number(float(tilt.max()))} µrad"),
            ]
        at = spell_axes(found.max_at_axes).removeprefix("axes ")
        loop = ", ".join((LOOP_WORDS[state.loop], *placed_words(state.view())))
        size = " × ".join(number(float(edge), 0) for edge in picture.grid.extent_mm)
        lines += [
            ("nodes", thousands(picture.field.norm_um.size)), ("volume", f"{size} mm"),
            ("loop", loop),
        ]  # fmt: skip
        where = fill('<p class="ws-tiny">max at {at} · {point} mm</p>', at=at,
                     point=spell_in_r(found.max_at_mm))  # fmt: skip
        return rows(lines) + where


# --- Gains ----------------------------------------------------------------------------------------


class GainsPart(AnalysisPart):
    """How far each error moves the point that was asked about, per µm or µrad."""

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Ask at the point that was asked about; else in the middle of the volume."""
        picked = state.picked
        own = {} if picked is None else {"at": spell_at(picked.at)}
        return {**super().defaults(state), **own}

    def headline(self, found: Result) -> Markup:
        """Say where."""
        words = found.where if isinstance(found, GainsResult) else ""
        return tag("p", words.partition(" · ")[2].replace(" -", f" {MINUS}"), class_="ws-quiet")

    def result_html(self, found: Result) -> Markup:
        """Draw the largest gains as bars; levers and components are folded."""
        if not isinstance(found, GainsResult):
            return super().result_html(found)
        first = [one for one in found.gains[:SHOWN_GAINS] if one.norm > 0.0]
        longest = max((one.norm for one in first), default=1.0)
        lines = join(
            fill('<div class="ws-pair"><span><b>{key}</b> {words}</span>'
                 '<span>{gain} {unit}</span></div><div class="ws-effect">'
                 '<i style="width:{share}%"></i></div>', key=one.key, words=one.parameter.name,
                 gain=number(one.norm, 3), unit=one.unit, share=number(100.0 * one.norm / longest))
            for one in first
        )  # fmt: skip
        return lines + details_html(found.blocks())
