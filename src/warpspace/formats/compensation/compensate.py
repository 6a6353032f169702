"""A compensation from a scene to the controller and back: written, read, evaluated, applied."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.grid import Grid, build_grid
from warpspace.formats.compensation.corrector import Corrector, build_corrector, field_after
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.importing import Reading
from warpspace.formats.kind import SIGNS, Format, ReadOptions
from warpspace.formats.measured import Imported
from warpspace.formats.registry import find_format
from warpspace.formats.source import Source, source_of_text
from warpspace.formats.terms import Tables
from warpspace.formats.to_scene import into_scene
from warpspace.kinematics.model import Coordinates
from warpspace.machine.errors import ErrorSet
from warpspace.machine.travel import TravelDirection
from warpspace.scene.model import Scene
from warpspace.units import Array

NODES = 28
"""Nodes per axis that what is left is evaluated at: between the points of usual tables."""
RESOLUTION = (0.0, 0.1)
"""mm or degrees."""
WAYS = {TravelDirection.FORWARD: 1, TravelDirection.BACKWARD: -1}


@dataclass(frozen=True)
class Plan:
    """What is asked for.

    Attributes
    ----------
    format : str
    points : int or mapping of str to int or None
        Points of the table per axis; None for what suits the format.
    resolution : float
        Smallest step of a value, mm or degrees; 0 for that of the format.
    sign : str
        "error", "correction", or empty for what the manual says.
    loop : str
        "tool", "relative", or empty.
    orientation : bool
        Whether the tool axis is corrected too.
    stem : str
        Name of the files.
    """

    format: str
    points: int | Mapping[str, int] | None = None
    resolution: float = 0.0
    sign: str = ""
    loop: str = ""
    orientation: bool = False
    stem: str = "compensation"


@dataclass(frozen=True)
class Compensation:
    """A compensation and what it leaves.

    Attributes
    ----------
    format : Format
    files : mapping of str to str
        Texts by what is added to the name of the file.
    points : mapping of str to int
        Points of the table per axis.
    size : int
        Numbers that the controller holds.
    grid : Grid
    before, after : ErrorField
    loop : str
    axes : tuple of str
        Axes that are corrected.
    assumed, notes : tuple of str
    """

    format: Format
    files: Mapping[str, str]
    points: Mapping[str, int]
    size: int
    grid: Grid
    before: ErrorField
    after: ErrorField
    loop: str
    axes: tuple[str, ...]
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def bytes(self) -> int:
        """Size of the files."""
        return sum(len(text.encode()) for text in self.files.values())

    @property
    def before_statistics(self) -> Statistics:
        """Of the scene as it is."""
        return volume_statistics(self.before, self.grid)

    @property
    def after_statistics(self) -> Statistics:
        """Of what is left."""
        return volume_statistics(self.after, self.grid)


def table_points(
    kind: Format, scene: Scene, asked: int | Mapping[str, int] | None
) -> dict[str, int]:
    """Give the points of a table along each axis of the volume.

    Raises
    ------
    OptionError
        If the controller takes fewer.
    """
    axes = [axis for axis in scene.machine.axes if axis in scene.workspace.volume_axes]
    if not axes:
        raise OptionError(f"{scene.name}: no axis has a range in [workspace]; nothing to correct")
    if isinstance(asked, Mapping):
        for axis in asked:
            if axis not in axes:
                raise OptionError(f"--grid {axis}: expected one of {', '.join(axes)}")
        given = {axis: asked.get(axis, kind.points) for axis in axes}
    else:
        given = dict.fromkeys(axes, asked or kind.points)
    for axis, count in given.items():
        if not 2 <= count <= kind.most_points:
            raise OptionError(
                f"--grid {axis}={count}: {kind.name} takes 2 to {kind.most_points} points an axis"
            )
    return given


def compensate(scene: Scene, plan: Plan, nodes: int = NODES) -> Compensation:
    """Write the compensation of a scene, have it read and evaluated, and give what is left.

    Parameters
    ----------
    scene : Scene
    plan : Plan
    nodes : int, optional
        Nodes per axis that what is left is evaluated at.

    Returns
    -------
    Compensation

    Raises
    ------
    OptionError, SceneError, UnknownNameError
        If the format cannot be written, or does not hold what is asked for.
    """
    kind = find_format(plan.format)
    if kind.write is None:
        raise OptionError(
            f"{kind.name} is read only; `warpspace formats` lists what can be written"
        )
    if plan.orientation and not kind.orientation:
        raise OptionError(f"--orientation: {kind.name} corrects the position only")
    low, high = RESOLUTION
    if not low <= plan.resolution <= high:
        raise OptionError(f"--resolution {plan.resolution:g}; expected {low:g} … {high:g} mm")
    if plan.sign and (plan.sign not in SIGNS or kind.tables is None):
        raise OptionError(f"--sign {plan.sign!r}: expected error or correction, of a table")
    if scene.model.direction == TravelDirection.DIFFERENCE:
        scene = replace(scene, model=replace(scene.model, direction=TravelDirection.MEAN))
    corrector = build_corrector(scene, plan.loop, orientation=plan.orientation)
    points = table_points(kind, scene, plan.points)
    wanted = Wanted(scene, corrector, points, plan.resolution, plan.sign, plan.stem)
    files = kind.write(wanted)
    grid = build_grid(scene.model, scene.workspace, nodes)
    sources = [
        source_of_text(text, f"{plan.stem}{add}{'' if add else kind.endings[0]}")
        for add, text in files.items()
    ]
    controller = _read_back(kind, sources, wanted)
    reference = _reference(scene)
    before = field_after(corrector, grid.coordinates, {}, grid.nominal_mm, reference, {})
    after = field_after(
        corrector,
        grid.coordinates,
        controller.moves(grid.coordinates),
        grid.nominal_mm,
        reference,
        {} if reference is None else controller.moves(reference),
    )
    return Compensation(
        kind,
        files,
        points,
        controller.size,
        grid,
        before,
        after,
        str(corrector.loop),
        corrector.moved,
        controller.assumed,
        controller.notes,
    )


@dataclass(frozen=True)
class _Controller:
    """What a controller does with the files it has read."""

    corrector: Corrector
    tables: Tables | None
    size: int
    assumed: tuple[str, ...]
    notes: tuple[str, ...]
    direction: int

    def moves(self, coordinates: Coordinates) -> dict[str, Array]:
        """Give what it adds to the commanded positions."""
        if self.tables is None:
            return self.corrector.moves(coordinates)
        return dict(self.tables.corrections(coordinates, self.direction))


def _read_back(kind: Format, sources: list[Source], wanted: Wanted) -> _Controller:
    """Read the files as the controller does."""
    scene = wanted.scene
    options = ReadOptions(scene.machine, sign=wanted.sign)
    direction = WAYS.get(TravelDirection(scene.model.direction), 0)
    if kind.tables is not None:
        tables = kind.tables(sources, options)
        return _Controller(
            wanted.corrector, tables, tables.size, tables.assumed, tables.notes, direction
        )
    found = kind.read(sources, options)
    bare = replace(scene, errors=ErrorSet(), uncertainty={}, measured={})
    held = into_scene(Reading(found, kind, recognised=True), bare, scene.title, scene.name).scene
    errors = held.errors
    if wanted.resolution:
        errors = _rounded(errors, wanted.resolution)
    model = replace(held.model, direction=scene.model.direction)
    corrector = replace(wanted.corrector, model=model, errors=errors)
    notes = list(found.notes)
    lost = [key for key in scene.errors if key not in errors and scene.errors.amplitude(key)]
    if lost:
        notes.append(f"has no place for {', '.join(lost)}")
    differing = [
        axis
        for axis in scene.machine.axes
        if model.convention(axis).name != scene.model.convention(axis).name
    ]
    if differing:
        notes.append(
            f"errors of {', '.join(differing)} stand in another convention here than in the scene"
        )
    return _Controller(corrector, None, _count(found), found.assumed, tuple(notes), direction)


def _rounded(errors: ErrorSet, resolution: float) -> ErrorSet:
    """Refuse: the resolution of error parameters is that of their digits."""
    del errors
    raise OptionError(
        f"--resolution {resolution:g}: formats of error parameters have as many digits as they"
        " print; expected a table of corrections"
    )


def _count(found: Imported) -> int:
    """Count the numbers of an error set."""
    series = sum(len(run.values) for one in found.series for run in one.runs)
    planes = sum(len(one.first) * len(one.second) for one in found.planes)
    return series + planes + len(found.constants)


def _reference(scene: Scene) -> dict[str, Array] | None:
    """Give the coordinates of the point that is held still."""
    if scene.reference is None:
        return None
    still = {**scene.workspace.positions, **scene.reference}
    return {axis: np.asarray(still[axis]) for axis in scene.machine.axes}
