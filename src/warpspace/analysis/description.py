"""What an analysis is: options as fields, one computation, one result that says itself."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeAlias, TypeVar

import numpy as np

from warpspace.analysis.blocks import Block, Table, blocks_html
from warpspace.analysis.options import PLACE, Option, options_of, outside_travel

if TYPE_CHECKING:
    from warpspace.analysis.uncertainty.propagation import ErrorUncertainty
    from warpspace.field.evaluate import SecondOrder
    from warpspace.scene.model import Scene

Task: TypeAlias = Literal["see", "understand", "measure", "improve", "design", "machine"]
ProgressCallback: TypeAlias = Callable[[float], None]
"""Called with the share of the work that is done; raises where nobody waits for it any more."""
A = TypeVar("A", bound="type[Analysis]")


@dataclass(frozen=True, slots=True)
class Quantity:
    """What one number of a result is: ``Annotated[float, Quantity("Flatness", "µm")]``."""

    head: str
    unit: str = ""
    form: str = ".2f"


@dataclass(frozen=True, slots=True)
class Change:
    """A scene that a result proposes: -o on the command line, Compare and Apply on the page."""

    words: str
    scene: "Scene"


@dataclass(frozen=True, kw_only=True)
class Result(ABC):
    """What an analysis found. Fields are the keys of its JSON object, unless `keys` lists them."""

    keys: ClassVar[tuple[str, ...]] = ()
    # "module:function" that draws its chart, where bars and curves do not say it
    drawn_by: ClassVar[str] = ""
    no_change: ClassVar[str] = "nothing is to be changed"
    # what its numbers leave out if they are of first order: a warning, and in its JSON object
    second_order: "SecondOrder | None" = None
    uncertainty: "ErrorUncertainty | None" = (
        None  # how sure the errors are, where its numbers say U95
    )

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Say it, in order: sentences, tables, charts."""

    def changes(self) -> Sequence[Change]:
        """Give the scenes it proposes, the best last."""
        return ()

    def caveats(self) -> Iterable[str]:
        """Say what a reader should doubt of its numbers."""
        return self.uncertainty.remarks() if self.uncertainty else ()

    def output_files(self, _ending: str = "", /) -> Mapping[str, str | bytes]:
        """Give the files that -o writes, by what is added to its name: "", "_X.COM"."""
        return {}

    def as_json(self) -> dict[str, Any]:
        """Give what ``--json`` prints."""
        left_out = {"second_order_um": self.second_order.um} if self.second_order else {}
        return self.as_plain() | left_out

    def as_plain(self) -> dict[str, Any]:
        """Give that, but for what the first order leaves out."""
        said = to_json(self)
        said.pop("second_order", None)
        return said

    def blocks_of(self, kind: type[Any]) -> list[Any]:
        """Give its tables, or its charts."""
        return [block for block in self.blocks() if isinstance(block, kind)]

    def file_table(self) -> Table | None:
        """Give the table that --csv writes: the first whose columns have keys."""
        tables = self.blocks_of(Table)
        return next((one for one in tables if any(c.key for c in one.columns)), None)

    def _repr_html_(self) -> str:
        return blocks_html(self.blocks())


@dataclass(frozen=True, kw_only=True)
class Analysis(ABC):
    """A question about a scene. A subclass is one file; its fields are its options."""

    name: ClassVar[str]  # of the command
    task: ClassVar[Task]  # where it stands: one of `catalogue.TASKS`
    title: ClassVar[str] = ""  # what it is called in a report, where its section does not say it
    # how many scenes it takes, at least and at most
    scenes: ClassVar[tuple[int, int | None]] = (1, 1)
    doing: ClassVar[str] = "computing"  # what is said while it works
    # whether its results propose scenes, so that there is an -o
    makes_scenes: ClassVar[bool] = False
    scene_help: ClassVar[str] = "Write the scene proposed last"  # what that -o writes
    # what -o writes where that is no scene; empty where there is no such -o
    file_help: ClassVar[str] = ""
    file_endings: ClassVar[tuple[str, ...]] = ()  # of what -o writes there; any where empty
    needs_file: ClassVar[bool] = False  # whether a command line must give -o
    has_chart: ClassVar[bool] = False  # whether its results hold a chart, so that there is a --plot
    chart_help: ClassVar[str] = "chart"  # what that --plot draws
    has_table: ClassVar[bool] = False  # whether its results hold a table for --csv

    def __post_init__(self) -> None:
        """Take words and mappings as Python users give them; refuse numbers out of range."""
        for one in options_of(type(self)):
            value = one.coerce(getattr(self, one.name))
            one.check(value)
            object.__setattr__(self, one.name, value)

    @classmethod
    def options(cls) -> tuple[Option, ...]:
        """List its options as they are shown."""
        return options_of(cls)

    @classmethod
    def explained(cls) -> str:
        """Give the help text of its command."""
        return cls.__doc__ or ""

    @abstractmethod
    def run(self, scene: "Scene", watch: ProgressCallback, /) -> Result:
        """Answer it.

        Parameters
        ----------
        scene : Scene
        watch : callable
            To be called with the share of the work that is done, 0 to 1.

        Raises
        ------
        OptionError
            If an option cannot be used with the scene; names it as ``{name}``.
        """

    def written(self, stem: str | None) -> Self:  # noqa: ARG002 - for others
        """Give it as it is run for a file of this name; refuse one too many, or none."""
        return self

    def run_all(self, scenes: "Sequence[Scene]", watch: ProgressCallback, /) -> Result:
        """Answer it for several scenes; an analysis of one scene takes the only one."""
        (scene,) = scenes
        return self.run(scene, watch)

    def warnings(self, scene: "Scene") -> Iterable[str]:
        """Say what a user should doubt of the options with this scene: places beyond the travel."""
        for one in self.options():
            if one.grammar is PLACE:
                for words in outside_travel(scene.machine, dict(getattr(self, one.name))):
                    yield f"{{{one.name}}} {words}"


def ignore_progress(_share: float) -> None:
    """Watch nothing."""


def count_progress(watch: ProgressCallback, total: float) -> ProgressCallback:
    """Give what is called with the work that was done since its last call."""
    done = 0.0

    def advance(step: float) -> None:
        nonlocal done
        done += step
        watch(min(done / total, 1.0))

    return advance


def to_json(value: Any) -> Any:
    """Spell a value in what JSON has: objects by their fields, or by the `keys` of their class.

    What a mapping `expanded_uncertainty` of theirs holds stands beside their other keys.
    """
    keys: Sequence[str] = getattr(type(value), "keys", ())
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(key): to_json(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        names = keys or [entry.name for entry in fields(value)]
        found = {
            name: to_json(getattr(value, name)) for name in names if name != "expanded_uncertainty"
        }
        sure = getattr(value, "expanded_uncertainty", None)
        return found | to_json(sure) if isinstance(sure, Mapping) else found
    if isinstance(value, (list, tuple, set, frozenset)):
        return [to_json(one) for one in value]
    return value
