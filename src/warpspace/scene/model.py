"""A scene as the program holds it: validated, frozen, without a trace of the file format."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.description import Machine, Vector
from warpspace.machine.errors import ErrorFunction, ErrorSet
from warpspace.machine.measurement import Measurement
from warpspace.machine.parameters import default_keys
from warpspace.machine.tolerances import ToleranceSet


@dataclass(frozen=True, slots=True)
class Scene:
    """One scene.

    Attributes
    ----------
    name : str
        Bundled name or file stem.
    title, description : str
        What a picture is headed with, and what a reader should know.
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
        Axis coordinates of the point held still; None is absolute.
    notes : tuple of str
        Remarks on the scene that are no errors.
    uncertainty : mapping of str to ErrorFunction
        Standard uncertainty (k = 1) of errors along their axes by key, µm or µrad, never negative.
    measured : mapping of str to Measurement
        Readings that errors were made from, by key.
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
    description: str = ""
    notes: tuple[str, ...] = ()
    uncertainty: Mapping[str, ErrorFunction] = field(default_factory=dict[str, ErrorFunction])
    measured: Mapping[str, Measurement] = field(default_factory=dict[str, Measurement])

    @property
    def machine(self) -> Machine:
        """The machine of the scene."""
        return self.model.machine

    @property
    def parameter_keys(self) -> tuple[str, ...]:
        """Keys of the machine's default parameters and of any other constant the scene gives."""
        default = default_keys(self.machine.chain.axes)
        given = [*self.errors, *self.tolerances.own, *self.uncertainty]
        extra = [key for key in self.machine.allowed_keys if key in given and key not in default]
        return (*default, *extra)

    def axis_span(self, axis: str) -> tuple[float, float]:
        """Give the range over which curves of an axis run, mm or degrees: else its travel."""
        low, high = self.workspace.ranges[axis]
        return (low, high) if low < high else self.machine.axes[axis].travel

    def view(self, loop: Loop = Loop.TOOL, frame: str = "machine") -> View:
        """Give the view of the scene through a loop, with the scene's reference."""
        return View(loop, frame, self.reference)
