"""The picture of a state or a comparison, which the app draws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np

from warpspace.analysis.statistics import Statistics
from warpspace.app.evaluation.scene_overlays import (
    SceneOverlay,
    T,
    bench_overlay,
    part_overlay,
    path_overlay,
)
from warpspace.app.state.app_state import AppState
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.machine.definition import Vector
from warpspace.parts.program import ToolPath
from warpspace.parts.workpiece import Workpiece
from warpspace.picture.model import Picture, choose_scale, picture_size_mm
from warpspace.picture.traces import TraceLine, TraceLines, is_moved, name_trace
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Compared:
    view: str  # "a", "b" or "difference"
    titles: tuple[str, str]  # names of the two sides
    sides: tuple[AppState, AppState]  # with the present display settings
    a: Statistics
    b: Statistics
    # of the length of the difference at each node, |E_B − E_A|; None where there is none
    difference: Statistics | None
    # [nx, ny, nz, 3]; displaced nodes of the other side; None for the difference
    other_mm: Array | None
    refused: str = ""  # reason for a missing difference

    @property
    def title(self) -> str:
        a, b = self.titles
        if self.view != "difference":
            return f"A: {a}" if self.view == "a" else f"B: {b}"
        a, b = (
            title.partition(": ")[0] if title.startswith(("after", "before")) else title
            for title in self.titles
        )
        return f"B − A: {b} − {a}"


@dataclass(frozen=True, kw_only=True)
class LivePicture(Picture):
    state: AppState  # the present state
    traces: tuple[TraceLines, ...]
    compared: Compared | None = None
    # of this picture only, unlike its id, which a later picture may have again
    serial: int = field(init=False, default_factory=count().__next__)

    @cached_property
    def size_mm(self) -> float:
        """Reference length of marker sizes, mm; defined for a single point, too."""
        return picture_size_mm(self.state.scene, self.grid)

    @cached_property
    def bench(self) -> SceneOverlay[str] | None:
        """The path of the selected standard test; None where there is none, or it cannot be run."""
        return None if self.is_difference else bench_overlay(self.drawn_state)

    @cached_property
    def part(self) -> SceneOverlay[Workpiece] | None:
        return self._in_box(part_overlay)

    @cached_property
    def path(self) -> SceneOverlay[ToolPath] | None:
        return self._in_box(path_overlay)

    def _in_box(self, find: Callable[[AppState], SceneOverlay[T] | None]) -> SceneOverlay[T] | None:
        """Evaluate an overlay; for a difference its change; None where there is none."""
        if not self.is_difference or self.compared is None:
            return find(self.drawn_state)
        a, b = map(find, self.compared.sides)
        if a is None or b is None or a.error_um.shape != b.error_um.shape:
            return None
        return replace(b, error_um=b.error_um - a.error_um)

    def coloured(self, overlay: SceneOverlay[Any]) -> tuple[Array, ColourScale]:
        """Return coloured values and colour scale of an overlay."""
        if self.state.part.normal and isinstance(overlay.of, Workpiece):
            normals = overlay.of.corners.normals @ overlay.pose[:3, :3].T
            values = np.einsum("ij,ij->i", overlay.error_um[overlay.at], normals)
            return values, choose_scale([values], "x")
        values = component_values(overlay.error_um, self.component)[overlay.at]
        return values, choose_scale([values], self.component) if self.tilts else self.scale

    @cached_property
    def worst_node(self) -> int:
        """Flat index of the node with the largest coloured magnitude."""
        return int(np.argmax(np.abs(self.values)))

    @cached_property
    def traced_points(self) -> Mapping[Vector, str]:
        """Short names of the traced points, P1, P2 and so on."""
        traces = (trace for of in self.traces for trace in of.group.traces)
        points = dict.fromkeys(trace.point_mm for trace in traces)
        return {point: f"P{number}" for number, point in enumerate(points, 1)}

    @cached_property
    def moved_traces(self) -> Mapping[str, TraceLine]:
        if not self.state.shown.traces and not self.is_rotary:
            return {}
        lines = (line for of in self.traces if of.error_um.any() for line in of.each())
        return {name_trace(line.trace): line for line in lines if is_moved(line)}

    @property
    def is_rotary(self) -> bool:
        """True where the rotary axes are drawn, not the volume."""
        return self.state.shows_rotary

    @cached_property
    def traced_um(self) -> Array:
        """Errors of all points of the traces, [n, 3], µm."""
        return np.concatenate([np.zeros((0, 3)), *(t.error_um.reshape(-1, 3) for t in self.traces)])

    @property
    def largest_um(self) -> float:
        """Largest length of the errors of what is drawn, µm."""
        if self.is_rotary:
            return float(np.linalg.norm(self.traced_um, axis=-1).max(initial=0.0))
        return float(self.field.norm_um.max())

    @cached_property
    def shown_values(self) -> Array:
        """Coloured values of what is drawn: of the volume, or of the traces."""
        return component_values(self.traced_um, self.component) if self.is_rotary else self.values

    @cached_property
    def scale(self) -> ColourScale:
        if self.is_rotary and self.colours is None:
            return choose_scale([self.shown_values], self.component, change=self.is_difference)
        return super().scale

    @property
    def drawn_state(self) -> AppState:
        """The drawn state: the present one, or a side of a comparison."""
        compared = self.compared
        return self.state if compared is None else compared.sides[compared.view != "a"]

    @property
    def title(self) -> str:
        return self.state.scene.title if self.compared is None else self.compared.title

    @property
    def other_title(self) -> str:
        """Title of what is drawn instead of the present state; empty where that is drawn."""
        compared, chosen = self.compared, self.state.comparison
        if compared is None:
            return ""
        side = chosen.a if compared.view == "a" else chosen.b
        is_present = not self.is_difference and (side is None or side.state is None)
        return "" if is_present else compared.title

    def describe_sides(self, word: Callable[[AppState], str]) -> str:
        """Describe the drawn state; for a difference both sides where they differ."""
        if self.compared is None or not self.is_difference:
            return word(self.drawn_state)
        a, b = (word(side) for side in self.compared.sides)
        return a if a == b else f"{b} − {a}"
