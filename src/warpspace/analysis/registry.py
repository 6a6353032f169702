"""Registries of analyses, one line here, one file each, and of publications; plug-ins add theirs.

Analyses are imported when they are used, so that the list costs no start-up time.
"""

from collections.abc import Callable
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

from warpspace.exceptions import UnknownNameError
from warpspace.plugins import Registry

if TYPE_CHECKING:
    from warpspace.analysis.description import Analysis, ProgressCallback, Result, Task
    from warpspace.scene.model import Scene

TASKS: "dict[Task, str]" = {
    "see": "See",
    "understand": "Understand",
    "measure": "Measure",
    "improve": "Improve",
    "design": "Design",
    "machine": "Scenes and machines",
}
"""Headings of the command list, by task."""


class Entry(NamedTuple):
    """Entry of the list: name, task and summary of an analysis, and its place."""

    name: str
    task: "Task"
    sentence: str
    place: "str | type[Analysis]" = ""  # module:Class, or the class of a plug-in

    def load(self) -> "type[Analysis]":
        return resolve_name(self.place) if isinstance(self.place, str) else self.place


R_co = TypeVar("R_co", bound="Result", covariant=True)


class Verb(Protocol[R_co]):
    """An analysis as a function: ``warpspace.NAME(scene, **options)``."""

    def __call__(self, *scenes: "Scene", watch: "ProgressCallback" = ..., **options: Any) -> R_co:
        """Run it; options are those of its command: ``at={"X": 0}``, ``over_travel=True``."""
        ...


_BUNDLED: "tuple[tuple[str, Task, str, str], ...]" = (
    ("gains", "understand", "analysis.commands.gains:Gains",
     "Rank the error parameters of SCENE by their gain."),
    ("line", "understand", "analysis.commands.line:Line",
     "Follow the error of SCENE along a straight line."),
    ("distance", "understand", "analysis.commands.distance:Distance",
     "Measure between points of SCENE: distance, angle."),
    ("conformance", "understand", "analysis.commands.conformance:Conformance",
     "Compute the share of the volume of SCENE within a limit."),
    ("uncertainty", "understand", "analysis.commands.uncertainty:Uncertainty",
     "Report the expanded uncertainty of the error map."),
    ("form", "understand", "analysis.commands.form:Form",
     "Evaluate flatness, straightness and squareness of SCENE."),
    ("adjust", "improve", "analysis.commands.adjust:Adjust",
     "Find which errors of SCENE to adjust, and to what."),
    ("convert", "measure", "analysis.commands.convert:Convert",
     "Write the errors of SCENE in another convention."),
    ("calibrate", "measure", "calibration.calibrate:Calibrate",
     "Fit the errors of the machine of SCENE to measured data."),
    ("diagnose", "measure", "diagnosis.diagnose:Diagnose",
     "Rank the causes of readings and symptoms of SCENE."),
    ("part", "measure", "parts.part:Part",
     "Evaluate a part, a mesh, as the machine of SCENE cuts it."),
    ("program", "measure", "parts.program:Program",
     "Evaluate the errors along the path of a program on SCENE."),
    ("clamp", "improve", "parts.clamp:Clamp",
     "Find the best fixture position of a part on SCENE."),
    ("compensate", "improve", "formats.compensation.compensate:Compensate",
     "Write a compensation table and report the residual error."),
    ("montecarlo", "design", "analysis.commands.montecarlo:MonteCarlo",
     "Sample machines within tolerance: distribution of |E|."),
    ("allocate", "design", "analysis.commands.allocate:Allocate",
     "Find the widest tolerances that meet a limit of |E|."),
    ("acceptance", "design", "acceptance_tests.acceptance:Acceptance",
     "Find the worst machine that passes its acceptance tests."),
    ("concepts", "design", "analysis.commands.concepts:Concepts",
     "Compare machines before one of them is built."),
    ("contributions", "design", "analysis.commands.contributions:Contributions",
     "Show which tolerances the volumetric error comes from."),
)  # fmt: skip
_ENTRIES: Registry[Entry] = Registry(
    "analysis",
    {
        name: Entry(name, task, sentence, f"warpspace.{place}")
        for name, task, place, sentence in _BUNDLED
    },
)
unregister = _ENTRIES.unregister
entries = _ENTRIES.members
"""List all analyses without importing any."""


def register(kind: "type[Analysis]") -> None:
    """Register an analysis; it becomes a command, a panel and a section of the report."""
    _ENTRIES.register(Entry(kind.name, kind.task, first_line(kind), kind))


def first_line(kind: "type[Analysis]") -> str:
    return (kind.__doc__ or "").partition("\n")[0]


def find_analysis(name: str) -> "type[Analysis]":
    return _ENTRIES.find(name).load()


def verb(name: str) -> "Verb[Result]":
    from warpspace.analysis.description import ignore_progress
    from warpspace.analysis.options import options_of

    kind = find_analysis(name)
    names = [option.name for option in options_of(kind)]

    def run(
        *scenes: "Scene", watch: "ProgressCallback" = ignore_progress, **options: Any
    ) -> "Result":
        for key in options:
            if key not in (*names, *kind.run_options):
                raise UnknownNameError(f"option of {name}", key, [*names, *kind.run_options])
        arguments = {key: options.pop(key) for key in kind.run_options if key in options}
        return kind(**options).run_all(scenes, watch, **arguments)

    run.__name__ = run.__qualname__ = name
    run.__doc__ = kind.__doc__
    return run


class PrintedNumber(NamedTuple):
    """A number of a publication, and the phrase that quotes it."""

    value_um: float
    quotation: str


class Publication(NamedTuple):
    """Numbers that a publication gives; each function returns nothing for other machines."""

    name: str  # heading of a column, mark of a chart, start of a key of a CSV file
    key_errors: Callable[[str], tuple[str, ...]]  # key errors of a machine by its name
    # mean |E| of machines within the tolerances of a scene, at one random point each, of a loop
    sampled_mean: "Callable[[Scene, str], PrintedNumber | None]"
    measured_error: "Callable[[Scene], PrintedNumber | None]"  # volumetric error of a machine


PUBLICATIONS: Registry[Publication] = Registry("publication", {})
