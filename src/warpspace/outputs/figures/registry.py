"""The figures there are: one entry in catalogue.toml, and one module that draws it."""

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

Draw = Callable[..., "Drawing"]  # takes scenes, settings and the keyword `exact`; gives the drawing


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A kind of figure."""

    name: str  # as it is asked for
    caption: str  # what it shows, one sentence: help of the command line, list of the app, report
    draw: str | Draw  # "module:function", imported when it is drawn, or the function itself
    scenes: int = 1  # how many scenes it is drawn from ...
    evidence: bool = False  # whether a report shows it after the error map of a scene
    most_scenes: int | None = None  # ... or at most, where that may differ
    command: str = ""  # that draws it where `draw` does not

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
    most = kind.most_scenes or kind.scenes
    if not kind.scenes <= len(scenes) <= most:
        words = "one scene" if kind.scenes == 1 else "two scenes"
        words = words if most == kind.scenes else f"{kind.scenes} to {most} scenes"
        raise OptionError(f"figure {name!r} is drawn from {words}; given {len(scenes)}")
    return kind.load()(scenes, settings or FigureSettings(), exact=exact)
