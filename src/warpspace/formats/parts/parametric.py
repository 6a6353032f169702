"""The errors of a scene as numbers at points: what formats of error parameters write."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.measured import (
    BACKWARD,
    BOTH,
    FORWARD,
    Imported,
    Plane,
    Run,
    Series,
    plane_by_direction,
)
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.directional import Directional
from warpspace.machine.curves.table import Table
from warpspace.machine.curves.two_arguments import TwoArguments
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.scene.model import Scene
from warpspace.units import Array

WAYS = {TravelDirection.FORWARD: FORWARD, TravelDirection.BACKWARD: BACKWARD}


@dataclass(frozen=True)
class Rows:
    """Errors of one axis side by side.

    Attributes
    ----------
    keys : tuple of str
    rows : tuple
        Position, direction, and a value for each key.
    directed : bool
        Whether they depend on the direction of travel.
    """

    keys: tuple[str, ...]
    rows: tuple[tuple[float, int, tuple[float, ...]], ...]
    directed: bool


def places_along(scene: Scene, axis: str, count: int) -> np.ndarray:
    """Give positions of a table along an axis: its working range, else its travel."""
    return np.linspace(*scene.axis_span(axis), count)


def zero_key(scene: Scene) -> str:
    """Give an error of the machine for a file of a scene without any: its value is zero."""
    axis = next(iter(scene.machine.axes))
    return f"E{'XYZABC'[direction_index(axis) + (0 if is_linear(axis) else 3)]}{axis}"


def sampled(wanted: Wanted) -> Imported:
    """Sample the errors of a scene at the points of a table.

    Parameters
    ----------
    wanted : Wanted

    Returns
    -------
    Imported
        A table keeps its own points where it has no more than are asked for.
    """
    scene = wanted.scene
    constants: dict[str, float] = {}
    series: list[Series] = []
    planes: list[Plane] = []
    for key, curve in scene.errors.functions.items():
        row = parameter(key)
        if row.axis not in scene.machine.axes:
            continue
        if row.is_constant:
            constants[key] = float(curve.amplitude)
            continue
        count = wanted.points.get(row.axis) or max(wanted.points.values())
        at = places_along(scene, row.axis, count)
        ways = _ways(curve)
        other = _second_axis(curve)
        tabled = all(isinstance(one, Table | TwoArguments) for one in ways.values() or [curve])
        if tabled and (other is not None or len(curve.kinks) <= count):
            at = np.array(curve.kinks)
        elif other is not None:
            at = np.union1d(at, curve.kinks)
        if other is not None:
            tables = {
                way: np.asarray(
                    part.evaluate_at(row.axis, {row.axis: at[:, None], other[0]: other[1]})
                )
                + np.zeros((len(at), len(other[1])))
                for way, part in {FORWARD: curve, BACKWARD: curve, **ways}.items()
            }
            planes.append(plane_by_direction(key, (row.axis, other[0]), (at, other[1]), tables))
        else:
            runs = tuple(
                Run(1, way, tuple(np.asarray(part.evaluate(at)).tolist()))
                for way, part in (ways or {BOTH: curve}).items()
            )
            series.append(Series(key, tuple(at.tolist()), runs))
    return Imported("scene", tuple(series), tuple(planes), constants)


def in_one_direction(held: Imported, wanted: Wanted) -> Imported:
    """Give errors by direction of travel as the scene has them in the direction it looks at."""
    way = WAYS.get(TravelDirection(wanted.scene.model.direction), BOTH)

    def values(one: Series) -> Array:
        mean = one.mean(way)
        return one.values if mean is None else mean

    return replace(
        held,
        series=tuple(
            replace(one, runs=(Run(1, BOTH, tuple(values(one).tolist())),)) for one in held.series
        ),
        planes=tuple(
            replace(one, values=tuple(map(tuple, one.table(way).tolist())), backward=())
            for one in held.planes
        ),
    )


def _ways(curve: ErrorFunction) -> dict[int, ErrorFunction]:
    """Give the curves of both directions of travel; none where they are the same."""
    if not isinstance(curve, Directional):
        return {}
    return {FORWARD: curve.forward, BACKWARD: curve.backward}


def _second_axis(curve: ErrorFunction) -> tuple[str, Array] | None:
    """Give the other axis that an error depends on, with its positions; None where there is none.

    Where its two directions depend on two different axes, both are taken in the middle of these.
    """
    surfaces = [one for one in (curve, *_ways(curve).values()) if isinstance(one, TwoArguments)]
    others = {one.axes[1] for one in surfaces}
    if len(others) != 1:
        return None
    at = np.unique(np.concatenate([one.positions[1] for one in surfaces]))
    return others.pop(), at


def table_of(series: Sequence[Series]) -> Rows:
    """Put errors of one axis side by side, at all their positions.

    Parameters
    ----------
    series : sequence of Series
        Of one axis.

    Returns
    -------
    Rows
        Values between the points of a series are interpolated linearly, beyond its ends held.
    """
    at = np.unique(np.concatenate([one.positions for one in series]))
    directed = any(one.reversal is not None for one in series)
    ways = (FORWARD, BACKWARD) if directed else (BOTH,)
    rows: list[tuple[float, int, tuple[float, ...]]] = []
    for way in ways:
        columns = []
        for one in series:
            mean = one.mean(way)
            values = one.values if mean is None else mean
            columns.append(np.interp(at, one.positions, values))
        rows += [
            (float(q), way, tuple(float(column[i]) for column in columns)) for i, q in enumerate(at)
        ]
    return Rows(tuple(one.key for one in series), tuple(rows), directed)
