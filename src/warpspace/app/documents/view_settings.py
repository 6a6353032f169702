"""How a scene is looked at as one line of text: for links and for saved scenes.

The line is a query string (``loop=relative&B=30&look.surface=cut``) with only what differs from the
scene as opened. Reading it trusts nothing: every value passes the pure updates of the state, what
cannot be read is left out and named.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from urllib.parse import parse_qsl, urlencode

from warpspace.app.evaluation.compare import plain_state, scene_side
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, Shown, start_state
from warpspace.app.state.bench import option_names
from warpspace.app.state.comparison import BEFORE, NOBODY, PRESENT, SHOWN, Comparison, Side
from warpspace.app.state.look import linear_spans, slice_spans
from warpspace.app.state.picked import Picked, read_trace, spell_trace
from warpspace.app.state.ranges import Exclusions
from warpspace.app.state.spelling import (
    Unreadable,
    read_number,
    read_numbers,
    read_point,
    read_switch,
    refuse,
    spell,
    spell_numbers,
)
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop

MAX_LENGTH = 16_000
MAX_FIELDS = 400
CAMERA = "camera"
CAMERA_NUMBERS = 10
FARTHEST = 1000.0  # farthest place of a camera, in units of the drawing
FOV_RAD = (0.01, 2.5)
LOOK_NAMES = ("surface", "quantity", "range_mode")
LOOK_SWITCHES = ("isolines", "arrows", "worst", "bars", "follow")
MACHINE_SWITCHES = ("shown", "bent", "ghost")
TRACE = "why.trace"
Handler = Callable[[AppState, str], AppState]


def settings_line(state: AppState, camera: CameraMemory | None = None) -> str:
    """Spell how a state is looked at, and its amplitudes, as a query string."""
    pairs = [*_differences(state)]
    if camera is not None:
        numbers = (*camera.position, *camera.look_at, *camera.up, camera.fov_rad)
        pairs.append((CAMERA, ",".join(f"{number:.6g}" for number in numbers)))
    return urlencode(pairs)


def _differences(state: AppState) -> Iterator[tuple[str, str]]:
    opened = start_state(state.scene)
    for key, value in state.amplitudes.items():
        if value != opened.amplitudes.get(key):
            yield key, repr(value)
    for axis, value in state.positions.items():
        if value != opened.positions.get(axis):
            yield axis, repr(value)
    if state.exaggeration != opened.exaggeration:
        yield "exaggeration", "auto" if state.exaggeration is None else repr(state.exaggeration)
    for name in ("component", "loop", "placed", "nodes"):
        if getattr(state, name) != getattr(opened, name):
            yield name, spell(getattr(state, name))
    for group in ("shown", "look", "machine", "specification"):
        now, before = getattr(state, group), getattr(opened, group)
        for field in fields(now):
            value = getattr(now, field.name)
            if value == getattr(before, field.name):
                continue
            if isinstance(value, dict):
                yield from (
                    (f"{group}.{field.name}.{axis}", repr(at))
                    for axis, at in value.items()
                    if axis in state.scene.machine.axes
                )
            elif isinstance(value, frozenset):
                yield f"{group}.{field.name}", ",".join(sorted(map(str, value)))
            else:
                yield f"{group}.{field.name}", spell(value)
    if state.rotary.off:
        yield "rotary.off", ",".join(map(str, sorted(state.rotary.off)))
    if state.rotary.own_mm is not None:
        yield "rotary.own", spell_numbers(state.rotary.own_mm)
    if state.rotary.chosen:
        yield "rotary.chosen", state.rotary.chosen
    for axis, at in state.rotary.held:
        if axis in state.positions:
            yield f"rotary.held.{axis}", spell_numbers(at)
    yield from state.bench.pairs()
    for name in ("excluded", "only"):
        if keys := getattr(state.exclusions, name):
            yield name, ",".join(sorted(keys))
    if state.picked is not None:
        if state.picked.point_mm is not None:
            yield TRACE, spell_trace(state.picked)
        yield from ((f"why.{axis}", repr(at)) for axis, at in state.picked.at.items())
        if state.lever:
            yield "lever", state.lever


def with_settings(state: AppState, line: str) -> AppState:
    """Apply a line of settings to a state."""
    handlers = _handlers(state)
    unread: list[str] = []
    for name, value in _pairs(line):
        if name == CAMERA:
            continue
        try:
            state = handlers[name](state, value)
        except (KeyError, Unreadable):
            unread.append(f"{name}={value}"[:60])
    if unread:
        more = f" and {len(unread) - 4} more" if len(unread) > 4 else ""
        note = f"settings left out, since they mean nothing here: {', '.join(unread[:4])}{more}"
        state = replace(state, notes=(*state.notes, note))
    return state


def camera_of(line: str) -> CameraMemory | None:
    """Read the camera of a line of settings; None where there is none that can be used."""
    text = dict(_pairs(line)).get(CAMERA)
    if text is None:
        return None
    try:
        numbers = read_numbers(text, CAMERA_NUMBERS)
    except Unreadable:
        return None
    position, look_at, up = ((n[0], n[1], n[2]) for n in (numbers[:3], numbers[3:6], numbers[6:9]))
    distance = math.dist(position, look_at)
    usable = max(map(abs, numbers)) <= FARTHEST and distance > 1e-3 and math.hypot(*up) > 1e-3
    if not usable or not FOV_RAD[0] <= numbers[9] <= FOV_RAD[1]:
        return None
    return CameraMemory(position, look_at, up, numbers[9])


def _pairs(line: str) -> list[tuple[str, str]]:
    if len(line) > MAX_LENGTH:
        return []
    try:
        return parse_qsl(line, keep_blank_values=True, max_num_fields=MAX_FIELDS)
    except ValueError:
        return []


def _handlers(state: AppState) -> dict[str, Handler]:
    found: dict[str, Handler] = {
        "exaggeration": lambda s, v: s.with_exaggeration(None if v == "auto" else read_number(v)),
        "component": lambda s, v: s.with_component(v),
        "loop": lambda s, v: s.with_loop(v) if v in [*Loop] else refuse(),
        "placed": lambda s, v: replace(s, placed=read_switch(v)),
        "nodes": lambda s, v: s.with_nodes(read_number(v)),
        "look.range_top": lambda s, v: _with_top(s, read_number(v)),
        "specification.limit_um": lambda s, v: replace(
            s, specification=s.specification.with_limit(read_number(v))
        ),
        "specification.over": lambda s, v: replace(s, specification=s.specification.with_over(v)),
        "specification.distribution": lambda s, v: replace(
            s, specification=s.specification.with_distribution(v)
        ),
        "specification.percent": lambda s, v: replace(
            s, specification=s.specification.with_percent(read_number(v))
        ),
        "specification.fixed": lambda s, v: replace(
            s, specification=replace(s.specification, fixed=_known_keys(s, v))
        ),
        "specification.costs": lambda s, v: replace(
            s, specification=s.specification.with_costs(v, s.amplitudes.keys())
        ),
        "rotary.off": lambda s, v: replace(
            s, rotary=replace(s.rotary, off=frozenset(_indices(s, v)))
        ),
        "rotary.own": lambda s, v: replace(s, rotary=s.rotary.with_own(read_point(v))),
        "rotary.chosen": lambda s, v: replace(s, rotary=s.rotary.with_chosen(v)),
        "excluded": lambda s, v: _with_exclusions(s, excluded=v),
        "only": lambda s, v: _with_exclusions(s, only=v),
        "test": lambda s, v: replace(s, bench=s.bench.with_test(v)),
        "test.path": lambda s, v: replace(s, bench=replace(s.bench, path=read_switch(v))),
        TRACE: lambda s, v: replace(s, picked=read_trace(v)),
        "lever": lambda s, v: replace(s, lever=v) if v in s.amplitudes else refuse(),
    }
    for name in option_names():
        found[f"test.{name}"] = lambda s, v, name=name: replace(
            s, bench=s.bench.with_option(name, v)
        )
    for key in state.amplitudes:
        found[key] = lambda s, v, key=key: edits.with_typed_amplitude(s, key, read_number(v))
    for axis in state.positions:
        found[axis] = lambda s, v, axis=axis: s.with_position(axis, read_number(v))
        found[f"why.{axis}"] = lambda s, v, axis=axis: _with_turned(s, axis, read_number(v))
        found[f"rotary.held.{axis}"] = lambda s, v, axis=axis: _with_held(s, axis, v)
    for field in fields(Shown):
        found[f"shown.{field.name}"] = lambda s, v, name=field.name: s.with_shown(
            **{name: read_switch(v)}
        )
    for name in LOOK_NAMES:
        found[f"look.{name}"] = lambda s, v, name=name: replace(
            s, look=s.look.with_choice(**{name: v})
        )
    for name in LOOK_SWITCHES:
        found[f"look.{name}"] = lambda s, v, name=name: replace(
            s, look=s.look.switched(**{name: read_switch(v)})
        )
    for name in MACHINE_SWITCHES:
        found[f"machine.{name}"] = lambda s, v, name=name: replace(
            s, machine=s.machine.switched(**{name: read_switch(v)})
        )
    for axis, span in slice_spans(state.scene).items():
        found[f"look.slices_mm.{axis}"] = lambda s, v, axis=axis, span=span: replace(
            s, look=s.look.with_slice(axis, read_number(v), span)
        )
    for axis, span in linear_spans(state.scene).items():
        found[f"machine.linear_mm.{axis}"] = lambda s, v, axis=axis, span=span: replace(
            s, machine=s.machine.with_linear(axis, read_number(v), span)
        )
        found[f"why.{axis}"] = lambda s, v, axis=axis, span=span: _with_asked(
            s, axis, span.clamp(read_number(v), 0.0)
        )
    return found


def _with_top(state: AppState, value: float) -> AppState:
    mode = state.look.range_mode
    return replace(state, look=state.look.with_top(value).with_choice(range_mode=mode))


def _with_exclusions(state: AppState, *, excluded: str = "", only: str = "") -> AppState:
    """Set what is excluded, or what alone takes part, from a list of keys."""
    exclusions = Exclusions(
        frozenset(excluded.split(",")) if excluded else state.exclusions.excluded,
        frozenset(only.split(",")) if only else state.exclusions.only,
    )
    return replace(state, exclusions=exclusions.within(state.amplitudes.keys()))


def _known_keys(state: AppState, text: str) -> frozenset[str]:
    return frozenset(text.split(",")) & state.amplitudes.keys()


def _with_held(state: AppState, axis: str, text: str) -> AppState:
    span = state.position_spans[axis]
    at = tuple(span.clamp(value, span.low) for value in read_numbers(text)[:8])
    return replace(state, rotary=state.rotary.with_held(axis, at))


def _with_asked(state: AppState, axis: str, at: float) -> AppState:
    """Ask about a point, one axis position at a time, mm or degrees."""
    picked = state.picked or Picked({})
    return replace(state, picked=replace(picked, at={**picked.at, axis: at}))


def _with_turned(state: AppState, axis: str, at: float) -> AppState:
    if state.picked is None or state.picked.point_mm is None:
        refuse()
    return _with_asked(state, axis, state.position_spans[axis].clamp(at, 0.0))


def _indices(state: AppState, text: str) -> Iterator[int]:
    for value in read_numbers(text):
        if 0 <= value < len(state.scene.trace_points_mm):
            yield int(value)


# --- A comparison as one line of text -------------------------------------------------------------
# What is compared, what is drawn, and what was pinned.
#
# A side that is a scene, and what was pinned, are spelt as links of their own, so that they come
# back as they are seen: by the name of a scene that is known, or with all that is in them.

PREFIX = "compare."
PINNED = "pinned"
NOW = "now"  # what is steered, in files and links
TITLE, OLD_TITLE = f"{BEFORE}: ", "snapshot: "
"""What the title of a pinned state begins with, now and in older files and links."""
LONGEST_TITLE = 200
NAMES = frozenset({"a", "b", "shown", "ghost", PINNED, "a.title", "b.title", "pinned.title"})
Write = Callable[[AppState], str]
Read = Callable[[str], AppState]


def comparison_line(comparison: Comparison[AppState], write: Write) -> str:
    """Spell a comparison as a query string."""
    pairs: list[tuple[str, str]] = []
    for name, side in (("a", comparison.a), ("b", comparison.b)):
        if side is None or (name == "a" and side.state is None):
            continue
        pairs.append((name, _side_text(side, write)))
        if side.is_scene and side.state and side.title != scene_side(side.state.scene).title:
            pairs.append((f"{name}.title", side.title))
    if comparison.shown != Comparison().shown:
        pairs.append(("shown", comparison.shown))
    if not comparison.ghost:
        pairs.append(("ghost", "0"))
    pinned = comparison.pinned
    if pinned is not None and pinned.state is not None:
        pairs += [(PINNED, write(pinned.state)), ("pinned.title", pinned.title)]
    return urlencode([(PREFIX + name, value) for name, value in pairs])


def _side_text(side: Side[AppState], write: Write) -> str:
    if side.state is None:
        return NOW
    return write(side.state) if side.is_scene else PINNED


def with_comparison(state: AppState, pairs: Mapping[str, str], read: Read) -> AppState:
    """Give a state the comparison that somebody has written down."""
    given = {k.removeprefix(PREFIX): v for k, v in pairs.items() if k.startswith(PREFIX)}
    if not given:
        return state
    for name in given:
        if name not in NAMES:
            raise OptionError(f"the comparison says {name[:30]!r}, which means nothing")
    pinned = None
    notes = state.notes
    if PINNED in given:
        before = read(given[PINNED])
        notes = (*notes, *(f"{BEFORE}: {note}" for note in before.notes))
        plain = replace(plain_state(before), notes=())
        given_title = given.get("pinned.title", "")
        title = TITLE + given_title.removeprefix(OLD_TITLE).removeprefix(TITLE)
        pinned = Side(title[:LONGEST_TITLE], plain)
    a, b = (_side(given, name, pinned, read) for name in "ab")
    shown, ghost = given.get("shown", Comparison().shown), given.get("ghost", "1")
    if shown not in SHOWN or ghost not in ("0", "1"):
        raise OptionError("the comparison does not say what is drawn: expected a, b or difference")
    if given.get("pinned.title", "").startswith(OLD_TITLE) and a is None and b is pinned:
        a, b, shown = pinned, Side(), {"a": "b", "b": "a"}.get(shown, shown)
    found = Comparison(a or Side(), b, shown, ghost == "1", pinned)
    return replace(state, comparison=found, notes=notes)


def _side(
    given: Mapping[str, str], name: str, pinned: Side[AppState] | None, read: Read
) -> Side[AppState] | None:
    """Read one side; None where there is none."""
    text = given.get(name)
    if text is None or text == NOW:
        return None if text is None else Side()
    if text == PINNED:
        if pinned is None:
            raise OptionError("the comparison is with a pinned state, but holds none")
        return pinned
    side = scene_side(read(text).scene)
    title = given.get(f"{name}.title", side.title)[:LONGEST_TITLE]
    return side if title in (NOW, PRESENT, NOBODY, "") else replace(side, title=title)
