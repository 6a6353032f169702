"""A controller that has read a table: what it adds to positions, and the error that it leaves."""

from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, field_uncertainty
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField, fit_placement
from warpspace.field.grid import Grid, build_grid
from warpspace.formats.compensation.corrections import Corrector, MovedPoints, RequiredCorrections
from warpspace.formats.registry import Files, Format, Reading, ReadOptions
from warpspace.formats.source import source_of_text
from warpspace.formats.terms import Tables
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene, in_direction
from warpspace.units import UM_PER_MM, URAD_PER_RAD, Array

TRAVEL_SIGN = {TravelDirection.FORWARD: 1, TravelDirection.BACKWARD: -1}


@dataclass(frozen=True)
class CorrectedPoints:
    """Points that a controller moves a machine to, before the errors of the machine count."""

    nominal_mm: Array  # [..., 3]
    points: MovedPoints
    reference: MovedPoints | None = None  # the point that is held still; None for absolute errors
    # what is subtracted: the way back, where the difference of both directions is looked at
    subtracted: "CorrectedPoints | None" = None
    # or None; nodes over which the placement of the workpiece is fitted out; None leaves it in
    placement_nodes: "tuple[Grid, CorrectedPoints] | None" = None

    def field(self, errors: ErrorSet) -> ErrorField:
        placement = None
        if self.placement_nodes is not None:
            grid, nodes = self.placement_nodes
            placement = fit_placement(self.points.model, grid, nodes.field(errors).error_um)
        position, orientation = self.points.without(placement, *self.points.residual(errors))
        if self.reference is not None:
            position = (
                position - self.reference.without(placement, *self.reference.residual(errors))[0]
            )
        shape = np.broadcast_shapes(position.shape, self.nominal_mm.shape)
        found = ErrorField(
            np.broadcast_to(self.nominal_mm, shape),
            np.broadcast_to(position, shape) * UM_PER_MM,
            np.broadcast_to(orientation, shape) * URAD_PER_RAD,
        )
        return found if self.subtracted is None else found - self.subtracted.field(errors)

    @property
    def nbytes(self) -> int:
        moved = self.points
        arrays = (*moved.coordinates.values(), moved.point_mm, moved.shift_mm, moved.turn_rad)
        total = sum(array.nbytes for array in arrays)
        total += 0 if self.placement_nodes is None else self.placement_nodes[1].nbytes
        return total + (0 if self.subtracted is None else self.subtracted.nbytes)


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller that has read the files of a table. Two are equal only if they are one."""

    scene: Scene  # the machine that the table was made for, with its errors of then
    loop: Loop  # the loop that is corrected
    label: str  # name of the format and points of the table, for people
    # axes that are corrected; where there is no table, with the errors that the files hold
    corrector: Corrector
    tables: Tables | None  # what it adds to the positions; None where it works that out from errors
    size: int  # numbers that it holds
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def moves(self, coordinates: Coordinates, direction: str = "") -> dict[str, Array]:
        """Give what it adds to commanded positions."""
        travel = TravelDirection(direction or self.scene.model.direction)
        if self.tables is not None:
            return dict(self.tables.corrections(coordinates, TRAVEL_SIGN.get(travel, 0)))
        corrector = self.corrector
        return replace(corrector, model=replace(corrector.model, direction=travel)).moves(
            coordinates
        )

    def at(
        self,
        coordinates: Coordinates,
        nominal_mm: Array,
        scene: Scene | None = None,
        loop: Loop | None = None,
        point_mm: Array | None = None,
    ) -> CorrectedPoints:
        """Work out all of a field that does not depend on the errors; see `field`."""
        scene, loop = scene or self.scene, loop or self.loop
        travel = TravelDirection(scene.model.direction)
        if travel is TravelDirection.DIFFERENCE:
            forward, backward = (
                self.at(coordinates, nominal_mm, in_direction(scene, one), loop, point_mm)
                for one in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
            )
            return replace(forward, subtracted=backward)
        machine = Corrector(scene.model, scene.errors, loop, ())
        reference = _reference(scene, coordinates)
        placement_volume, volume = scene.view(loop).placed_over, None
        if placement_volume is not None:
            grid, absolute = (
                build_grid(scene.model, placement_volume),
                replace(scene, reference=None),
            )
            at = (grid.coordinates, grid.nominal_mm, replace(absolute, placed=False), loop)
            volume = grid, self.at(*at, grid.point_mm)
        return CorrectedPoints(
            nominal_mm,
            machine.move(coordinates, self.moves(coordinates, travel), point_mm),
            None if reference is None else machine.move(reference, self.moves(reference, travel)),
            placement_nodes=volume,
        )

    def field(
        self,
        coordinates: Coordinates,
        nominal_mm: Array,
        scene: Scene | None = None,
        loop: Loop | None = None,
        point_mm: Array | None = None,
    ) -> ErrorField:
        errors = (scene or self.scene).errors
        return self.at(coordinates, nominal_mm, scene, loop, point_mm).field(errors)

    def without(self) -> "Controller":
        """Give the same controller with an empty table: it leaves the machine as it is."""
        return replace(self, tables=Tables(()))


def _reference(scene: Scene, coordinates: Coordinates) -> dict[str, Array] | None:
    if scene.reference is None:
        return None
    still = scene.reference
    return {axis: np.asarray(still.get(axis, at)) for axis, at in coordinates.items()}


def read_back(
    kind: Format, files: Files, corrections: RequiredCorrections, label: str
) -> Controller:
    from warpspace.formats.to_scene import build_imported_scene

    scene, corrector = corrections.scene, corrections.corrector
    sources = [
        source_of_text(text, f"{corrections.stem}{add}{'' if add else kind.endings[0]}")
        for add, text in files.items()
    ]
    options = ReadOptions(scene.machine, sign=corrections.sign)
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
    imported = kind.errors(sources, options)
    bare = replace(scene, errors=ErrorSet(), uncertainty={}, measured={})
    imported_scene = build_imported_scene(
        Reading(imported, kind, recognised=True), bare, scene.title, scene.name
    ).scene
    errors = imported_scene.errors
    if corrections.resolution:
        raise OptionError(
            f"{{resolution}} {corrections.resolution:g}: formats of error parameters have as many digits"
            " as they print; expected a table of corrections"
        )
    model = replace(imported_scene.model, direction=scene.model.direction)
    notes = list(imported.notes)
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
        scene, corrector.loop, label, knows, None, imported.size, imported.assumed, tuple(notes)
    )


MAX_REVERSAL_SHARE = 0.05
"""Share of the reversal that may be left where a format holds it: the steps of its table."""
MIN_REVERSAL_UM = 0.01  # A reversal below it is none


@dataclass(frozen=True)
class BeforeAfter:
    """The errors over the working volume before and after a compensation."""

    before: ErrorField
    after: ErrorField
    grid: Grid
    field_uncertainty: (
        FieldUncertainty | None
    )  # how sure the errors before are; those after are no surer

    @property
    def before_statistics(self) -> Statistics:
        return self._summed_up(self.before)

    @property
    def after_statistics(self) -> Statistics:
        return self._summed_up(self.after)

    def _summed_up(self, field: ErrorField) -> Statistics:
        statistics = volume_statistics(field, self.grid)
        return (
            replace(self.field_uncertainty, error_um=field.error_um).with_expanded_uncertainty(
                statistics
            )
            if self.field_uncertainty
            else statistics
        )

    def tilt_urad(self, field: ErrorField) -> tuple[float, float]:
        """Give mean, by volume, and largest tilt of the tool axis in one of the fields, µrad."""
        statistics = volume_statistics(field.tilts, self.grid)
        return statistics.mean_um, statistics.max_um


def evaluate_before_after(controller: Controller, grid: Grid, direction: str) -> BeforeAfter:
    at, nominal, scene = grid.coordinates, grid.nominal_mm, controller.scene
    scene = in_direction(scene, direction)
    before = controller.without().field(at, nominal, scene)
    view = scene.view(controller.loop)
    uncertainty = field_uncertainty(scene, before.error_um, at, view, grid.point_mm, grid.weights)
    return BeforeAfter(before, controller.field(at, nominal, scene), grid, uncertainty)


def reversal_notes(
    forward: BeforeAfter, backward: BeforeAfter, errors: ErrorSet, direction: str
) -> tuple[str, ...]:
    before, after = (
        float((one - other).norm_um.max())
        for one, other in ((forward.before, backward.before), (forward.after, backward.after))
    )
    if after <= max(MIN_REVERSAL_UM, MAX_REVERSAL_SHARE * before):
        return ()
    keys = ", ".join(key for key, curve in errors.functions.items() if curve.has_directions)
    description = DIRECTION_WORDS[TravelDirection(direction)]
    note = (
        f"direction of travel is not held here, or not all of it: by {keys} forward and backward"
        f" differ by up to {before:.3g} µm before and {after:.3g} µm after (where one value stands"
        f" for both: {description})"
    )
    return (note,)
