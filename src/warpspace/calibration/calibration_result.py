"""Result of a calibration: fitted errors, estimable combinations and residuals."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np

from warpspace.analysis.blocks import (
    Band,
    Bars,
    Block,
    Column,
    Curve,
    Lines,
    Panel,
    Series,
    Table,
    number_columns,
)
from warpspace.analysis.description import Change, Result, to_json
from warpspace.analysis.options import place_words
from warpspace.calibration.instruments import budget_blocks
from warpspace.calibration.readings import Circle, Readings
from warpspace.calibration.solve import Rank, describe_rank
from warpspace.machine.axes import parameter
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MICRORADIAN, UM_PER_MM, Array

Target: TypeAlias = str | tuple[tuple[str, float], ...]
"""Quantity whose uncertainty is minimised: one of those below, or axis positions of a point."""
TARGETS = {
    "map": "of the position error, RMS over the volume",
    "corner": "of the position error, at the most uncertain node",
    "part": "of the vertices of the part, placed, RMS",
    "verdict": "of the most uncertain measurand of the part with a tolerance, µm or µrad",
}
NUMBERS = (
    "rms_before_mm", "rms_after_mm", "rms_predicted_before_mm", "rms_predicted_after_mm",
    "predicted_coverage_95", "sigma_mm",
)  # fmt: skip
MAX_BARS = 22  # parameters of one unit that are drawn: the most significant changes


class Estimability(StrEnum):
    """Estimability of one parameter; a confounded value holds for the others as in the scene."""

    ESTIMABLE = "yes"
    CONFOUNDED = "confounded"
    NOT_ESTIMABLE = "no"


@dataclass(frozen=True, slots=True)
class FittedParameter:
    """One parameter after a calibration."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "key", "unit", "before", "value", "standard_uncertainty", "interval_95", "identifiable",
        "estimable",
    )  # fmt: skip
    key: str
    before: float  # µm or µrad
    value: float
    # µm or µrad; None where the parameter is not estimable by itself
    standard_uncertainty: float | None
    interval_95: tuple[float, float] | None
    estimable: Estimability

    @property
    def unit(self) -> str:
        return parameter(self.key).unit

    @property
    def identifiable(self) -> bool:
        """True where the readings determine it without fixing another parameter."""
        return self.estimable is Estimability.ESTIMABLE


@dataclass(frozen=True, slots=True)
class Combination:
    """Sum of confounded parameters that is estimable."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "factors", "unit", "value", "standard_uncertainty", "interval_95",
    )  # fmt: skip
    # factor by parameter; the first, with factor 1, is the one that was fitted
    factors: Mapping[str, float]
    value: float  # in the unit of the first
    standard_uncertainty: float
    interval_95: tuple[float, float]

    @property
    def expression(self) -> str:
        expression, *keys = self.factors
        for key in keys:
            unit, factor = parameter(key).unit, self.factors[key]
            ratio = "" if unit == self.unit else f" {self.unit}/{unit}"
            size = f"{abs(factor):.3g}{ratio} · ".removeprefix("1 · ")
            expression += f" {'−' if factor < 0.0 else '+'} {size}{key}"
        return expression

    @property
    def unit(self) -> str:
        return parameter(next(iter(self.factors))).unit


@dataclass(frozen=True, slots=True)
class Residuals:
    """Residuals of one file of readings."""

    readings: Readings
    # [n, d]; observed − predicted: with the errors of the scene, and with the fitted errors
    before_mm: Array
    after_mm: Array
    outliers: tuple[int, ...] = ()  # rows of readings with outlying residuals

    @property
    def file(self) -> str:
        """Name of the file, without its folder."""
        return Path(self.readings.source).name

    def as_json(self) -> dict[str, Any]:
        readings = self.readings
        rows = [
            {
                "line": line,
                "session": readings.session[at],
                "axes": {
                    name: float(position[at]) for name, position in readings.coordinates.items()
                },
                "before_mm": self.before_mm[at].tolist(),
                "after_mm": self.after_mm[at].tolist(),
                "outlier": at in self.outliers,
            }
            for at, line in enumerate(readings.lines)
        ]
        return {"file": self.file, "kind": readings.kind, "readings": rows}

    def rows(self, use: str, axes: Sequence[str]) -> Iterator[tuple[object, ...]]:
        readings = self.readings
        for at, line in enumerate(readings.lines):
            positions = [float(readings.coordinates[name][at]) for name in axes]
            before = [*self.before_mm[at].tolist(), None, None][:3]
            after = [*self.after_mm[at].tolist(), None, None][:3]
            yield (self.file, line, use, readings.session[at], *positions, *before, *after)


@dataclass(frozen=True, slots=True)
class Candidate:
    """Candidate for the next measurement."""

    name: str  # description with the poses
    readings: Readings  # nominal ones


@dataclass(frozen=True, slots=True)
class NextMeasurement:
    """Recommended measurement."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "measurement", "kind", "minutes", "before_um", "after_um", "map_before_um", "map_after_um",
    )  # fmt: skip
    candidate: Candidate
    minutes: float  # typical duration
    before_um: float  # U95 of the target, without and with this measurement
    after_um: float
    # standard uncertainty of the position error, root mean square over the volume (weighted by
    # volume): without and with this measurement, after all earlier ones
    map_before_um: float
    map_after_um: float
    covariance: Array  # [K, K]; of the parameters, with this measurement

    @property
    def measurement(self) -> str:
        return self.candidate.name

    @property
    def kind(self) -> str:
        return self.candidate.readings.kind


@dataclass(frozen=True, kw_only=True)
class Calibration(Result):
    """A calibrated machine."""

    scene: Scene  # with the fitted errors
    title: str  # of the scene before the calibration
    parameters: tuple[FittedParameter, ...]
    combinations: tuple[Combination, ...]  # estimable sums of confounded parameters
    rank: Rank
    slopes: frozenset[str]  # parameters with a slope as amplitude
    fit: tuple[str, ...]  # (k,); parameters of `covariance`
    covariance: Array  # [k, k], µm and µrad
    unknowns: Mapping[str, float]  # mm; fitted unknowns of the set-ups
    fitted: tuple[Residuals, ...]
    predicted: tuple[Residuals, ...]
    rms_before_mm: float  # of the residual vectors of fitted readings
    rms_after_mm: float
    rms_predicted_before_mm: float | None
    rms_predicted_after_mm: float | None
    # share of predicted components inside their 95 % intervals; None where no reading was
    # predicted, or where only the fitted readings state their uncertainty
    predicted_coverage_95: float | None
    # standard deviation of one component, from the residuals (of a robust fit: their median); in
    # units of the stated uncertainty where there is one
    sigma_mm: float
    dof: int  # components less fitted numbers
    # scatter of the residuals in units of the stated uncertainty, else of the scatter of repeated
    # readings; None where there is neither
    lack_of_fit: float | None
    instrument: Mapping[str, Any] | None  # uncertainty budget
    notes: tuple[str, ...] = ()
    # measurement that separates each confounded group
    separated_by: Mapping[tuple[str, ...], str] = field(default_factory=dict[tuple[str, ...], str])
    next_measurements: tuple[NextMeasurement, ...] = ()
    target: Target = "map"  # quantity whose uncertainty they minimise
    # observability index of the location and orientation errors of each rotary axis
    observability: Mapping[str, float] = field(default_factory=dict[str, float])

    # of inspection reports: keys of the JSON object (`SessionTerms.as_json`)
    sessions: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def circles(self) -> list[Circle]:
        """Circles about rotary axes through fitted readings."""
        return [circle for group in self.fitted for circle in group.readings.circles]

    @property
    def correlation(self) -> Array:
        """Correlation of the fitted parameters, [k, k]."""
        width = np.sqrt(np.diag(self.covariance))
        width = np.where(width > 0.0, width, 1.0)
        return self.covariance / np.outer(width, width)

    def changes(self) -> tuple[Change, ...]:
        return (Change("with the fitted errors", self.scene),)

    def as_json(self) -> dict[str, Any]:
        return {
            "parameters": to_json(self.parameters),
            "combinations": to_json(self.combinations),
            "rank": self.rank.rank,
            "confounded": to_json(self.rank.confounded),
            "without_effect": list(self.rank.without_effect),
            "rank_notes": list(describe_rank(self.rank, self.slopes)),
            "separated_by": [
                {"keys": list(group), "measurement": name}
                for group, name in self.separated_by.items()
            ],
            **{name: getattr(self, name) for name in NUMBERS},
            "degrees_of_freedom": self.dof,
            "set_up_mm": dict(self.unknowns),
            "correlation": {"keys": list(self.fit), "matrix": self.correlation.tolist()},
            "circles": to_json(self.circles),
            "lack_of_fit": self.lack_of_fit,
            "instrument": self.instrument,
            "observability": dict(self.observability),
            "next": to_json(self.next_measurements),
            "fitted": [group.as_json() for group in self.fitted],
            "predicted": [group.as_json() for group in self.predicted],
            "notes": list(self.notes),
            **self.sessions,
        }

    def file_table(self) -> Table:
        axes = self.scene.machine.axes
        places = [f"axis_{name}_{'mm' if axis.is_linear else 'deg'}" for name, axis in axes.items()]
        parts = [f"{when}_{x}_mm" for when in ("before", "after") for x in "xyz"]
        keys = ("file", "line", "use", "session", *places, *parts)
        uses = (("fitted", self.fitted), ("predicted", self.predicted))
        rows = [
            row for use, groups in uses for group in groups for row in group.rows(use, tuple(axes))
        ]
        return Table(tuple(Column(key=key) for key in keys), rows, exact=True)

    def blocks(self) -> Iterator[Block]:
        files = ", ".join(
            f"{group.file} ({group.readings.kind}, {len(group.readings)} readings)"
            for group in self.fitted
        )
        yield f"{self.title} · {files}"
        yield (
            f"  residuals (RMS of the vectors): {self.rms_before_mm:.4f} mm before,"
            f" {self.rms_after_mm:.4f} mm after"
        )
        if self.rms_predicted_before_mm is not None:
            yield (
                f"  predicted, not fitted: {self.rms_predicted_before_mm:.4f} mm before,"
                f" {self.rms_predicted_after_mm:.4f} mm after"
            )
        if self.predicted_coverage_95 is not None:
            share = f"{100.0 * self.predicted_coverage_95:.1f} %"
            yield f"  {share} of their components are inside their 95 % intervals"
        yield from (f"  note: {note}" for note in self.notes)
        yield from map(_describe_circle, self.circles)
        yield from self._errors()
        wide = self.sigma_mm >= 1.0
        width = f"{self.sigma_mm:.2f} mm" if wide else f"{UM_PER_MM * self.sigma_mm:.2f} µm"
        width = f"standard deviation of one component {width}"
        if all(group.readings.sigma_mm is not None for group in self.fitted):
            width = f"residuals are {self.sigma_mm:.2f} times the stated uncertainty"
        yield f"  {width}, {self.dof} degrees of freedom"
        yield from budget_blocks(self.instrument) if self.instrument else ()
        yield from session_blocks(self.sessions) if self.sessions else ()
        if self.observability:
            axes = ", ".join(f"{axis} {index:.2f}" for axis, index in self.observability.items())
            yield (
                f"  observability index O3 of location and orientation errors: {axes} µm/µm (all"
                " readings; rotations at a lever arm of 250 mm)"
            )
        for group in (*self.fitted, *self.predicted):
            for at in group.outliers:
                yield f"  outlier: {group.file} line {group.readings.lines[at]}"
        yield from (f"  {line}" for line in describe_rank(self.rank, self.slopes))
        for keys, measurement in self.separated_by.items():
            yield f"    {keys[0]} would be determined by: {measurement}"
        if self.next_measurements:
            columns = (
                Column("measurement", leads=True, wraps=True),
                Column("minutes", ".0f"),
                *number_columns(("U95 before", "after"), unit="µm"),
            )
            rows = [
                (step.measurement, step.minutes, step.before_um, step.after_um)
                for step in self.next_measurements
            ]
            title = "Recommended measurements, by reduction of U95 per minute (typical times):"
            yield Table(columns, rows, title)
            yield f"  U95 {describe_target(self.target)}"
        yield from self._charts()

    def _errors(self) -> Iterator[Block]:
        without_effect = self.rank.without_effect
        listed = [row for row in self.parameters if row.before or row.key not in without_effect]
        columns = (
            Column("key", leads=True), Column("name"),
            *(Column(name, ".1f") for name in ("start", "value", "± u")), Column("unit"),
            *number_columns(("from", "to"), ".1f"), Column("estimable"),
        )  # fmt: skip
        rows = [
            (
                row.key, parameter(row.key).name, row.before,
                None if row.estimable is Estimability.NOT_ESTIMABLE else row.value,
                row.standard_uncertainty, row.unit, *(row.interval_95 or (None, None)),
                row.estimable,
            )
            for row in listed
        ]  # fmt: skip
        yield Table(columns, rows, "Error parameters, with 95 % intervals from … to:")
        if any(row.estimable is Estimability.CONFOUNDED for row in listed):
            yield "  confounded: the value holds if the others in its combination are as in SCENE"
        for total in self.combinations:
            low, high = total.interval_95
            estimate = f"{total.value:.1f} ± {total.standard_uncertainty:.1f} {total.unit}"
            yield f"  estimable: {total.expression} = {estimate}, 95 % {low:.1f} to {high:.1f}"

    def _charts(self) -> Iterator[Block]:
        yield self._lengths()
        groups = (*self.fitted, *self.predicted)
        vectors = [group for group in groups if group.after_mm.shape[1] == 3]
        none = np.zeros((0, 3))
        before = UM_PER_MM * np.concatenate([none, *(group.before_mm for group in vectors)])
        after = UM_PER_MM * np.concatenate([none, *(group.after_mm for group in vectors)])
        for a, b in ((0, 1), (0, 2)) if vectors else ():
            labels = (f"{'xyz'[a]} [µm]", f"{'xyz'[b]} [µm]")
            title = f"Residual vectors, {'xyz'[a]} and {'xyz'[b]}"
            curves = _before_and_after(before[:, (a, b)], after[:, (a, b)])
            yield Lines("plane", title, *labels, tuple(curves))
        for unit in (MICROMETRE, MICRORADIAN):
            rows = [row for row in self._estimates() if row.unit == unit]
            rows = sorted(rows, key=_significance, reverse=True)[:MAX_BARS]
            if rows:
                highs = [row.interval_95[1] if row.interval_95 else row.value for row in rows]
                spread = [high - row.value for high, row in zip(highs, rows, strict=True)]
                estimates = Series([row.value for row in rows], spread=spread)
                before_fit = Series([row.before for row in rows], as_mark=True)
                series = (estimates, before_fit)
                panel = Panel("Fitted errors, 95 % intervals", series, unit, signed=True)
                names = [row.key + ("" if row.identifiable else " …") for row in rows]
                yield Bars("Fitted errors", "", names, (panel,))

    def _lengths(self) -> Lines:
        groups = (*self.fitted, *self.predicted)
        before, after = (
            UM_PER_MM * np.concatenate([np.linalg.norm(row, axis=-1) for row in rows])
            for rows in ([g.before_mm for g in groups], [g.after_mm for g in groups])
        )
        at = np.linspace(1.0, len(before), len(before))
        counts = [len(group.readings) for group in groups]
        starts = np.cumsum([0, *counts[:-1]])
        outliers = [np.array(group.outliers, int) for group in groups]
        far = np.concatenate([start + at for start, at in zip(starts, outliers, strict=True)])
        curves = _before_and_after(np.stack([at, before], -1), np.stack([at, after], -1))
        if len(far):
            curves.append(Curve("after, outliers", at[far], after[far], 3, "dots"))
        bands: tuple[Band, ...] = ()
        if self.predicted:
            x = np.array([starts[len(self.fitted)] + 0.5, len(at) + 0.5], float)
            bands = (Band("not fitted", x, np.zeros(2), np.full(2, before.max()), 7),)
        title = "Residuals, observed − predicted, by reading"
        return Lines("lines", title, "reading", "length [µm]", tuple(curves), bands)

    def _estimates(self) -> Iterator[FittedParameter]:
        combinations = {next(iter(total.factors)): total for total in self.combinations}
        for row in self.parameters:
            total = combinations.get(row.key)
            if total is not None:
                before = total.value - row.value + row.before
                width, interval = total.standard_uncertainty, total.interval_95
                yield FittedParameter(row.key, before, total.value, width, interval, row.estimable)
            elif row.interval_95 is not None:
                yield row


def session_blocks(sessions: Mapping[str, Any]) -> Iterator[Block]:
    """List the shape of the mean part, and the session term of each part."""
    columns = (
        Column("shape", leads=True), Column("unit"),
        *number_columns(("mean part", "from", "to"), "+.1f"),
        *number_columns(("next from", "to"), "+.1f"),
    )  # fmt: skip
    rows = [
        (row["measure"], row["unit"], row["value"], *row["interval_95"],
         *(row["next_part_95"] or (None, None)))
        for row in sessions["shape"]
    ]  # fmt: skip
    yield Table(columns, rows, "Shape of the mean part and of the next part, 95 % intervals:")
    variation = sessions["between_parts"]
    u, dof = variation["standard_uncertainty"], variation["degrees_of_freedom"]
    if u is not None:
        extent = "" if dof is None else f", {dof} degrees of freedom"
        yield f"  variation between parts ({variation['source']}): u = {u:.1f} µm/m, µrad{extent}"
    for row in sessions["sessions"] if u is not None else ():
        numbers = ", ".join(f"{value:+.1f}" for value in row["term"].values())
        yield f"    {row['file']}: {numbers} from the mean"


def _significance(row: FittedParameter) -> float:
    return abs(row.value - row.before) / max(row.standard_uncertainty or 1.0, 1e-12)


def describe_target(target: Target) -> str:
    if not isinstance(target, str):
        return f"of the position error, at {place_words(dict(target))}"
    return TARGETS[target]


def _describe_circle(circle: Circle) -> str:
    (first, second), (a, b) = circle.plane, circle.centre_mm
    runs = " and ".join(filter(None, circle.sessions)) or "all readings"
    return (
        f"  circle about {circle.axis} in {first}–{second} ({runs}): radius"
        f" {circle.radius_mm:.6f} mm, centre {first} {a:.6f}, {second} {b:.6f} mm,"
        f" RMS {UM_PER_MM * circle.rms_mm:.1f} µm"
    )


def _before_and_after(before: Array, after: Array) -> list[Curve]:
    """Draw points, [n, 2], before and after the fit, and a line from one to the other."""
    x, y = np.stack([before, after, np.full_like(before, np.nan)], axis=1).reshape(-1, 2).T
    first = Curve("before", before[:, 0], before[:, 1], 0, "dots")
    last = Curve("after", after[:, 0], after[:, 1], 1, "dots")
    return [Curve("", x, y, style="thin"), first, last]
