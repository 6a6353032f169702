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
from warpspace.app.browser.html import EMPTY, button, field, fill, join, menu, number, tag, text_box
from warpspace.app.browser.viser_private import queued
from warpspace.app.documents import legend
from warpspace.app.drawing.camera import Room
from warpspace.app.drawing.labels import Label, axis_labels, note_labels, point_labels
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.live_picture import Compared, LivePicture
from warpspace.app.evaluation.point_explanation import explain_point, pick, pick_worst
from warpspace.app.panels.conventions import with_travel
from warpspace.app.panels.design import allowed_words
from warpspace.app.panels.panel import Context, Panel, Refresh, on, setting, tiny
from warpspace.app.state.app_state import COMPARISON_VIEWS, COMPONENT_NAMES, NOBODY, AppState, Side
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import DRAWINGS, QUANTITIES, SURFACES, slice_positions
from warpspace.app.state.tree import leaves, put, spell
from warpspace.geometry.surfaces import corners
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection, is_linear, parameter
from warpspace.picture.formatting import spell_cause, spell_factor
from warpspace.picture.map_mesh import isoline_labels
from warpspace.units import Array, spell_short


class HeadPanel(Panel):
    """Largest error and its main cause; mean and maximum, and the place of the maximum."""

    name = "head"
    refresh = Refresh.IMMEDIATE
    _subject: object = None  # of the latest heading

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        subjects, place = legend.subject_words(picture), legend.place_words(picture)
        head = fill(
            '<div data-piece="reopened"></div>'
            '<h1>{largest}<span data-piece="head.cause"></span></h1>'
            '<div class="ws-numbers"><b>{numbers}</b> <small>{loop}</small></div>'
            '<div>{place}<span data-piece="head.kept"></span></div>'
            '<div data-piece="head.allowed"></div>{words}<div data-piece="head.order"></div>',
            largest=legend.largest_words(picture), numbers=legend.numbers_words(picture),
            loop=legend.loop_words(picture), place=place,
            words=(tag("p", " · ".join(subjects), class_="ws-subject") if subjects else EMPTY)
            + (EMPTY if picture.is_rotary else legend.part_html(picture)) + _rotary_offer(picture),
        )  # fmt: skip
        subject = (Identity(picture.drawn_state.scene), picture.is_rotary, picture.is_difference,
                   picture.largest_um > 0.0)  # fmt: skip
        late = () if subject == self._subject else ("head.order", "head.allowed", "head.cause")
        self._subject = subject
        return {"head": head, **dict.fromkeys(late, EMPTY)}  # `OrderPanel` writes them later


def _rotary_offer(picture: LivePicture) -> Markup:
    """Offer the drawing of the rotary axes after a change of an error of one."""
    axis = parameter(picture.state.page.row).axis if picture.state.page.row else ""
    if picture.is_rotary or not axis or is_linear(axis):
        return EMPTY
    show = button("show its traces", do.ShowDrawing("rotary"), kind="link")
    return tag("p", join((f"{axis} is a rotary axis: ", show)))


class LegendPanel(Panel):
    """The colour bar, and the share of the volume within the limit."""

    name = "legend"
    refresh = Refresh.THROTTLED

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (picture.scale, picture.serial)

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        limit_menu = EMPTY
        if not picture.is_difference and not picture.is_rotary:
            share, kind = legend.within_limit_words(picture)
            name, limit = "specification.limit_um", spell_limit(picture.state)
            box = text_box(do.SetLeaf(name), limit, size="short", label="Limit", id="ws-limit")
            body = tag("div", join(("Limit ", box, " µm")), class_="ws-field")
            limit_menu = menu(share, body, key="limit", hint="Change the limit", kind=kind)
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

MACHINES = {"off": "off", "ghost": "ghost", "solid": "solid"}
VIEWS = {"iso": "Iso", "front": "Front", "right": "Right", "top": "Top"}
FACTORS = (1, 100, 1000, 10_000, 100_000)
SWITCHES = (
    "look.worst", "look.arrows", "look.isolines", "shown.grid_lines", "shown.ghost", "shown.axes",
    "shown.traces", "look.bars", "shown.dark",
)  # fmt: skip


def _picks(
    action: Callable[[Any], do.AnyAction],
    labels: Mapping[str, object],
    chosen: str,
    prefix: str = "",
) -> Markup:
    return tag("div", join(
        button(text, action(prefix + key), pressed=prefix + key == chosen, kind="choice")
        for key, text in labels.items()
    ), class_="ws-choices")  # fmt: skip


def _leaf_picks(state: AppState, path: str) -> Markup:
    return _picks(partial(do.SetLeaf, path), leaves(state)[path].choices, spell(state, path))


def chosen_map(state: AppState) -> str:
    """Return the quantity that colours the map, as in `ColourBy`."""
    chosen = f"{state.look.quantity}.{state.component}"
    is_set = state.specification.limit_um is not None
    return "limit" if is_set and state.look.pass_fail and chosen == "position.norm" else chosen


def spell_limit(state: AppState) -> str:
    limit = state.specification.limit_um
    return "" if limit is None else f"{limit:g}"


NO_LIMIT = "Pass or fail: set a limit in the heading."


class ControlsPanel(Panel):
    name = "controls"

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        camera = self.context.camera
        lens = html.switch(do.SetOrthographic(), "Orthographic", on=camera.orthographic,
                      hint="Parallel projection")  # fmt: skip
        triad = html.fill(
            '<svg data-piece="triad.axes" viewBox="-46 -46 92 92" aria-hidden="true"></svg>'
        )
        of_volume = () if picture.is_rotary else (_surface(picture), _machine(picture.state))
        menus = (_drawings(picture.state), _exaggeration(picture), _colours(picture), *of_volume)
        return {
            "controls": join(menus),
            "triad": html.menu(triad, _picks(do.ViewFrom, VIEWS, camera.view) + lens,
                               key="view", label="View from", kind="up",
                               hint="Machine axes; click to select a view direction"),
        }  # fmt: skip

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
        if action.value == "volume":
            return state
        opened = state.page.open | {"rotary"}
        return replace(state, page=replace(state.page, task="machine", open=opened))

    @on(do.Input.SET_TRAVEL)
    def set_travel(self, state: AppState, direction: str) -> AppState:
        return with_travel(state, direction)

    @on(do.ViewFrom, later=True)
    def view_from(self, action: do.ViewFrom) -> None:
        self.context.fit_view(action.view)
        self.rerender()

    @on(do.SetOrthographic, later=True)
    def set_orthographic(self, action: do.SetOrthographic) -> None:
        self.context.fit_view(lens=action.value == "1")
        self.rerender()


def _drawings(state: AppState) -> Markup:
    """Render the switch of the drawing: volume or rotary axes; empty without rotary axes."""
    if all(map(is_linear, state.scene.machine.axes)):
        return EMPTY
    chosen = "rotary" if state.shows_rotary else "volume"
    radios = (
        fill('<label title="Draw the {title}"><input type="radio" name="drawing" value="{key}"'
             '{checked} data-set="{action}">{label}</label>',
             title=label, key=key, action=do.ShowDrawing(), label=label.capitalize(),
             checked=Markup(" checked") if key == chosen else EMPTY)
        for key, label in DRAWINGS.items()
    )  # fmt: skip
    return tag("div", join(radios), class_="ws-drawings", role="radiogroup", aria_label="Drawing")


def _exaggeration(picture: LivePicture) -> Markup:
    state = picture.state
    factors = {"auto": "auto", **{str(n): spell_factor(n) for n in FACTORS}}
    chosen = "auto" if state.exaggeration is None else f"{state.exaggeration:g}"
    label = "true scale" if picture.exaggeration == 1.0 else spell_factor(picture.exaggeration)
    name = do.SetLeaf("exaggeration")
    box = text_box(name, f"{picture.exaggeration:.7g}", size="short")
    picks = _picks(partial(do.SetLeaf, name.path), factors, chosen)
    body = field("Exaggeration ×", box, name) + picks
    return html.menu(label, body, key="exaggeration", label=f"Exaggeration: {label}", kind="up",
                hint="Display factor of the errors, 0.001 to 1 000 000")  # fmt: skip


def _colours(picture: LivePicture) -> Markup:
    state, look, chosen = picture.state, picture.state.look, chosen_map(picture.state)
    uncertainty = picture.uncertainty
    limit = f"pass / fail at {spell_limit(state)} µm"
    body: list[Markup] = []
    label: object = limit
    for quantity, title in QUANTITIES.items():
        names = {key: html.lowered(text) for key, text in COMPONENT_NAMES[quantity].items()}
        if quantity == "uncertainty" and (uncertainty is None or not uncertainty.errors.is_known):
            text = NOT_STATED if uncertainty is None else "; ".join(uncertainty.errors.remarks())
            if not picture.is_difference:
                body += [tag("h3", title), tiny(text)]
            continue
        body += [tag("h3", title), _picks(do.Input.COLOUR_BY, names, chosen, f"{quantity}.")]
        if quantity == picture.quantity and chosen != "limit":
            label = names[state.component]
    is_set = state.specification.limit_um is not None
    picks = _picks(do.Input.COLOUR_BY, {"limit": limit}, chosen)
    body.insert(2, picks if is_set else tiny(NO_LIMIT))
    top = look.range_top if look.range_mode == "fixed" else picture.scale.high
    body += [tag("h3", "Colour range"), _leaf_picks(state, "look.range_mode"),
             setting(state, "look.range_top", text=f"{top:.4g}")]  # fmt: skip
    return html.menu(label, join(body), key="map", kind="up", hint="Quantity shown by the colours")


def _surface(picture: LivePicture) -> Markup:
    state, switches = picture.state, [*SWITCHES]
    if picture.uncertainty is not None:
        switches += ["look.significant", "look.ellipsoids", "look.unmeasured"]
    body = [_leaf_picks(state, "look.surface")]
    if state.look.surface == "slices":
        axes = slice_positions(state.scene, state.look, state.machine)
        body += [setting(state, f"look.slices_mm.{axis}", bar=True) for axis in axes]
        body.append(setting(state, "look.follow"))
    body += [tag("h3", "Also show"), *(setting(state, path) for path in (*switches, "loop"))]
    if state.loop is Loop.RELATIVE:
        body.append(setting(state, "placed"))
    direction, name = state.scene.model.direction, do.Input.SET_TRAVEL()
    if state.scene.errors.has_directions or direction != TravelDirection.MEAN:
        directions = {str(travel): label for travel, label in DIRECTION_WORDS.items()}
        body.append(
            field("Direction of travel", html.choice(name, str(direction), directions), name)
        )
    body.append(setting(state, "nodes"))
    return html.menu(SURFACES[state.look.surface], join(body), key="surface", kind="up",
                hint="Display of the volume")  # fmt: skip


def _machine(state: AppState) -> Markup:
    look = state.machine
    chosen = "solid" if look.shown else "ghost" if look.ghost else "off"
    body = _picks(do.ShowMachine, MACHINES, chosen)
    body += setting(state, "machine.bent") if look.shown else EMPTY
    return html.menu(f"machine: {chosen}", body, key="machine", kind="up",
                hint="Display of the machine")  # fmt: skip


# --- Comparison -----------------------------------------------------------------------------------


class ComparePanel(Panel):
    """The two sides of a comparison, the displayed one, and the statistics of both."""

    name = "compare"
    refresh = Refresh.IMMEDIATE

    def dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (Identity(picture.state.comparison), Identity(picture.compared),
                *self.context.scenes)  # fmt: skip

    def render(self, picture: LivePicture) -> Mapping[str, str]:
        state, compared = picture.state, picture.compared
        comparison = state.comparison
        titles = {title: title for title in (*_own_sides(state), *self.context.scenes)}
        b = NOBODY if comparison.b is None else comparison.b.title
        body = [
            field(title, html.choice(name, side, label), name)
            for title, name, side, label in (
                ("A", do.SetSide("a"), comparison.a.title, titles),
                ("B", do.SetSide("b"), b, {NOBODY: NOBODY, **titles}),
            )
        ]
        body.append(button("Set current errors as A", do.Signal.PIN_AS_A,
                           hint="Later changes belong to B"))  # fmt: skip
        if compared is not None:
            body += [setting(state, "comparison.ghost"), comparison_html(compared)]
        label = "compare" if compared is None else COMPARISON_VIEWS[compared.view]
        return {"compared": "" if compared is None else _sides(compared),
                "compare": html.menu(label, join(body), key="compare", kind="up wide",
                                hint="Compare two scenes, or errors before and after")}  # fmt: skip

    @on(do.Signal.OPEN_COMPARISON, later=True)
    def open(self) -> None:
        self.context.page.call("menu", self.name)

    @on(do.Signal.PIN_AS_A)
    def pin(self, state: AppState) -> AppState:
        return with_pin(state)

    @on(do.Signal.END_COMPARISON)
    def end(self, state: AppState) -> AppState:
        return with_sides(state, state.comparison.a, None)

    @on(do.SetSide)
    def set_side(self, state: AppState, action: do.SetSide) -> AppState | None:
        """Set a side of the comparison; an unknown title is ignored."""
        chosen, scene = state.comparison, self.context.scenes.get(action.value)
        if action == do.SetSide("b", NOBODY):
            return self.end(state)
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


def _sides(compared: Compared) -> Markup:
    difference = compared.refused or "Difference of A and B at each node, with its own colours"
    hints = {"a": compared.titles[0], "b": compared.titles[1], "difference": difference}
    choices: list[Markup] = []
    for key, label in COMPARISON_VIEWS.items():
        choices.append(button(label, do.SetLeaf("comparison.shown", key), kind="chip",
                              hint=hints[key], pressed=compared.view == key,
                              disabled=bool(compared.refused) and key == "difference"))  # fmt: skip
    leave = button("✕", do.Signal.END_COMPARISON, kind="chip", hint="End the comparison",
                   aria_label="End the comparison")  # fmt: skip
    return tag("div", join((*choices, leave)), role="group", aria_label="Displayed side")


ROWS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}


def comparison_html(compared: Compared) -> Markup:
    change, lines = compared.difference, list[Markup]()
    for label, name in ROWS.items():
        a, b = getattr(compared.a, name), getattr(compared.b, name)
        node_by_node = "" if change is None else number(getattr(change, name))
        cells = (number(a), number(b), html.signed(b - a), node_by_node)
        lines.append(tag("tr", tag("th", label) + join(
            tag("td", cell, data_compared=f"{label} {side}")
            for side, cell in zip(("A", "B", "change", "B − A"), cells, strict=True)
        )))  # fmt: skip
    head = join(tag("th", label) for label in (
        "µm", "A", "B", "change", html.lowered("|E_B − E_A|")))  # fmt: skip
    titles = html.rows(zip("AB", compared.titles, strict=True), kind="ws-titles")
    note = compared.refused or "change: B − A of each statistic. |E_B − E_A|: at each node."
    table = tag("table", tag("tr", head) + join(lines), class_="ws-numbers")
    return titles + table + tiny(html.lowered(note))
