"""A compensation from a scene to the controller and back: written, read, evaluated, applied."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from warpspace.exceptions import OptionError
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.controller import Controller, read_back
from warpspace.formats.compensation.corrector import build_corrector
from warpspace.formats.compensation.directions import BeforeAfter, evaluated, reversal_notes
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import SIGNS, Format
from warpspace.formats.registry import find_format
from warpspace.formats.source import source_of_text
from warpspace.machine.travel import TravelDirection
from warpspace.scene.model import Scene

NODES = 28
"""Nodes per axis that what is left is evaluated at: between the points of usual tables."""
RESOLUTION = (0.0, 0.1)
"""mm or degrees."""
EXPECTED_GRID = "expected a number of points, or AXIS=NUMBER with commas between"


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
    controller : Controller
        It has read the files.
    directions : mapping of str to BeforeAfter
        "forward" and "backward", where errors depend on the direction of travel.
    reversal : tuple of str
        What of that the format has no place for, in words.
    """

    format: Format
    files: Mapping[str, str]
    points: Mapping[str, int]
    controller: Controller
    directions: Mapping[str, BeforeAfter] = field(default_factory=dict[str, BeforeAfter])
    reversal: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Numbers that the controller holds."""
        return self.controller.size

    @property
    def loop(self) -> str:
        """Structural loop that is corrected."""
        return str(self.controller.loop)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that are corrected."""
        return self.controller.corrector.moved

    @property
    def assumed(self) -> tuple[str, ...]:
        """What the documentation of the format leaves open."""
        return self.controller.assumed

    @property
    def notes(self) -> tuple[str, ...]:
        """What the controller cannot hold, in words."""
        return (*self.controller.notes, *self.reversal)

    @property
    def points_words(self) -> str:
        """Spell the points of the table."""
        return spell_points(self.format, self.points)

    @property
    def bytes(self) -> int:
        """Size of the files."""
        return sum(len(text.encode()) for text in self.files.values())


def read_points(text: str) -> int | dict[str, int]:
    """Read points per axis as a user types them: 9, or X=9,Y=5.

    Raises
    ------
    OptionError
        If it is neither; whether a format takes so many is asked by `table_points`.
    """
    try:
        if "=" not in text:
            return int(text)
        pairs = [part.partition("=") for part in text.split(",")]
        return {name.strip().upper(): int(count) for name, _, count in pairs}
    except ValueError:
        raise OptionError(f"--grid {text!r}; {EXPECTED_GRID}") from None


def spell_points(kind: Format, points: Mapping[str, int]) -> str:
    """Spell the points of a table."""
    if kind.grid.startswith("none"):
        return "no grid"
    return ", ".join(f"{axis} {count}" for axis, count in points.items()) + " points"


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


def compensate(
    scene: Scene, plan: Plan, nodes: int = NODES, *, watch: Callable[[], None] | None = None
) -> Compensation:
    """Write the compensation of a scene, have it read and evaluated, and give what is left.

    Parameters
    ----------
    scene : Scene
    plan : Plan
    nodes : int, optional
        Nodes per axis that what is left is evaluated at.
    watch : callable, optional
        Called between the steps; what it raises ends the work.

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
    watch = watch or _go_on
    corrector = build_corrector(scene, plan.loop, orientation=plan.orientation)
    points = table_points(kind, scene, plan.points)
    wanted = Wanted(scene, corrector, points, plan.resolution, plan.sign, plan.stem)
    watch()
    files = kind.write(wanted)
    watch()
    grid = build_grid(scene.model, scene.workspace, nodes)
    sources = [
        source_of_text(text, f"{plan.stem}{add}{'' if add else kind.endings[0]}")
        for add, text in files.items()
    ]
    label = f"{kind.name} ({spell_points(kind, points)})"
    controller = read_back(kind, sources, wanted, label)
    watch()
    own = evaluated(controller, grid, scene.model.direction)
    watch()
    directions: dict[str, BeforeAfter] = {}
    reversal: tuple[str, ...] = ()
    if scene.errors.has_directions:
        there, back = (
            evaluated(controller, grid, way)
            for way in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
        )
        directions = {"forward": there, "backward": back}
        reversal = reversal_notes(there, back, scene.errors, scene.model.direction)
        watch()
    return Compensation(
        own.before, own.after, grid, kind, files, points, controller, directions, reversal
    )


def _go_on() -> None:
    """Let the work go on."""
