"""Error gains: displacement of the functional point per unit of each error, and its lever."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from warpspace.analysis.blocks import Bars, Block, Column, Panel, Series, Table, number_columns
from warpspace.analysis.description import Analysis, ProgressCallback, Result
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.options import (
    AT_HELP,
    LOOP_HELP,
    LOOP_UNSET,
    Place,
    error_words,
    option,
    place_words,
)
from warpspace.analysis.registry import PUBLICATIONS
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import JacobianColumn as Response
from warpspace.kinematics.chain import branch_frames, nominal_point
from warpspace.kinematics.chain import columns as responses
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.axes import Parameter, is_linear, is_rotary, parameter
from warpspace.machine.definition import Machine
from warpspace.scene.model import Scene
from warpspace.units import Array

# The motions and offsets between an error and the functional point.

Part = tuple[str, tuple[float, float, float]]  # name and vector in R, mm


def lever_parts(model: Model, loop: Loop, key: str, at: Mapping[str, float]) -> tuple[Part, ...]:
    row = parameter(key)
    on_tool = row.axis in model.machine.chain.tool
    if loop is Loop.RELATIVE and not on_tool:
        return ()
    side = "tool" if on_tool else "workpiece"
    coordinates = complete_coordinates(model.machine, at)
    stops: list[tuple[str, Array]] = []
    started, last = False, np.eye(4)
    for frames in branch_frames(model, side, coordinates):
        name = frames.axis.name
        if started:
            stops.append((f"{name} offset", frames.before[:3, 3]))
        if name == row.axis:
            started = True
            # Where the error acts behind the motion, the motion is no part of its lever: zero.
            stops.append(("", model.convention(name).frame(frames, row)[:3, 3]))
        if started:
            stops.append((f"{name} motion", frames.after[:3, 3]))
        last = frames.after
    for name, offset, rotation in model.machine.end_frames(side):
        last = last @ transforms.placed(offset, rotation)
        stops.append((name, last[:3, 3]))
    point = model.tool_point_mm if side == "tool" else model.workpiece_point_mm
    stops.append(("point", transforms.apply(last, point)))
    vectors = [(name, vector(end - start)) for (_, start), (name, end) in pairwise(stops)]
    return tuple((name, vector) for name, vector in vectors if any(vector))


def vector(values: Array) -> tuple[float, float, float]:
    """Return the three floats of an array without rounding errors and negative zeros."""
    x, y, z = (round(float(value), 9) + 0.0 for value in values)
    return x, y, z


DEFAULT_SHARE = 0.8
DEFAULT_STEPS_DEG = (1.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0)
"""Of rotary axes: the finest that keeps to `MAX_DEFAULT_NODES` positions; 1° for two axes."""
MAX_NODES = 5_000_000
MAX_DEFAULT_NODES = 500_000
NODES_AT_ONCE = 16_000  # of a sweep: few calls, and arrays that stay in the cache


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain of one parameter."""

    json_keys: ClassVar[tuple[str, ...]] = ("key", "symbol", "unit", "x", "y", "z", "norm")
    key: str
    x: float  # µm/µm or µm/µrad; in R: signed at a point, largest absolute value over the travel
    y: float
    z: float
    # length; over the travel the largest, which need not be where the components are largest
    norm: float
    # from the origin of the frame the error sits in to the point, in R; over the travel where the
    # norm is largest
    lever_mm: tuple[float, float, float]
    at: Mapping[str, float]  # mm or degrees; axis positions that belong to the lever
    # the lever taken apart: motions and offsets it is made of, in R; empty for a workpiece-side
    # parameter in the relative loop, where the point belongs to the other branch
    lever_parts_mm: tuple[Part, ...] = ()
    is_key: bool = False  # whether it is one of the key errors, see `mark_key_errors`

    @property
    def parameter(self) -> Parameter:
        return parameter(self.key)

    @property
    def symbol(self) -> str:
        return self.parameter.symbol

    @property
    def unit(self) -> str:
        return f"µm/{self.parameter.unit}"


def gains_at(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    at: Mapping[str, ArrayLike],
    share: float = DEFAULT_SHARE,
) -> tuple[Gain, ...]:
    chosen = loop_keys(model, loop, keys)
    coordinates = complete_coordinates(model.machine, at)
    point = nominal_point(model, loop, coordinates)
    columns = responses(model, loop, chosen, coordinates, point)
    rows: list[Gain] = []
    for key in chosen:
        x, y, z = vector(np.broadcast_to(columns[key].position, (3,)))
        largest = _larger(model, loop, key, columns[key], coordinates)
        rows.append(replace(largest, x=x, y=y, z=z))
    return mark_key_errors(rows, share)


def gains_max(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    ranges: Mapping[str, tuple[float, float]],
    step_deg: float | None = None,
    share: float = DEFAULT_SHARE,
) -> tuple[Gain, ...]:
    """Compute the largest absolute gains over the travel."""
    chosen = loop_keys(model, loop, keys)
    best: dict[str, Gain] = {}
    for coordinates in _sweep(model, loop, ranges, step_deg):
        point = nominal_point(model, loop, coordinates)
        columns = responses(model, loop, chosen, coordinates, point)
        for key in chosen:
            best[key] = _larger(model, loop, key, columns[key], coordinates, best.get(key))
    return mark_key_errors(list(best.values()), share)


def mark_key_errors(rows: Sequence[Gain], share: float = DEFAULT_SHARE) -> tuple[Gain, ...]:
    """Sort by norm and mark the largest that together make up a share of the sum of squares."""
    if not 0.0 < share <= 1.0:
        raise OptionError(f"share: {share:g}; expected above 0, at most 1, for instance 0.8")
    # Rounded, so that gains that are equal but for rounding errors keep the order of the table.
    ranked = sorted(rows, key=lambda row: -round(row.norm, 9))
    squares = np.array([row.norm**2 for row in ranked])
    before = np.cumsum(squares) - squares
    limit = share * squares.sum() * (1.0 - 1e-12)
    return tuple(
        replace(row, is_key=bool(row.norm > 0.0 and done < limit))
        for row, done in zip(ranked, before, strict=True)
    )


def _larger(
    model: Model,
    loop: Loop,
    key: str,
    col: Response,
    coordinates: Mapping[str, Array],
    best: Gain | None = None,
) -> Gain:
    shape = np.broadcast_shapes(*(values.shape for values in coordinates.values()))
    top = np.abs(col.position)
    while top.ndim > 1:  # one dimension after the other: long rows, several times faster
        top = top.max(axis=0)
    squares = np.einsum("...i,...i", col.position, col.position)
    is_below = best is not None and not (top > (best.x, best.y, best.z)).any()
    if best is not None and is_below and np.sqrt(squares.max()) <= best.norm:
        return best
    norms = np.broadcast_to(np.sqrt(squares), shape)
    # Rounded, so that of positions that are equal but for rounding errors the first is taken.
    index = np.unravel_index(int(np.argmax(np.round(norms, 9))), shape)
    norm = float(norms[index])
    if best is not None:
        top = np.maximum(top, (best.x, best.y, best.z))
    x, y, z = vector(top)
    if best is not None and norm <= best.norm + 1e-9:
        return replace(best, x=x, y=y, z=z)
    at = {
        name: float(np.broadcast_to(values, shape)[index]) for name, values in coordinates.items()
    }
    lever = vector(np.broadcast_to(col.lever_mm, (*shape, 3))[index])
    return Gain(key, x, y, z, norm, lever, at, lever_parts(model, loop, key, at))


def _sweep(
    model: Model, loop: Loop, ranges: Mapping[str, tuple[float, float]], step_deg: float | None
) -> Iterator[dict[str, Array]]:
    sides = ("tool", "workpiece") if loop is Loop.RELATIVE else (str(loop),)
    axes = [axis for side in sides for axis in model.machine.branch(side)]
    rotary = [axis.name for axis in axes if not axis.is_linear]
    step = _default_step(ranges, rotary) if step_deg is None else step_deg
    if not 0.0 < step <= 90.0:
        raise OptionError(f"step: {step:g}°; expected above 0, at most 90")
    spans = {name: ranges[name] for name in rotary}
    steps = {name: math.ceil((high - low) / step - 1e-9) for name, (low, high) in spans.items()}
    count = math.prod(number + 1 for number in steps.values())
    if count > MAX_NODES:
        raise OptionError(
            f"step: {step:g}° gives {count:,} positions; expected at most {MAX_NODES:,}"
        )
    turns = {name: np.linspace(*spans[name], steps[name] + 1) for name in rotary}
    linear = [axis.name for axis in axes if axis.is_linear]
    outer, inner = rotary[:1], rotary[1:]
    mesh = dict(zip(inner, np.meshgrid(*(turns[name] for name in inner)), strict=True))
    rows = max(1, NODES_AT_ONCE // math.prod(len(turns[name]) for name in inner))
    columns = [turns[name].reshape(-1, *(1 for _ in inner)) for name in outer]
    blocks = [np.array_split(column, range(rows, len(column), rows)) for column in columns]
    for values in product(*(dict.fromkeys(ranges[name]) for name in linear), *blocks):
        pairs = zip((*linear, *outer), values, strict=True)
        positions = {**mesh, **{name: np.asarray(value) for name, value in pairs}}
        yield complete_coordinates(model.machine, positions)


def _default_step(ranges: Mapping[str, tuple[float, float]], rotary: Sequence[str]) -> float:
    spans = [ranges[name][1] - ranges[name][0] for name in rotary]
    for step in DEFAULT_STEPS_DEG:
        if math.prod(math.ceil(span / step) + 1 for span in spans) <= MAX_DEFAULT_NODES:
            return step
    return DEFAULT_STEPS_DEG[-1]


@dataclass(frozen=True, kw_only=True)
class Gains(Analysis):
    """Rank the error parameters of SCENE by their gain.

    A gain is the displacement of the functional point per unit of an error: µm per µm or µm per
    µrad, signed at a point (--at, by default the middle of the scene's ranges). The lever from the
    origin of the frame an error sits in to the point explains it: 1 m gives 1 µm per µrad.
    """

    name = "gains"
    task = "understand"
    has_chart = True
    has_table = True
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    at: Place = option((), AT_HELP, unset="the middle of the scene's ranges")
    over_travel: bool = option(
        False,
        "The largest absolute gains over the machine's travel instead of those at a point",
        flag="--max",
        label="Over the travel",
    )
    step_deg: float | None = option(
        None,
        "Step of rotary axes (ends of linear axes are exact)",
        unit="degrees",
        unset="1; 5 for three rotary axes",
        needs="over_travel",
    )
    share: float = option(
        DEFAULT_SHARE,
        "Key errors: the largest that together make up this share of the sum of squares",
    )

    def run(self, scene: Scene, _watch: ProgressCallback, /) -> "GainsResult":
        if self.at and self.over_travel:
            raise OptionError("{at}: expected one point, and none with {over_travel}")
        if self.step_deg is not None and not self.over_travel:
            raise OptionError("{step_deg} belongs to {over_travel}")
        keys, loop = scene.parameter_keys, scene.view(self.loop).loop
        if self.over_travel:
            travel = {name: axis.travel for name, axis in scene.machine.axes.items()}
            gains = gains_max(scene.model, loop, keys, travel, self.step_deg, self.share)
        else:
            place = {**scene.workspace.positions, **dict(self.at)}
            gains = gains_at(scene.model, loop, keys, place, self.share)
        return GainsResult(gains=gains, analysis=replace(self, loop=loop), machine=scene.machine)


@dataclass(frozen=True, kw_only=True)
class GainsResult(Result, Sequence[Gain]):
    """Gains of all parameters in a loop, largest first."""

    json_keys = ("gains",)
    gains: tuple[Gain, ...]
    analysis: Gains
    machine: Machine

    def __getitem__(self, index: Any) -> Any:
        return self.gains[index]

    def __len__(self) -> int:
        return len(self.gains)

    @property
    def where(self) -> str:
        if self.analysis.over_travel:
            return f"{self.analysis.loop} loop · largest absolute gains over the travel"
        return f"{self.analysis.loop} loop · gains at {place_words(self.gains[0].at)}"

    def blocks(self) -> Iterator[Block]:
        count = sum(gain.is_key for gain in self.gains)
        yield f"{self.machine.title} · {self.where}"
        yield self._table()
        yield (
            f"  * key errors: the largest {count} make up {self.analysis.share:.0%} of the sum of"
            " squares, one µm and one µrad counted alike"
        )
        yield self.bars()

    def _table(self) -> Table:
        over_travel = self.analysis.over_travel
        printed = {
            publication.name: publication.key_errors(self.machine.name)
            for publication in PUBLICATIONS.members()
        }
        lever = "lever of |E| at" if over_travel else "largest component read off the lever"
        columns = (
            Column(form=lambda key: "*" if key else "", key="key_error", leads=True),
            Column("key", key="key", leads=True),
            Column("symbol", key="symbol"),
            *number_columns(("|E|", "x", "y", "z"), ".3f", keys=("norm", "x", "y", "z")),
            Column("unit", key="unit"),
            *(
                Column(
                    name, lambda key: "key" if key else "", key=f"{name}_key_error",
                    shows=bool(keys),
                )
                for name, keys in printed.items()
            ),
            Column("name", key="name", wraps=True),
            *(Column(key=f"lever_{x}_mm", shows=False) for x in "xyz"),
            *number_columns(("lever x", "y", "z"), ".6g", "mm"),
            Column(lever, wraps=True),
            *(
                Column(key=f"{name}_{'mm' if is_linear(name) else 'deg'}", shows=False)
                for name in self.gains[0].at
            ),
        )  # fmt: skip
        rows = [
            (
                gain.is_key, gain.key, gain.symbol, gain.norm, gain.x, gain.y, gain.z, gain.unit,
                *(gain.key in keys for keys in printed.values()), gain.parameter.name,
                *gain.lever_mm,
                *(gain.lever_mm if gain.parameter.is_rotation else (None, None, None)),
                _place(gain) if over_travel else _explain(gain), *gain.at.values(),
            )
            for gain in self.gains
        ]  # fmt: skip
        levers = ("lever_x_mm", "lever_y_mm", "lever_z_mm")
        order = (
            "key", "symbol", "name", "unit", "x", "y", "z", "norm", *levers, "key_error",
            *(f"{name}_key_error" for name in printed),
            *(column.key for column in columns[-len(self.gains[0].at) :]),
        )  # fmt: skip
        return Table(columns, rows, csv_order=order)

    def bars(self) -> Bars:
        signed = not self.analysis.over_travel
        panels = tuple(
            Panel(
                title="|E|" if name == "norm" else name,
                series=(Series([getattr(gain, name) for gain in self.gains], form=form),),
                unit="µm per µm or µrad",
                signed=signed and name != "norm",
                width=width,
            )
            for name, form, width in (("norm", ".2f", 2.2), *((name, "", 1.0) for name in "xyz"))
        )
        count = sum(gain.is_key for gain in self.gains)
        legend = f"key errors: the largest {count}, {self.analysis.share:.0%} of the sum of squares"
        return Bars(
            f"Error gains · {self.machine.title}", self.where,
            [error_words(gain.key) for gain in self.gains], panels,
            keys=[gain.is_key for gain in self.gains],
            legend=((legend, "key"), ("others", "plain")),
        )  # fmt: skip


def _explain(gain: Gain) -> str:
    if not gain.parameter.is_rotation:
        return ""
    largest = max(abs(gain.x), abs(gain.y), abs(gain.z))
    for index, length in enumerate(gain.lever_mm):
        if largest > 0.0 and abs(abs(length) * 1e-3 - largest) < 1e-9:
            parts = [
                f"{vector[index]:+g} {name}"
                for name, vector in gain.lever_parts_mm
                if abs(vector[index]) > 1e-6
            ]
            total = f"{'xyz'[index]}: {length:+g} mm"
            return f"{total} = {' '.join(parts)}" if len(parts) > 1 else total
    return ""


def _place(gain: Gain) -> str:
    if not gain.parameter.is_rotation:
        return ""
    rotary = is_rotary(gain.parameter.axis)
    return place_words({name: at for name, at in gain.at.items() if is_rotary(name) == rotary})
