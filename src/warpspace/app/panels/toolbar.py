"""The bar below the drawing: how the volume is drawn, from where, and what is compared."""

from collections.abc import Mapping
from dataclasses import replace

from markupsafe import Markup

from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    fill,
    join,
    lowered,
    menu,
    number,
    rows,
    signed,
    switch,
    tag,
    text_box,
)
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.live_picture import Compared, LivePicture
from warpspace.app.panels.conventions import with_travel
from warpspace.app.panels.form_controls import setting
from warpspace.app.panels.panel import Panel, Refresh
from warpspace.app.state.app_state import COMPARISON_VIEWS, COMPONENT_NAMES, NOBODY, AppState, Side
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import QUANTITIES, SURFACES, slice_positions
from warpspace.app.state.tree import leaves, put, spell
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection
from warpspace.picture.formatting import spell_factor
from warpspace.picture.model import NOT_STATED

MACHINES = {"off": "off", "ghost": "ghost", "solid": "solid"}
VIEWS = {"iso": "Iso", "front": "Front", "right": "Right", "top": "Top"}
FACTORS = (1, 100, 1000, 10_000, 100_000)
SWITCHES = (
    "look.worst", "look.arrows", "look.isolines", "shown.grid_lines", "shown.ghost", "shown.axes",
    "shown.traces", "look.bars", "shown.dark",
)  # fmt: skip


def _picks(do: str, words: Mapping[str, object], chosen: str, prefix: str = "") -> Markup:
    return tag("div", join(
        button(text, do, prefix + key, pressed=prefix + key == chosen, kind="choice")
        for key, text in words.items()
    ), class_="ws-choices")  # fmt: skip


def _leaf_picks(state: AppState, path: str) -> Markup:
    return _picks(f"state:set.{path}", leaves(state)[path].choices, spell(state, path))


def chosen_map(state: AppState) -> str:
    """Name what is coloured: a word of the event ``controls:map``."""
    chosen = f"{state.look.quantity}.{state.component}"
    return "limit" if state.look.pass_fail and chosen == "position.norm" else chosen


class ControlsPanel(Panel):
    name = "controls"

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        camera = self.context.camera
        lens = switch("controls:set.lens", "Orthographic", on=camera.orthographic,
                      hint="Parallel edges stay parallel")  # fmt: skip
        triad = fill(
            '<svg data-piece="triad.axes" viewBox="-46 -46 92 92" aria-hidden="true"></svg>'
        )
        menus = (_exaggeration(picture), _colours(picture), _surface(picture),
                 _machine(picture.state))  # fmt: skip
        return {
            "controls": join(menus),
            "triad": menu(triad, _picks("controls:view", VIEWS, camera.view) + lens, key="view",
                          label="View from", kind="up",
                          hint="The machine's axes; click to look from another side"),
        }  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        context = self.context
        if word == "map":
            quantity, _, component = value.partition(".")
            if value == "limit":
                quantity, component = "position", "norm"
            state = put(state, "look.pass_fail", str(int(value == "limit")))
            state = put(state, "look.quantity", quantity)
            return put(state, "component", component)
        if word == "machine" and value in MACHINES:
            machine = replace(state.machine, shown=value == "solid", ghost=value != "off")
            return replace(state, machine=machine)
        if word == "set.travel":
            return with_travel(state, value)
        view = value if word == "view" and value in VIEWS else None
        lens = value == "1" if word == "set.lens" else None
        if view is not None or lens is not None:
            context.act(lambda: context.fit_view(view, lens))
            context.act(self.renew)
        return state


def _exaggeration(picture: LivePicture) -> Markup:
    state = picture.state
    factors = {"auto": "auto", **{str(n): spell_factor(n) for n in FACTORS}}
    chosen = "auto" if state.exaggeration is None else f"{state.exaggeration:g}"
    words = "true scale" if picture.exaggeration == 1.0 else spell_factor(picture.exaggeration)
    name = "state:set.exaggeration"
    box = text_box(name, f"{picture.exaggeration:.4g}", size="short")
    body = field("Errors drawn ×", box, name) + _picks(name, factors, chosen)
    return menu(words, body, key="exaggeration", label=f"Exaggeration: {words}", kind="up",
                hint="How much larger than true the errors are drawn, 0.001 to 1 000 000",
                )  # fmt: skip


def _colours(picture: LivePicture) -> Markup:
    state, look, chosen = picture.state, picture.state.look, chosen_map(picture.state)
    found = picture.uncertainty
    limit = f"within {state.specification.limit_um:g} µm or not"
    body: list[Markup] = []
    words: object = limit
    for quantity, title in QUANTITIES.items():
        names = {key: lowered(said) for key, said in COMPONENT_NAMES[quantity].items()}
        if quantity == "uncertainty" and (found is None or not found.errors.is_known):
            said = NOT_STATED if found is None else "; ".join(found.errors.remarks())
            if not picture.is_difference:
                body += [tag("h3", title), tag("p", said, class_="ws-tiny")]
            continue
        body += [tag("h3", title), _picks("controls:map", names, chosen, f"{quantity}.")]
        if quantity == picture.quantity and chosen != "limit":
            words = names[state.component]
    body.insert(2, _picks("controls:map", {"limit": limit}, chosen))
    top = look.range_top if look.range_mode == "fixed" else picture.scale.high
    body += [tag("h3", "Colour range"), _leaf_picks(state, "look.range_mode"),
             setting(state, "look.range_top", shown=f"{top:.4g}")]  # fmt: skip
    return menu(words, join(body), key="map", kind="up", hint="What the colours mean")


def _surface(picture: LivePicture) -> Markup:
    state, switches = picture.state, [*SWITCHES]
    if picture.uncertainty is not None:
        switches += ["look.significant", "look.ellipsoids", "look.unmeasured"]
    body = [_leaf_picks(state, "look.surface")]
    if state.look.surface == "slices":
        axes = slice_positions(state.scene, state.look, state.machine)
        body += [setting(state, f"look.slices_mm.{axis}", bar=True) for axis in axes]
        body.append(setting(state, "look.follow"))
    body += [tag("h3", "Shown too"), *(setting(state, path) for path in (*switches, "loop"))]
    if state.loop is Loop.RELATIVE:
        body.append(setting(state, "placed"))
    direction, name = state.scene.model.direction, "controls:set.travel"
    if state.scene.errors.has_directions or direction != TravelDirection.MEAN:
        ways = {str(way): words for way, words in DIRECTION_WORDS.items()}
        body.append(field("Direction of travel", choice(name, str(direction), ways), name))
    body.append(setting(state, "nodes"))
    return menu(SURFACES[state.look.surface], join(body), key="surface", kind="up",
                hint="How the volume is drawn")  # fmt: skip


def _machine(state: AppState) -> Markup:
    look = state.machine
    chosen = "solid" if look.shown else "ghost" if look.ghost else "off"
    body = _picks("controls:machine", MACHINES, chosen)
    body += setting(state, "machine.bent") if look.shown else EMPTY
    return menu(f"machine: {chosen}", body, key="machine", kind="up",
                hint="The machine around the volume")  # fmt: skip


# --- Comparing ------------------------------------------------------------------------------------


class ComparePanel(Panel):
    """Which two are compared and which of them is drawn, and the numbers of both."""

    name = "compare"
    refresh = Refresh.IMMEDIATE

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        return (Identity(picture.state.comparison), Identity(picture.compared),
                *self.context.scenes)  # fmt: skip

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        state, found = picture.state, picture.compared
        chosen = state.comparison
        known = {title: title for title in (*_own_sides(state), *self.context.scenes)}
        b = NOBODY if chosen.b is None else chosen.b.title
        body = [
            field(title, choice(name, side, words), name)
            for title, name, side, words in (
                ("A", "compare:set.a", chosen.a.title, known),
                ("B", "compare:set.b", b, {NOBODY: NOBODY, **known}),
            )
        ]
        body.append(button("Keep the present errors as A", "compare:pin",
                           hint="What is changed from then on is B"))  # fmt: skip
        if found is not None:
            body += [setting(state, "comparison.ghost"), comparison_html(found)]
        words = "compare" if found is None else COMPARISON_VIEWS[found.view]
        return {"compared": "" if found is None else _sides(found),
                "compare": menu(words, join(body), key="compare", kind="up wide",
                                hint="Two scenes, or the errors before and after")}  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Take what a browser has chosen; a title that nobody has changes nothing."""
        chosen, scene = state.comparison, self.context.scenes.get(value)
        if word == "pin":
            return with_pin(state)
        if word == "leave" or (word == "set.b" and value == NOBODY):
            return with_sides(state, chosen.a, None)
        side = _own_sides(state).get(value)
        if side is None and scene is not None:
            side = replace(scene_side(scene), title=value)
        if side is None or word not in ("set.a", "set.b"):
            return state
        a, b = (side, chosen.b or Side()) if word == "set.a" else (chosen.a, side)
        return with_sides(state, a, b)


def _own_sides(state: AppState) -> dict[str, Side]:
    chosen = state.comparison
    used = (Side(), chosen.pinned, chosen.a, chosen.b)
    return {side.title: side for side in used if side is not None}


def _sides(found: Compared) -> Markup:
    change = found.refused or "The change from A to B, node by node, with colours of its own"
    hints = {"a": found.titles[0], "b": found.titles[1], "difference": change}
    choices = (
        button(words, "state:set.comparison.shown", key, kind="chip", hint=hints[key],
               pressed=found.view == key, disabled=bool(found.refused) and key == "difference")
        for key, words in COMPARISON_VIEWS.items()
    )  # fmt: skip
    leave = button("✕", "compare:leave", kind="chip", hint="End the comparison",
                   aria_label="End the comparison")  # fmt: skip
    return tag("div", join((*choices, leave)), role="group", aria_label="What is drawn")


ROWS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}


def comparison_html(found: Compared) -> Markup:
    change, lines = found.difference, list[Markup]()
    for words, name in ROWS.items():
        a, b = getattr(found.a, name), getattr(found.b, name)
        own = "" if change is None else number(getattr(change, name), 2)
        cells = (number(a, 2), number(b, 2), signed(b - a, 2), own)
        lines.append(tag("tr", tag("th", words) + join(
            tag("td", cell, data_compared=f"{words} {side}")
            for side, cell in zip(("A", "B", "change", "B − A"), cells, strict=True)
        )))  # fmt: skip
    head = join(tag("th", words) for words in (
        "µm", "A", "B", "change", lowered("|E_B − E_A|")))  # fmt: skip
    titles = rows(zip("AB", found.titles, strict=True), kind="ws-titles")
    note = found.refused or "change: B − A of each number. |E_B − E_A|: node by node."
    return (
        titles
        + tag("table", tag("tr", head) + join(lines), class_="ws-numbers")
        + tag("p", lowered(note), class_="ws-tiny")
    )
