"""Panels over the drawing: heading, colour bar, labels, pointers; and the toolbar below it."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import msgspec
import numpy as np
from markupsafe import Markup

from warpspace.analysis.uncertainty.propagation import NOT_STATED
from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, join, tag
from warpspace.app.browser.templates import Templates
from warpspace.app.browser.viser_private import queued
from warpspace.app.documents import legend
from warpspace.app.drawing.camera import Room
from warpspace.app.drawing.labels import Label, axis_labels, note_labels, point_labels
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import explain_point, pick, pick_worst
from warpspace.app.panels.conventions import with_travel
from warpspace.app.panels.design import allowed_words
from warpspace.app.panels.panel import Context, Panel, Refresh, on, setting, with_section
from warpspace.app.state.app_state import COMPARISON_VIEWS, COMPONENT_NAMES, NOBODY, AppState, Side
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import DRAWINGS, QUANTITIES, SURFACES, slice_positions
from warpspace.app.state.tree import leaves, put
from warpspace.geometry.surfaces import corners
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection, is_linear, parameter
from warpspace.picture.formatting import spell_cause, spell_factor
from warpspace.picture.map_mesh import isoline_labels
from warpspace.units import Array, spell_short

HTML = Templates("overlay")


class HeadPanel(Panel):
    """Largest error and its main cause; mean and maximum, and the place of the maximum."""

    name = "head"
    refresh = Refresh.IMMEDIATE
    _subject: object = None  # of the latest heading

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        axis = parameter(picture.state.page.row).axis if picture.state.page.row else ""
        is_offered = axis and not is_linear(axis) and not picture.is_rotary
        head = HTML.head(
            legend.largest_words(picture), legend.numbers_words(picture),
            legend.loop_words(picture), legend.place_words(picture),
            " · ".join(legend.subject_words(picture)),
            EMPTY if picture.is_rotary else legend.part_html(picture), axis if is_offered else "",
        )  # fmt: skip
        subject = (Identity(picture.drawn_state.scene), picture.is_rotary, picture.is_difference,
                   picture.largest_um > 0.0)  # fmt: skip
        late = () if subject == self._subject else ("head.order", "head.allowed", "head.cause")
        self._subject = subject
        return {"head": head, **dict.fromkeys(late, EMPTY)}  # `OrderPanel` writes them later


class LegendPanel(Panel):
    """The colour bar, and the share of the volume within the limit."""

    name = "legend"
    refresh = Refresh.THROTTLED

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (picture.scale, picture.serial)

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        limit_menu = EMPTY
        if not picture.is_difference and not picture.is_rotary:
            words = legend.within_limit_words(picture)
            limit_menu = HTML.limit(*words, spell_limit(picture.state))
        return {"head.kept": limit_menu, "legend": legend.legend_html(picture)}


class OrderPanel(Panel):
    """Main cause, errors permitted by the tolerances, second order, and replaced errors.

    They are too slow to follow a drag.
    """

    name = "order"
    refresh = Refresh.IDLE

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        conditions, scene = [*legend.order_conditions(picture)], picture.state.left_behind
        conditions += filter(None, [legend.unknown_words(picture)])
        if scene:
            conditions.append(f"with the errors of this machine; those of “{scene}” are not used")
        of_volume = not picture.is_difference and not picture.is_rotary
        allowed = "" if not of_volume else allowed_words(picture.drawn_state)
        return {"head.order": tag("p", " · ".join(conditions)) if conditions else EMPTY,
                "head.allowed": allowed, "head.cause": cause_words(picture)}  # fmt: skip


def cause_words(picture: LivePicture) -> str:
    """Name the error that contributes most to the largest one: ``, mostly because …``."""
    errors = picture.traced_um if picture.is_rotary else picture.field.error_um
    if picture.is_difference or picture.drawn_state.controller or not errors.any():
        return ""
    worst = explain_point(picture.drawn_state, pick_worst(picture), picture.exaggeration)
    if not worst.ranked or not worst.length_um:
        return ""
    first = worst.ranked[0]
    return f", {spell_cause(first.key, first.along_um / worst.length_um)}"


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

    @on(do.Resize, later=True)
    def resize(self, action: do.Resize) -> None:
        room = Room(*map(float, msgspec.structs.astuple(action)))
        self.context.camera.take_room(room, self.context.picture)


def _facts(picture: LivePicture) -> dict[str, Any]:
    look, grid = picture.state.look, picture.grid
    isolines = look.isolines and look.surface != "grid"
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
            for low, high in [piece.grid.bounds_mm for piece in picture.slices]
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
LONGEST_NAME = 24  # characters
MOST_QUEUED = 8  # messages waiting for a page; beyond that it is sent no pointers
Tabs = Callable[[], Iterable[Context]]


class PointerPanel(Panel):
    """Passes the pointer of this tab on to the other tabs."""

    name = "pointer"

    def __init__(self, context: Context, tabs: Tabs) -> None:
        super().__init__(context)
        self._tabs, self._last = tabs, 0.0
        context.page.call("together")

    @on(do.PointAt, later=True)
    def point(self, action: do.PointAt) -> None:
        now, picture = time.monotonic(), self.context.picture
        if now - self._last < INTERVAL_S or self.context.story_state:
            return
        self._last, ray = now, np.array(action.ray).reshape(2, 3)
        picked = picture and pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        self._send(action.author, picked and (picked[1] * SCENE_PER_MM).round(4).tolist())

    @on(do.Signal.POINTER_GONE, later=True)
    def hide(self) -> None:
        self._send("", None)

    def _send(self, author: str, at: list[float] | None) -> None:
        label = " ".join(author[:LONGEST_NAME].split())
        for tab in self._tabs():
            is_free = tab.story_state is None and queued(tab.client) <= MOST_QUEUED
            if tab is not self.context and is_free:
                tab.page.call("pointer", self.context.client.client_id, label, at)


# --- The toolbar: display of the volume, view direction -------------------------------------------

FACTORS = (1, 100, 1000, 10_000, 100_000)


def chosen_map(state: AppState) -> str:
    """Return the quantity that colours the map, as in `ColourBy`."""
    chosen = f"{state.look.quantity}.{state.component}"
    is_set = state.specification.limit_um is not None
    return "limit" if is_set and state.look.pass_fail and chosen == "position.norm" else chosen


def spell_limit(state: AppState) -> str:
    limit = state.specification.limit_um
    return "" if limit is None else f"{limit:g}"


class ControlsPanel(Panel):
    name = "controls"

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        state, menus = picture.state, [_exaggeration(picture), _colours(picture)]
        if not all(map(is_linear, state.scene.machine.axes)):
            menus.insert(0, HTML.drawings(DRAWINGS, "rotary" if state.shows_rotary else "volume"))
        if not picture.is_rotary:
            menus += [_surface(picture), HTML.machine(state.machine, partial(setting, state))]
        return {"controls": join(menus), "triad": HTML.triad(self.context.camera)}

    @on(do.Input.COLOUR_BY)
    def colour_by(self, state: AppState, quantity: str) -> AppState:
        is_limit, (quantity, _, component) = quantity == "limit", quantity.partition(".")
        if is_limit:
            quantity, component = "position", "norm"
        state = put(state, "look.pass_fail", str(int(is_limit)))
        return put(put(state, "look.quantity", quantity), "component", component)

    @on(do.ShowMachine)
    def show_machine(self, state: AppState, action: do.ShowMachine) -> AppState:
        shown, ghost = action.look == "solid", action.look != "off"
        return replace(state, machine=replace(state.machine, shown=shown, ghost=ghost))

    @on(do.ShowDrawing)
    def show_drawing(self, state: AppState, action: do.ShowDrawing) -> AppState:
        state = put(state, "look.drawing", action.value)
        return state if action.value == "volume" else with_section(state, "machine", "rotary")

    @on(do.Input.SET_TRAVEL)
    def set_travel(self, state: AppState, direction: str) -> AppState:
        return with_travel(state, direction)

    @on(do.Signal.FIT_VIEW, do.ViewFrom, do.SetOrthographic, later=True)
    def move_camera(self, action: do.AnyAction) -> None:
        lens = action.value == "1" if isinstance(action, do.SetOrthographic) else None
        self.context.fit_view(action.view if isinstance(action, do.ViewFrom) else None, lens)
        self.rerender()


def _exaggeration(picture: LivePicture) -> Markup:
    chosen, factor = picture.state.exaggeration, picture.exaggeration
    factors = {"auto": "auto", **{str(n): spell_factor(n) for n in FACTORS}}
    label = "true scale" if factor == 1.0 else spell_factor(factor)
    chosen = "auto" if chosen is None else f"{chosen:g}"
    return HTML.exaggeration(label, f"{factor:.7g}", factors, chosen)


def _colours(picture: LivePicture) -> Markup:
    state, look, uncertainty = picture.state, picture.state.look, picture.uncertainty
    chosen, limit = chosen_map(state), f"pass / fail at {spell_limit(state)} µm"
    remark = NOT_STATED if uncertainty is None else "; ".join(uncertainty.errors.remarks())
    is_known = uncertainty is not None and uncertainty.errors.is_known
    labels = {
        quantity: {f"{quantity}.{key}": html.lowered(text) for key, text in names.items()}
        for quantity, names in COMPONENT_NAMES.items()
    }
    quantities = [
        (title, labels[quantity], "" if is_known or quantity != "uncertainty" else remark)
        for quantity, title in QUANTITIES.items()
        if is_known or quantity != "uncertainty" or not picture.is_difference
    ]
    label: object = limit
    if chosen != "limit":
        label = html.lowered(COMPONENT_NAMES[picture.quantity][state.component])
    top = look.range_top if look.range_mode == "fixed" else picture.scale.high
    return HTML.colours(
        label, quantities, chosen, limit if state.specification.limit_um is not None else "",
        leaves(state)["look.range_mode"].choices, look.range_mode,
        setting(state, "look.range_top", text=f"{top:.4g}"),
    )  # fmt: skip


def _surface(picture: LivePicture) -> Markup:
    state, chosen = picture.state, picture.state.look.surface
    is_sliced, direction = chosen == "slices", state.scene.model.direction
    axes = slice_positions(state.scene, state.look, state.machine) if is_sliced else ()
    has_directions = state.scene.errors.has_directions or direction != TravelDirection.MEAN
    directions = {str(travel): label for travel, label in DIRECTION_WORDS.items()}
    return HTML.surface(SURFACES, chosen, partial(setting, state), axes, picture.uncertainty,
                        state.loop is Loop.RELATIVE, directions if has_directions else {},
                        str(direction))  # fmt: skip


# --- Comparison -----------------------------------------------------------------------------------


class ComparePanel(Panel):
    """The two sides of a comparison, the displayed one, and the statistics of both."""

    name = "compare"
    refresh = Refresh.IMMEDIATE

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (Identity(picture.state.comparison), Identity(picture.compared),
                *self.context.scenes)  # fmt: skip

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        state, compared, chosen = picture.state, picture.compared, picture.state.comparison
        titles = {title: title for title in (*_own_sides(state), *self.context.scenes)}
        b = NOBODY if chosen.b is None else chosen.b.title
        sides = ("a", chosen.a.title, titles), ("b", b, {NOBODY: NOBODY, **titles})
        label = "compare" if compared is None else COMPARISON_VIEWS[compared.view]
        views = compared and HTML.displayed_side(compared, COMPARISON_VIEWS)
        ghost = compared and setting(state, "comparison.ghost")
        return {"compared": views or EMPTY,
                "compare": HTML.comparison(label, sides, ghost, compared)}  # fmt: skip

    @on(do.Signal.OPEN_COMPARISON, later=True)
    def open(self) -> None:
        self.context.page.call("menu", self.name)

    @on(do.Signal.PIN_AS_A, do.Signal.END_COMPARISON)
    def start_or_end(self, state: AppState, signal: do.Signal) -> AppState:
        is_start = signal is do.Signal.PIN_AS_A
        return with_pin(state) if is_start else with_sides(state, state.comparison.a, None)

    @on(do.SetSide)
    def set_side(self, state: AppState, action: do.SetSide) -> AppState | None:
        """Set a side of the comparison; an unknown title is ignored."""
        chosen, scene = state.comparison, self.context.scenes.get(action.value)
        if action == do.SetSide("b", NOBODY):
            return with_sides(state, chosen.a, None)
        side = _own_sides(state).get(action.value)
        if side is None and scene is not None:
            side = replace(scene_side(scene), title=action.value)
        if side is None:
            return None
        a, b = (side, chosen.b or Side()) if action.side == "a" else (chosen.a, side)
        return with_sides(state, a, b)


def _own_sides(state: AppState) -> dict[str, Side]:
    chosen = state.comparison
    used = (Side(), chosen.pinned, chosen.a, chosen.b)
    return {side.title: side for side in used if side is not None}
