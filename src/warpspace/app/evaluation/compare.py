"""Two states side by side: shared grid, shared colours, shared display factor, and the difference.

A difference is taken node by node, so the nominal volumes must coincide. Where they do not, the two
sides are still shown and the reason stands in `Compared.refused`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpspace.analysis.statistics import Statistics, statistics
from warpspace.app.evaluation.colouring import shown_values
from warpspace.app.evaluation.slices import SliceMap, draw_slice
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Comparison, Side
from warpspace.app.state.look import RotaryLook
from warpspace.field.basis import ErrorField
from warpspace.geometry.colour import ColourScale, build_scale
from warpspace.geometry.deform import deform
from warpspace.scene.model import Scene
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.app.evaluation.evaluate import LivePicture, TraceLines

SAME_PLACE_MM = 1e-6


@dataclass(frozen=True, slots=True)
class Compared:
    """What is known of a comparison beside the picture drawn.

    Attributes
    ----------
    shown : str
        What is drawn: "a", "b" or "difference".
    titles : tuple of str, (2,)
        Names of the two sides.
    sides : tuple of AppState, (2,)
        What they are, looked at as now.
    a, b : Statistics
    difference : Statistics or None
        None where there is no difference.
    other_mm : ndarray, [nx, ny, nz, 3], mm, or None
        Displaced nodes of the side that is not drawn; None for the difference.
    refused : str
        Why there is no difference; empty where there is one.
    """

    shown: str
    titles: tuple[str, str]
    sides: tuple[AppState, AppState]
    a: Statistics
    b: Statistics
    difference: Statistics | None
    other_mm: Array | None
    refused: str = ""

    @property
    def title(self) -> str:
        """Name of what is drawn."""
        a, b = self.titles
        return {"a": f"A: {a}", "b": f"B: {b}", "difference": f"A − B: {a} − {b}"}[self.shown]


def drawn_title(picture: "LivePicture") -> str:
    """Name what is drawn: the scene, or a side of a comparison, or the difference."""
    return picture.state.scene.title if picture.compared is None else picture.compared.title


def is_difference(picture: "LivePicture") -> bool:
    """Tell whether a difference of two states is drawn."""
    return picture.compared is not None and picture.compared.shown == "difference"


def both_words(picture: "LivePicture", word: Callable[[AppState], str]) -> str:
    """Say something of what is drawn; of a difference for both sides where they are not alike.

    Parameters
    ----------
    picture : LivePicture
    word : callable
        Says it of a state.
    """
    found = picture.compared
    if found is None or not is_difference(picture):
        return word(picture.subject or picture.state)
    a, b = (word(side) for side in found.sides)
    return a if a == b else f"{a} − {b}"


def side_state(now: AppState, side: Side) -> AppState:
    """Give the state of one side, looked at as the present one.

    Parameters
    ----------
    now : AppState
    side : Side

    Returns
    -------
    AppState
        Component, density, factor and look are those of now. A scene also stands at the rotary
        positions of now, in its loop; a snapshot keeps what it was taken with.
    """
    base = side.state or now
    if side.is_scene:
        base = replace(base, loop=now.loop)
        for axis, position in now.positions.items():
            if axis in base.positions:
                base = base.with_position(axis, position).without_notes()
    return replace(
        base,
        component=now.component,
        nodes=now.nodes,
        exaggeration=now.exaggeration,
        look=now.look,
        machine=now.machine,
        shown=now.shown,
        rotary=now.rotary if _turns_alike(base, now) else RotaryLook(),
        comparison=Comparison(),
        picked=now.picked,
        lever=now.lever,
    )


def _turns_alike(one: AppState, other: AppState) -> bool:
    """Tell whether the same points are traced over the same axes."""
    points = one.scene.trace_points_mm == other.scene.trace_points_mm
    return points and one.positions.keys() == other.positions.keys()


def scene_side(scene: Scene) -> Side:
    """Make a side of a scene as it is opened."""
    return Side(scene.title or scene.name, start_state(scene), is_scene=True)


def pinned_side(state: AppState) -> Side:
    """Make a side of what is shown now; it holds no comparison of its own."""
    edited = len(state.changed_keys)
    title = state.scene.title or state.scene.name
    if edited:
        title += f" · {edited} changed"
    plain = replace(state, comparison=Comparison(), picked=None, lever="")
    return Side(f"snapshot: {title}", plain)


def compare_pictures(single: "Callable[[AppState], LivePicture]", state: AppState) -> "LivePicture":
    """Evaluate a state that compares two.

    Parameters
    ----------
    single : callable
        Evaluates one plain state.
    state : AppState
        With `state.comparison.b`.

    Returns
    -------
    LivePicture
        Of what is drawn; `LivePicture.subject` is the side it shows.
    """
    chosen = state.comparison
    other_side = chosen.b or Side()
    first = [single(side_state(state, side)) for side in (chosen.a, other_side)]
    factor = state.exaggeration or min(picture.exaggeration for picture in first)
    a, b = (
        picture
        if picture.exaggeration == factor
        else single(replace(picture.state, exaggeration=factor))
        for picture in first
    )
    refused = _why_not(a, b)
    difference = None if refused else _difference(a, b, factor)
    maps = [a, b] if difference is None else [a, b, difference]
    scale = _shared_scale(state, maps)
    shown = "a" if refused and chosen.shown == "difference" else chosen.shown
    drawn, other = {"a": (a, b), "b": (b, a), "difference": (difference or a, None)}[shown]
    compared = Compared(
        shown,
        (_title(state, chosen.a), _title(state, other_side)),
        (a.state, b.state),
        a.statistics,
        b.statistics,
        None if difference is None else difference.statistics,
        None if other is None else other.drawn_mm,
        refused,
    )
    if other is not None and other.drawn_mm.shape != drawn.drawn_mm.shape:
        compared = replace(compared, other_mm=None)
    return replace(drawn, state=state, subject=drawn.state, scale=scale, compared=compared)


def _title(state: AppState, side: Side) -> str:
    """Name a side on the page."""
    return side.title if side.state else f"now, {state.scene.title or state.scene.name}"


def _why_not(a: "LivePicture", b: "LivePicture") -> str:
    """Say why there is no difference; empty where there is one."""
    if not _same_place(a.grid.nominal_mm, b.grid.nominal_mm):
        return "The working volumes are not the same, so there is no difference node by node."
    return ""


def _difference(a: "LivePicture", b: "LivePicture", factor: float) -> "LivePicture":
    """Subtract b from a: node by node, slice by slice and trace by trace."""
    field = _subtract(a.field, b.field)
    return replace(
        a,
        field=field,
        statistics=statistics(field),
        values=shown_values(a.state, field),
        drawn_mm=deform(field.nominal_mm, field.error_um, factor),
        traces=_trace_differences(a, b),
        slices=_slice_differences(a, b, factor),
    )


def _subtract(one: ErrorField, two: ErrorField) -> ErrorField:
    """Subtract two fields over the same points."""
    return ErrorField(
        one.nominal_mm,
        one.error_um - two.error_um,
        one.orientation_urad - two.orientation_urad,
    )


def _slice_differences(a: "LivePicture", b: "LivePicture", factor: float) -> tuple[SliceMap, ...]:
    """Subtract what the model says on the slices themselves, where both lie in one place."""
    return tuple(
        draw_slice(
            a.state, one.axis, one.position_mm, one.grid, _subtract(one.field, two.field), factor
        )
        for one, two in zip(a.slices, b.slices, strict=False)
        if _same_place(one.grid.nominal_mm, two.grid.nominal_mm)
    )


def _same_place(one: Array, two: Array) -> bool:
    """Tell whether nodes nominally coincide."""
    return one.shape == two.shape and np.allclose(one, two, rtol=0.0, atol=SAME_PLACE_MM)


def _trace_differences(a: "LivePicture", b: "LivePicture") -> "tuple[TraceLines, ...]":
    """Subtract traces where they are the same ones."""
    found: list[TraceLines] = []
    for one, two in zip(a.traces, b.traces, strict=False):
        if _same_place(one.nominal_mm, two.nominal_mm):
            found.append(replace(one, actual_mm=one.nominal_mm + one.actual_mm - two.actual_mm))
    return tuple(found)


def _shared_scale(state: AppState, maps: "list[LivePicture]") -> ColourScale:
    """Give one colour scale that holds all maps."""
    widest = max((picture.scale for picture in maps), key=lambda scale: scale.high)
    if state.look.range_mode == "fixed":
        return maps[0].scale
    largest = max(float(np.abs(picture.values).max()) for picture in maps)
    if largest <= widest.high:
        return widest
    found = build_scale(largest, state.component)
    return replace(found, label=widest.label, unit=widest.unit)


def with_sides(state: AppState, a: Side, b: Side | None) -> AppState:
    """Compare two sides; None for b ends it."""
    if b is None:
        return replace(state, comparison=state.comparison.off())
    return replace(state, comparison=replace(state.comparison, a=a, b=b))


def with_pin(state: AppState) -> AppState:
    """Take a snapshot of now and compare now against it."""
    pinned = pinned_side(state)
    return replace(
        state, comparison=replace(state.comparison, a=Side(), b=pinned, shown="a", pinned=pinned)
    )
