"""Legend of a picture: statistics, place of the max, colour bar, conditions."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from warpspace.analysis.statistics import P95, share_below, share_within, volume_mean
from warpspace.app.browser.html import EMPTY, number
from warpspace.app.browser.templates import Templates
from warpspace.app.drawing.around import unmeasured_mm
from warpspace.app.drawing.camera import CameraMemory, view_axes
from warpspace.app.drawing.labels import axis_labels, point_labels, trace_label
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.compare import table_words
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import worst_traced
from warpspace.app.state.app_state import AppState
from warpspace.field.evaluate import placed_words, second_order_words
from warpspace.geometry.colour import ColourScale, component_values, tick_values
from warpspace.picture import formatting
from warpspace.picture.comparison import conditions_of_both
from warpspace.scene.model import second_order
from warpspace.units import Array, spell_count, spell_short

# --- The colour bar -------------------------------------------------------------------------------

HTML = Templates("legend")
NOTHING_TRACED = (
    "No error moves the traced points: the dashed circles are nominal. Set an error of a rotary"
    " axis, for example a tilt, to see the actual traces."
)
GEOMETRY_ONLY = "Geometry only: no forces, heat, wear or servo"
APART = 15.5 / 240.0  # smallest distance of two labels of the colour bar, relative to its height
MOST_TICKS = 5.0  # intervals between round values
_STOPS = 33


class LegendMark(NamedTuple):
    """A label of the colour bar; heights are relative to the bar."""

    name: str
    text: str
    at: float
    name_at: float  # of the label, separated from others


def marks(picture: LivePicture) -> list[LegendMark]:
    """List limit and statistics of the coloured quantity, in ascending order."""
    low, high = picture.scale.low, picture.scale.high
    named = sorted(marked(picture).items(), key=lambda mark: mark[1])
    values = np.array([value for _, value in named])
    at: list[float] = ((np.clip(values, low, high) - low) / (high - low)).tolist()
    placed, beyond = list(at), int((values > high).sum())
    for i in range(1, len(placed)):
        placed[i] = max(placed[i], placed[i - 1] + APART)
    for i in reversed(range(len(placed))):
        placed[i] = min(placed[i], 1.0 - APART * (len(placed) - 1 - beyond - i))
    spelt = [spell_short(value) if name == "limit" else number(value) for name, value in named]
    return [
        LegendMark(name, f"{name} {text}{' ↑' if value > high else ''}", height, name_at)
        for (name, value), text, height, name_at in zip(named, spelt, at, placed, strict=True)
    ]


def ticks(scale: ColourScale, drawn: Array | None = None) -> list[tuple[str, float]]:
    """List the ends and round values of a scale, with their heights relative to the bar."""
    span, apart = scale.high - scale.low, 1.2 * APART
    inner = ((tick - scale.low) / span for tick in tick_values(scale.low, scale.high, MOST_TICKS))
    heights = [0.0, *(at for at in inner if apart < at < 1.0 - apart), 1.0]
    spelt = [spell_short(scale.low + at * span) for at in heights]
    # an end that is exceeded: of a fixed range, or while a slider is dragged
    if drawn is not None and drawn.max(initial=scale.high) > scale.high:
        spelt[-1] = f"> {spelt[-1]}"
    if drawn is not None and drawn.min(initial=scale.low) < scale.low:
        spelt[0] = f"< {spelt[0]}"
    return [*zip(spelt, heights, strict=True)]


def marked(picture: LivePicture) -> dict[str, float]:
    field, values = picture.field, picture.values
    if picture.is_rotary:
        traced = picture.shown_values
        mean, largest = (traced.mean(), traced.max()) if traced.size else (0.0, 0.0)
        return {"mean": float(mean), "max": float(largest)}
    if picture.component != "norm" or picture.quantity == "uncertainty":
        # statistics of the length do not apply to components
        mean = volume_mean(values, picture.grid)
        return {"min": float(values.min()), "mean": mean, "max": float(values.max())}
    if picture.tilts:  # summarised as position errors are
        field = field.tilts
    norm = field.norm_um
    marks = dict[str, float]()
    if norm.any():
        marks = {"mean": volume_mean(norm, picture.grid), "P95": share_within(field, P95),
                 "max": float(norm.max())}  # fmt: skip
    limit = picture.state.specification.limit_um
    if limit is not None and not picture.tilts and not picture.is_difference:
        marks["limit"] = limit
    return marks


def legend_html(picture: LivePicture) -> Markup:
    scale, named, limit = picture.scale, marks(picture), picture.exceeded_um
    label = f"Colours from {spell_short(scale.low)} to {spell_short(scale.high)} {scale.unit}: "
    return HTML.legend(
        scale, label + ", ".join(mark.text for mark in named), _stops(scale),
        None if limit is None else 100.0 * min(limit / scale.high, 1.0), named,
        ticks(scale, picture.shown_values), faded_words(picture), unmeasured_mm(picture).size,
    )  # fmt: skip


@lru_cache(maxsize=16)
def _stops(scale: ColourScale) -> str:
    limit = getattr(scale, "limit", None)
    if limit is None:
        colours = scale.colours(np.linspace(scale.low, scale.high, _STOPS)).tolist()
        return ",".join(f"rgb({r},{g},{b})" for r, g, b in colours)
    at = 100.0 * min(limit / scale.high, 1.0)  # boundary of two colours
    colours = scale.colours(np.array([0.0, 2.0 * limit])).tolist()
    return ",".join(f"rgb({r},{g},{b}) {at:.1f}%" for r, g, b in colours)


def part_html(picture: LivePicture) -> Markup:
    """Render the largest errors of part and program, with the remark on other effects."""
    part, path, look = picture.part, picture.path, picture.state.part
    if part is None and path is None:
        return EMPTY
    change = " changes" if picture.is_difference else ""
    named = (f"Part {look.name}{change}", part), (f"Program {look.program_name}{change}", path)
    errors = [
        (subject, number(float(component_values(overlay.error_um, "norm").max())),
         overlay.outside.any() and spell_count(int(overlay.outside.sum())))
        for subject, overlay in named if overlay is not None
    ]  # fmt: skip
    if part is None or not look.normal:
        return HTML.part(errors, (), "", GEOMETRY_ONLY)
    scale = picture.coloured(part)[1]
    ends = spell_short(scale.low), spell_short(scale.high)
    return HTML.part(errors, ends, _stops(scale), GEOMETRY_ONLY)


# --- The heading ----------------------------------------------------------------------------------


def largest_words(picture: LivePicture) -> str:
    """Format the heading: ``Errors up to 51.7 µm``."""
    largest = picture.largest_um
    subject = "Change" if picture.is_difference else "Errors"
    if picture.is_rotary:
        subject = f"{'Change of rotary' if picture.is_difference else 'Rotary'} errors"
    return f"{subject} up to {number(largest)} µm" if largest else f"No {subject.lower()}"


def numbers_words(picture: LivePicture) -> str:
    """Format mean and max: ``mean 30.9 µm · max 51.7 µm``; with ± U95 where it is known."""
    norm, change = picture.field.norm_um, "change: " if picture.is_difference else ""
    if picture.is_rotary:
        traced = np.linalg.norm(picture.traced_um, axis=-1)
        mean = float(traced.mean()) if traced.size else 0.0
        return f"{change}traces: mean {number(mean)} µm · max {number(picture.largest_um)} µm"
    numbers = {"mean": volume_mean(norm, picture.grid), "max": float(norm.max())}
    uncertainty, u95_texts, factor = picture.uncertainty, dict.fromkeys(numbers, ""), ""
    if uncertainty is not None:
        u95 = uncertainty.statistics()
        u95_texts = {name: formatting.u95_behind(u95[f"{name}_um"]) for name in numbers}
        factor = f" (k = {uncertainty.errors.factor:.3g})"
    terms = (f"{name} {number(value)}{u95_texts[name]} µm" for name, value in numbers.items())
    return f"{change}{' · '.join(terms)}{factor}"


def loop_words(picture: LivePicture) -> str:
    if picture.is_rotary and not picture.is_difference:
        loops = dict.fromkeys(of.group.loop for of in picture.traces)
        return ", ".join(formatting.LOOP_WORDS[loop] for loop in loops)
    return "" if picture.is_difference else formatting.LOOP_WORDS[picture.drawn_state.loop]


def place_words(picture: LivePicture) -> str:
    """Format the place of the max: ``at X 275 Y −225 Z −480``; of a trace its name and angle."""
    if picture.is_rotary:
        if not picture.traced_um.any():
            return NOTHING_TRACED
        line, at_deg = worst_traced(picture)
        points = (
            f"{name} ({', '.join(map(spell_short, point))}) mm"
            for point, name in picture.traced_points.items()
        )
        name = trace_label(picture, line)
        angle = f"{line.trace.axis} {number(at_deg, 0)}°"
        return f"at {angle} of {name} · {', '.join(points)}"
    if not picture.field.norm_um.any():
        return ""
    node = np.unravel_index(int(np.argmax(picture.field.norm_um)), picture.shape)
    positions = picture.grid.coordinates.items()
    at = {name: float(np.broadcast_to(values, picture.shape)[node]) for name, values in positions}
    axes = formatting.point_axes(picture.drawn_state.scene, at)
    return f"at {formatting.list_axes(axes)}" if axes else ""


def within_limit_words(picture: LivePicture) -> tuple[str, str]:
    """Format the share of the volume within the limit; also return the class of the text.

    An incomplete share is never rounded to all (`share_below`).
    """
    limit = picture.state.specification.limit_um
    if limit is None:
        return "no limit set", ""
    percent = 100.0 * share_below(picture.field, limit)
    is_within = float(picture.field.norm_um.max()) <= limit
    share = number(min(percent, 99.9), 0 if percent < 99.0 else 1)
    words = f"{'all' if is_within else f'{share} %'} of the volume within {limit:g} µm"
    return words, "ws-pass" if is_within else "ws-fail"


def subject_words(picture: LivePicture) -> list[str]:
    """List side of a comparison, table, changes and exclusions of the drawn state."""
    state = picture.drawn_state
    subjects = [] if picture.compared is None else [picture.compared.title]
    table = "" if picture.is_difference else table_words(state)
    if table and not (subjects and table in subjects[0]):
        subjects.append(table)
    edited, excluded = len(state.changed_keys), len(_left_out(state))
    if edited:
        subjects.append(f"{edited} error{'s' if edited > 1 else ''} changed")
    if excluded:
        subjects.append(f"{excluded} excluded")
    beyond = formatting.beyond_words(state.standing, state.loop)
    return [*subjects, *formatting.direction_words(state.scene), *filter(None, [beyond])]


# --- Conditions: restrictions that a reader of a picture must know --------------------------------


def _left_out(state: AppState) -> list[str]:
    active = state.active
    if active is state.amplitudes:
        return []
    return [key for key, value in state.amplitudes.items() if value != active[key]]


def state_conditions(state: AppState) -> tuple[str, ...]:
    """List the excluded errors of a state; empty where exclusion has no effect."""
    chosen, left_out = state.exclusions, _left_out(state)
    only = [key for key in state.amplitudes if key in chosen.only and key not in chosen.excluded]
    if left_out and chosen.only:
        return (f"only: {', '.join(only or ['no error'])}",)
    return (f"excluded: {', '.join(left_out)}",) if left_out else ()


def order_conditions(picture: LivePicture) -> tuple[str, ...]:
    """Remark on states for which the first order is insufficient."""
    sides = picture.compared.sides if picture.compared and picture.is_difference else ()
    states = [state for state in sides or (picture.drawn_state,) if state.controller is None]
    return second_order_words(*(second_order(state.active_scene(), state.loop) for state in states))


def picture_conditions(picture: LivePicture) -> tuple[str, ...]:
    """List all conditions of a picture; for a difference those of both sides."""

    def of(state: AppState) -> tuple[str, ...]:
        view = (*formatting.direction_words(state.scene), *placed_words(state.view()))
        remarks = table_words(state), formatting.beyond_words(state.standing, state.loop)
        return (*view, *state_conditions(state), *filter(None, remarks))

    if picture.is_difference and picture.compared is not None:
        conditions = conditions_of_both(*map(of, picture.compared.sides))
    else:
        conditions = of(picture.drawn_state)
    colours = range_conditions(picture) + faded_words(picture)
    return (*conditions, *order_conditions(picture), *colours)


def faded_words(picture: LivePicture) -> tuple[str, ...]:
    if picture.faded is None:
        return ()
    percent = 100.0 * float(picture.grid.weights[picture.faded].sum())
    of = "|E|" if picture.component == "norm" else f"|E_{picture.component}|"
    what = f"{of} ≤ U95" if picture.limit_um is None else "undecided at 95 %"
    return (f"grey: {what}, {number(percent, 0)} % of the volume",)


def unknown_words(picture: LivePicture) -> str:
    """Explain “± ?” in the heading: the errors without a stated uncertainty, and what to do."""
    uncertainty = picture.uncertainty
    if uncertainty is None or uncertainty.errors.is_known or picture.is_rotary:
        return ""
    remarks = "; ".join(uncertainty.errors.remarks())
    return f"{remarks}. State it in [uncertainty] of the scene, or calibrate these errors."


def range_conditions(picture: LivePicture) -> tuple[str, ...]:
    scale = picture.scale
    fixed = picture.state.look.range_mode == "fixed"
    return (formatting.range_words(scale.low, scale.high, scale.unit),) if fixed else ()


def look_words(picture: LivePicture) -> list[str]:
    """List exaggeration, view, conditions and machine; for a difference of both sides."""
    machine, describe = picture.drawn_state.scene.machine, picture.describe_sides
    size = " × ".join(f"{edge:.0f}" for edge in picture.grid.extent_mm)
    nodes = spell_count(picture.field.norm_um.size)
    return [
        f"exaggeration {formatting.spell_factor(picture.exaggeration)}",
        f"{describe(lambda state: state.loop.value)} loop",
        describe(lambda state: formatting.reference_words(state.scene)),
        *picture_conditions(picture),
        f"{machine.title}, chain {machine.chain}",
        f"{size} mm, {nodes} nodes",
        describe(lambda state: formatting.convention_words(state.scene)),
        describe(lambda state: "exact chain" if state.controller else "first-order model"),
        "error = actual − nominal",
    ]


def projected_labels(
    picture: LivePicture, camera: CameraMemory, height: int, width: int
) -> tuple[list[tuple[str, Array]], float | None]:
    """Project the labels of a picture, px from the lower left; also return the scale.

    It is in px per mm in the middle of the volume; None without scale bars.
    """
    labels = [*axis_labels(picture), *point_labels(picture)]
    points = np.array([*(label.at_mm for label in labels), picture.grid.bounds_mm.mean(axis=0)])
    position = np.array(camera.position)
    axes = view_axes(position - camera.look_at, camera.up)
    across, up, away = ((points * SCENE_PER_MM - position) @ axes * (1.0, 1.0, -1.0)).T
    px = height / 2.0 / np.tan(camera.fov_rad / 2.0) / away
    spots = np.stack([width / 2.0 + across * px, height / 2.0 + up * px], axis=-1)
    inside = (away > 0.0) & (spots > 0.0).all(axis=-1) & (spots < (width, height)).all(axis=-1)
    visible = [(label.text, spots[k]) for k, label in enumerate(labels) if inside[k]]
    has_bars = picture.state.look.bars and away[-1] > 0.0
    return visible, float(px[-1]) * SCENE_PER_MM if has_bars else None
