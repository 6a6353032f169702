"""Which table is worth it: what is left, by kind of table and number of points."""

from collections.abc import Sequence
from dataclasses import dataclass

from warpspace.analysis.statistics import Statistics
from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import Compensation, Plan, compensate
from warpspace.formats.registry import find_format, formats
from warpspace.scene.model import Scene

POINTS = (3, 5, 9, 17)
MOST = 32
"""Compensations of one sweep."""
FEW = ("linuxcnc-matrix", "marlin")
"""Formats without a grid that a sweep shows where none are named; Klipper's skew is Marlin's."""
TABLES = ("sinumerik-enc", "sinumerik-cec", "heidenhain", "fanuc-3d", "isg-csv")


@dataclass(frozen=True)
class Step:
    """One compensation of a sweep.

    Attributes
    ----------
    format : str
    points : int
        Per axis; 0 where there is no grid.
    numbers, bytes : int
        Size in the controller and of the files.
    pitch : float
        Largest step of the table, mm or degrees; 0 where there is none.
    after : Statistics
    """

    format: str
    points: int
    numbers: int
    bytes: int
    pitch: float
    after: Statistics


def sweep(
    scene: Scene,
    plan: Plan,
    kinds: Sequence[str] = (),
    points: Sequence[int] = POINTS,
) -> tuple[Statistics, list[Step], list[str]]:
    """Compensate a scene with several tables.

    Parameters
    ----------
    scene : Scene
    plan : Plan
        Resolution, loop and sign; its format and points are not used.
    kinds : sequence of str, optional
        Formats; by default those of different structure that the scene can have.
    points : sequence of int, optional
        Points per axis.

    Returns
    -------
    before : Statistics
    steps : list of Step
    left_out : list of str
        Why a kind has no step.

    Raises
    ------
    OptionError
        If there are too many, or none that can be done.
    """
    names = list(dict.fromkeys(kinds)) or [*TABLES, *FEW]
    wanted = [(name, count) for name in names for count in _counts(name, points)]
    if len(wanted) > MOST:
        raise OptionError(f"--sweep of {len(wanted)} tables; expected at most {MOST}")
    before: Statistics | None = None
    steps: list[Step] = []
    left_out: dict[str, str] = {}
    for name, count in wanted:
        kind = find_format(name)
        resolution = 0.0 if kind.parametric else plan.resolution
        asked = Plan(name, count or None, resolution, plan.sign if kind.tables else "", plan.loop)
        try:
            found = compensate(scene, asked)
        except OptionError as error:
            if kinds:
                raise
            left_out[name] = str(error)
            continue
        before = found.before_statistics
        steps.append(_step(scene, found, count))
    if before is None:
        raise OptionError(f"--sweep: no table can be made: {'; '.join(left_out.values())}")
    return before, steps, [f"{name}: {why}" for name, why in left_out.items()]


def _counts(name: str, points: Sequence[int]) -> tuple[int, ...]:
    """Give the numbers of points of a format: none where it has no grid."""
    kind = find_format(name)
    if kind.grid.startswith("none"):
        return (0,)
    return tuple(count for count in points if 2 <= count <= kind.most_points)


def _step(scene: Scene, found: Compensation, count: int) -> Step:
    """Summarise a compensation."""
    spans = [
        (scene.workspace.ranges[axis][1] - scene.workspace.ranges[axis][0]) / (number - 1)
        for axis, number in found.points.items()
    ]
    pitch = max(spans) if count else 0.0
    return Step(found.format.name, count, found.size, found.bytes, pitch, found.after_statistics)


def written_formats() -> tuple[str, ...]:
    """List the formats that can be written."""
    return tuple(one.name for one in formats() if one.can_write)
