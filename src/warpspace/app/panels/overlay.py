"""What lies over the drawing: heading, colour bar, words and scale bars, pointers of other tabs."""

import time
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, fill, join, menu, tag, text_box
from warpspace.app.browser.viser_private import queued
from warpspace.app.documents.legend import (
    legend_html,
    numbers_words,
    order_conditions,
    part_html,
    place_words,
    subject_words,
    within_limit_words,
)
from warpspace.app.drawing.camera import read_room
from warpspace.app.drawing.labels import Label, axis_labels, note_labels, point_labels
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import pick
from warpspace.app.panels.design import allowed_words
from warpspace.app.panels.panel import Context, Panel, Refresh
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.geometry.surfaces import corners
from warpspace.machine.axes import is_linear
from warpspace.picture.formatting import spell_factor
from warpspace.picture.map_mesh import isoline_labels
from warpspace.units import Array, spell_short


class HeadPanel(Panel):
    """Mean and max with the place of the latter."""

    name = "head"
    refresh = Refresh.IMMEDIATE

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        words, place = subject_words(picture), place_words(picture)
        head = fill(
            '<div data-piece="reopened"></div><h1>{numbers}</h1>'
            '<div>{place}<span data-piece="head.kept"></span>'
            '<span data-piece="head.allowed"></span></div>{words}'
            '<div data-piece="head.order"></div>',
            numbers=numbers_words(picture), place=place,
            words=(tag("p", " · ".join(words), class_="ws-subject") if words else EMPTY)
            + part_html(picture),
        )  # fmt: skip
        return {"head": head}


class LegendPanel(Panel):
    """The colour bar, and how much of the volume keeps the limit."""

    name = "legend"
    refresh = Refresh.THROTTLED

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (picture.scale, id(picture))

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        kept = EMPTY
        if not picture.is_difference:
            (words, is_kept), limit = (
                within_limit_words(picture),
                picture.state.specification.limit_um,
            )
            box = text_box("state:set.specification.limit_um", f"{limit:g}", size="short",
                           label="Limit", id="ws-limit")  # fmt: skip
            body = tag("div", join(("Limit ", box, " µm")), class_="ws-field")
            kept = menu(words, body, key="limit", hint="Change the limit",
                        kind="ws-kept" if is_kept else "ws-missed")  # fmt: skip
            kept = Markup(" · ") + kept if place_words(picture) else kept
        return {"head.kept": kept, "legend": legend_html(picture)}


class OrderPanel(Panel):
    """What machines within tolerance reach, what the first order leaves out, errors left behind.

    All but the last are too slow for every move.
    """

    name = "order"
    refresh = Refresh.IDLE

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        words, left = [*order_conditions(picture)], picture.state.left_behind
        words += [f"with its own errors; those of “{left}” are left behind"] if left else []
        allowed = "" if picture.is_difference else allowed_words(picture.drawn_state)
        return {"head.order": tag("p", " · ".join(words)) if words else EMPTY,
                "head.allowed": f" · {allowed}" if allowed else ""}  # fmt: skip


class RoomPanel(Panel):
    """What the page places by itself as the camera moves, and how large the drawing is."""

    name = "room"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._sent: dict[str, Any] = {}

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        facts = _facts(picture)
        changes = {name: value for name, value in facts.items() if self._sent.get(name) != value}
        if changes:
            self.context.page.call("room.show", changes)
        self._sent = facts
        return {}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        room, context = read_room(value) if word == "size" else None, self.context
        if room is not None:
            context.act(lambda: context.camera.take_room(room, context.shown))
        return state


def _facts(picture: LivePicture) -> dict[str, Any]:
    look, grid = picture.state.look, picture.grid
    isolines = look.isolines and look.surface != "grid"
    bounds = [one.grid.bounds_mm for one in picture.slices]
    return {
        "axes": _words(Identity(axis_labels(picture))),
        "triad": [
            {"name": name if name and is_linear(name) else "xyz"[k],
             "way": [float(k == i) * way for i in range(3)]}
            for k, (name, way) in enumerate(zip(grid.axes, grid.ways.tolist(), strict=True))
        ],
        "perMm": SCENE_PER_MM,
        "centre": _scene(grid.bounds_mm.mean(axis=0)),
        "bars": look.bars,
        "solid": look.surface in ("surface", "cut"),
        "factor": picture.exaggeration,
        "spelt": spell_factor(picture.exaggeration),
        "corners": [_scene(at) for at in picture.drawn_mm.reshape(-1, 3)[corners(picture.shape)]],
        "marks": list(map(_word, (*point_labels(picture), *note_labels(picture)))),
        "labels": [
            {"at": _scene(label.at_mm), "out": label.outward.tolist(),
             "text": f"{spell_short(label.value)} {picture.scale.unit}"}
            for label in (isoline_labels(picture) if isolines else ())
        ],
        "slices": [
            {"axis": (axis := int((high - low).argmin())), "at": _scene(low)[axis],
             "low": _scene(low), "high": _scene(high)}
            for low, high in bounds
        ],
    }  # fmt: skip


def _scene(point_mm: Array) -> list[float]:
    return [round(value * SCENE_PER_MM, 4) for value in point_mm.tolist()]


@lru_cache(maxsize=32)
def _words(labels: Identity) -> list[dict[str, Any]]:
    return list(map(_word, labels.target))


def _word(label: Label) -> dict[str, Any]:
    found = {"text": label.text, "at": _scene(label.at_mm), "kind": label.kind}
    if label.from_mm is not None:
        found |= {"from": _scene(label.from_mm), "axis": label.axis}
    return found


# --- A shared review: each tab sees where the others point ----------------------------------------

OFTEN_S = 0.08  # between two places of one pointer; a page sends one each tenth of a second
LONGEST_NAME, LONGEST_RAY = 24, 200  # characters
MOST_QUEUED = 8  # messages that wait for a page; one that takes none is sent no pointers
Tabs = Callable[[], Iterable[Context]]


class PointerPanel(Panel):
    """Takes where the mouse is over the map: ``pointer:at``, a name, then a ray of six numbers."""

    name = "pointer"

    def __init__(self, context: Context, tabs: Tabs) -> None:
        super().__init__(context)
        self._tabs, self._last = tabs, 0.0
        context.page.call("together")

    def take(self, state: AppState, word: str, value: str) -> AppState:
        now, picture, at = time.monotonic(), self.context.shown, None
        spelt, _, name = value.partition("\n")
        if word == "at":
            if len(spelt) > LONGEST_RAY or now - self._last < OFTEN_S or self.context.telling:
                return state
            try:
                ray = np.array([float(one) for one in spelt.split(",")]).reshape(2, 3)
            except ValueError:  # not six numbers; what is not finite or too far meets nothing
                return state
            self._last = now
            found = picture and pick(picture, ray[0] / SCENE_PER_MM, ray[1])
            at = found and (found[1] * SCENE_PER_MM).round(4).tolist()
        for one in self._tabs():
            if one is not self.context and not one.telling and queued(one.client) <= MOST_QUEUED:
                said = " ".join(name[:LONGEST_NAME].split())
                one.page.call("pointer", self.context.client.client_id, said, at)
        return state
