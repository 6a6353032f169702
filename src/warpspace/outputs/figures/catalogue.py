"""The figures there are, by name."""

from collections.abc import Callable, Sequence
from importlib import import_module
from types import MappingProxyType

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.scene.model import Scene

Builder = Callable[..., Drawing]
_HOMES = MappingProxyType(
    {
        "error-map": ("warpspace.outputs.figures.error_map", "draw_error_map"),
        "slices": ("warpspace.outputs.figures.slices", "draw_slices"),
        "orientation-map": ("warpspace.outputs.figures.orientation", "draw_orientation"),
        "machine": ("warpspace.outputs.figures.machine", "draw_machine"),
        "traces": ("warpspace.outputs.figures.traces", "draw_traces"),
        "error-curves": ("warpspace.outputs.figures.curves", "draw_curves"),
        "gains": ("warpspace.outputs.figures.charts", "draw_gains"),
        "montecarlo": ("warpspace.outputs.figures.charts", "draw_montecarlo"),
        "ballbar": ("warpspace.outputs.figures.charts", "draw_ballbar"),
        "comparison": ("warpspace.outputs.figures.comparison", "draw_comparison"),
    }
)
FIGURES = tuple(_HOMES)
"""Names of the figures."""
PAIRS = ("comparison",)
"""Figures of two scenes."""


def draw_figure(
    name: str,
    scenes: Sequence[Scene],
    settings: FigureSettings | None = None,
    *,
    exact: bool = True,
) -> Drawing:
    """Draw a figure by its name.

    Parameters
    ----------
    name : str
        One of `FIGURES`.
    scenes : sequence of Scene
        One; two for a comparison.
    settings : FigureSettings, optional
    exact : bool, optional
        Whether the figure becomes pixels of its own size (PNG), or is to be scaled (SVG, PDF).

    Returns
    -------
    Drawing

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such figure, or it needs another number of scenes.
    """
    if name not in _HOMES:
        raise UnknownNameError("figure", name, FIGURES)
    needed = 2 if name in PAIRS else 1
    if len(scenes) != needed:
        words = "one scene" if needed == 1 else "two scenes"
        raise OptionError(f"figure {name!r} is drawn from {words}; given {len(scenes)}")
    module, function = _HOMES[name]
    builder: Builder = getattr(import_module(module), function)
    return builder(scenes, settings or FigureSettings(), exact=exact)
