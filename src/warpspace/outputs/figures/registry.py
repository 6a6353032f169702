"""Registry of the figures: one entry in catalogue.toml, and one function that draws it."""

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from warpspace.exceptions import OptionError
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.plugins import Registry, load_plugins

if TYPE_CHECKING:
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.outputs.drawing.sheet import Drawing
    from warpspace.scene.model import Scene

Draw = Callable[..., "Drawing"]  # of scenes, settings and the keyword `exact`


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A kind of figure."""

    name: str
    caption: str  # one sentence: help of the command line, list of the app, report
    draw: str | Draw  # "module:function", imported for drawing, or the function
    scenes: int = 1  # number of scenes ...
    evidence: bool = False  # shown in a report after the error map of a scene
    most_scenes: int | None = None  # ... or the largest number, where it varies
    command: str = ""  # that draws it instead of `draw`

    def load(self) -> Draw:
        return resolve_name(self.draw) if isinstance(self.draw, str) else self.draw


_TABLE = (files("warpspace.outputs.figures") / "catalogue.toml").read_text("utf-8")
_KINDS = Registry(
    "figure", {name: FigureKind(name, **row) for name, row in tomllib.loads(_TABLE).items()}
)
_KINDS["concepts"] = replace(_KINDS["concepts"], most_scenes=MOST_CONCEPTS)
figure_kinds = _KINDS.members
register_figure, unregister_figure = _KINDS.register, _KINDS.unregister


def figure_command(name: str) -> str:
    load_plugins()
    return _KINDS[name].command if name in _KINDS else ""


def figure_names(scenes: int = 1) -> tuple[str, ...]:
    return tuple(kind.name for kind in figure_kinds() if kind.scenes == scenes)


def draw_figure(
    name: str,
    scenes: "Sequence[Scene]",
    settings: "FigureSettings | None" = None,
    *,
    exact: bool = True,
) -> "Drawing":
    from warpspace.outputs.drawing.settings import FigureSettings

    kind = _KINDS.find(name)
    max_scenes = kind.most_scenes or kind.scenes
    if not kind.scenes <= len(scenes) <= max_scenes:
        expected = f"{kind.scenes} to {max_scenes} scenes"
        if max_scenes == kind.scenes:
            expected = "one scene" if kind.scenes == 1 else "two scenes"
        raise OptionError(f"figure {name!r} is drawn from {expected}; given {len(scenes)}")
    return kind.load()(scenes, (settings or FigureSettings()).for_scenes(scenes), exact=exact)
