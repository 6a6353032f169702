"""What an instrument adds to the uncertainty of readings: a table of contributions, one file each.

A contribution has the standard uncertainty u of its distribution and a sensitivity c: what one unit
of it does to a reading (ISO/IEC Guide 98-3, 4.3 and 5.1). It acts on each reading by itself, on all
alike (a zero, an artefact), or as a scale, in proportion to the distance from the mean point.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.analysis.blocks import Column, Table
from warpspace.bench.placing import ball_point
from warpspace.calibration.readings import Readings
from warpspace.calibration.solve import MeasurementModel
from warpspace.exceptions import SceneError, UnknownNameError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.resources import assets_dir
from warpspace.scene import schema
from warpspace.scene.text_files import parse_toml, read_text
from warpspace.units import MM_PER_UM, Array


@dataclass(frozen=True, slots=True)
class Contribution:
    """One line of a budget."""

    name: str
    type: str  # A: from repeated readings, B: otherwise
    distribution: str
    value: float  # standard uncertainty if it is normal, else half width
    unit: str
    sensitivity: float  # µm per unit, or µm/m per unit of a scale
    acts: str  # each, all or scale
    dof: float  # degrees of freedom
    source: str

    def at(self, length_mm: float) -> float:
        """Give the standard uncertainty of a reading at a distance from the mean point, µm."""
        u = self.sensitivity * self.value / schema.DIVISORS[self.distribution]
        return u * length_mm * 1e-3 if self.acts == "scale" else u


@dataclass(frozen=True, slots=True)
class Instrument:
    """An instrument and its contributions."""

    name: str
    title: str
    contributions: tuple[Contribution, ...]

    @property
    def shared(self) -> tuple[Contribution, ...]:
        """Contributions that all readings have together."""
        return tuple(one for one in self.contributions if one.acts != "each")

    @property
    def scatter(self) -> tuple[float, float]:
        """Standard uncertainty that each reading has by itself, µm, and degrees of freedom."""
        return self.budget(0.0, ("each",))

    def budget(self, length_mm: float, acts: Collection[str] = schema.ACTS) -> tuple[float, float]:
        """Give the standard uncertainty of a reading, µm, and its degrees of freedom."""
        rows = [one for one in self.contributions if one.acts in acts]
        variances = np.array([one.at(length_mm) ** 2 for one in rows])
        freedom = effective_freedom(variances, [one.dof for one in rows])
        return float(np.sqrt(variances.sum())), float(freedom)


NO_INSTRUMENT = Instrument("", "", ())


def effective_freedom(variances: Array, freedoms: Sequence[float]) -> Array:
    """Give the degrees of freedom of sums of variances, [c, ...], by Welch and Satterthwaite.

    ISO/IEC Guide 98-3, equation G.2b.
    """
    squares = np.tensordot(1.0 / np.array(freedoms, float), variances**2, 1)
    total = np.sum(variances, axis=0) ** 2
    return np.where(squares > 0.0, total / np.where(squares > 0.0, squares, 1.0), np.inf)


def instrument_names() -> tuple[str, ...]:
    return tuple(path.stem for path in sorted((assets_dir() / "instruments").glob("*.toml")))


def load_instrument(name: str, _scene: object = None) -> Instrument:
    """Read a bundled instrument by name, or a file of one."""
    path = Path(name)
    if path.suffix != ".toml":
        if name not in instrument_names():
            raise UnknownNameError("instrument", name, instrument_names())
        path = assets_dir() / "instruments" / f"{name}.toml"
    problems = schema.Problems()
    raw = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
    found = problems.read(schema.INSTRUMENT, "", raw)
    if problems.lines:
        raise SceneError(str(path), problems.lines)
    rows = tuple(Contribution(**row) for row in found["contributions"])
    return Instrument(path.stem, found["title"] or path.stem, rows)


def _levers_mm(stack: MeasurementModel, one: Readings) -> Array:
    """Give what readings take of a scale: distances from the mean point as they are sensed."""
    if one.kind in {"lengths", "positions"}:  # in the frame of the instrument
        return one.observed_mm - one.observed_mm.mean(axis=0)
    if (plan := one.plan) is None:
        return one.nominal_mm - one.nominal_mm.mean(axis=0)
    tip = ball_point(stack.scene.model, plan.coordinates)
    turn = branch_pose(stack.scene.model, "workpiece", one.coordinates)[..., :3, :3]
    origin = np.where((plan.against >= 0)[:, None], tip[plan.against], tip[plan.site].mean(axis=0))
    away = transforms.rotate(turn, tip[plan.site] - origin)
    return (np.sum(away * plan.direction, axis=1) * plan.gain)[:, None]


def common_mode(stack: MeasurementModel, one: Contribution) -> Array:
    """Give what a standard uncertainty of a contribution moves all readings by, [N, c], mm."""
    if one.acts == "scale":
        levers = np.concatenate([_levers_mm(stack, each).ravel() for each in stack.sets])
        return one.at(1.0) * MM_PER_UM * levers[:, None]
    shifts = [np.tile(np.eye(each.observed_mm.shape[1], 3), (len(each), 1)) for each in stack.sets]
    return one.at(0.0) * MM_PER_UM * np.vstack(shifts)


BUDGET = (
    Column("contribution", key="name", leads=True, wraps=True), Column("type", key="type"),
    Column(key="distribution", shows=False), Column("acts", key="acts"),
    Column("u", ".3g", key="u"), Column("unit", key="unit"), Column("c", ".3g", key="c"),
    Column("c·u", ".3g", key="u_um"), Column("share", ".0%", key="share"),
    Column("map", ".0%", key="share_of_map"), Column(key="degrees_of_freedom", shows=False),
    Column(key="source", shows=False),
)  # fmt: skip


def share_out(
    instrument: Instrument, stack: MeasurementModel, shares: Sequence[float]
) -> dict[str, Any]:
    """Say what an instrument brings; shares of the map: of scatter, and of each that is shared."""
    levers = [np.linalg.norm(_levers_mm(stack, one), axis=-1) for one in stack.sets]
    length = round(float(np.sqrt(np.mean(np.concatenate(levers) ** 2))), 6)
    width, freedom = instrument.budget(length)
    each, (scatter, *common) = max(instrument.scatter[0], 1e-300), shares
    rows: list[dict[str, Any]] = []
    for one in instrument.contributions:
        own, u = one.at(length), one.value / schema.DIVISORS[one.distribution]
        of_map = scatter * (own / each) ** 2 if one.acts == "each" else common.pop(0)
        row = (
            one.name, one.type, one.distribution, one.acts, u, one.unit, one.sensitivity, own,
            (own / width) ** 2, of_map, _finite(one.dof), one.source,
        )  # fmt: skip
        rows.append({column.key: value for column, value in zip(BUDGET, row, strict=True)})
    return {
        "name": instrument.name, "title": instrument.title, "length_mm": length, "u_um": width,
        "degrees_of_freedom": _finite(freedom), "contributions": rows,
    }  # fmt: skip


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None


def budget_blocks(told: Mapping[str, Any]) -> Iterator[str | Table]:
    title = f"{told['title']}: uncertainty of a reading {told['length_mm']:.0f} mm"
    rows = [[*one.values()] for one in told["contributions"]]
    yield Table(BUDGET, rows, f"{title} from the mean point (c·u in µm):")
    freedom = told["degrees_of_freedom"] or np.inf
    yield (
        f"  together {told['u_um']:.2f} µm, {freedom:.0f} effective degrees of freedom;"
        " share: of its variance, map: of the variance of the map"
    )
