"""Uncertainty contributions of measuring instruments, one file each.

A contribution has the standard uncertainty u of its distribution and a sensitivity coefficient c
(ISO/IEC Guide 98-3, 4.3 and 5.1). It acts on each reading independently, on all readings alike (a
zero, an artefact), or as a scale, in proportion to the distance from the mean point.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.analysis.blocks import Column, Table
from warpspace.calibration.readings import Readings
from warpspace.calibration.solve import MeasurementModel
from warpspace.exceptions import SceneError, UnknownNameError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.relative_motion import relative_point
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
    value: float  # standard uncertainty if normal, else half-width
    unit: str
    sensitivity: float  # µm per unit, or µm/m per unit of a scale
    acts: str  # each, all or scale
    dof: float  # degrees of freedom
    source: str

    def uncertainty_um(self, length_mm: float) -> float:
        """Compute the standard uncertainty of a reading at a distance from the mean point, µm."""
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
        """Contributions common to all readings."""
        return tuple(row for row in self.contributions if row.acts != "each")

    @property
    def scatter(self) -> tuple[float, float]:
        """Standard uncertainty of independent contributions, µm, and degrees of freedom."""
        return self.budget(0.0, ("each",))

    def budget(self, length_mm: float, acts: Collection[str] = schema.ACTS) -> tuple[float, float]:
        """Compute the standard uncertainty of a reading, µm, and its degrees of freedom."""
        rows = [row for row in self.contributions if row.acts in acts]
        variances = np.array([row.uncertainty_um(length_mm) ** 2 for row in rows])
        dof = effective_dof(variances, [row.dof for row in rows])
        return float(np.sqrt(variances.sum())), float(dof)


NO_INSTRUMENT = Instrument("", "", ())


def effective_dof(variances: Array, dofs: Sequence[float]) -> Array:
    """Compute the effective dof of sums of variances, [c, ...], by Welch and Satterthwaite.

    ISO/IEC Guide 98-3, equation G.2b.
    """
    squares = np.tensordot(1.0 / np.array(dofs, float), variances**2, 1)
    total = np.sum(variances, axis=0) ** 2
    return np.where(squares > 0.0, total / np.where(squares > 0.0, squares, 1.0), np.inf)


def instrument_names() -> tuple[str, ...]:
    return tuple(path.stem for path in sorted((assets_dir() / "instruments").glob("*.toml")))


def load_instrument(name: str, _scene: object = None) -> Instrument:
    """Read a bundled instrument by name, or an instrument file."""
    path = Path(name)
    if path.suffix != ".toml":
        if name not in instrument_names():
            raise UnknownNameError("instrument", name, instrument_names())
        path = assets_dir() / "instruments" / f"{name}.toml"
    problems = schema.Problems()
    raw = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
    table = problems.read(schema.INSTRUMENT, "", raw)
    if problems.lines:
        raise SceneError(str(path), problems.lines)
    rows = tuple(Contribution(**row) for row in table["contributions"])
    return Instrument(path.stem, table["title"] or path.stem, rows)


def _levers_mm(model: MeasurementModel, readings: Readings) -> Array:
    """Compute the effect of a unit scale error: distances from the mean point, as sensed."""
    if readings.kind in {"lengths", "positions"}:  # in the frame of the instrument
        return readings.observed_mm - readings.observed_mm.mean(axis=0)
    plan = readings.plan
    if plan is None:
        levers = readings.nominal_mm - readings.nominal_mm.mean(axis=0)
        return levers @ readings.part.axes.T if readings.part else levers
    tip = relative_point(model.scene.model, plan.coordinates)
    turn = branch_pose(model.scene.model, "workpiece", readings.coordinates)[..., :3, :3]
    origin = np.where((plan.against >= 0)[:, None], tip[plan.against], tip[plan.site].mean(axis=0))
    away = transforms.rotate(turn, tip[plan.site] - origin)
    return (np.sum(away * plan.direction, axis=1) * plan.gain)[:, None]


def common_mode(model: MeasurementModel, contribution: Contribution) -> Array:
    """Compute the change of all readings by one u of a contribution, [N, c], mm."""
    if contribution.acts == "scale":
        levers = np.concatenate([_levers_mm(model, readings).ravel() for readings in model.sets])
        return contribution.uncertainty_um(1.0) * MM_PER_UM * levers[:, None]
    shifts = [
        np.tile(np.eye(readings.observed_mm.shape[1], 3), (len(readings), 1))
        for readings in model.sets
    ]
    return contribution.uncertainty_um(0.0) * MM_PER_UM * np.vstack(shifts)


BUDGET = (
    Column("contribution", key="name", leads=True, wraps=True), Column("type", key="type"),
    Column(key="distribution", shows=False), Column("acts", key="acts"),
    Column("u", ".3g", key="u"), Column("unit", key="unit"), Column("c", ".3g", key="c"),
    Column("c·u", ".3g", key="u_um"), Column("share", ".0%", key="share"),
    Column("map", ".0%", key="share_of_map"), Column(key="degrees_of_freedom", shows=False),
    Column(key="source", shows=False),
)  # fmt: skip


def build_budget(
    instrument: Instrument, model: MeasurementModel, map_shares: Sequence[float]
) -> dict[str, Any]:
    """Build the uncertainty budget of an instrument.

    Shares of the variance of the map: of the scatter, then of each common contribution.
    """
    levers = [np.linalg.norm(_levers_mm(model, readings), axis=-1) for readings in model.sets]
    length = round(float(np.sqrt(np.mean(np.concatenate(levers) ** 2))), 6)
    u_um, dof = instrument.budget(length)
    scatter_um = max(instrument.scatter[0], 1e-300)
    scatter_share, *common_shares = map_shares
    rows: list[dict[str, Any]] = []
    for contribution in instrument.contributions:
        contribution_um = contribution.uncertainty_um(length)
        if contribution.acts == "each":
            map_share = scatter_share * (contribution_um / scatter_um) ** 2
        else:
            map_share = common_shares.pop(0)
        cells = (
            contribution.name, contribution.type, contribution.distribution, contribution.acts,
            contribution.value / schema.DIVISORS[contribution.distribution], contribution.unit,
            contribution.sensitivity, contribution_um, (contribution_um / u_um) ** 2, map_share,
            _finite(contribution.dof), contribution.source,
        )  # fmt: skip
        rows.append({column.key: cell for column, cell in zip(BUDGET, cells, strict=True)})
    return {
        "name": instrument.name, "title": instrument.title, "length_mm": length, "u_um": u_um,
        "degrees_of_freedom": _finite(dof), "contributions": rows,
    }  # fmt: skip


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None


def budget_blocks(budget: Mapping[str, Any]) -> Iterator[str | Table]:
    title = f"{budget['title']}: uncertainty of a reading {budget['length_mm']:.0f} mm"
    rows = [[*row.values()] for row in budget["contributions"]]
    yield Table(BUDGET, rows, f"{title} from the mean point (c·u in µm):")
    dof = budget["degrees_of_freedom"] or np.inf
    yield (
        f"  combined {budget['u_um']:.2f} µm, {dof:.0f} effective degrees of freedom;"
        " share: of its variance, map: of the variance of the error map"
    )
