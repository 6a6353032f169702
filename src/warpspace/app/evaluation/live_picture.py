"""The picture of a state: what the app draws, with the comparison it belongs to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
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
from warpspace.bench.base import BenchTest
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.parts.program import ToolPath
from warpspace.parts.workpiece import PartMesh
from warpspace.picture.model import Picture, choose_scale, picture_size_mm
from warpspace.picture.traces import TraceLine, TraceLines, is_moved, name_trace
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Compared:
    view: str  # what is drawn: "a", "b" or "difference"
    titles: tuple[str, str]  # names of the two sides
    sides: tuple[AppState, AppState]  # what they are, looked at as now
    a: Statistics
    b: Statistics
    # of the length of the change at each node, |E_B − E_A|; None where there is no difference
    difference: Statistics | None
    # [nx, ny, nz, 3], or None; displaced nodes of the side that is not drawn; None for the
    # difference
    other_mm: Array | None
    refused: str = ""  # why there is no difference; empty where there is one

    @property
    def title(self) -> str:
        """Name of what is drawn."""
        a, b = self.titles
        if self.view != "difference":
            return f"A: {a}" if self.view == "a" else f"B: {b}"
        a, b = (
            one.partition(": ")[0] if one.startswith(("after", "before")) else one
            for one in self.titles
        )
        return f"B − A: {b} − {a}"


@dataclass(frozen=True, kw_only=True)
class LivePicture(Picture):
    state: AppState  # what is steered
    traces: tuple[TraceLines, ...]
    compared: Compared | None = None  # the comparison it belongs to

    @cached_property
    def size_mm(self) -> float:
        """Length that marks are sized by, mm, for a single point too."""
        return picture_size_mm(self.state.scene, self.grid)

    @cached_property
    def bench(self) -> SceneOverlay[type[BenchTest]] | None:
        """The path of the standard test that is run; None where none is, or cannot be."""
        return None if self.is_difference else bench_overlay(self.drawn_state)

    @cached_property
    def part(self) -> SceneOverlay[PartMesh] | None:
        return self._in_box(part_overlay)

    @cached_property
    def path(self) -> SceneOverlay[ToolPath] | None:
        return self._in_box(path_overlay)

    def _in_box(self, find: Callable[[AppState], SceneOverlay[T] | None]) -> SceneOverlay[T] | None:
        """Find a part or a path; of a difference its change; None where none is, or cannot be."""
        if not self.is_difference or self.compared is None:
            return find(self.drawn_state)
        a, b = map(find, self.compared.sides)
        if a is None or b is None or a.error_um.shape != b.error_um.shape:
            return None
        return replace(b, error_um=b.error_um - a.error_um)

    def coloured(self, overlay: SceneOverlay[Any]) -> tuple[Array, ColourScale]:
        """Give what is coloured of it, in the colours of the map; along normals in its own."""
        if self.state.part.normal and isinstance(overlay.of, PartMesh):
            normals = overlay.of.corners.normals @ overlay.pose[:3, :3].T
            values = np.einsum("ij,ij->i", overlay.error_um[overlay.at], normals)
            return values, choose_scale([values], "x")
        values = component_values(overlay.error_um, self.component)[overlay.at]
        return values, choose_scale([values], self.component) if self.tilts else self.scale

    @cached_property
    def worst_node(self) -> int:
        """Flat number of the node where what is coloured is largest in magnitude."""
        return int(np.argmax(np.abs(self.values)))

    @cached_property
    def moved_traces(self) -> Mapping[str, TraceLine]:
        if not self.state.shown.traces:
            return {}
        lines = (one for of in self.traces if of.error_um.any() for one in of.each())
        return {name_trace(one.trace): one for one in lines if is_moved(one)}

    @property
    def drawn_state(self) -> AppState:
        """The state that is drawn: the one steered, or a side of a comparison."""
        compared = self.compared
        return self.state if compared is None else compared.sides[compared.view != "a"]

    @property
    def title(self) -> str:
        """Name of what is drawn: the scene, or a side of a comparison, or the difference."""
        return self.state.scene.title if self.compared is None else self.compared.title

    def describe_sides(self, word: Callable[[AppState], str]) -> str:
        """Say something of what is drawn; of a difference for both sides where they differ."""
        if self.compared is None or not self.is_difference:
            return word(self.drawn_state)
        a, b = (word(side) for side in self.compared.sides)
        return a if a == b else f"{b} − {a}"
