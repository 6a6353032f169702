"""What a calibration gives: the errors found, what is told together, and what is left."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
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
from warpspace.calibration.solve import Rank, spell_rank
from warpspace.machine.axes import parameter
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MICRORADIAN, UM_PER_MM, Array

Target: TypeAlias = str | tuple[tuple[str, float], ...]
"""What is to be made sure: one of those below, or axis positions of a point."""
TARGETS = {
    "map": "of the position error, RMS over the volume",
    "corner": "of the position error, at the least sure node",
    "part": "of the vertices of the part, placed, RMS",
    "verdict": "of the least sure measure of the part that has a tolerance, µm or µrad",
}
NUMBERS = (
    "rms_before_mm", "rms_after_mm", "rms_predicted_before_mm", "rms_predicted_after_mm",
    "predicted_coverage_95", "sigma_mm",
)  # fmt: skip
MOST_BARS = 22  # parameters of one unit that are drawn; the largest by their uncertainty


@dataclass(frozen=True, slots=True)
class FittedParameter:
    """One parameter after a calibration."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "key", "unit", "before", "value", "standard_uncertainty", "interval_95", "identifiable",
        "told",
    )  # fmt: skip
    key: str
    before: float  # µm or µrad
    value: float
    # µm or µrad; none where the readings do not determine it by itself
    standard_uncertainty: float | None
    interval_95: tuple[float, float] | None
    told: str  # "yes"; "in part": the value holds if others are what the scene says; "no"

    @property
    def unit(self) -> str:
        return parameter(self.key).unit

    @property
    def identifiable(self) -> bool:
        """Whether the readings determine it without holding another parameter."""
        return self.told == "yes"


@dataclass(frozen=True, slots=True)
class Combination:
    """A sum of parameters that the readings tell, although not the parameters in it."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "factors", "unit", "value", "standard_uncertainty", "interval_95",
    )  # fmt: skip
    # factor by parameter; the first, with factor 1, is the one that was fitted
    factors: Mapping[str, float]
    value: float  # in the unit of the first
    standard_uncertainty: float
    interval_95: tuple[float, float]

    @property
    def words(self) -> str:
        first, *others = self.factors
        words = first
        for key in others:
            own, factor = parameter(key).unit, self.factors[key]
            each = "" if own == self.unit else f" {self.unit}/{own}"
            size = f"{abs(factor):.3g}{each} · ".removeprefix("1 · ")
            words += f" {'−' if factor < 0.0 else '+'} {size}{key}"
        return words

    @property
    def unit(self) -> str:
        return parameter(next(iter(self.factors))).unit


@dataclass(frozen=True, slots=True)
class Residuals:
    """What one file of readings leaves."""

    readings: Readings
    # [n, d]; observed − predicted: with the errors of the scene, and with those found
    before_mm: Array
    after_mm: Array
    outliers: tuple[int, ...] = ()  # rows that lie further off than the others let expect

    @property
    def file(self) -> str:
        """Name of the file, without its folder."""
        return Path(self.readings.source).name

    def as_json(self) -> dict[str, Any]:
        told = self.readings
        rows = [
            {
                "line": line,
                "session": told.session[at],
                "axes": {name: float(values[at]) for name, values in told.coordinates.items()},
                "before_mm": self.before_mm[at].tolist(),
                "after_mm": self.after_mm[at].tolist(),
                "outlier": at in self.outliers,
            }
            for at, line in enumerate(told.lines)
        ]
        return {"file": self.file, "kind": told.kind, "readings": rows}

    def rows(self, use: str, axes: Sequence[str]) -> Iterator[tuple[object, ...]]:
        told = self.readings
        for at, line in enumerate(told.lines):
            places = [float(told.coordinates[name][at]) for name in axes]
            parts = [
                [*map(float, rows[at]), None, None][:3] for rows in (self.before_mm, self.after_mm)
            ]
            yield (self.file, line, use, told.session[at], *places, *parts[0], *parts[1])


@dataclass(frozen=True, slots=True)
class Candidate:
    """A measurement that could be made."""

    name: str  # in words, with the poses
    readings: Readings  # nominal ones


@dataclass(frozen=True, slots=True)
class NextMeasurement:
    """One measurement to make."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "measurement", "kind", "minutes", "before_um", "after_um", "map_before_um", "map_after_um",
    )  # fmt: skip
    candidate: Candidate
    minutes: float  # that it takes, typically
    before_um: float  # U95 of the position error at the target, likewise without and with it
    after_um: float
    # standard uncertainty of the position error, root mean square over the volume (weighted by
    # volume): without and with this measurement, all those before it made
    map_before_um: float
    map_after_um: float
    covariance: Array  # [K, K]; of the parameters once it is made

    @property
    def measurement(self) -> str:
        return self.candidate.name

    @property
    def kind(self) -> str:
        return self.candidate.readings.kind


@dataclass(frozen=True, kw_only=True)
class Calibration(Result):
    """A calibrated machine."""

    scene: Scene  # with the errors found
    title: str  # of the scene before
    parameters: tuple[FittedParameter, ...]
    combinations: tuple[Combination, ...]  # what is told of the parameters that are told in part
    rank: Rank
    slopes: frozenset[str]  # parameters of which a slope was looked for
    fit: tuple[str, ...]  # (k,); parameters of `covariance`
    covariance: Array  # [k, k], µm and µrad
    unknowns: Mapping[str, float]  # mm; what the set-up left unknown, as found
    fitted: tuple[Residuals, ...]
    predicted: tuple[Residuals, ...]
    rms_before_mm: float  # of the residual vectors that were fitted
    rms_after_mm: float
    rms_predicted_before_mm: float | None
    rms_predicted_after_mm: float | None
    # share of predicted components inside their stated 95 % intervals; none where no reading was
    # predicted, or where only those that were fitted state their uncertainty
    predicted_coverage_95: float | None
    # standard deviation of one component, from the residuals (of a robust fit: their median); of a
    # weight of one where uncertainties are given
    sigma_mm: float
    freedom: int  # components less what was fitted
    # scatter of the residuals in units of what is stated of readings, else of repeated ones; none
    # where there is neither
    lack_of_fit: float | None
    instrument: Mapping[str, Any] | None  # its contributions, and what they bring
    notes: tuple[str, ...] = ()
    # groups that cannot be told apart, and the measurement that would
    apart: Mapping[tuple[str, ...], str] = field(default_factory=dict[tuple[str, ...], str])
    steps: tuple[NextMeasurement, ...] = ()  # next measurements
    target: Target = "map"  # that they are to make sure
    # by rotary axis: how well the poses tell its location and orientation errors
    merit: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def circles(self) -> list[Circle]:
        """Circles about rotary axes, through the readings that were fitted."""
        return [circle for group in self.fitted for circle in group.readings.circles]

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters that were fitted, [k, k]."""
        width = np.sqrt(np.diag(self.covariance))
        width = np.where(width > 0.0, width, 1.0)
        return self.covariance / np.outer(width, width)

    def changes(self) -> tuple[Change, ...]:
        return (Change("with the errors found", self.scene),)

    def as_json(self) -> dict[str, Any]:
        return {
            "parameters": to_json(self.parameters),
            "combinations": to_json(self.combinations),
            "rank": self.rank.rank,
            "confounded": to_json(self.rank.confounded),
            "unseen": list(self.rank.unseen),
            "cannot_tell": list(spell_rank(self.rank, self.slopes)),
            "separated_by": [
                {"keys": list(group), "measurement": told} for group, told in self.apart.items()
            ],
            **{name: getattr(self, name) for name in NUMBERS},
            "degrees_of_freedom": self.freedom,
            "set_up_mm": dict(self.unknowns),
            "correlation": {"keys": list(self.fit), "matrix": self.correlation.tolist()},
            "circles": to_json(self.circles),
            "lack_of_fit": self.lack_of_fit,
            "instrument": self.instrument,
            "merit": dict(self.merit),
            "next": to_json(self.steps),
            "fitted": [group.as_json() for group in self.fitted],
            "predicted": [group.as_json() for group in self.predicted],
            "notes": list(self.notes),
        }

    def file_table(self) -> Table:
        axes = self.scene.machine.axes
        places = [f"axis_{name}_{'mm' if axis.is_linear else 'deg'}" for name, axis in axes.items()]
        parts = [f"{when}_{x}_mm" for when in ("before", "after") for x in "xyz"]
        keys = ("file", "line", "use", "session", *places, *parts)
        uses = (("fitted", self.fitted), ("predicted", self.predicted))
        rows = [row for use, groups in uses for one in groups for row in one.rows(use, tuple(axes))]
        return Table(tuple(Column(key=key) for key in keys), rows, exact=True)

    def blocks(self) -> Iterator[Block]:
        sets = [(group.file, group.readings) for group in self.fitted]
        files = ", ".join(f"{name} ({one.kind}, {len(one)} readings)" for name, one in sets)
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
            yield f"  {share} of their components are inside the 95 % intervals stated for them"
        yield from (f"  note: {note}" for note in self.notes)
        yield from map(_circle_words, self.circles)
        yield from self._errors()
        wide = self.sigma_mm >= 1.0
        width = f"{self.sigma_mm:.2f} mm" if wide else f"{UM_PER_MM * self.sigma_mm:.2f} µm"
        width = f"standard deviation of one component {width}"
        if all(one.readings.sigma_mm is not None for one in self.fitted):
            width = f"residuals scatter {self.sigma_mm:.2f} times as far as stated"
        yield f"  {width}, {self.freedom} degrees of freedom"
        yield from budget_blocks(self.instrument) if self.instrument else ()
        if self.merit:
            each = ", of ".join(f"{axis} by {value:.2f}" for axis, value in self.merit.items())
            yield (
                f"  poses tell location and orientation of {each} µm per µm (all readings together,"
                " of the combination that they tell least; rotations count at 250 mm)"
            )
        for group in (*self.fitted, *self.predicted):
            for at in group.outliers:
                yield f"  far off: {group.file} line {group.readings.lines[at]}"
        yield from (f"  {words}" for words in spell_rank(self.rank, self.slopes))
        for keys, measurement in self.apart.items():
            yield f"    {keys[0]} would be determined by: {measurement}"
        if self.steps:
            columns = (
                Column("measurement", leads=True, wraps=True),
                Column("minutes", ".0f"),
                *number_columns(("U95 before", "after"), unit="µm"),
            )
            rows = [
                (one.measurement, one.minutes, one.before_um, one.after_um) for one in self.steps
            ]
            words = "Next measurements, each for the greatest gain per minute (typical times):"
            yield Table(columns, rows, words)
            yield f"  U95 {target_words(self.target)}"
        yield from self._charts()

    def _errors(self) -> Iterator[Block]:
        shown = [one for one in self.parameters if one.before or one.key not in self.rank.unseen]
        columns = (
            Column("key", leads=True), Column("name"),
            *(Column(name, ".1f") for name in ("before", "value", "± u")), Column("unit"),
            *number_columns(("95 % from", "to"), ".1f"), Column("told"),
        )  # fmt: skip
        rows = [
            (
                one.key, parameter(one.key).name, one.before,
                None if one.told == "no" else one.value, one.standard_uncertainty, one.unit,
                *(one.interval_95 or (None, None)), one.told,
            )
            for one in shown
        ]  # fmt: skip
        yield Table(columns, rows)
        if any(one.told == "in part" for one in shown):
            yield (
                "  told in part: the value holds if those that look like it are what the scene says"
            )
        for one in self.combinations:
            low, high = one.interval_95
            value = f"{one.value:.1f} ± {one.standard_uncertainty:.1f} {one.unit}"
            yield f"  told together: {one.words} = {value}, 95 % {low:.1f} to {high:.1f}"

    def _charts(self) -> Iterator[Block]:
        yield self._lengths()
        wide = [one for one in (*self.fitted, *self.predicted) if one.after_mm.shape[1] == 3]
        before, after = (
            UM_PER_MM * np.concatenate([np.zeros((0, 3)), *rows])
            for rows in ([one.before_mm for one in wide], [one.after_mm for one in wide])
        )
        for a, b in ((0, 1), (0, 2)) if wide else ():
            labels = (f"{'xyz'[a]} [µm]", f"{'xyz'[b]} [µm]")
            title = f"Residual vectors, {'xyz'[a]} and {'xyz'[b]}"
            curves = (
                Curve("", _joined(before[:, a], after[:, a]), _joined(before[:, b], after[:, b]),
                      style="thin"),
                Curve("before", before[:, a], before[:, b], 0, "dots"),
                Curve("after", after[:, a], after[:, b], 1, "dots"),
            )  # fmt: skip
            yield Lines("plane", title, *labels, curves)
        for unit in (MICROMETRE, MICRORADIAN):
            rows = sorted(
                (one for one in self._told() if one.unit == unit),
                key=lambda one: (
                    abs(one.value - one.before) / max(one.standard_uncertainty or 1.0, 1e-12)
                ),
            )
            if kept := rows[-MOST_BARS:][::-1]:
                spread = [
                    (one.interval_95[1] - one.value) if one.interval_95 else 0.0 for one in kept
                ]
                found = Series([one.value for one in kept], spread=spread)
                was = Series([one.before for one in kept], as_mark=True)
                panel = Panel("Errors found, 95 % intervals", (found, was), unit, signed=True)
                names = [one.key + ("" if one.identifiable else " …") for one in kept]
                yield Bars("Errors found", "", names, (panel,))

    def _lengths(self) -> Lines:
        groups = (*self.fitted, *self.predicted)
        before, after = (
            UM_PER_MM * np.concatenate([np.linalg.norm(one, axis=-1) for one in rows])
            for rows in ([one.before_mm for one in groups], [one.after_mm for one in groups])
        )
        at = np.linspace(1.0, len(before), len(before))
        counts = [len(group.readings) for group in groups]
        starts = [sum(counts[:index]) for index in range(len(counts))]
        far = np.array(
            [start + row for start, g in zip(starts, groups, strict=True) for row in g.outliers],
            int,
        )
        curves = [
            Curve("", _joined(at, at), _joined(before, after), style="thin"),
            Curve("before", at, before, 0, "dots"),
            Curve("after", at, after, 1, "dots"),
        ]
        if len(far):
            curves.append(Curve("after, far off", at[far], after[far], 3, "dots"))
        bands: tuple[Band, ...] = ()
        if self.predicted:
            x = np.array([starts[len(self.fitted)] + 0.5, len(at) + 0.5], float)
            bands = (Band("not fitted", x, np.zeros(2), np.full(2, before.max()), 7),)
        title = "Residuals, observed − predicted, by reading"
        return Lines("lines", title, "reading", "length [µm]", tuple(curves), bands)

    def _told(self) -> Iterator[FittedParameter]:
        together = {next(iter(one.factors)): one for one in self.combinations}
        for one in self.parameters:
            if (total := together.get(one.key)) is not None:
                before = total.value - one.value + one.before
                width, interval = total.standard_uncertainty, total.interval_95
                yield FittedParameter(one.key, before, total.value, width, interval, one.told)
            elif one.interval_95 is not None:
                yield one


def target_words(target: Target) -> str:
    if not isinstance(target, str):
        return f"of the position error, at {place_words(dict(target))}"
    return TARGETS[target]


def _circle_words(circle: Circle) -> str:
    (first, second), (a, b) = circle.plane, circle.centre_mm
    runs = " and ".join(filter(None, circle.sessions)) or "all readings"
    return (
        f"  circle about {circle.axis} in {first}–{second} ({runs}): radius"
        f" {circle.radius_mm:.6f} mm, centre {first} {a:.6f}, {second} {b:.6f} mm,"
        f" RMS {UM_PER_MM * circle.rms_mm:.1f} µm"
    )


def _joined(start: Array, end: Array) -> Array:
    return np.stack([start, end, np.full(len(start), np.nan)], axis=-1).ravel()
