"""A compensation from a scene to the controller and back: written, read, evaluated, applied."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.corrector import Corrector, build_corrector
from warpspace.formats.compensation.directions import (
    WAYS,
    BeforeAfter,
    evaluated,
    reversal_notes,
    toward,
)
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.importing import Reading
from warpspace.formats.kind import SIGNS, Format, ReadOptions
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
class Compensation(BeforeAfter):
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
    loop : str
    axes : tuple of str
        Axes that are corrected.
    assumed, notes : tuple of str
    directions : mapping of str to BeforeAfter
        "forward" and "backward", where errors depend on the direction of travel.
    """

    format: Format
    files: Mapping[str, str]
    points: Mapping[str, int]
    size: int
    loop: str
    axes: tuple[str, ...]
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    directions: Mapping[str, BeforeAfter] = field(default_factory=dict[str, BeforeAfter])

    @property
    def bytes(self) -> int:
        """Size of the files."""
        return sum(len(text.encode()) for text in self.files.values())


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
    still = _reference(scene)
    own = evaluated(corrector, controller.moves, grid, still)
    directions: dict[str, BeforeAfter] = {}
    notes = controller.notes
    if scene.errors.has_directions:
        there, back = (
            evaluated(toward(corrector, way), controller.toward(way).moves, grid, still)
            for way in WAYS
        )
        directions = {"forward": there, "backward": back}
        notes += reversal_notes(there, back, scene.errors, scene.model.direction)
    return Compensation(
        own.before,
        own.after,
        own.grid,
        kind,
        files,
        points,
        controller.size,
        str(corrector.loop),
        corrector.moved,
        controller.assumed,
        notes,
        directions,
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

    def toward(self, direction: TravelDirection) -> "_Controller":
        """Give the controller whose axes travel in a direction."""
        return replace(self, corrector=toward(self.corrector, direction), direction=WAYS[direction])

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
    partly = [
        key
        for key in scene.errors
        if key in errors and set(scene.errors.arguments(key)) - set(errors.arguments(key))
    ]
    if partly:
        notes.append(f"holds {', '.join(partly)} over fewer axes than the scene")
    differing = [
        axis
        for axis in scene.machine.axes
        if model.convention(axis).name != scene.model.convention(axis).name
    ]
    if differing:
        notes.append(
            f"errors of {', '.join(differing)} stand in another convention here than in the scene"
        )
    return _Controller(corrector, None, found.size, found.assumed, tuple(notes), direction)


def _rounded(errors: ErrorSet, resolution: float) -> ErrorSet:
    """Refuse: the resolution of error parameters is that of their digits."""
    del errors
    raise OptionError(
        f"--resolution {resolution:g}: formats of error parameters have as many digits as they"
        " print; expected a table of corrections"
    )


def _reference(scene: Scene) -> dict[str, Array] | None:
    """Give the coordinates of the point that is held still."""
    if scene.reference is None:
        return None
    still = {**scene.workspace.positions, **scene.reference}
    return {axis: np.asarray(still[axis]) for axis in scene.machine.axes}
