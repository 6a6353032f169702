"""What lies over the drawing in every state: heading, colour bar, words and scale bars."""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, fill, join, menu, tag, text_box
from warpspace.app.browser.room import read_room
from warpspace.app.documents.legend import (
    kept_words,
    legend_html,
    numbers_words,
    order_conditions,
    place_words,
    subject_words,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import SHOWN
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part
from warpspace.app.viewport.labels import Label, axis_labels, point_labels
from warpspace.app.viewport.shapes import SCENE_PER_MM
from warpspace.geometry.surfaces import corners
from warpspace.machine.axes import is_linear
from warpspace.picture.mesh import isoline_labels
from warpspace.picture.words import spell_factor
from warpspace.units import Array, spell_short


class HeadPart(Part):
    """Mean and max with the place of the latter, the limit, and the colour bar."""

    name = "head"
    follows = "at once"

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Write both."""
        words = subject_words(picture)
        place = place_words(picture)
        head = fill(
            '<h1>{numbers}</h1><div>{place}{limit}</div>{words}<div data-piece="head.order"></div>',
            numbers=numbers_words(picture),
            limit=EMPTY if picture.is_difference else _limit(picture),
            place=place if picture.is_difference or not place else f"{place} · ",
            words=tag("p", " · ".join(words), class_="ws-subject") if words else EMPTY,
        )  # fmt: skip
        return {"head": head, "legend": legend_html(picture)}


def _limit(picture: LivePicture) -> Markup:
    words, kept = kept_words(picture)
    limit = f"{picture.state.specification.limit_um:g}"
    box = text_box("state:set.specification.limit_um", limit, size="short", label="Limit")
    body = tag("div", join(("Limit ", box, " µm")), class_="ws-field")
    kind = "ws-kept" if kept else "ws-missed"
    return menu(words, body, key="limit", hint="Change the limit", kind=kind)


class OrderPart(Part):
    """What the first order leaves out, and errors that a change of scene left behind."""

    name = "order"
    follows = "at rest"

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Say it below the heading; evaluating it is too slow for every move."""
        left = picture.state.left_behind
        words = [
            *order_conditions(picture),
            *([f"with its own errors; those of “{left}” are left behind"] if left else []),
        ]
        return {"head.order": tag("p", " · ".join(words)) if words else EMPTY}


class ComparedPart(Part):
    """Which side of a comparison is drawn; one switch leaves it."""

    name = "compared"
    follows = "at once"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow what is drawn."""
        found = picture.compared
        return (None if found is None else (found.shown, found.titles, found.refused),)

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Write the switch while two are compared."""
        found = picture.compared
        if found is None:
            return {"compared": ""}
        hints = {"a": found.titles[0], "b": found.titles[1], "difference": found.refused or
                 "The change from A to B, node by node, with colours of its own"}  # fmt: skip
        choices = (
            button(words, "compare:shown", key, kind="chip", hint=hints[key],
                   pressed=found.shown == key, disabled=bool(found.refused) and key not in "ab")
            for key, words in SHOWN.items()
        )  # fmt: skip
        leave = button("✕", "compare:leave", kind="chip", hint="End the comparison",
                       aria_label="End the comparison")  # fmt: skip
        row = tag("div", join((*choices, leave)), role="group", aria_label="What is drawn")
        return {"compared": row}


class RoomPart(Part):
    """What the page places by itself as the camera moves, and how large the drawing is."""

    name = "room"
    follows = "at once"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._sent: dict[str, Any] = {}
        self._axes: tuple[tuple[object, ...], dict[str, Any]] = ((), {})

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Tell what has changed."""
        state = picture.state
        key = (picture.grid.nominal_mm, state.shown.axes, state.machine.shown)
        if key[0] is not (self._axes[0] or (None,))[0] or key[1:] != self._axes[0][1:]:
            self._axes = key, _axes(picture)
        facts = {**self._axes[1], **_facts(picture)}
        changes = {name: value for name, value in facts.items() if self._sent.get(name) != value}
        if changes:
            self.context.page.call("room.show", changes)
        self._sent = facts
        return {}

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Have the camera fill a drawing whose size has changed."""
        room = read_room(value) if word == "size" else None
        if room is not None:
            self.context.act(lambda: self._fill(room))
        return state

    def _fill(self, room: Any) -> None:
        picture = self.context.shown
        if picture is not None and self.context.camera.take_room(room, picture):
            self.context.client.flush()


def _axes(picture: LivePicture) -> dict[str, Any]:
    grid = picture.grid
    triad = [
        {"name": name if name and is_linear(name) else "xyz"[k],
         "way": [float(k == i) * float(grid.ways[k]) for i in range(3)]}
        for k, name in enumerate(grid.axes)
    ]  # fmt: skip
    return {"axes": list(map(_word, axis_labels(picture))), "triad": triad}


def _facts(picture: LivePicture) -> dict[str, Any]:
    state, bounds = picture.state, picture.grid.bounds_mm
    outer = picture.drawn_mm.reshape(-1, 3)[corners(picture.shape)]
    return {
        "bars": state.look.bars,
        "solid": state.look.surface in ("surface", "cut"),
        "factor": picture.exaggeration,
        "spelt": spell_factor(picture.exaggeration),
        "perMm": SCENE_PER_MM,
        "centre": _scene(bounds.mean(axis=0)),
        "corners": [_scene(point) for point in outer],
        "marks": list(map(_word, point_labels(picture))),
        "labels": _labels(picture),
        "slices": _slices(picture),
    }


def _scene(point_mm: Array) -> list[float]:
    return [round(float(value) * SCENE_PER_MM, 4) for value in point_mm]


def _word(label: Label) -> dict[str, Any]:
    found = {"text": label.text, "at": _scene(label.at_mm), "kind": label.kind}
    if label.from_mm is not None:
        found |= {"from": _scene(label.from_mm), "axis": label.axis}
    return found


def _labels(picture: LivePicture) -> list[dict[str, Any]]:
    """Spell the values of the isolines that are drawn."""
    look = picture.state.look
    if not look.isolines or look.surface == "grid":
        return []
    return [
        {
            "at": _scene(label.at_mm),
            "out": [float(v) for v in label.outward],
            "text": f"{spell_short(label.value)} {picture.scale.unit}",
        }
        for label in isoline_labels(picture)
    ]


def _slices(picture: LivePicture) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for one in picture.slices:
        low, high = one.grid.bounds_mm
        axis = int((high - low).argmin())
        found.append(
            {"axis": axis, "at": _scene(low)[axis], "low": _scene(low), "high": _scene(high)}
        )
    return found
