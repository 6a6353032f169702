"""The errors of a scene as numbers at points: what formats of error parameters write."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, Imported, Plane, Run, Series
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.curves.directional import Directional
from warpspace.machine.curves.table import Table
from warpspace.machine.curves.two_arguments import TwoArguments
from warpspace.machine.parameters import parameter
from warpspace.scene.model import Scene


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
        if isinstance(curve, Table) and len(curve.points) <= count:
            at = np.array(curve.kinks)
        if isinstance(curve, TwoArguments):
            planes.append(Plane(key, curve.axes, *curve.positions, curve.values))
        elif isinstance(curve, Directional):
            runs = tuple(
                Run(1, way, tuple(part.evaluate(at).tolist()))
                for way, part in ((FORWARD, curve.forward), (BACKWARD, curve.backward))
            )
            series.append(Series(key, tuple(at.tolist()), runs))
        else:
            run = Run(1, BOTH, tuple(np.asarray(curve.evaluate(at)).tolist()))
            series.append(Series(key, tuple(at.tolist()), (run,)))
    return Imported("scene", tuple(series), tuple(planes), constants)


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
