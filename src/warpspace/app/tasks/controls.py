"""The bar below the drawing: how the volume is drawn, from where, and what is compared."""

from collections.abc import Mapping
from dataclasses import replace

from markupsafe import Markup

from warpspace.app.browser.html import (
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
    slider,
    switch,
    tag,
    text_box,
)
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.compare import scene_side, with_pin, with_sides
from warpspace.app.evaluation.live_picture import Compared, LivePicture
from warpspace.app.state.app_state import COMPONENT_NAMES, LOOP_NAMES, AppState
from warpspace.app.state.comparison import NOBODY, PRESENT, SHOWN, Side
from warpspace.app.state.look import (
    QUANTITIES,
    RANGES,
    SURFACES,
    slice_positions,
    slice_spans,
)
from warpspace.app.state.tree import leaves, put, value
from warpspace.app.tasks.conventions import with_travel
from warpspace.app.tasks.parts import Part
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection
from warpspace.picture.words import spell_factor

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


def chosen_map(state: AppState) -> str:
    """Name what is coloured: a word of the event ``controls:map``."""
    look = state.look
    if look.pass_fail and not look.tilts and state.component == "norm":
        return "limit"
    return f"{look.quantity}.{state.component}"


class ControlsPart(Part):
    """How the volume is drawn: exaggeration, component, surface, machine, and what is rarer."""

    name = "controls"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow what the controls show."""
        state = picture.state
        return (picture.exaggeration, picture.scale.high, state.exaggeration, state.component,
                Identity(state.look), Identity(state.shown), Identity(state.machine), state.loop,
                state.placed, state.nodes, state.specification.limit_um, Identity(state.scene),
                self.context.camera.stand)  # fmt: skip

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Write them."""
        state = picture.state
        kept = self.context.camera.stand
        views = tag("div", join(
            button(words, "controls:view", key, pressed=kept.view == key, kind="choice")
            for key, words in VIEWS.items()
        ), class_="ws-choices")  # fmt: skip
        lens = switch("controls:set.lens", "Orthographic", on=kept.orthographic,
                      hint="Parallel edges stay parallel")  # fmt: skip
        triad = fill(
            '<svg data-piece="triad.axes" viewBox="-46 -46 92 92" aria-hidden="true"></svg>'
        )
        return {
            "controls": join((_exaggeration(picture), _colours(picture), _surface(picture),
                              _machine(state))),
            "triad": menu(triad, views + lens, key="view", label="View from", kind="up",
                          hint="The machine's axes; click to look from another side"),
        }  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Choose what is not one field of the state."""
        context = self.context
        if word == "map":
            quantity, _, component = value.partition(".")
            look = replace(state.look, pass_fail=value == "limit")
            if value == "limit":
                quantity, component = "position", "norm"
            look = look.with_choice(quantity=quantity)
            return put(replace(state, look=look), "component", component)
        if word == "machine" and value in MACHINES:
            machine = replace(state.machine, shown=value == "solid", ghost=value != "off")
            return replace(state, machine=machine)
        if word == "set.travel":
            return with_travel(state, value)
        if word == "view" and value in VIEWS:
            context.act(lambda: self._look(view=value))
        if word == "set.lens":
            context.act(lambda: self._look(lens=value == "1"))
        return state

    def _look(self, view: str | None = None, *, lens: bool | None = None) -> None:
        self.context.fit_view(view, lens)
        self.context.renew(self)


def _exaggeration(picture: LivePicture) -> Markup:
    state, name = picture.state, "state:set.exaggeration"
    factors = {"auto": "auto", **{str(n): spell_factor(n) for n in FACTORS}}
    chosen = "auto" if state.exaggeration is None else f"{state.exaggeration:g}"
    box = text_box(name, f"{picture.exaggeration:.4g}", size="short")
    hint = "How much larger than true the errors are drawn, 0.001 to 1 000 000"
    words = "true scale" if picture.exaggeration == 1.0 else spell_factor(picture.exaggeration)
    body = field("Errors drawn ×", box, name) + _picks(name, factors, chosen)
    return menu(words, body, key="exaggeration", label=f"Exaggeration: {words}",
                hint=hint, kind="up")  # fmt: skip


def _colours(picture: LivePicture) -> Markup:
    state, look, chosen = picture.state, picture.state.look, chosen_map(picture.state)
    limit = f"within {state.specification.limit_um:g} µm or not"
    body: list[Markup] = []
    words: object = limit
    for quantity, title in QUANTITIES.items():
        names = {key: lowered(said) for key, said in COMPONENT_NAMES[quantity].items()}
        body += [tag("h3", title), _picks("controls:map", names, chosen, f"{quantity}.")]
        if quantity == look.quantity and chosen != "limit":
            words = names[state.component]
    body.insert(2, _picks("controls:map", {"limit": limit}, chosen))
    top = look.range_top if look.range_mode == "fixed" else picture.scale.high
    body += [
        tag("h3", "Colour range"),
        _picks("state:set.look.range_mode", RANGES, look.range_mode),
        _typed(state, "look.range_top", f"{top:.4g}"),
    ]
    return menu(
        words,
        join(body),
        key="map",
        kind="up",
        hint="What the colours mean",
    )


def _typed(state: AppState, path: str, value: str) -> Markup:
    leaf, name = leaves(state)[path], f"state:set.{path}"
    return field(leaf.label, text_box(name, value, size="short"), name, leaf.unit, leaf.hint)


def _switch(state: AppState, path: str) -> Markup:
    leaf = leaves(state)[path]
    return switch(f"state:set.{path}", leaf.label, on=bool(value(state, path)), hint=leaf.hint)


def _surface(picture: LivePicture) -> Markup:
    state, look = picture.state, picture.state.look
    body = [_picks("state:set.look.surface", SURFACES, look.surface)]
    if look.surface == "slices":
        spans = slice_spans(state.scene)
        for axis, at in slice_positions(state.scene, look, state.machine).items():
            name, span = f"state:set.look.slices_mm.{axis}", spans[axis]
            bar = slider(name, at, span.low, span.high, span.step, label=f"Slice at {axis}",
                         twin=name)  # fmt: skip
            body.append(field(axis, bar + text_box(name, f"{at:g}", size="short"), name, "mm"))
        body.append(_switch(state, "look.follow"))
    body += _more(state)
    return menu(SURFACES[look.surface], join(body), key="surface", kind="up",
                hint="How the volume is drawn")  # fmt: skip


def _machine(state: AppState) -> Markup:
    look = state.machine
    chosen = "solid" if look.shown else "ghost" if look.ghost else "off"
    body = _picks("controls:machine", MACHINES, chosen)
    if look.shown:
        body += _switch(state, "machine.bent")
    return menu(f"machine: {chosen}", body, key="machine", kind="up",
                hint="The machine around the volume")  # fmt: skip


def _more(state: AppState) -> list[Markup]:
    body = [tag("h3", "Shown too"), *(_switch(state, path) for path in SWITCHES)]
    loop = leaves(state)["loop"]
    chosen = choice("state:set.loop", str(state.loop), LOOP_NAMES)
    body.append(field(loop.label, chosen, "state:set.loop", hint=loop.hint))
    if state.loop is Loop.RELATIVE:
        body.append(_switch(state, "placed"))
    direction = state.scene.model.direction
    if state.scene.errors.has_directions or direction != TravelDirection.MEAN:
        ways = {str(way): words for way, words in DIRECTION_WORDS.items()}
        travel = "controls:set.travel"
        body.append(field("Direction of travel", choice(travel, str(direction), ways), travel))
    body.append(_typed(state, "nodes", str(state.nodes)))
    return body


# --- Comparing ------------------------------------------------------------------------------------


class ComparePart(Part):
    """Which two are compared, and the numbers of both."""

    name = "compare"

    def depends(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow the comparison, its numbers, and the scenes there are."""
        return (Identity(picture.state.comparison), Identity(picture.compared),
                *self.context.scenes)  # fmt: skip

    def pieces(self, picture: LivePicture) -> Mapping[str, str]:
        """Write the menu."""
        chosen, found = picture.state.comparison, picture.compared
        known = {title: title for title in (*_own_sides(picture.state), *self.context.scenes)}
        a, b = chosen.a.title, NOBODY if chosen.b is None else chosen.b.title
        sides = {"a": (a, {PRESENT: PRESENT, **known}),
                 "b": (b, {NOBODY: NOBODY, PRESENT: PRESENT, **known})}  # fmt: skip
        body = [
            field(side.upper(), choice(f"compare:set.{side}", title, words), f"compare:set.{side}")
            for side, (title, words) in sides.items()
        ]
        body.append(button("Keep the present errors as A", "compare:pin",
                           hint="What is changed from then on is B"))  # fmt: skip
        if found is not None:
            body.append(switch("compare:set.ghost", "Outline of the other one", on=chosen.ghost))
            body.append(comparison_html(found))
        words = "compare" if found is None else SHOWN[found.shown]
        return {"compare": menu(words, join(body), key="compare", kind="up wide",
                                hint="Two scenes, or the errors before and after")}  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Take what a browser has chosen; a title that nobody has changes nothing."""
        chosen = state.comparison
        if word == "pin":
            return with_pin(state)
        if word == "shown":
            return put(state, "comparison.shown", value)
        if word == "leave":
            return replace(state, comparison=chosen.off())
        if word == "set.ghost":
            return replace(state, comparison=replace(chosen, ghost=value == "1"))
        if word == "set.a":
            side = self._side(state, value)
            return state if side is None else with_sides(state, side, chosen.b or Side())
        if word == "set.b":
            side = self._side(state, value)
            return state if side is None and value != NOBODY else with_sides(state, chosen.a, side)
        return state

    def _side(self, state: AppState, title: str) -> Side[AppState] | None:
        if title == PRESENT:
            return Side()
        scene = self.context.scenes.get(title)
        own = _own_sides(state).get(title)
        if own is not None or scene is None:
            return own
        return replace(scene_side(scene), title=title)


def _own_sides(state: AppState) -> dict[str, Side[AppState]]:
    chosen = state.comparison
    used = (chosen.pinned, chosen.a, chosen.b)
    return {side.title: side for side in used if side is not None and side.state is not None}


ROWS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}


def comparison_html(found: Compared) -> Markup:
    """Spell the numbers of a comparison."""
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
    titles = rows([("A", found.titles[0]), ("B", found.titles[1])], kind="ws-titles")
    note = found.refused or "change: B − A of each number. |E_B − E_A|: node by node."
    return (
        titles
        + tag("table", tag("tr", head) + join(lines), class_="ws-numbers")
        + tag("p", lowered(note), class_="ws-tiny")
    )
