"""Diagonal displacement tests: body, face and step diagonals (ISO 230-6)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.analysis.options import option
from warpspace.bench.base import BenchRun, BenchTest
from warpspace.bench.data import ALONG, DataColumn, ReadingsFile
from warpspace.bench.kinds.positioning import target_statistics
from warpspace.bench.placing import PLANES, find_plane, following_axes, relative_point, tool_points
from warpspace.bench.plan import BenchPlan, BenchQuantity, Outcome, Whole, build_plan
from warpspace.exceptions import OptionError
from warpspace.scene.model import Scene
from warpspace.units import Array

BODY = ("PPP", "NPP", "PNP", "PPN")  # which way x, y and z run: P upwards, N downwards
FACES = tuple(f"{plane}:{way}" for plane in PLANES for way in ("PP", "NP"))


def diagonal_signs(names: Sequence[str]) -> Array:
    """Give which way x, y and z run along diagonals, [d, 3]: +1, −1, or 0 where one stands."""
    signs = np.zeros((len(names), 3))
    for row, name in enumerate(names):
        first, _, second = name.partition(":")
        for axis, way in zip(first if second else "XYZ", second or first, strict=True):
            signs[row, "XYZ".index(axis)] = 1.0 if way == "P" else -1.0
    return signs


def means_along(position: Array, way: Array, readings: Array) -> dict[str, Array]:
    """Take the mean at each position: of each direction, of both, and their difference."""
    position = np.round(position, 3)
    both = target_statistics(position, way, readings).mean
    ways = both[np.isfinite(both).all(axis=1)]
    if not len(ways):
        ways = target_statistics(position, np.ones(len(way)), readings).mean[:1]
    found = {"all": ways, "mean": ways.mean(axis=0)}
    if len(ways) == 2:
        found["reversal"] = ways[0] - ways[1]
    return found


def squareness_of_diagonals(
    plan: BenchPlan, names: Sequence[str], lengths: Array
) -> dict[str, float]:
    """Squareness errors that the lengths of diagonals look like, µrad.

    A squareness of γ between axes of lengths a and b changes a diagonal of length L by ±γ·a·b/L;
    what all diagonals have in common is scale.
    """
    start = {name: np.flatnonzero(plan.marks["diagonal"] == i) for i, name in enumerate(names)}
    if any(len(rows) == 0 for rows in start.values()):
        return {}
    size = np.array([np.ptp(plan.marks["position_mm"][rows]) for rows in start.values()])
    first = [rows[0] for rows in start.values()]
    keys = [key for _, _, key in PLANES.values()]
    columns = [plan.marks[key][first] * size for key in keys]
    if len(names) == len(BODY):
        design = np.stack([np.ones(len(names)), *columns], -1)
    else:
        faces = np.kron(np.eye(3), np.ones((2, 1)))
        design = np.concatenate([faces, np.stack(columns, -1)], axis=-1)
    solution = np.linalg.lstsq(design, lengths, rcond=None)[0]
    return dict(zip(keys, solution[-3:].tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class Diagonals(BenchTest):
    """Displacement along the diagonals of the working volume."""

    name = "diagonals"
    title = "Diagonal displacement"
    standard = "ISO 230-6"
    words = (
        "A laser interferometer looks along the four body diagonals of the working volume, or the"
        " two diagonals of each face through its middle; the tool runs along them and back."
        " Displacements count from the start. E, M and B are those of ISO 230-2 along each"
        " diagonal; diagonals of different length betray squareness errors. Step diagonals move"
        " one axis after the other, so that the part of each axis can be told."
    )
    columns = (DataColumn("diagonal", "name"), *ALONG)
    kind: Literal["body", "face", "step"] = option("body", "Which diagonals")
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
        problems = table.unknown_words("diagonal", names, f"one of {', '.join(names)}")
        if problems:
            raise table.refuse(*problems)
        number = np.array([names.index(word) for word in table.words["diagonal"]], dtype=float)
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
        stand = self.stand(scene)
        here = np.array([float(stand[name]) for name in axes])
        start = np.where(signs > 0.0, low, np.where(signs < 0.0, high, here))
        end = np.where(signs > 0.0, high, np.where(signs < 0.0, low, here))
        return start, end

    def _lay(self, scene: Scene, number: Array, way: Array, share: Array) -> BenchPlan:
        start, end = self._ends(scene)
        index = number.astype(np.intp)
        positions = start[index] + share[:, None] * (end - start)[index]
        return self._plan(scene, positions, index, {"diagonal": number, "way": way})

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
            "way": np.ones(len(index)),
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
                    f" {self.targets - 1} steps of each of three axes (--targets {self.targets})"
                )
            values.append(table["deviation_um"][chosen])
        return plan, np.concatenate(values)

    def _plan(
        self, scene: Scene, positions: Array, index: Whole, marks: dict[str, Array]
    ) -> BenchPlan:
        model, axes = self.model(scene), following_axes(scene.model)
        start, end = self._ends(scene)
        signs = diagonal_signs(self.names)
        ways = np.concatenate([signs[index] * marks["way"][:, None], signs])

        def standing(at: Array) -> dict[str, Array]:
            return {**self.stand(scene), **dict(zip(axes, at.T, strict=True))}

        def seen(at: Array) -> Array:
            return np.asarray(relative_point(model, standing(at)))

        along = seen(end) - seen(start)
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
        rows, coordinates = np.arange(len(positions)), standing(np.concatenate([positions, start]))
        distance = np.sum((seen(positions) - seen(start)[index]) * along[index], axis=-1)
        zero = {
            f"zero_{name}_um": (index == number).astype(float)
            for number, name in enumerate(self.names)
        }
        for plane, (_, _, key) in PLANES.items():
            found = find_plane(model, self.stand(scene), plane)
            product = (along @ found.along) * (along @ found.up)
            marks[key] = 1e-3 * found.sign * product[index]
        ends = np.flatnonzero(np.diff(index, append=-1) != 0) + 1
        return build_plan(
            coordinates,
            tool_points(model, coordinates, len(positions) + len(start)),
            along[index],
            place=f"{self.kind} diagonals · {self.place_words(scene, axes)}",
            marks={**marks, "position_mm": distance},
            site=rows,
            against=len(positions) + index,
            travel=dict(zip(axes, ways.T, strict=True)),
            setup=zero,
            path=tuple(np.split(rows, ends[:-1])),
        )  # fmt: skip

    def evaluate(self, plan: BenchPlan, readings: Array) -> Outcome:
        names = self.names
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
                # what the steps of each axis contribute
                steps = np.diff(readings[chosen], prepend=readings[chosen][:1])
                axis = plan.marks["axis"][chosen]
                row["by_axis_um"] = {x: float(steps[axis == i].sum()) for i, x in enumerate("XYZ")}
            rows.append(row)
        quantities = [
            BenchQuantity("E_um", "largest systematic deviation E", _largest(rows, "E_um"), "µm"),
            BenchQuantity(
                "length_difference_um", "longest less shortest deviation of length",
                float(np.ptp(lengths[np.isfinite(lengths)])), "µm",
            ),
        ]  # fmt: skip
        if any("B_um" in row for row in rows):
            quantities.append(
                BenchQuantity("B_um", "largest reversal B", _largest(rows, "B_um"), "µm")
            )
        squareness = squareness_of_diagonals(plan, names, lengths)
        words = "squareness {} that it looks like"
        quantities += [
            BenchQuantity(f"squareness_{key}_urad", words.format(key), value, "µrad")
            for key, value in squareness.items()
        ]
        return Outcome(tuple(quantities), {"diagonals": rows})

    def charts(self, runs: Sequence[BenchRun]) -> tuple[Lines, ...]:
        curves: list[Curve] = []
        for run in runs:
            marks = run.plan.marks
            for index, name in enumerate(self.names):
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
            Lines(
                "lines", f"Along the {self.kind} diagonals", "distance from the start [mm]",
                "deviation [µm]", tuple(curves), (),
                "P: the axis runs upwards, N: downwards, in the order x, y, z.",
            ),
        )  # fmt: skip


def _alike(run: BenchRun, index: int) -> bool:
    marks = run.plan.marks
    there, back = (
        run.readings[(marks["diagonal"] == index) & (marks["way"] == way)] for way in (1.0, -1.0)
    )
    return len(there) == len(back) and bool(np.abs(there - back[::-1]).max(initial=0.0) < 1e-9)


def _largest(rows: Sequence[dict[str, object]], key: str) -> float:
    return max(float(str(row[key])) for row in rows if key in row)
