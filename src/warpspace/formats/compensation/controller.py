"""A controller that has read a table: what it adds to positions, and the error that it leaves."""

from dataclasses import dataclass, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.formats.compensation.corrector import Corrector, Moved
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.importing import Reading
from warpspace.formats.kind import Format, ReadOptions
from warpspace.formats.source import Source
from warpspace.formats.terms import Tables
from warpspace.formats.to_scene import into_scene
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.machine.errors import ErrorSet
from warpspace.machine.travel import TravelDirection
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, URAD_PER_RAD, Array

WAYS = {TravelDirection.FORWARD: 1, TravelDirection.BACKWARD: -1}


@dataclass(frozen=True)
class Corrected:
    """Points that a controller moves a machine to, before the errors of the machine count.

    Attributes
    ----------
    nominal_mm : ndarray, [..., 3], mm
    moved : Moved
    held : Moved or None
        The point that is held still; None for absolute errors.
    less : Corrected or None
        What is subtracted: the way back, where the difference of both directions is looked at.
    """

    nominal_mm: Array
    moved: Moved
    held: Moved | None = None
    less: "Corrected | None" = None

    def field(self, errors: ErrorSet) -> ErrorField:
        """Evaluate what is left with errors, by the exact chain, µm and µrad."""
        position, orientation = self.moved.residual(errors)
        if self.held is not None:
            position = position - self.held.residual(errors)[0]
        shape = np.broadcast_shapes(position.shape, self.nominal_mm.shape)
        found = ErrorField(
            np.broadcast_to(self.nominal_mm, shape),
            np.broadcast_to(position, shape) * UM_PER_MM,
            np.broadcast_to(orientation, shape) * URAD_PER_RAD,
        )
        if self.less is None:
            return found
        back = self.less.field(errors)
        return replace(
            found,
            error_um=found.error_um - back.error_um,
            orientation_urad=found.orientation_urad - back.orientation_urad,
        )

    @property
    def nbytes(self) -> int:
        """Bytes it holds, about."""
        moved = self.moved
        arrays = (*moved.coordinates.values(), moved.point_mm, moved.shift_mm, moved.turn_rad)
        own = sum(array.nbytes for array in arrays)
        return own + (0 if self.less is None else self.less.nbytes)


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller that has read the files of a table. Two are equal only if they are one.

    Attributes
    ----------
    scene : Scene
        The machine that the table was made for, with its errors of then.
    loop : Loop
        The loop that is corrected.
    label : str
        Name of the format and points of the table, for people.
    corrector : Corrector
        Axes that are corrected; where there is no table, with the errors that the files hold.
    tables : Tables or None
        What it adds to the positions; None where it works that out from errors.
    size : int
        Numbers that it holds.
    assumed, notes : tuple of str
    """

    scene: Scene
    loop: Loop
    label: str
    corrector: Corrector
    tables: Tables | None
    size: int
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def moves(self, coordinates: Coordinates, direction: str = "") -> dict[str, Array]:
        """Give what it adds to commanded positions.

        Parameters
        ----------
        coordinates : mapping of str to ndarray, [...], mm or degrees
        direction : str, optional
            Direction of travel; that of the scene by default.

        Returns
        -------
        dict of str to ndarray, [...], mm or degrees
        """
        way = TravelDirection(direction or self.scene.model.direction)
        if self.tables is not None:
            return dict(self.tables.corrections(coordinates, WAYS.get(way, 0)))
        own = self.corrector
        return replace(own, model=replace(own.model, direction=way)).moves(coordinates)

    def at(
        self,
        coordinates: Coordinates,
        nominal_mm: Array,
        scene: Scene | None = None,
        loop: Loop | None = None,
        point_mm: Array | None = None,
    ) -> Corrected:
        """Work out all of a field that does not depend on the errors; see `field`."""
        scene, loop = scene or self.scene, loop or self.loop
        way = TravelDirection(scene.model.direction)
        if way is TravelDirection.DIFFERENCE:
            there, back = (
                self.at(coordinates, nominal_mm, toward(scene, one), loop, point_mm)
                for one in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
            )
            return replace(there, less=back)
        machine = Corrector(scene.model, scene.errors, loop, ())
        held = _reference(scene, coordinates)
        return Corrected(
            nominal_mm,
            machine.move(coordinates, self.moves(coordinates, way), point_mm),
            None if held is None else machine.move(held, self.moves(held, way)),
        )

    def field(
        self,
        coordinates: Coordinates,
        nominal_mm: Array,
        scene: Scene | None = None,
        loop: Loop | None = None,
        point_mm: Array | None = None,
    ) -> ErrorField:
        """Evaluate the error that is left, by the exact chain.

        Parameters
        ----------
        coordinates : mapping of str to ndarray, [...], mm or degrees
            Commanded positions.
        nominal_mm : ndarray, [..., 3], mm
            Where the points are drawn.
        scene : Scene, optional
            The machine as it is now; by default as it was when the table was made.
        loop : Loop, optional
            The loop that is looked at; by default the one that is corrected.
        point_mm : ndarray, [..., 3], mm, optional
            Nominal points in R; by default the tool point.

        Returns
        -------
        ErrorField
            µm and µrad, less that of the reference point of the scene, should it have one.
        """
        errors = (scene or self.scene).errors
        return self.at(coordinates, nominal_mm, scene, loop, point_mm).field(errors)

    def without(self) -> "Controller":
        """Give the same controller with an empty table: it leaves the machine as it is."""
        return replace(self, tables=Tables(()))


def toward(scene: Scene, direction: str) -> Scene:
    """Look at a scene in one direction of travel."""
    return replace(scene, model=replace(scene.model, direction=direction))


def _reference(scene: Scene, coordinates: Coordinates) -> dict[str, Array] | None:
    """Give the coordinates of the point that is held still; other axes stand as they do."""
    if scene.reference is None:
        return None
    still = scene.reference
    return {axis: np.asarray(still.get(axis, at)) for axis, at in coordinates.items()}


def read_back(kind: Format, sources: list[Source], wanted: Wanted, label: str) -> Controller:
    """Read files as the controller does.

    Parameters
    ----------
    kind : Format
    sources : list of Source
    wanted : Wanted
        What they were written for.
    label : str
        Name of the format and points of the table, for people.

    Returns
    -------
    Controller

    Raises
    ------
    OptionError, SceneError
        If the controller would refuse them.
    """
    scene, corrector = wanted.scene, wanted.corrector
    options = ReadOptions(scene.machine, sign=wanted.sign)
    if kind.tables is not None:
        tables = kind.tables(sources, options)
        return Controller(
            scene,
            corrector.loop,
            label,
            corrector,
            tables,
            tables.size,
            tables.assumed,
            tables.notes,
        )
    found = kind.read(sources, options)
    bare = replace(scene, errors=ErrorSet(), uncertainty={}, measured={})
    held = into_scene(Reading(found, kind, recognised=True), bare, scene.title, scene.name).scene
    errors = held.errors
    if wanted.resolution:
        errors = _rounded(errors, wanted.resolution)
    model = replace(held.model, direction=scene.model.direction)
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
    knows = replace(corrector, model=model, errors=errors)
    return Controller(
        scene, corrector.loop, label, knows, None, found.size, found.assumed, tuple(notes)
    )


def _rounded(errors: ErrorSet, resolution: float) -> ErrorSet:
    """Refuse: the resolution of error parameters is that of their digits."""
    del errors
    raise OptionError(
        f"--resolution {resolution:g}: formats of error parameters have as many digits as they"
        " print; expected a table of corrections"
    )
