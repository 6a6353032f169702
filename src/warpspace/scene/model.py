"""Validated scenes, and the evaluation of their error fields."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import (
    ErrorBasis,
    ErrorField,
    SecondOrder,
    View,
    build_basis,
    compare_orders,
    error_values,
    evaluate_field,
)
from warpspace.field.grid import DEFAULT_NODES, Grid, Workspace, build_grid
from warpspace.kinematics.model import Coordinates, Loop, Model, complete_coordinates
from warpspace.machine import axes
from warpspace.machine.definition import Machine, Vector
from warpspace.machine.errors import (
    Covariance,
    ErrorFunction,
    ErrorSet,
    Harmonics,
    Measurement,
    ToleranceSet,
)
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.notes import Note


@dataclass(frozen=True, slots=True)
class PartSource:
    """Workpiece of a scene: files of its mesh, features and program, and its placement."""

    file: str = ""  # mesh
    place: tuple[float, ...] | None = None  # (6,), mm and degrees; fixture position
    unit: str = ""  # of the mesh; empty for that of its format
    features: str = ""  # names and tolerances
    program: str = ""
    tcp: str = ""  # tool centre point mode of the program
    folder: str = field(default="", compare=False)  # of the scene, if any

    def path(self, name: Literal["file", "features", "program"]) -> str | None:
        """Return the path of a file; None where none is stated, or the scene has no folder."""
        file: str = getattr(self, name)
        return str(Path(self.folder, file)) if file and self.folder else None


def curve_span(machine: Machine, workspace: Workspace, axis: str) -> tuple[float, float]:
    low, high = workspace.ranges[axis]
    return (low, high) if low < high else machine.axes[axis].travel


def spanning_axes(names: Iterable[str]) -> tuple[str, ...]:
    """List the first linear axis along each direction."""
    axis_of: dict[int, str] = {}
    for name in filter(axes.is_linear, names):
        axis_of.setdefault(axes.direction_index(name), name)
    return tuple(axis_of.values())


@dataclass(frozen=True, slots=True)
class Scene:
    """One scene.

    Attributes
    ----------
    name : str
        Bundled name or file stem.
    title, description : str
        Heading of pictures; remarks for readers.
    model : Model
        Machine, conventions and functional points.
    workspace : Workspace
        The working volume in axis coordinates.
    errors : ErrorSet
    tolerances : ToleranceSet
    trace_points_mm : tuple of tuple of float, (n, 3), mm
        Points of the workpiece frame whose traces are drawn.
    exaggeration : float or None
        Display factor of displacements; None chooses a round one.
    reference : mapping of str to float or None
        Axis coordinates of the point with zero displacement; None is absolute.
    placed : bool
        Whether the placement of the workpiece is fitted out of relative errors over the workspace.
    notes : tuple of str
        Remarks on the scene that are no errors.
    uncertainty : mapping of str to ErrorFunction
        Standard uncertainty (k = 1) of errors along their axes by key, µm or µrad, above 0.
    covariance : Covariance or None
        Joint uncertainty of the amplitudes of other errors.
    measured : mapping of str to Measurement
        Readings that errors were fitted to, by key.
    limit_um : float or None, µm
        Largest length of an error that is accepted.
    review : tuple of Note
        Review notes.
    part : PartSource
        Workpiece.
    """

    name: str
    title: str
    model: Model
    workspace: Workspace
    errors: ErrorSet = field(default_factory=ErrorSet)
    tolerances: ToleranceSet = field(default_factory=ToleranceSet)
    trace_points_mm: tuple[Vector, ...] = ()
    exaggeration: float | None = None
    reference: Mapping[str, float] | None = None
    placed: bool = False
    description: str = ""
    notes: tuple[str, ...] = ()
    uncertainty: Mapping[str, ErrorFunction] = field(default_factory=dict[str, ErrorFunction])
    covariance: Covariance | None = None
    measured: Mapping[str, Measurement] = field(default_factory=dict[str, Measurement])
    limit_um: float | None = None
    review: tuple[Note, ...] = ()
    part: PartSource = PartSource()

    @property
    def machine(self) -> Machine:
        return self.model.machine

    @property
    def parameter_keys(self) -> tuple[str, ...]:
        """Keys of the default parameters of the machine and of other constants of the scene."""
        default = self.machine.parameter_keys
        stated = [*self.errors, *self.tolerances.individual, *self.uncertainty]
        extra = [key for key in self.machine.allowed_keys if key in stated and key not in default]
        return (*default, *extra)

    def axis_span(self, axis: str) -> tuple[float, float]:
        """Return the range of the curves of an axis, mm or degrees; without one its travel."""
        return curve_span(self.machine, self.workspace, axis)

    @property
    def default_loop(self) -> Loop:
        """Tool relative to workpiece if that is placed or moved by an axis, else tool."""
        return Loop.RELATIVE if self.placed or self.machine.chain.workpiece else Loop.TOOL

    def view(self, loop: Loop | None = None, frame: str = "machine") -> View:
        """Return the view of the scene for a loop, with the reference of the scene."""
        loop = loop or self.default_loop
        fitted_over = self.workspace if self.placed and loop is Loop.RELATIVE else None
        return View(loop, frame, self.reference, fitted_over)


FRAMES = ("machine", "workpiece")
CHECK_NODES = 5  # nodes per axis at which the first order is compared with the exact chain


def evaluate(
    scene: Scene,
    *,
    at: Mapping[str, ArrayLike] | None = None,
    grid: int | Sequence[int] | None = None,
    loop: Loop | str | None = None,
    exact: bool = False,
    frame: str = "machine",
    placed: bool = False,
) -> ErrorField:
    """Evaluate the error field of a scene at points or over the grid of its working volume.

    Parameters
    ----------
    scene : Scene
    at : mapping of str to array_like, [...], mm or degrees, optional
        Axis positions; an axis that is not given stands at its position in the scene's workspace,
        the middle of a range. Without it the grid is evaluated.
    grid : int or sequence of int, (3,), optional
        Nodes per axis of the working volume; 21 by default.
    loop : Loop or str, optional
        "tool", "workpiece" or "relative"; by default relative for a placed scene and where an
        axis moves the workpiece, else tool. At points the workpiece loop takes the scene's
        functional workpiece point; over the grid the workpiece points that nominally coincide with
        the nodes.
    exact : bool, optional
        Full rotations and all products instead of the first order.
    frame : str, optional
        "machine" for results in R, "workpiece" for the nominal workpiece frame.
    placed : bool, optional
        Whether the placement of the workpiece is fitted out of the relative loop: the three shifts
        and three small rotations of its frame that leave the smallest RMS over the working volume.

    Returns
    -------
    ErrorField
        Arrays of shape [..., 3], the batch being that of `at` or of the grid.

    Raises
    ------
    OptionError, UnknownNameError
        If an argument names something that does not exist.

    Examples
    --------
    >>> from warpspace import load_scene
    >>> scene = load_scene("dvf5000_first")
    >>> corner = evaluate(scene, at={"X": 275, "Y": -225, "Z": -480})
    >>> [round(float(part), 2) for part in corner.error_um]
    [3.94, 49.81, -13.39]
    >>> evaluate(scene, grid=11).error_um.shape
    (11, 11, 11, 3)
    """
    if at is not None and grid is not None:
        raise OptionError("expected either points (at) or a grid, not both")
    scene = with_placement(scene, loop, placed=placed)
    view = choose_view(scene, loop, frame)
    if at is not None:
        coordinates = complete_coordinates(scene.machine, at, scene.workspace.positions)
        check_magnitude(scene, coordinates)
        return evaluate_field(scene.model, scene.errors, coordinates, view, exact=exact)
    nodes = build_grid(scene.model, scene.workspace, DEFAULT_NODES if grid is None else grid)
    return evaluate_grid(scene, nodes, view, exact=exact)


def evaluate_grid(scene: Scene, grid: Grid, view: View, *, exact: bool = False) -> ErrorField:
    at, point = grid.coordinates, grid.point_mm
    field = evaluate_field(scene.model, scene.errors, at, view, point, exact=exact)
    return replace(field, nominal_mm=grid.nominal_mm)


def check_magnitude(scene: Scene, coordinates: Coordinates) -> None:
    for key, values in error_values(scene.model, scene.errors, coordinates).items():
        peak = np.abs(values).max(initial=0.0)
        if not peak <= MAX_ERROR:
            row = axes.parameter(key)
            raise OptionError(
                f"{key} reaches {peak:.3g} {row.unit} at the positions given for {row.axis};"
                f" expected at most ±{MAX_ERROR:g}"
            )


def with_direction(scene: Scene, direction: str | None) -> Scene:
    if direction is None:
        return scene
    if direction not in [*axes.TravelDirection]:
        names = ", ".join(axes.TravelDirection)
        raise OptionError(f"direction {direction!r}; expected one of {names}")
    return replace(scene, model=replace(scene.model, direction=axes.TravelDirection(direction)))


def with_placement(scene: Scene, loop: Loop | str | None, *, placed: bool = True) -> Scene:
    """Return a scene with a best-fit placement of the workpiece, if `placed`."""
    if placed and loop and loop != Loop.RELATIVE:
        raise OptionError(
            f"{{placed}}: the {loop} loop does not contain the placement of the workpiece; expected"
            f" loop {Loop.RELATIVE}"
        )
    return replace(scene, placed=True) if placed else scene


def common_loop(scenes: Sequence[Scene], loop: Loop | str | None) -> Loop:
    """Return the loop of several scenes: the stated one, else relative if it is that of any."""
    defaults = [scene.default_loop for scene in scenes]
    return Loop(loop or (Loop.RELATIVE if Loop.RELATIVE in defaults else Loop.TOOL))


def choose_view(scene: Scene, loop: Loop | str | None, frame: str = "machine") -> View:
    loop = loop or scene.default_loop
    if loop not in [*Loop]:
        raise OptionError(f"loop {loop!r}; expected one of {', '.join(Loop)}")
    if frame not in FRAMES:
        raise OptionError(f"frame {frame!r}; expected one of {', '.join(FRAMES)}")
    return scene.view(Loop(loop), frame)


def grid_basis(
    scene: Scene, grid: Grid, view: View | None = None, keys: Sequence[str] | None = None
) -> ErrorBasis:
    basis = build_basis(
        scene.model,
        scene.errors,
        scene.parameter_keys if keys is None else keys,
        grid.coordinates,
        view or scene.view(),
        grid.point_mm,
    )
    return replace(basis, nominal_mm=grid.nominal_mm)


def second_order(
    scene: Scene,
    loop: Loop | str | None = None,
    *,
    at: Mapping[str, ArrayLike] | None = None,
    first: ErrorField | None = None,
) -> SecondOrder:
    """Compare the first order, if it is known, with the exact chain, over the grid or at points."""
    nodes = CHECK_NODES if at is None else None
    first = evaluate(scene, at=at, grid=nodes, loop=loop) if first is None else first
    exact = evaluate(scene, at=at, grid=nodes, loop=loop, exact=True)
    return compare_orders(first.error_um, exact.error_um)


LEAST_SHARE = 0.5  # of the range of an axis that data cover without a note
MANY_COSINES = 10_000_000
"""Cosines of the curves of a scene without a note: about a second of computing time."""


def scene_notes(machine: Machine, workspace: Workspace, errors: ErrorSet) -> tuple[str, ...]:
    """List notes on directions, volumes beyond the travel, carried squareness, costly curves."""
    return (
        *_direction_notes(machine),
        *_travel_notes(machine, workspace),
        *_carried_notes(machine, errors),
        *_costly_notes(errors),
    )


def _direction_notes(machine: Machine) -> Iterator[str]:
    for name, axis in machine.axes.items():
        if machine.sense(name) > 0:
            continue
        setting = f"machine.direction.{name} = {axis.direction}"
        verb = "moves the tool towards" if axis.is_linear else "turns the tool about"
        effect = f"positive {name} {verb} −{name} over the workpiece, against ISO 841"
        if axis.direction_given:
            yield f"{setting}: {effect}"
        else:
            yield (
                f"{setting} by default: {effect}; expected −1, or an explicit 1 if the machine"
                " does so"
            )


def coverage_notes(scene: Scene, measured: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    """List axes whose measured range is less than half of the range that the scene covers."""
    for axis, (low, high) in measured.items():
        first, last = scene.axis_span(axis)
        share, unit = (high - low) / (last - first), scene.machine.axes[axis].unit
        if 0.0 < share < LEAST_SHARE:
            yield (
                f"data over {axis} {low:g} … {high:g} {unit}, {100.0 * share:.0f} % of its range"
                f" {first:g} … {last:g} {unit}: the rest is not measured"
            )


def _travel_notes(machine: Machine, workspace: Workspace) -> Iterator[str]:
    for name, axis in machine.axes.items():
        (low, high), (first, last) = workspace.ranges[name], axis.travel
        if low < first or high > last:
            yield (
                f"workspace.{name} {low:g} … {high:g} {axis.unit} reaches beyond the travel"
                f" {first:g} … {last:g} {axis.unit}"
            )


def _costly_notes(errors: ErrorSet) -> Iterator[str]:
    curves = [part for curve in errors.functions.values() for part in curve.parts]
    waves = [curve for curve in curves if isinstance(curve, Harmonics)]
    if sum(curve.cosines for curve in waves) > MANY_COSINES:
        terms = sum(len(curve.terms) for curve in waves)
        problem = f"errors: {len(waves)} curves with {terms} harmonics, many of short wavelength"
        yield f"{problem}: opening the scene takes seconds; fewer terms are faster"


def _carried_notes(machine: Machine, errors: ErrorSet) -> Iterator[str]:
    for key in errors:
        row = axes.PARAMETERS[key]
        index = axes.direction_index(row.axis)
        is_squareness = row.kind is axes.ErrorKind.SQUARENESS and row.direction != index
        if not is_squareness or errors.amplitude(key) == 0.0:
            continue
        branches = (machine.chain.tool, machine.chain.workpiece)
        branch = next(branch for branch in branches if row.axis in branch)
        for other in branch[branch.index(row.axis) + 1 :]:
            if axes.is_linear(other) and axes.direction_index(other) == 3 - row.direction - index:
                yield (
                    f"errors.{key} turns {other} as well, which rides on {row.axis}: the angle"
                    " between them stays, the pair turns as a whole"
                )
