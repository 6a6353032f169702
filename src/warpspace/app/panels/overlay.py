"""The overlay of the drawing: heading, colour bar, labels, scale bars, pointers of other tabs."""

import time
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, fill, join, menu, tag, text_box
from warpspace.app.browser.viser_private import queued
from warpspace.app.documents import legend
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
    """Mean and maximum error, and the place of the maximum."""

    name = "head"
    refresh = Refresh.IMMEDIATE

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        subjects, place = legend.subject_words(picture), legend.place_words(picture)
        head = fill(
            '<div data-piece="reopened"></div><h1>{numbers}</h1>'
            '<div>{place}<span data-piece="head.kept"></span>'
            '<span data-piece="head.allowed"></span></div>{words}'
            '<div data-piece="head.order"></div>',
            numbers=legend.numbers_words(picture), place=place,
            words=(tag("p", " · ".join(subjects), class_="ws-subject") if subjects else EMPTY)
            + legend.part_html(picture),
        )  # fmt: skip
        return {"head": head}


class LegendPanel(Panel):
    """The colour bar, and the share of the volume within the limit."""

    name = "legend"
    refresh = Refresh.THROTTLED

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (picture.scale, id(picture))

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        limit_menu = EMPTY
        if not picture.is_difference:
            (share, is_pass), limit = (
                legend.within_limit_words(picture),
                picture.state.specification.limit_um,
            )
            box = text_box("state:set.specification.limit_um", f"{limit:g}", size="short",
                           label="Limit", id="ws-limit")  # fmt: skip
            body = tag("div", join(("Limit ", box, " µm")), class_="ws-field")
            limit_menu = menu(share, body, key="limit", hint="Change the limit",
                        kind="ws-pass" if is_pass else "ws-fail")  # fmt: skip
            limit_menu = Markup(" · ") + limit_menu if legend.place_words(picture) else limit_menu
        return {"head.kept": limit_menu, "legend": legend.legend_html(picture)}


class OrderPanel(Panel):
    """The errors permitted by the tolerances, second-order remainder, and replaced errors.

    They are too slow to follow a drag.
    """

    name = "order"
    refresh = Refresh.IDLE

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        conditions, scene = [*legend.order_conditions(picture)], picture.state.left_behind
        if scene:
            conditions.append(f"with the errors of this machine; those of “{scene}” are not used")
        allowed = "" if picture.is_difference else allowed_words(picture.drawn_state)
        return {"head.order": tag("p", " · ".join(conditions)) if conditions else EMPTY,
                "head.allowed": f" · {allowed}" if allowed else ""}  # fmt: skip


class OverlayPanel(Panel):
    """Labels and scale bars, placed by the page as the camera moves; the size of the drawing."""

    name = "overlay"
    refresh = Refresh.IMMEDIATE

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._sent: dict[str, Any] = {}

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        facts = _facts(picture)
        changes = {name: value for name, value in facts.items() if self._sent.get(name) != value}
        if changes:
            self.context.page.call("overlay.show", changes)
        self._sent = facts
        return {}

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        room, context = read_room(value) if action == "size" else None, self.context
        if room is not None:
            context.call_soon(lambda: context.camera.take_room(room, context.picture))
        return state


def _facts(picture: LivePicture) -> dict[str, Any]:
    look, grid = picture.state.look, picture.grid
    isolines = look.isolines and look.surface != "grid"
    bounds = [piece.grid.bounds_mm for piece in picture.slices]
    return {
        "axes": _labels_json(Identity(axis_labels(picture))),
        "triad": [
            {"name": name if name and is_linear(name) else "xyz"[k],
             "way": [float(k == i) * sign for i in range(3)]}
            for k, (name, sign) in enumerate(zip(grid.axes, grid.directions.tolist(), strict=True))
        ],
        "perMm": SCENE_PER_MM,
        "centre": _scene(grid.bounds_mm.mean(axis=0)),
        "bars": look.bars,
        "solid": look.surface in ("surface", "cut"),
        "factor": picture.exaggeration,
        "spelt": spell_factor(picture.exaggeration),
        "corners": [_scene(at) for at in picture.drawn_mm.reshape(-1, 3)[corners(picture.shape)]],
        "marks": list(map(_label_json, (*point_labels(picture), *note_labels(picture)))),
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
def _labels_json(labels: Identity) -> list[dict[str, Any]]:
    return list(map(_label_json, labels.target))


def _label_json(label: Label) -> dict[str, Any]:
    entry = {"text": label.text, "at": _scene(label.at_mm), "kind": label.kind}
    if label.from_mm is not None:
        entry |= {"from": _scene(label.from_mm), "axis": label.axis}
    return entry


# --- Shared review: pointers of other tabs --------------------------------------------------------

INTERVAL_S = 0.08  # between two positions of a pointer; a page sends one each tenth of a second
LONGEST_NAME, LONGEST_RAY = 24, 200  # characters
MOST_QUEUED = 8  # messages waiting for a page; beyond that it is sent no pointers
Tabs = Callable[[], Iterable[Context]]


class PointerPanel(Panel):
    """Pointer events: ``pointer:at`` with a ray of six numbers and a name."""

    name = "pointer"

    def __init__(self, context: Context, tabs: Tabs) -> None:
        super().__init__(context)
        self._tabs, self._last = tabs, 0.0
        context.page.call("together")

    def handle(self, state: AppState, action: str, value: str) -> AppState:
        now, picture, at = time.monotonic(), self.context.picture, None
        numbers, _, name = value.partition("\n")
        if action == "at":
            is_early = now - self._last < INTERVAL_S
            if len(numbers) > LONGEST_RAY or is_early or self.context.story_state:
                return state
            try:
                ray = np.array([float(text) for text in numbers.split(",")]).reshape(2, 3)
            except ValueError:  # not six numbers; a ray that is not finite meets nothing
                return state
            self._last = now
            picked = picture and pick(picture, ray[0] / SCENE_PER_MM, ray[1])
            at = picked and (picked[1] * SCENE_PER_MM).round(4).tolist()
        label = " ".join(name[:LONGEST_NAME].split())
        for tab in self._tabs():
            is_free = tab.story_state is None and queued(tab.client) <= MOST_QUEUED
            if tab is not self.context and is_free:
                tab.page.call("pointer", self.context.client.client_id, label, at)
        return state
