"""Diagonal displacement tests: body, face and step diagonals (ISO 230-6)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import ALONG, DataColumn, ReadingsFile
from warpspace.bench.kinds.positioning import target_statistics
from warpspace.bench.linear_form import LinearForm, absolute, largest_range, zone
from warpspace.bench.placing import PLANES, find_plane, following_axes, tool_offset, tool_points
from warpspace.bench.plan import BenchPlan, IndexArray, Outcome, build_outcome, build_plan
from warpspace.exceptions import OptionError
from warpspace.scene.model import Scene
from warpspace.units import Array

BODY = ("PPP", "NPP", "PNP", "PPN")  # senses of x, y and z: P upwards, N downwards
FACES = tuple(f"{plane}:{senses}" for plane in PLANES for senses in ("PP", "NP"))


def diagonal_signs(names: Sequence[str]) -> Array:
    """Return the senses of x, y and z along diagonals, [d, 3]: +1, −1, or 0 if at rest."""
    signs = np.zeros((len(names), 3))
    for row, name in enumerate(names):
        first, _, second = name.partition(":")
        for axis, letter in zip(first if second else "XYZ", second or first, strict=True):
            signs[row, "XYZ".index(axis)] = 1.0 if letter == "P" else -1.0
    return signs


def means_along(position: Array, travel_sign: Array, readings: Array) -> dict[str, Array]:
    """Compute the means at each position: per direction, of both, and their difference."""
    position = np.round(position, 3)
    by_direction = target_statistics(position, travel_sign, readings).mean
    complete = by_direction[np.isfinite(by_direction).all(axis=1)]
    if not len(complete):
        complete = target_statistics(position, np.ones(len(travel_sign)), readings).mean[:1]
    means = {"all": complete, "mean": complete.mean(axis=0)}
    if len(complete) == 2:
        means["reversal"] = complete[0] - complete[1]
    return means


def squareness_of_diagonals(
    plan: BenchPlan, names: Sequence[str], lengths: Array
) -> dict[str, Array]:
    """Fit the squareness errors, µrad, that explain the lengths of diagonals, [d, ...], µm.

    A squareness of γ between axes of lengths a and b changes a diagonal of length L by ±γ·a·b/L;
    the common part of all diagonals is scale.
    """
    start = {name: np.flatnonzero(plan.marks["diagonal"] == i) for i, name in enumerate(names)}
    if any(len(rows) == 0 for rows in start.values()):
        return {}
    size = np.array([np.ptp(plan.marks["position_mm"][rows]) for rows in start.values()])
    first = [rows[0] for rows in start.values()]
    keys = plan.squareness_key.split()
    columns = [plan.marks[key][first] * size for key in keys]
    if len(names) == len(BODY):
        design = np.stack([np.ones(len(names)), *columns], -1)
    else:
        faces = np.kron(np.eye(3), np.ones((2, 1)))
        design = np.concatenate([faces, np.stack(columns, -1)], axis=-1)
    solution = np.linalg.lstsq(design, lengths, rcond=None)[0]
    return dict(zip(keys, solution[-3:], strict=True))


@dataclass(frozen=True, kw_only=True)
class Diagonals(BenchTest):
    """Displacement along the diagonals of the working volume."""

    name = "diagonals"
    title = "Diagonal displacement"
    standard = "ISO 230-6"
    description = (
        "A laser interferometer measures along the four body diagonals of the working volume, or"
        " the two diagonals of each face through its middle; the tool runs along them and back."
        " Displacements count from the start. E, M and B are those of ISO 230-2 along each"
        " diagonal; diagonals of different length indicate squareness errors. Step diagonals move"
        " one axis after the other, which separates the contributions of the axes."
    )
    columns = (DataColumn("diagonal", "name"), *ALONG)
    kind: Literal["body", "face", "step"] = option("body", "Kind of diagonals")
    targets: int = option(11, "Targets along each diagonal", low=2, high=500)

    @property
    def names(self) -> tuple[str, ...]:
        return FACES if self.kind == "face" else BODY

    def plan(self, scene: Scene) -> BenchPlan:
        share = np.linspace(0.0, 1.0, self.targets)
        if self.kind == "step":
            return self._steps(scene)
        count = len(self.names)
        return self._lay(
            scene,
            np.repeat(np.arange(count, dtype=float), 2 * self.targets),
            np.tile(np.repeat([1.0, -1.0], self.targets), count),
            np.tile(np.concatenate([share, share[::-1]]), count),
        )

    def plan_data(self, scene: Scene, table: ReadingsFile) -> tuple[BenchPlan, Array]:
        names = self.names
        problems = table.unknown_labels("diagonal", names, f"one of {', '.join(names)}")
        if problems:
            raise table.refuse(*problems)
        number = np.array([names.index(word) for word in table.labels["diagonal"]], dtype=float)
        if self.kind == "step":
            return self._step_data(scene, table, number)
        start, end = self._ends(scene)
        lengths = np.linalg.norm(end - start, axis=-1)
        share = table["position_mm"] / lengths[number.astype(int)]
        for index in np.unique(number).astype(int):
            chosen = number == index
            if len(np.unique(np.round(share[chosen], 6))) < 2:
                problems.append(f"diagonal {names[index]}: fewer than 2 positions")
        beyond = (share < -1e-3) | (share > 1.0 + 1e-3)
        problems += [
            f"line {int(line)}, position_mm: {value:g}; the diagonal {names[int(which)]} is"
            f" {lengths[int(which)]:.3f} mm long"
            for line, value, which in zip(
                table.lines[beyond], table["position_mm"][beyond], number[beyond], strict=True
            )
        ]
        if problems:
            raise table.refuse(*problems)
        plan = self._lay(scene, number, table["direction"], np.clip(share, 0.0, 1.0))
        return plan, table["deviation_um"]

    def _ends(self, scene: Scene) -> tuple[Array, Array]:
        axes, signs = following_axes(scene.model), diagonal_signs(self.names)
        low, high = np.array([scene.workspace.ranges[name] for name in axes]).T
        flat = [axes[at] for at in np.flatnonzero(signs.any(axis=0)) if not low[at] < high[at]]
        if flat:
            raise OptionError(
                f"diagonals need a range of {', '.join(flat)} in [workspace]; expected [low, high]"
            )
        stand = self.axis_positions(scene)
        positions = np.array([float(stand[name]) for name in axes])
        start = np.where(signs > 0.0, low, np.where(signs < 0.0, high, positions))
        end = np.where(signs > 0.0, high, np.where(signs < 0.0, low, positions))
        return start, end

    def _lay(self, scene: Scene, number: Array, travel_sign: Array, share: Array) -> BenchPlan:
        start, end = self._ends(scene)
        index = number.astype(np.intp)
        positions = start[index] + share[:, None] * (end - start)[index]
        return self._plan(scene, positions, index, {"diagonal": number, "travel_sign": travel_sign})

    def _steps(self, scene: Scene) -> BenchPlan:
        start, end = self._ends(scene)
        steps = self.targets - 1
        done = np.zeros((3 * steps + 1, 3))
        for axis in range(3):
            done[axis + 1 :: 3, axis] = 1.0
        share = np.cumsum(done, axis=0) / steps
        index = np.repeat(np.arange(len(BODY)), len(share))
        positions = (start[:, None] + share * (end - start)[:, None]).reshape(-1, 3)
        moved = np.concatenate([[-1.0], np.tile([0.0, 1.0, 2.0], steps)])  # the start by none
        marks = {
            "diagonal": index.astype(float),
            "travel_sign": np.ones(len(index)),
            "axis": np.tile(moved, len(BODY)),
        }
        return self._plan(scene, positions, index, marks)

    def _step_data(
        self, scene: Scene, table: ReadingsFile, number: Array
    ) -> tuple[BenchPlan, Array]:
        plan = self._steps(scene)
        values: list[Array] = []
        each = plan.readings // len(BODY)
        for index, name in enumerate(BODY):
            chosen = number == index
            if int(chosen.sum()) != each:
                raise table.refuse(
                    f"diagonal {name}: {int(chosen.sum())} readings; expected {each}, the start and"
                    f" {self.targets - 1} steps of each of three axes ({{targets}} {self.targets})"
                )
            values.append(table["deviation_um"][chosen])
        return plan, np.concatenate(values)

    def _plan(
        self, scene: Scene, positions: Array, index: IndexArray, marks: dict[str, Array]
    ) -> BenchPlan:
        model, axes = self.model(scene), following_axes(scene.model)
        start, end = self._ends(scene)
        signs = diagonal_signs(self.names)
        travel_signs = np.concatenate([signs[index] * marks["travel_sign"][:, None], signs])

        def positions_at(at: Array) -> dict[str, Array]:
            return {**self.axis_positions(scene), **dict(zip(axes, at.T, strict=True))}

        def relative_points(at: Array) -> Array:
            return np.asarray(tool_offset(model, positions_at(at)))

        along = relative_points(end) - relative_points(start)
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
        rows, coordinates = (
            np.arange(len(positions)),
            positions_at(np.concatenate([positions, start])),
        )
        distance = np.sum(
            (relative_points(positions) - relative_points(start)[index]) * along[index], axis=-1
        )
        zero = {
            f"zero_{name}_um": (index == number).astype(float)
            for number, name in enumerate(self.names)
        }
        planes = [find_plane(model, self.axis_positions(scene), plane) for plane in PLANES]
        for plane in planes:
            product = (along @ plane.first_direction) * (along @ plane.second_direction)
            marks[plane.key] = 1e-3 * plane.sign * product[index]
        ends = np.flatnonzero(np.diff(index, append=-1) != 0) + 1
        return build_plan(
            coordinates,
            tool_points(model, coordinates, len(positions) + len(start)),
            along[index],
            place=f"{self.kind} diagonals · {self.place_text(scene, axes)}",
            marks={**marks, "position_mm": distance},
            site=rows,
            against=len(positions) + index,
            travel=dict(zip(axes, travel_signs.T, strict=True)),
            setup=zero,
            path=tuple(np.split(rows, ends[:-1])),
            squareness_key=" ".join(plane.key for plane in planes),
        )  # fmt: skip

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        names = self.names
        number, travel_sign = plan.marks["diagonal"], plan.marks["travel_sign"]
        position = plan.marks["position_mm"]
        rows: list[dict[str, Any]] = []
        lengths = np.full(len(names), np.nan)
        for index, name in enumerate(names):
            chosen = number == index
            if not chosen.any():
                continue
            means = means_along(position[chosen], travel_sign[chosen], readings[chosen])
            lengths[index] = means["mean"][-1] - means["mean"][0]
            row: dict[str, Any] = {
                "diagonal": name,
                "length_mm": float(np.ptp(position[chosen])),
                "length_deviation_um": float(lengths[index]),
                "E_um": float(np.ptp(means["all"])),
                "M_um": float(np.ptp(means["mean"])),
            }
            if "reversal" in means:
                row["B_um"] = float(np.abs(means["reversal"]).max())
            if self.kind == "step":
                # contribution of the steps of each axis
                steps = np.diff(readings[chosen], prepend=readings[chosen][:1])
                axis = plan.marks["axis"][chosen]
                row["by_axis_um"] = {x: float(steps[axis == i].sum()) for i, x in enumerate("XYZ")}
            rows.append(row)
        complete = lengths[np.isfinite(lengths)]
        quantities = [
            ("E_um", "largest systematic deviation E", max(row["E_um"] for row in rows)),
            ("length_difference_um", "longest less shortest deviation of length", np.ptp(complete)),
        ]
        reversals = [row["B_um"] for row in rows if "B_um" in row]
        if reversals:
            quantities.append(("B_um", "largest reversal B", max(reversals)))
        for key, value in squareness_of_diagonals(plan, names, lengths).items():
            text = f"equivalent squareness {key}"
            quantities.append((f"squareness_{key}_urad", text, float(value)))
        return build_outcome(quantities, {"diagonals": rows})

    def linear_forms(self, plan: BenchPlan, readings: Array) -> Mapping[str, LinearForm]:
        number, position = plan.marks["diagonal"], np.round(plan.marks["position_mm"], 3)
        lengths: list[Array] = []
        for index in range(len(self.names)):
            at, along = position[number == index], readings[number == index]
            ends = (along[at == end].mean(axis=0) for end in (at.min(), at.max()))
            lengths.append(-np.subtract(*ends))
        squareness = squareness_of_diagonals(plan, self.names, np.stack(lengths))
        return {
            "E_um": largest_range(readings, number),
            "length_difference_um": zone(np.stack(lengths)),
            **{f"squareness_{key}_urad": absolute(row[None]) for key, row in squareness.items()},
        }

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        curves: list[Curve] = []
        for run in runs:
            marks = run.plan.marks
            for index, name in enumerate(self.names):
                forth, back = (
                    (marks["diagonal"] == index) & (marks["travel_sign"] == sign)
                    for sign in (1.0, -1.0)
                )
                if not run.is_measured and _alike(run.readings[forth], run.readings[back]):
                    back = back & False
                for text, chosen in ((name, forth), (f"{name} back", back)):
                    if chosen.any():
                        x, y = marks["position_mm"][chosen], run.readings[chosen]
                        style = "line" if chosen is forth else "dashed"
                        style = "dots" if run.is_measured else style
                        curves.append(Curve(run.label(text), x, y, index, style))
        title, note = f"Along the {self.kind} diagonals", "P: the axis runs upwards, N: downwards"
        labels = title, "distance from the start [mm]", "deviation [µm]"
        return (Lines("lines", *labels, tuple(curves), note=f"{note}, in the order x, y, z."),)


def _alike(forward: Array, backward: Array) -> bool:
    return len(forward) == len(backward) and bool(
        np.abs(forward - backward[::-1]).max(initial=0.0) < 1e-9
    )
