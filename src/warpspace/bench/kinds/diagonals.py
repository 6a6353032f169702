"""Diagonal displacement tests: body, face and step diagonals (ISO 230-6)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpspace.bench.base import BenchTest, Run
from warpspace.bench.data import DataColumn, Table
from warpspace.bench.evaluation.diagonal import (
    KINDS,
    diagonal_names,
    diagonal_signs,
    means_along,
    squareness_of_diagonals,
    steps_by_axis,
)
from warpspace.bench.options import check_count, option
from warpspace.bench.outcome import Chart, Curve, Outcome, Quantity
from warpspace.bench.paths.placing import following_axes, relative_point
from warpspace.bench.paths.planes import PLANES, find_plane
from warpspace.bench.plan import Plan, Whole, build_plan
from warpspace.exceptions import OptionError
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop
from warpspace.scene.model import Scene
from warpspace.units import Array


@dataclass(frozen=True, kw_only=True)
class Diagonals(BenchTest):
    """Displacement along the diagonals of the working volume."""

    name: ClassVar[str] = "diagonals"
    title: ClassVar[str] = "Diagonal displacement"
    standard: ClassVar[str] = "ISO 230-6"
    words: ClassVar[str] = (
        "A laser interferometer looks along the four body diagonals of the working volume, or the"
        " two diagonals of each face through its middle; the tool runs along them and back."
        " Displacements count from the start. E, M and B are those of ISO 230-2 along each"
        " diagonal; diagonals of different length betray squareness errors. Step diagonals move one"
        " axis after the other, so that the part of each axis can be told."
    )
    columns: ClassVar[tuple[DataColumn, ...]] = (
        DataColumn("diagonal", "name"),
        DataColumn("direction", "sign", default="+"),
        DataColumn("position_mm", "number"),
        DataColumn("deviation_um"),
    )
    kind: str = option("body", "choice", "Which diagonals.", choices=KINDS)
    targets: int = option(11, "count", "Targets along each diagonal.")

    def plan(self, scene: Scene) -> Plan:
        """Run every diagonal there and back; step diagonals there only."""
        check_count("--targets", self.targets, 2, 500)
        share = np.linspace(0.0, 1.0, self.targets)
        if self.kind == "step":
            return self._steps(scene)
        names = diagonal_names(self.kind)
        rows = [(name, way) for name in names for way in (1.0, -1.0)]
        return self._lay(
            scene,
            np.repeat([names.index(name) for name, _ in rows], self.targets).astype(float),
            np.repeat([way for _, way in rows], self.targets),
            np.concatenate([share if way > 0.0 else share[::-1] for _, way in rows]),
        )

    def plan_data(self, scene: Scene, table: Table) -> tuple[Plan, Array]:
        """Run the positions of a file; ``position_mm`` counts along the diagonal from its start."""
        names = diagonal_names(self.kind)
        given = table.words["diagonal"]
        problems = [
            f"line {int(line)}, diagonal: {word!r}; expected one of {', '.join(names)}"
            for line, word in zip(table.lines, given, strict=True)
            if word not in names
        ]
        if problems:
            raise table.refuse(*problems)
        number = np.array([names.index(word) for word in given], dtype=float)
        if self.kind == "step":
            return self._step_data(scene, table, number)
        _, lengths = self._box(scene, names)
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

    def _box(self, scene: Scene, names: Sequence[str]) -> tuple[Array, Array]:
        """Give lower and upper ends of the three axes, [2, 3], and the length of each diagonal."""
        axes = following_axes(scene.model)
        ranges = np.array([scene.workspace.ranges[name] for name in axes]).T
        needed = {index for name in names for index in np.flatnonzero(diagonal_signs(name))}
        flat = [axes[index] for index in sorted(needed) if not ranges[0, index] < ranges[1, index]]
        if flat:
            raise OptionError(
                f"diagonals need a range of {', '.join(flat)} in [workspace]; expected [low, high]"
            )
        extent = np.array([np.abs(diagonal_signs(name)) for name in names]) * np.ptp(ranges, axis=0)
        return ranges, np.linalg.norm(extent, axis=-1)

    def _positions(self, scene: Scene, names: Sequence[str]) -> tuple[Array, Array]:
        """Give axis positions at start and end of each diagonal, [d, 3] each."""
        ranges, _ = self._box(scene, names)
        stand = self.stand(scene)
        here = np.array([float(stand[name]) for name in following_axes(scene.model)])
        signs = np.array([diagonal_signs(name) for name in names])
        low, high = ranges
        start = np.where(signs > 0.0, low, np.where(signs < 0.0, high, here))
        end = np.where(signs > 0.0, high, np.where(signs < 0.0, low, here))
        return start, end

    def _lay(self, scene: Scene, number: Array, way: Array, share: Array) -> Plan:
        """Lay the plan through shares of diagonals."""
        names = diagonal_names(self.kind)
        start, end = self._positions(scene, names)
        index = number.astype(np.intp)
        positions = start[index] + share[:, None] * (end - start)[index]
        signs = np.array([diagonal_signs(name) for name in names])[index]
        marks = {"diagonal": number, "way": way}
        return self._plan(scene, positions, signs * way[:, None], index, marks)

    def _steps(self, scene: Scene) -> Plan:
        """Run the step diagonals: one axis after the other."""
        names = diagonal_names("step")
        start, end = self._positions(scene, names)
        steps = self.targets - 1
        done = np.zeros((3 * steps + 1, 3))
        for axis in range(3):
            done[axis + 1 :: 3, axis] = 1.0
        share = np.cumsum(done, axis=0) / steps
        index = np.repeat(np.arange(len(names)), len(share))
        positions = (start[:, None] + share * (end - start)[:, None]).reshape(-1, 3)
        moved = np.concatenate([[0.0], np.tile([0.0, 1.0, 2.0], steps)])
        moved[0] = np.nan  # the start is reached by none
        signs = np.array([diagonal_signs(name) for name in names])[index]
        marks = {
            "diagonal": index.astype(float),
            "way": np.ones(len(index)),
            "axis": np.tile(np.nan_to_num(moved, nan=-1.0), len(names)),
        }
        return self._plan(scene, positions, signs, index, marks)

    def _step_data(self, scene: Scene, table: Table, number: Array) -> tuple[Plan, Array]:
        """Put the readings of step diagonals in order: all steps of each, from its start."""
        plan = self._steps(scene)
        names = diagonal_names("step")
        values: list[Array] = []
        each = plan.readings // len(names)
        for index, name in enumerate(names):
            chosen = number == index
            if int(chosen.sum()) != each:
                raise table.refuse(
                    f"diagonal {name}: {int(chosen.sum())} readings; expected {each}, the start and"
                    f" {self.targets - 1} steps of each of three axes (--targets {self.targets})"
                )
            values.append(table["deviation_um"][chosen])
        return plan, np.concatenate(values)

    def _plan(
        self, scene: Scene, positions: Array, ways: Array, index: Whole, marks: dict[str, Array]
    ) -> Plan:
        """Put the plan together from axis positions, [m, 3]; sites of the starts come last."""
        names = diagonal_names(self.kind)
        model, axes = self.model(scene), following_axes(scene.model)
        start, end = self._positions(scene, names)
        every = np.concatenate([positions, start])
        coordinates = {
            name: np.broadcast_to(values, (len(every),)).copy()
            for name, values in self.stand(scene).items()
        }
        for column, name in enumerate(axes):
            coordinates[name] = every[:, column]

        def seen(at: Array) -> Array:
            moved = {**self.stand(scene), **dict(zip(axes, at.T, strict=True))}
            return np.asarray(relative_point(model, moved))

        along = seen(end) - seen(start)
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
        count, first = len(positions), len(positions)
        rows = np.arange(count)
        distance = np.sum((seen(positions) - seen(start)[index]) * along[index], axis=-1)
        zero = {
            f"zero_{name}_um": (index == number).astype(float) for number, name in enumerate(names)
        }
        for plane, (_, _, key) in PLANES.items():
            found = find_plane(model, self.stand(scene), plane)
            product = (along @ found.along) * (along @ found.up)
            marks[key] = 1e-3 * found.sign * product[index]
        ends = np.flatnonzero(np.diff(index, append=-1) != 0) + 1
        return build_plan(
            coordinates,
            np.broadcast_to(nominal_point(model, Loop.TOOL, coordinates), (len(every), 3)),
            along[index],
            place=f"{self.kind} diagonals · {self.place_words(scene, axes)}",
            marks={**marks, "position_mm": distance},
            site=rows,
            against=first + index,
            travel={
                name: np.append(ways[:, column], (np.array(
                    [diagonal_signs(one) for one in names]))[:, column])
                for column, name in enumerate(axes)
            },
            setup=zero,
            path=tuple(np.split(rows, ends[:-1])),
        )  # fmt: skip

    def evaluate(self, plan: Plan, readings: Array) -> Outcome:
        """Take length, systematic deviation, mean deviation and reversal of each diagonal."""
        names = diagonal_names(self.kind)
        number, way = plan.marks["diagonal"], plan.marks["way"]
        position = plan.marks["position_mm"]
        rows: list[dict[str, object]] = []
        lengths = np.full(len(names), np.nan)
        for index, name in enumerate(names):
            chosen = number == index
            if not chosen.any():
                continue
            there = means_along(position[chosen], way[chosen], readings[chosen])
            lengths[index] = there["mean"][-1] - there["mean"][0]
            row: dict[str, object] = {
                "diagonal": name,
                "length_mm": float(np.ptp(position[chosen])),
                "length_deviation_um": float(lengths[index]),
                "E_um": float(np.ptp(there["all"])),
                "M_um": float(np.ptp(there["mean"])),
            }
            if "reversal" in there:
                row["B_um"] = float(np.abs(there["reversal"]).max())
            if self.kind == "step":
                row["by_axis_um"] = steps_by_axis(plan.marks["axis"][chosen], readings[chosen])
            rows.append(row)
        quantities = [
            Quantity("E_um", "largest systematic deviation E", _largest(rows, "E_um"), "µm"),
            Quantity(
                "length_difference_um", "longest less shortest deviation of length",
                float(np.ptp(lengths[np.isfinite(lengths)])), "µm",
            ),
        ]  # fmt: skip
        if any("B_um" in row for row in rows):
            quantities.append(Quantity("B_um", "largest reversal B", _largest(rows, "B_um"), "µm"))
        squareness = squareness_of_diagonals(plan, names, lengths)
        words = "squareness {} that it looks like"
        quantities += [
            Quantity(f"squareness_{key}_urad", words.format(key), value, "µrad")
            for key, value in squareness.items()
        ]
        return Outcome(tuple(quantities), {"diagonals": rows})

    def charts(self, runs: Sequence[Run]) -> tuple[Chart, ...]:
        """Draw the deviation along each diagonal."""
        names = diagonal_names(self.kind)
        curves: list[Curve] = []
        for run in runs:
            marks = run.plan.marks
            for index, name in enumerate(names):
                for way, word in ((1.0, ""), (-1.0, " back")):
                    chosen = (marks["diagonal"] == index) & (marks["way"] == way)
                    if not chosen.any() or (
                        way < 0.0 and not run.is_measured and _alike(run, index)
                    ):
                        continue
                    style = "dots" if run.is_measured else ("line" if way > 0.0 else "dashed")
                    x, y = marks["position_mm"][chosen], run.readings[chosen]
                    curves.append(Curve(run.named(name + word), x, y, index, style))
        return (
            Chart(
                "lines", f"Along the {self.kind} diagonals", "distance from the start [mm]",
                "deviation [µm]", tuple(curves), (),
                "P: the axis runs upwards, N: downwards, in the order x, y, z.",
            ),
        )  # fmt: skip


def _alike(run: Run, index: int) -> bool:
    """Tell whether a diagonal reads the same there and back."""
    marks = run.plan.marks
    there, back = (
        run.readings[(marks["diagonal"] == index) & (marks["way"] == way)] for way in (1.0, -1.0)
    )
    return len(there) == len(back) and bool(np.abs(there - back[::-1]).max(initial=0.0) < 1e-9)


def _largest(rows: Sequence[dict[str, object]], key: str) -> float:
    """Give the largest of a number over the diagonals."""
    return max(float(str(row[key])) for row in rows if key in row)
