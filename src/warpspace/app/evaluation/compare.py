"""Two states side by side, and what results propose: drawn beside what is shown, or in its place.

Both are drawn with one grid, colours and display factor, their change in its own colours. It is
taken node by node, so the nominal volumes must coincide. Where they do not, the two sides are still
shown and the reason stands in `Compared.refused`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from warpspace.app.evaluation.live_picture import Compared, LivePicture
from warpspace.app.state.app_state import PRESENT, AppState, Comparison, Side, start_state
from warpspace.app.state.look import RotaryLook
from warpspace.geometry.colour import ColourScale
from warpspace.picture.model import choose_scale, same_nodes, subtract_pictures, subtract_traces
from warpspace.scene.model import Scene

BEFORE, AFTER = "before", "after"
"""What was pinned, and what is steered beside it."""
DIGITS = 3  # decimals of a proposed error, µm or µrad: a nanometre is nothing to be set
LOOKED_AT = (
    "component", "nodes", "exaggeration", "look", "machine", "shown", "part", "forms", "picked",
    "lever",
)  # fmt: skip
"""What of the present state a side is looked at with."""
REFUSED = "The working volumes are not the same, so there is no difference node by node."


def side_state(now: AppState, side: Side) -> AppState:
    """Give the state of one side, looked at as the present one."""
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
    return viewed.within_reach()


def scene_side(scene: Scene) -> Side:
    return Side(scene.title or scene.name, start_state(scene), is_scene=True)


def pinned_side(state: AppState) -> Side:
    """Make the side "before" of what is steered; it holds no comparison of its own."""
    edited = f"{len(state.changed_keys)} changed" if state.changed_keys else ""
    title_parts = (state.scene.title or state.scene.name, edited, table_words(state))
    return Side(f"{BEFORE}: {' · '.join(filter(None, title_parts))}", plain_state(state))


def plain_state(state: AppState) -> AppState:
    """Give a state as the side of a comparison: with none of its own, and nothing asked."""
    return replace(state, comparison=Comparison(), picked=None, lever="", forms={})


def compare_pictures(single: Callable[[AppState], LivePicture], state: AppState) -> LivePicture:
    chosen = state.comparison
    other_side = chosen.b or Side()
    sides = [single(side_state(state, side)) for side in (chosen.a, other_side)]
    if len({one.quantity for one in sides}) > 1:  # one of them states no uncertainty
        plain = replace(state, look=replace(state.look, quantity="position"))
        sides = [single(side_state(plain, side)) for side in (chosen.a, other_side)]
    factor = min(one.exaggeration for one in sides)
    a, b = (
        one if one.exaggeration == factor else single(replace(one.state, exaggeration=factor))
        for one in sides
    )
    refused = "" if same_nodes(a.grid.nominal_mm, b.grid.nominal_mm) else REFUSED
    difference = None if refused else _difference(a, b)
    scale = _shared_scale(state, [a, b])
    view = "b" if refused and chosen.shown == "difference" else chosen.shown
    drawn, other = {"a": (a, b), "b": (b, a), "difference": (difference or b, None)}[view]
    alike = other is not None and other.drawn_mm.shape == drawn.drawn_mm.shape
    compared = Compared(
        view,
        (_title(state, chosen.a), _title(state, other_side, chosen.a)),
        (a.state, b.state),
        a.statistics,
        b.statistics,
        None if difference is None else difference.statistics,
        other.drawn_mm if other is not None and alike else None,
        refused,
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
            subtract_pictures(one, other)
            for one, other in zip(b.slices, a.slices, strict=False)
            if same_nodes(one.grid.nominal_mm, other.grid.nominal_mm)
        ),
    )


def _shared_scale(state: AppState, maps: Sequence[LivePicture]) -> ColourScale:
    if state.look.range_mode == "fixed":
        return maps[0].scale
    widest = max((picture.scale for picture in maps), key=lambda scale: scale.high)
    shared = choose_scale([one.values for one in maps], state.component, maps[0].quantity)
    return shared if shared.high > widest.high else widest


def with_sides(state: AppState, a: Side, b: Side | None) -> AppState:
    """Compare two sides; None for b ends it."""
    if b is None:
        return replace(state, comparison=state.comparison.off())
    return replace(state, comparison=replace(state.comparison, a=a, b=b))


def with_pin(state: AppState) -> AppState:
    """Pin what is steered as the state before (A); what is steered from then on is B, after."""
    return with_before(state, pinned_side(state))


def with_before(state: AppState, side: Side) -> AppState:
    """Take a side as the state before (A); what is steered is B, after, and drawn."""
    comparison = replace(state.comparison, a=side, b=Side(), shown="b", pinned=side)
    return replace(state, comparison=comparison)


def applied(state: AppState, scene: Scene) -> AppState:
    present = state.scene
    if (
        scene.machine.axes != present.machine.axes
        or scene.workspace.volume_axes != present.workspace.volume_axes
    ):
        return state.with_scene(scene)
    fresh = start_state(scene)
    values = {key: round(value, DIGITS) for key, value in fresh.amplitudes.items()}
    inactive = {
        key: value
        for key, value in state.amplitudes.items()
        if key in fresh.amplitudes and not state.exclusions.active(key)
    }
    start = {key: state.start.get(key, 0.0) for key in fresh.amplitudes}
    return replace(
        state,
        scene=replace(scene, title=present.title, name=present.name),
        loaded=state.origin,
        amplitudes={**values, **inactive},
        start=start,
        tolerances=scene.tolerances,
    )


def with_proposal(state: AppState, scene: Scene, title: str) -> AppState:
    after = Side(title, applied(plain_state(state), scene))
    return replace(
        state, comparison=replace(state.comparison, a=Side(), b=after, pinned=after, shown="b")
    )


def with_applied(state: AppState, scene: Scene, before: str) -> AppState:
    """Apply a proposal; the state before it stays as A of a comparison."""
    return applied(with_before(state, Side(before, plain_state(state))), scene)


# --- The table of compensation whose effect is drawn: in words, and without it --------------------

WITHOUT = "Of the machine without the table of compensation, which the box is drawn with: {}."
"""Said wherever numbers are worked out from the errors, not taken from what is drawn."""


def table_words(state: AppState) -> str:
    """Say which table corrects the machine; empty where none does."""
    return "" if state.controller is None else f"with the table {state.controller.label}"


def drawn_tables(state: AppState) -> tuple[str, ...]:
    """Name the tables of a state and of what it is compared with, each once."""
    sides = (Side(), state.comparison.a, state.comparison.b or Side())
    tables = [(side.state or state).controller for side in sides]
    return tuple(dict.fromkeys(table.label for table in tables if table is not None))


def without_words(state: AppState) -> str:
    """Say that numbers are of the machine without a table; empty where there is none."""
    names = " and ".join(drawn_tables(state))
    return WITHOUT.format(names) if names else ""


def without_table(state: AppState) -> AppState:
    """Give a state without its table; a comparison that has one ends, since it would be another.

    What was pinned goes with it, if it has a table.
    """
    if not drawn_tables(state):
        return state
    return replace(state, controller=None, comparison=replace(state.comparison.off(), pinned=None))
