"""Analyses: options as fields, one computation, one result that is rendered and serialised."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, Protocol, Self, TypeAlias, TypeVar

import numpy as np

from warpspace.analysis.blocks import Block, Table, blocks_html
from warpspace.analysis.options import PLACE, Option, options_of, outside_travel

if TYPE_CHECKING:
    from warpspace.field.evaluate import SecondOrder
    from warpspace.scene.model import Scene

Task: TypeAlias = Literal["see", "understand", "measure", "improve", "design", "machine"]
ProgressCallback: TypeAlias = Callable[[float], None]
"""Called with the completed share of the work; raises if the computation has been cancelled."""
V = TypeVar("V")
NO_JSON: Final = {"json": False}
"""Metadata of a field that is not part of the JSON object."""


class ExpandedUncertainty(dict[str, V]):
    """Expanded uncertainties by JSON key, `u95_…`: None where unknown, empty where not stated.

    A field of this type adds its keys to the JSON object of its owner.
    """


class UncertaintySource(Protocol):
    """The uncertainty that a result was propagated from."""

    @property
    def factor(self) -> float: ...

    def remarks(self) -> Iterable[str]: ...


@dataclass(frozen=True, slots=True)
class Quantity:
    """Heading, unit and format of a number: ``Annotated[float, Quantity("Flatness", "µm")]``."""

    head: str
    unit: str = ""
    form: str = ".2f"


@dataclass(frozen=True, slots=True)
class Change:
    """A scene that a result proposes: -o on the command line, Compare and Apply on the page."""

    label: str
    scene: "Scene"
    steps: tuple[str, ...] = ()  # to carry out, where they are more than changes of errors


@dataclass(frozen=True, kw_only=True)
class Result(ABC):
    """The result of an analysis; the fields that a subclass adds are the keys of its JSON object.

    `json_keys` lists other attributes instead.
    """

    json_keys: ClassVar[tuple[str, ...]] = ()
    # "module:function" that draws its chart, where Bars and Lines do not suffice
    drawn_by: ClassVar[str] = ""
    no_change: ClassVar[str] = "there is nothing to change"
    # deviation of the first order from the exact chain: a warning, and `second_order_um` in JSON
    second_order: "SecondOrder | None" = field(default=None, metadata=NO_JSON)
    # of the errors that its expanded uncertainties result from
    uncertainty: UncertaintySource | None = field(default=None, metadata=NO_JSON)

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Return its content in order: sentences, tables, charts."""

    def changes(self) -> Sequence[Change]:
        """Return the scenes it proposes, the best last."""
        return ()

    def caveats(self) -> Iterable[str]:
        """List restrictions on the validity of its numbers."""
        return self.uncertainty.remarks() if self.uncertainty else ()

    def output_files(self, _ending: str = "", /) -> Mapping[str, str | bytes]:
        """Return the files that -o writes, by the suffix added to its name: "", "_X.COM"."""
        return {}

    def updated_files(self) -> Mapping[str, str]:
        """Return the text of files that the analysis extends, such as logs, by path."""
        return {}

    def named_files(self) -> Mapping[str, str]:
        """Return the new files that options other than -o name, by path."""
        return {}

    def as_json(self) -> dict[str, Any]:
        """Return the object that ``--json`` prints."""
        extra = {"second_order_um": self.second_order.um} if self.second_order else {}
        return self.json_fields() | extra

    def json_fields(self) -> dict[str, Any]:
        """Return the object without the deviation of the first order."""
        return to_json(self)

    def blocks_of(self, kind: type[Any]) -> list[Any]:
        """List its blocks of one type, for instance its tables."""
        return [block for block in self.blocks() if isinstance(block, kind)]

    def file_table(self) -> Table | None:
        """Return the table that --csv writes: the first whose columns have keys."""
        tables = self.blocks_of(Table)
        return next((table for table in tables if any(c.key for c in table.columns)), None)

    def _repr_html_(self) -> str:
        return blocks_html(self.blocks())


@dataclass(frozen=True, kw_only=True)
class Analysis(ABC):
    """A computation on a scene. A subclass is one file; its fields are its options."""

    name: ClassVar[str]  # of the command
    task: ClassVar[Task]  # heading it is listed under: one of `registry.TASKS`
    title: ClassVar[str] = ""  # in a report, where it differs from that of its section
    # number of scenes, at least and at most
    scenes: ClassVar[tuple[int, int | None]] = (1, 1)
    doing: ClassVar[str] = "computing"  # label of the progress bar
    # whether its results propose scenes, so that there is an -o
    makes_scenes: ClassVar[bool] = False
    scene_help: ClassVar[str] = "Write the scene proposed last"  # of that -o
    # help of -o where it writes no scene; empty where there is no such -o
    file_help: ClassVar[str] = ""
    file_endings: ClassVar[tuple[str, ...]] = ()  # accepted by that -o; any where empty
    needs_file: ClassVar[bool] = False  # whether -o is required
    has_chart: ClassVar[bool] = False  # whether its results hold a chart, so that there is a --plot
    chart_help: ClassVar[str] = "chart"  # what that --plot draws
    has_table: ClassVar[bool] = False  # whether its results hold a table for --csv
    run_options: ClassVar[tuple[str, ...]] = ()  # keywords of its `run_all`, for Python only

    def __post_init__(self) -> None:
        """Convert strings and mappings to the types of the fields; check the ranges."""
        for option in options_of(type(self)):
            value = option.coerce(getattr(self, option.name))
            option.check(value)
            object.__setattr__(self, option.name, value)

    @classmethod
    def options(cls) -> tuple[Option, ...]:
        """List its options in the order of display."""
        return options_of(cls)

    @classmethod
    def explained(cls) -> str:
        """Return the help text of its command."""
        return cls.__doc__ or ""

    @abstractmethod
    def run(self, scene: "Scene", watch: ProgressCallback, /) -> Result:
        """Compute the result for a scene.

        Parameters
        ----------
        scene : Scene
        watch : callable
            To be called with the completed share of the work, 0 to 1.

        Raises
        ------
        OptionError
            If an option cannot be used with the scene; names it as ``{name}``.
        """

    def for_output(self, stem: str | None) -> Self:  # noqa: ARG002 - for others
        """Return the analysis for an output file of this name; refuse a wrong or missing one."""
        return self

    def run_all(self, scenes: "Sequence[Scene]", watch: ProgressCallback, /) -> Result:
        """Compute the result for several scenes; an analysis of one scene takes the only one."""
        (scene,) = scenes
        return self.run(scene, watch)

    def warnings(self, scene: "Scene") -> Iterable[str]:
        """List doubtful options for this scene: axis positions beyond the travel."""
        for option in self.options():
            if option.grammar is PLACE:
                for warning in outside_travel(scene.machine, dict(getattr(self, option.name))):
                    yield f"{{{option.name}}} {warning}"


def ignore_progress(_share: float) -> None:
    pass


def count_progress(watch: ProgressCallback, total: float) -> ProgressCallback:
    """Return a callback that takes the work done since its last call and reports the share."""
    done = 0.0

    def advance(step: float) -> None:
        nonlocal done
        done += step
        watch(min(done / total, 1.0))

    return advance


def to_json(value: Any) -> Any:
    """Convert to JSON types: a dataclass by its `json_keys`, or by all fields that are not NO_JSON.

    Expanded uncertainties follow the other keys of their owner.
    """
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        declared = [entry.name for entry in fields(value) if entry.metadata.get("json", True)]
        names = getattr(value, "json_keys", ()) or declared
        members = {name: getattr(value, name) for name in names}
        u95: dict[str, Any] = {}
        for name in names:
            if isinstance(members[name], ExpandedUncertainty):
                u95 |= members.pop(name)
        return to_json(members | u95)
    if isinstance(value, (list, tuple, set, frozenset)):
        return [to_json(item) for item in value]
    return value
