"""A controller with a compensation table: its corrections and the residual error."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpspace.analysis.description import to_json
from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, field_uncertainty
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField, Turn, fit_placement
from warpspace.field.grid import Grid, build_grid
from warpspace.formats.compensation.corrections import Corrector, MovedPoints, RequiredCorrections
from warpspace.formats.measured import RUN_DIRECTION, UNDIRECTED
from warpspace.formats.registry import Files, Format, Reading, ReadOptions
from warpspace.formats.source import source_of_text
from warpspace.formats.terms import Tables
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene, with_direction
from warpspace.units import UM_PER_MM, URAD_PER_RAD, Array


@dataclass(frozen=True)
class CorrectedPoints:
    """Points that a controller moves a machine to, without the errors of the machine."""

    nominal_mm: Array  # [..., 3]
    points: MovedPoints
    reference: MovedPoints | None = None  # the reference point; None for absolute errors
    # travel in the negative direction, for the difference of both directions
    subtracted: "CorrectedPoints | None" = None
    # nodes over which the placement of the workpiece is fitted out; None where it is not
    placement_nodes: "tuple[Grid, CorrectedPoints] | None" = None

    def field(self, errors: ErrorSet) -> ErrorField:
        placement = None
        if self.placement_nodes is not None:
            grid, nodes = self.placement_nodes
            error_um = nodes.field(errors).error_um
            placement = fit_placement(self.points.model, grid, error_um, Turn.ON_PART)
        position, orientation = self.points.residual(errors, placement)
        if self.reference is not None:
            position = position - self.reference.residual(errors, placement)[0]
        shape = np.broadcast_shapes(position.shape, self.nominal_mm.shape)
        error_field = ErrorField(
            np.broadcast_to(self.nominal_mm, shape),
            np.broadcast_to(position, shape) * UM_PER_MM,
            np.broadcast_to(orientation, shape) * URAD_PER_RAD,
        )
        if self.subtracted is None:
            return error_field
        return error_field - self.subtracted.field(errors)

    @property
    def nbytes(self) -> int:
        moved = self.points
        arrays = (*moved.coordinates.values(), moved.point_mm, moved.shift_mm, moved.turn_rad)
        total = sum(array.nbytes for array in arrays)
        if self.placement_nodes is not None:
            total += self.placement_nodes[1].nbytes
        if self.subtracted is not None:
            total += self.subtracted.nbytes
        return total


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller that has read the files of a table; compared by identity."""

    scene: Scene  # the machine and the errors for which the table was computed
    loop: Loop  # that is corrected
    label: str  # title of the format and points of the table
    # the corrected axes; without a table, with the errors that the files contain
    corrector: Corrector
    # None where the controller computes its corrections from error parameters
    tables: Tables | None
    size: int  # count of stored numbers
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def moves(self, coordinates: Coordinates, direction: str = "") -> dict[str, Array]:
        """Return the corrections at commanded positions, by axis."""
        travel = TravelDirection(direction or self.scene.model.direction)
        if self.tables is not None:
            return dict(self.tables.corrections(coordinates, RUN_DIRECTION.get(travel, UNDIRECTED)))
        model = replace(self.corrector.model, direction=travel)
        return replace(self.corrector, model=model).moves(coordinates)

    def at(
        self,
        coordinates: Coordinates,
        nominal_mm: Array,
        scene: Scene | None = None,
        loop: Loop | None = None,
        point_mm: Array | None = None,
    ) -> CorrectedPoints:
        """Compute the part of the error field that does not depend on the errors; see `field`."""
        scene, loop = scene or self.scene, loop or self.loop
        travel = TravelDirection(scene.model.direction)
        if travel is TravelDirection.DIFFERENCE:
            forward, backward = (
                self.at(coordinates, nominal_mm, with_direction(scene, direction), loop, point_mm)
                for direction in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
            )
            return replace(forward, subtracted=backward)
        machine = Corrector(scene.model, scene.errors, loop, ())
        reference = None
        if scene.reference is not None:
            still = {axis: scene.reference.get(axis, at) for axis, at in coordinates.items()}
            still = {axis: np.asarray(at) for axis, at in still.items()}
            reference = machine.move(still, self.moves(still, travel))
        placement_volume, placement_nodes = scene.view(loop).placed_over, None
        if placement_volume is not None:
            grid = build_grid(scene.model, placement_volume)
            absolute = replace(scene, reference=None, placed=False)
            nodes = self.at(grid.coordinates, grid.nominal_mm, absolute, loop, grid.point_mm)
            placement_nodes = grid, nodes
        points = machine.move(coordinates, self.moves(coordinates, travel), point_mm)
        return CorrectedPoints(nominal_mm, points, reference, placement_nodes=placement_nodes)

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
        stated = (tables.size, tables.assumed, tables.notes)
        return Controller(scene, corrector.loop, label, corrector, tables, *stated)
    imported = kind.errors(sources, options)
    bare = replace(scene, errors=ErrorSet(), uncertainty={}, measured={})
    reading = Reading(imported, kind, recognised=True)
    imported_scene = build_imported_scene(reading, bare, scene.title, scene.name).scene
    errors = imported_scene.errors
    if corrections.resolution:
        raise OptionError(
            f"{{resolution}} {corrections.resolution:g}: the resolution of formats with error"
            " parameters is fixed; expected a table of corrections"
        )
    model = replace(imported_scene.model, direction=scene.model.direction)
    lost = [key for key in scene.errors if key not in errors and scene.errors.amplitude(key)]
    partly = [
        key
        for key in scene.errors
        if key in errors and set(scene.errors.arguments(key)) - set(errors.arguments(key))
    ]
    differing = [
        axis
        for axis in scene.machine.axes
        if model.convention(axis).name != scene.model.convention(axis).name
    ]
    limits = {
        "cannot represent {}": lost,
        "represents {} over fewer axes than the scene": partly,
        "uses a different convention for errors of {}": differing,
    }
    notes = [f"the format {text.format(', '.join(of))}" for text, of in limits.items() if of]
    corrector = replace(corrector, model=model, errors=errors)
    stated = (imported.size, imported.assumed, (*imported.notes, *notes))
    return Controller(scene, corrector.loop, label, corrector, None, *stated)


MAX_REVERSAL_SHARE = 0.05
"""Largest residual share of the reversal in a format that represents it (steps of its table)."""
MIN_REVERSAL_UM = 0.01  # smaller reversal errors are ignored


@dataclass(frozen=True)
class BeforeAfter:
    """Errors over the working volume before and after compensation."""

    before: ErrorField
    after: ErrorField
    grid: Grid
    field_uncertainty: FieldUncertainty | None  # of the errors before; those after have the same
    before_statistics: Statistics  # over the nodes of error maps, as everywhere else

    @property
    def after_statistics(self) -> Statistics:
        return _statistics(self.grid, self.after, self.field_uncertainty)

    def as_statistics(self) -> dict[str, Any]:
        return {"before": to_json(self.before_statistics), "after": to_json(self.after_statistics)}

    def tilt_urad(self, field: ErrorField) -> tuple[float, float]:
        """Return the volume mean and the maximum of the tilt of the tool axis, µrad."""
        statistics = volume_statistics(field.tilts, self.grid)
        return statistics.mean_um, statistics.max_um


def _statistics(grid: Grid, field: ErrorField, uncertainty: FieldUncertainty | None) -> Statistics:
    statistics = volume_statistics(field, grid)
    if uncertainty is None:
        return statistics
    return replace(uncertainty, error_um=field.error_um).with_expanded_uncertainty(statistics)


def evaluate_before_after(controller: Controller, grid: Grid, direction: str) -> BeforeAfter:
    scene = with_direction(controller.scene, direction)
    view, uncompensated = scene.view(controller.loop), replace(controller, tables=Tables(()))
    after = controller.field(grid.coordinates, grid.nominal_mm, scene)

    def before(nodes: Grid) -> tuple[ErrorField, FieldUncertainty | None]:
        at, point, weights = nodes.coordinates, nodes.point_mm, nodes.weights
        field = uncompensated.field(at, nodes.nominal_mm, scene)
        return field, field_uncertainty(scene, field.error_um, at, view, point, weights)

    mapped = build_grid(scene.model, scene.workspace)
    field, uncertainty = before(grid)
    return BeforeAfter(field, after, grid, uncertainty, _statistics(mapped, *before(mapped)))


def reversal_notes(
    directions: Mapping[str, BeforeAfter], errors: ErrorSet, direction: str
) -> tuple[str, ...]:
    forward, backward = directions["forward"], directions["backward"]
    before, after = (
        float((first - second).norm_um.max())
        for first, second in ((forward.before, backward.before), (forward.after, backward.after))
    )
    if after <= max(MIN_REVERSAL_UM, MAX_REVERSAL_SHARE * before):
        return ()
    keys = ", ".join(key for key, curve in errors.functions.items() if curve.has_directions)
    description = DIRECTION_WORDS[TravelDirection(direction)]
    note = (
        f"the format does not fully represent the direction of travel: due to {keys}, forward and"
        f" backward differ by up to {before:.3g} µm before and {after:.3g} µm after compensation"
        f" (a value for both directions is that of: {description})"
    )
    return (note,)
