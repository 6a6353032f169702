"""Comparison of two states, and preview and application of proposals.

Both sides have one grid, one colour scale and one exaggeration; their difference has its own scale.
It is evaluated node by node, so the nominal volumes must coincide. Where they do not, the sides can
be shown, and `Compared.refused` states the reason.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from warpspace.app.evaluation.live_picture import Compared, LivePicture
from warpspace.app.state.app_state import PRESENT, AppState, Comparison, Side, start_state
from warpspace.app.state.look import RotaryLook
from warpspace.field.grid import DEFAULT_NODES, RESIDUAL_NODES
from warpspace.geometry.colour import ColourScale
from warpspace.picture.model import choose_scale, same_nodes, subtract_pictures, subtract_traces
from warpspace.scene.model import Scene

BEFORE, AFTER = "before", "after"
"""Labels of a pinned state and of the present one."""
DIGITS = 3  # decimals of a proposed error, µm or µrad
LOOKED_AT = (
    "component", "nodes", "exaggeration", "look", "machine", "shown", "part", "forms", "picked",
    "lever", "specification",
)  # fmt: skip
"""Fields of the present state that apply to both sides."""
REFUSED = "The working volumes differ, so no difference can be computed node by node."
TRACES_DIFFER = "The nominal traces differ, so no difference can be computed point by point."


def side_state(now: AppState, side: Side) -> AppState:
    """Return the state of one side, with the display settings of the present one."""
    base = side.state or now
    if side.is_scene:
        spans = base.position_spans
        at = {a: spans[a].clamp(now.positions.get(a, p), p) for a, p in base.positions.items()}
        base = replace(base, loop=now.loop, placed=now.placed, positions=at)
    points = base.scene.trace_points_mm == now.scene.trace_points_mm
    turns_alike = points and base.positions.keys() == now.positions.keys()
    viewed = replace(
        base,
        rotary=now.rotary if turns_alike else RotaryLook(),
        comparison=Comparison(),
        **{name: getattr(now, name) for name in LOOKED_AT},
    )
    if drawn_tables(now) and now.nodes == DEFAULT_NODES:  # both sides, for their difference
        viewed = replace(viewed, nodes=RESIDUAL_NODES)
    return viewed.within_reach()


def scene_side(scene: Scene) -> Side:
    return Side(scene.title or scene.name, start_state(scene), is_scene=True)


def pinned_side(state: AppState) -> Side:
    """Build the side "before" from the present state, without its comparison."""
    edited = f"{len(state.changed_keys)} changed" if state.changed_keys else ""
    title_parts = (state.scene.title or state.scene.name, edited, table_words(state))
    return Side(f"{BEFORE}: {' · '.join(filter(None, title_parts))}", plain_state(state))


def plain_state(state: AppState) -> AppState:
    """Return a state as the side of a comparison: without comparison, picked point and forms."""
    return replace(state, comparison=Comparison(), picked=None, lever="", forms={})


def compare_pictures(single: Callable[[AppState], LivePicture], state: AppState) -> LivePicture:
    chosen = state.comparison
    other_side = chosen.b or Side()
    sides = [single(side_state(state, side)) for side in (chosen.a, other_side)]
    if len({picture.quantity for picture in sides}) > 1:  # one has no uncertainty
        plain = replace(state, look=replace(state.look, quantity="position"))
        sides = [single(side_state(plain, side)) for side in (chosen.a, other_side)]
    factor = min(picture.exaggeration for picture in sides)
    a, b = (
        side if side.exaggeration == factor else single(replace(side.state, exaggeration=factor))
        for side in sides
    )
    refused = "" if same_nodes(a.grid.nominal_mm, b.grid.nominal_mm) else REFUSED
    difference = None if refused else _difference(a, b)
    if difference and state.shows_rotary and len(difference.traces) < len(b.traces):
        refused, difference = TRACES_DIFFER, None
    scale = _shared_scale(state, [a, b])
    view = "b" if refused and chosen.shown == "difference" else chosen.shown
    drawn, other = {"a": (a, b), "b": (b, a), "difference": (difference or b, None)}[view]
    alike = other is not None and other.drawn_mm.shape == drawn.drawn_mm.shape
    titles = _title(state, chosen.a), _title(state, other_side, chosen.a)
    change = None if difference is None else difference.statistics
    other_mm = other.drawn_mm if other is not None and alike else None
    compared = Compared(
        view, titles, (a.state, b.state), a.statistics, b.statistics, change, other_mm, refused
    )
    colours = drawn.scale if drawn.is_difference else scale
    return replace(drawn, state=state, colours=colours, compared=compared)


def _title(state: AppState, side: Side, before: Side | None = None) -> str:
    if side.state:
        return side.title
    name = AFTER if before and before.state and not before.is_scene else PRESENT
    title_parts = (state.scene.title or state.scene.name, table_words(state))
    return f"{name}: {' · '.join(filter(None, title_parts))}"


def _difference(a: LivePicture, b: LivePicture) -> LivePicture:
    change = subtract_pictures(b, a)
    if b.state.look.range_mode == "fixed":
        change = replace(change, colours=replace(change.scale, low=b.scale.low, high=b.scale.high))
    return replace(
        change,
        traces=subtract_traces(b.traces, a.traces),
        slices=tuple(
            subtract_pictures(plane, other)
            for plane, other in zip(b.slices, a.slices, strict=False)
            if same_nodes(plane.grid.nominal_mm, other.grid.nominal_mm)
        ),
    )


def _shared_scale(state: AppState, maps: Sequence[LivePicture]) -> ColourScale:
    if state.look.range_mode == "fixed":
        return maps[0].scale
    widest = max((picture.scale for picture in maps), key=lambda scale: scale.high)
    shared = choose_scale(
        [picture.shown_values for picture in maps], state.component, maps[0].quantity
    )
    return shared if shared.high > widest.high else widest


def with_sides(state: AppState, a: Side, b: Side | None) -> AppState:
    if b is None:
        return replace(state, comparison=state.comparison.off())
    return replace(state, comparison=replace(state.comparison, a=a, b=b))


def with_pin(state: AppState) -> AppState:
    """Pin the present state as A, before; further changes apply to B, after."""
    return with_before(state, pinned_side(state))


def with_before(state: AppState, side: Side) -> AppState:
    """Compare a side as A, before, with the present state as B, after, which is drawn."""
    comparison = replace(state.comparison, a=side, b=Side(), shown="b", pinned=side)
    return replace(state, comparison=comparison)


def applied(state: AppState, scene: Scene) -> AppState:
    present = state.scene
    same_axes = scene.machine.axes == present.machine.axes
    if not (same_axes and scene.workspace.volume_axes == present.workspace.volume_axes):
        return state.with_scene(scene)
    amplitudes: dict[str, float] = {}
    for key in scene.parameter_keys:
        stays = key in state.amplitudes and not state.exclusions.active(key)
        proposed = round(scene.errors.amplitude(key), DIGITS)
        amplitudes[key] = state.amplitudes[key] if stays else proposed
    return replace(
        state,
        scene=replace(scene, title=present.title, name=present.name),
        loaded=state.origin,
        amplitudes=amplitudes,
        start={key: state.start.get(key, 0.0) for key in amplitudes},
        tolerances=scene.tolerances,
    )


def with_proposal(state: AppState, scene: Scene, title: str) -> AppState:
    b = Side(title, applied(plain_state(state), scene))
    return replace(state, comparison=replace(state.comparison, a=Side(), b=b, pinned=b, shown="b"))


# --- The applied compensation table ---------------------------------------------------------------

WITHOUT = "For the machine without the compensation table {}, which is applied to the box."
"""Remark on numbers that are computed from the errors, not from the drawn field."""


def table_words(state: AppState) -> str:
    """Return the remark on the applied table; empty without one."""
    return "" if state.controller is None else f"with the table {state.controller.label}"


def drawn_tables(state: AppState) -> tuple[str, ...]:
    sides = (Side(), state.comparison.a, state.comparison.b or Side())
    tables = [(side.state or state).controller for side in sides]
    return tuple(dict.fromkeys(table.label for table in tables if table is not None))


def without_words(state: AppState) -> str:
    """Return the remark that numbers are for the machine without table; empty without one."""
    names = " and ".join(drawn_tables(state))
    return WITHOUT.format(names) if names else ""


def present_words(picture: LivePicture) -> str:
    """Return the remark that numbers are not those of what is drawn; empty where they are."""
    if picture.other_title:
        return f"For the present errors; the drawing shows {picture.other_title}."
    return without_words(picture.state)


def without_table(state: AppState) -> AppState:
    """Return a state without table, and without a comparison or pinned state that has one."""
    if not drawn_tables(state):
        return state
    return replace(state, controller=None, comparison=replace(state.comparison.off(), pinned=None))
