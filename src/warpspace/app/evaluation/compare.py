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
from warpspace.app.state.table import table_words
from warpspace.geometry.colour import ColourScale
from warpspace.picture.model import (
    choose_scale,
    same_nodes,
    subtract_pictures,
    subtract_traces,
)
from warpspace.scene.model import Scene

BEFORE, AFTER = "before", "after"
"""What was pinned, and what is steered beside it."""
DIGITS = 3  # decimals of a proposed error, µm or µrad: a nanometre is nothing to be set
REFUSED = "The working volumes are not the same, so there is no difference node by node."


def side_state(now: AppState, side: Side) -> AppState:
    """Give the state of one side, looked at as the present one."""
    base = side.state or now
    if side.is_scene:
        spans = base.position_spans
        at = {a: spans[a].clamp(now.positions.get(a, p), p) for a, p in base.positions.items()}
        base = replace(base, loop=now.loop, placed=now.placed, positions=at)
    return replace(
        base,
        component=now.component,
        nodes=now.nodes,
        exaggeration=now.exaggeration,
        look=now.look,
        machine=now.machine,
        shown=now.shown,
        rotary=now.rotary if _turns_alike(base, now) else RotaryLook(),
        forms=now.forms,
        comparison=Comparison(),
        picked=now.picked,
        lever=now.lever,
    )


def _turns_alike(one: AppState, other: AppState) -> bool:
    points = one.scene.trace_points_mm == other.scene.trace_points_mm
    return points and one.positions.keys() == other.positions.keys()


def scene_side(scene: Scene) -> Side:
    """Make a side of a scene as it is opened."""
    return Side(scene.title or scene.name, start_state(scene), is_scene=True)


def pinned_side(state: AppState) -> Side:
    """Make the side "before" of what is steered; it holds no comparison of its own."""
    edited = len(state.changed_keys)
    title = state.scene.title or state.scene.name
    if edited:
        title += f" · {edited} changed"
    if table := table_words(state):
        title += f" · {table}"
    return Side(f"{BEFORE}: {title}", plain_state(state))


def plain_state(state: AppState) -> AppState:
    """Give a state as the side of a comparison: with none of its own, and nothing asked."""
    return replace(state, comparison=Comparison(), picked=None, lever="", forms={})


def compare_pictures(single: Callable[[AppState], LivePicture], state: AppState) -> LivePicture:
    """Evaluate a state that compares two."""
    chosen = state.comparison
    other_side = chosen.b or Side()
    a, b = _with_one_factor(
        state, [single(side_state(state, side)) for side in (chosen.a, other_side)]
    )
    refused = "" if same_nodes(a.grid.nominal_mm, b.grid.nominal_mm) else REFUSED
    difference = None if refused else _difference(a, b)
    scale = _shared_scale(state, [a, b])
    shown = "b" if refused and chosen.shown == "difference" else chosen.shown
    drawn, other = {"a": (a, b), "b": (b, a), "difference": (difference or b, None)}[shown]
    alike = other is not None and other.drawn_mm.shape == drawn.drawn_mm.shape
    compared = Compared(
        shown,
        (_title(state, chosen.a, other_side), _title(state, other_side, chosen.a)),
        (a.state, b.state),
        a.statistics,
        b.statistics,
        None if difference is None else difference.statistics,
        other.drawn_mm if other is not None and alike else None,
        refused,
    )
    colours = drawn.scale if drawn.is_difference else scale
    return replace(drawn, state=state, subject=drawn.state, colours=colours, compared=compared)


def _with_one_factor(
    state: AppState, pictures: Sequence[LivePicture]
) -> tuple[LivePicture, LivePicture]:
    factor = state.exaggeration or min(picture.exaggeration for picture in pictures)
    a, b = (
        replace(
            picture,
            exaggeration=factor,
            slices=tuple(replace(one, exaggeration=factor) for one in picture.slices),
            traces=tuple(replace(lines, exaggeration=factor) for lines in picture.traces),
        )
        for picture in pictures
    )
    return a, b


def _title(state: AppState, side: Side, beside: Side) -> str:
    if side.state:
        return side.title
    pinned = beside.state is not None and not beside.is_scene
    title = f"{AFTER if pinned else PRESENT}: {state.scene.title or state.scene.name}"
    table = table_words(state)
    return f"{title} · {table}" if table else title


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
    held = choose_scale([picture.values for picture in maps], state.component, state.look.quantity)
    return held if held.high > widest.high else widest


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
    """Give the state with the errors, tolerances and machine of a scene; the view stays."""
    own = state.scene
    if (
        scene.machine.axes != own.machine.axes
        or scene.workspace.volume_axes != own.workspace.volume_axes
    ):
        return state.with_scene(scene)
    fresh = start_state(scene)
    values = {key: round(value, DIGITS) for key, value in fresh.amplitudes.items()}
    kept = {
        key: value
        for key, value in state.amplitudes.items()
        if key in fresh.amplitudes and not state.exclusions.active(key)
    }
    start = {key: state.start.get(key, 0.0) for key in fresh.amplitudes}
    return replace(
        state, scene=replace(scene, title=own.title, name=own.name), loaded=state.origin,
        amplitudes={**values, **kept}, start=start,
        tolerances=scene.tolerances,
    )  # fmt: skip


def with_proposal(state: AppState, scene: Scene, title: str) -> AppState:
    """Compare what is steered with a proposal, and draw the latter."""
    after = Side(title, applied(plain_state(state), scene))
    return replace(
        state, comparison=replace(state.comparison, a=Side(), b=after, pinned=after, shown="b")
    )


def with_applied(state: AppState, scene: Scene, before: str) -> AppState:
    """Apply a proposal; the state before it stays as A of a comparison."""
    return applied(with_before(state, Side(before, plain_state(state))), scene)
