"""Form of the distorted volume: flatness, straightness and squareness."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import ClassVar

import numpy as np

from warpspace.analysis import description
from warpspace.analysis.blocks import Block, Column, Table
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, option
from warpspace.analysis.uncertainty.propagation import field_uncertainty, plus_minus
from warpspace.exceptions import OptionError
from warpspace.field.grid import Grid, build_grid
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.kinematics.relative_motion import programmed_direction
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene, choose_view, evaluate_grid
from warpspace.units import Array

PLACES = {"low": 0.0, "middle": 0.5, "high": 1.0}


@dataclass(frozen=True, slots=True)
class FormDeviation:
    """Form deviation of one plane or line."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "kind", "of", "at", "value", "unit", "expanded_uncertainty",
    )  # fmt: skip
    kind: str  # "flatness", "straightness" or "squareness"
    of: str  # "XY", "X in y", "X to Y"
    at: str  # where the other axes stand
    value: float
    unit: str
    expanded_uncertainty: description.ExpandedUncertainty[float | None] = field(
        default_factory=description.ExpandedUncertainty[float | None]
    )


@dataclass(frozen=True, kw_only=True)
class Form(description.Analysis):
    """Evaluate flatness, straightness and squareness of SCENE.

    The form that an inspector would measure on a part with the shape of the distorted volume.
    Flatness and straightness are the widths of the minimum zone (ISO 12780, 12781) along the
    programmed directions of the axes. Squareness is the angle between the least-squares lines
    through the middle of the volume in their programmed positive directions, minus 90°.
    """

    name = "form"
    task = "understand"
    has_table = True
    nodes: int = option(11, "Nodes per axis of the working volume", low=3, high=41, flag="--grid")
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)

    def run(self, scene: Scene, watch: description.ProgressCallback, /) -> "FormResult":
        grid = build_grid(scene.model, scene.workspace, self.nodes)
        axes = grid.axes
        if sum(map(bool, axes)) < 2 or not all(is_linear(axis) for axis in axes if axis):
            raise OptionError("form: expected a working volume with two or three linear axes")
        view = choose_view(scene, self.loop, "workpiece")
        error = evaluate_grid(scene, grid, view).error_um
        volume = FormVolume.of(scene, grid)
        deviations = tuple(volume.deviations(error))
        uncertainty = field_uncertainty(scene, error, grid.coordinates, view, grid.point_mm)
        n_evaluations = 2 * (1 + len(uncertainty.errors.keys)) if uncertainty else 1
        advance = description.count_progress(watch, n_evaluations)
        advance(1)
        if uncertainty is None:
            return FormResult(deviations=deviations, title=scene.title, loop=view.loop)

        def deviation_values(error_um: Array) -> Array:
            advance(1)
            return np.array([deviation.value for deviation in volume.deviations(error_um)])

        u95 = uncertainty.propagate(deviation_values)
        deviations = tuple(
            replace(deviation, expanded_uncertainty=description.ExpandedUncertainty(u95=expanded))
            for deviation, expanded in zip(deviations, u95, strict=True)
        )
        return FormResult(
            deviations=deviations,
            title=scene.title,
            loop=view.loop,
            uncertainty=uncertainty.errors,
        )


@dataclass(frozen=True, kw_only=True)
class FormResult(description.Result):
    """Form deviations of the distorted volume."""

    json_keys = ("deviations",)
    deviations: tuple[FormDeviation, ...]
    title: str
    loop: Loop

    def blocks(self) -> Iterator[Block]:
        yield f"{self.title} · {self.loop} loop · form of the distorted volume"
        columns = (
            *(Column(name, key=name, leads=name != "at") for name in ("kind", "of", "at")),
            Column("value", ".2f", key="value"),
            *([Column("U95"), Column(key="u95", shows=False)] if self.uncertainty else ()),
            Column("unit", key="unit"),
        )
        rows: list[tuple[object, ...]] = []
        for deviation in self.deviations:
            u95 = deviation.expanded_uncertainty.get("u95")
            expanded = (plus_minus(u95), u95) if self.uncertainty else ()
            location = deviation.kind, deviation.of, deviation.at
            rows.append((*location, deviation.value, *expanded, deviation.unit))
        yield Table(columns, rows)


def zone_width(deviation: Array, *places: Array) -> float:
    """Compute the minimum zone: the least width of d − (a + Σ bᵢ·xᵢ) over all points, [n]."""
    from scipy.optimize import linprog

    centred = ((place - place.mean()) / (float(np.ptp(place)) or 1.0) for place in places)
    design = np.column_stack([np.ones(deviation.size), *centred])
    half = np.ones((deviation.size, 1))
    bounds = [(None, None)] * design.shape[1] + [(0.0, None)]
    matrix = np.block([[design, -half], [-design, -half]])
    limits = np.concatenate([deviation, -deviation])
    solution = linprog([0.0] * design.shape[1] + [1.0], matrix, limits, bounds=bounds)
    return 2.0 * float(solution.x[-1])


@dataclass(frozen=True)
class FormVolume:
    """Nodes of a volume by axis positions; deviations are along programmed directions."""

    axes: dict[int, str]  # by dimension of the grid
    positions: dict[int, Array]  # [n], mm
    directions: Array  # [3, 3]; programmed directions in the workpiece frame, by dimension

    @classmethod
    def of(cls, scene: Scene, grid: Grid) -> "FormVolume":
        axes = {i: axis for i, axis in enumerate(grid.axes) if axis}
        middle = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        pose = branch_pose(scene.model, "workpiece", middle)[:3, :3]
        directions = np.zeros((3, 3))
        for i, axis in axes.items():
            directions[i] = pose.T @ programmed_direction(scene.model, middle, axis)
        positions = {i: grid.coordinates[axis].ravel() for i, axis in axes.items()}
        return cls(axes, positions, directions)

    def deviations(self, error_um: Array) -> Iterator[FormDeviation]:
        """Evaluate errors at the nodes, [nx, ny, nz, 3], µm, in the workpiece frame."""
        error = error_um @ self.directions.T
        for third in self.axes:
            yield from self._flatness(error, third)
        for axis in self.axes:
            yield from self._straightness(error, axis)
        yield from (self._squareness(error, *pair) for pair in combinations(self.axes, 2))

    def _flatness(self, error: Array, third: int) -> Iterator[FormDeviation]:
        plane = [i for i in self.axes if i != third]
        places = np.meshgrid(*(self.positions[i] for i in plane), indexing="ij")
        for word, share in PLACES.items():
            index = round(share * (error.shape[third] - 1))
            flat = np.take(error[..., third], index, third)
            width = zone_width(flat.ravel(), *(place.ravel() for place in places))
            at = f"{self.axes[third]} {self.positions[third][index]:.6g} mm ({word})"
            name = "".join(self.axes[i] for i in plane)
            yield FormDeviation("flatness", name, at, width, "µm")

    def _straightness(self, error: Array, axis: int) -> Iterator[FormDeviation]:
        across_axes = [i for i in self.axes if i != axis]
        for across in across_axes:
            widths: dict[str, float] = {}
            for places in product(PLACES.items(), repeat=len(across_axes)):
                index: list[slice | int] = [slice(None) if i == axis else 0 for i in range(3)]
                for i, (_, share) in zip(across_axes, places, strict=True):
                    index[i] = round(share * (error.shape[i] - 1))
                at = ", ".join(
                    f"{self.axes[i]} {word}"
                    for i, (word, _) in zip(across_axes, places, strict=True)
                )
                widths[at] = zone_width(error[tuple(index)][:, across], self.positions[axis])
            worst = max(widths, key=lambda at: widths[at])
            name = f"{self.axes[axis]} in {self.axes[across].lower()}"
            yield FormDeviation(
                "straightness", name, f"worst of lines: {worst}", widths[worst], "µm"
            )

    def _squareness(self, error: Array, first: int, second: int) -> FormDeviation:
        slope = 0.0
        for axis, across in ((first, second), (second, first)):
            index = tuple(
                slice(None) if i == axis else (n - 1) // 2 for i, n in enumerate(error.shape[:3])
            )
            fit = np.polynomial.polynomial.polyfit(self.positions[axis], error[index][:, across], 1)
            slope += 1e3 * float(fit[1])  # µm over mm is mrad
        name = f"{self.axes[second]} to {self.axes[first]}"
        return FormDeviation("squareness", name, "through the middle", -slope, "µrad")
