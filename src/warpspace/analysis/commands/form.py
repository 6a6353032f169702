"""Form of the distorted volume: flatness, straightness and squareness."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from typing import ClassVar

import numpy as np

from warpspace.analysis import description
from warpspace.analysis.blocks import Block, Column, Table
from warpspace.analysis.options import LOOP_HELP, option
from warpspace.analysis.uncertainty.propagation import field_uncertainty, plus_minus
from warpspace.exceptions import OptionError
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
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

    What an inspector would find on a part that the bent volume is copied to. Flatness and
    straightness are the widths of the zone between two parallel planes or lines that
    holds all points (minimum zone, ISO 12780 and 12781). Squareness is that of the least-squares
    lines through the middle of the volume, positive where their angle is above 90°.
    """

    name = "form"
    task = "understand"
    has_table = True
    nodes: int = option(11, "Nodes per axis of the working volume", low=3, high=41, flag="--grid")
    loop: Loop = option(Loop.TOOL, LOOP_HELP)

    def run(self, scene: Scene, watch: description.ProgressCallback, /) -> "FormResult":
        grid = build_grid(scene.model, scene.workspace, self.nodes)
        axes = grid.axes
        if sum(map(bool, axes)) < 2 or not all(is_linear(axis) for axis in axes if axis):
            raise OptionError("form: expected a working volume with two or three linear axes")
        view = choose_view(scene, self.loop)
        error = evaluate_grid(scene, grid, view).error_um
        deviations = tuple(_deviations(axes, grid.nominal_mm, error))
        uncertainty = field_uncertainty(scene, error, grid.coordinates, view, grid.point_mm)
        n_evaluations = 2 * (1 + len(uncertainty.errors.keys)) if uncertainty else 1
        advance = description.count_progress(watch, n_evaluations)
        advance(1)
        if uncertainty is None:
            return FormResult(deviations=deviations, title=scene.title)

        def deviation_values(error_um: Array) -> Array:
            advance(1)
            return np.array(
                [deviation.value for deviation in _deviations(axes, grid.nominal_mm, error_um)]
            )

        u95 = uncertainty.propagate(deviation_values)
        deviations = tuple(
            replace(deviation, expanded_uncertainty=description.ExpandedUncertainty(u95=expanded))
            for deviation, expanded in zip(deviations, u95, strict=True)
        )
        return FormResult(deviations=deviations, title=scene.title, uncertainty=uncertainty.errors)


def _deviations(axes: tuple[str, ...], nominal: Array, error: Array) -> Iterator[FormDeviation]:
    moving = [i for i, axis in enumerate(axes) if axis]
    for third in moving:
        yield from _flatness(axes, nominal, error, [i for i in moving if i != third], third)
    for axis in moving:
        yield from _straightness(axes, nominal, error, moving, axis)
    yield from (_squareness(axes, nominal, error, *pair) for pair in combinations(moving, 2))


@dataclass(frozen=True, kw_only=True)
class FormResult(description.Result):
    """Form deviations of the distorted volume."""

    json_keys = ("deviations",)
    deviations: tuple[FormDeviation, ...]
    title: str

    def blocks(self) -> Iterator[Block]:
        yield f"{self.title} · form of the distorted volume"
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


def _flatness(
    axes: tuple[str, ...], nominal: Array, error: Array, plane: list[int], third: int
) -> Iterator[FormDeviation]:
    name = "".join(axes[i] for i in plane)
    for word, share in PLACES.items():
        index = round(share * (error.shape[third] - 1))
        flat, places = (np.take(part, index, third) for part in (error[..., third], nominal))
        width = zone_width(flat.ravel(), *(places[..., i].ravel() for i in plane))
        at = f"{axes[third]} {np.take(nominal, index, third)[..., third].mean():.6g} mm ({word})"
        yield FormDeviation("flatness", name, at, width, "µm")


def _straightness(
    axes: tuple[str, ...], nominal: Array, error: Array, moving: list[int], axis: int
) -> Iterator[FormDeviation]:
    across_axes = [i for i in moving if i != axis]
    for across in across_axes:
        widths: dict[str, float] = {}
        for places in product(PLACES.items(), repeat=len(across_axes)):
            index: list[slice | int] = [slice(None) if i == axis else 0 for i in range(3)]
            for i, (_, share) in zip(across_axes, places, strict=True):
                index[i] = round(share * (error.shape[i] - 1))
            line = tuple(index)
            at = ", ".join(
                f"{axes[i]} {word}" for i, (word, _) in zip(across_axes, places, strict=True)
            )
            widths[at] = zone_width(error[line][:, across], nominal[line][:, axis])
        worst = max(widths, key=lambda at: widths[at])
        name = f"{axes[axis]} in {'xyz'[across]}"
        yield FormDeviation("straightness", name, f"worst of lines: {worst}", widths[worst], "µm")


def _squareness(
    axes: tuple[str, ...], nominal: Array, error: Array, first: int, second: int
) -> FormDeviation:
    slope = 0.0
    for axis, across in ((first, second), (second, first)):
        index = tuple(
            slice(None) if i == axis else (n - 1) // 2 for i, n in enumerate(error.shape[:3])
        )
        fit = np.polynomial.polynomial.polyfit(nominal[index][:, axis], error[index][:, across], 1)
        slope += 1e3 * float(fit[1])  # µm over mm is mrad
    name = f"{axes[second]} to {axes[first]}"
    return FormDeviation("squareness", name, "through the middle", -slope, "µrad")
