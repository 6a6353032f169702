"""Readings of a measurement as a calibration takes them: where, what was read, how well."""

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from warpspace.bench.placing import ball_point
from warpspace.bench.plan import BenchPlan
from warpspace.exceptions import OptionError, SceneError, near_miss
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import MAX_CSV_BYTES
from warpspace.resources import assets_dir
from warpspace.scene.model import Scene, coverage_notes
from warpspace.scene.text_files import CsvRows, plain_heading, radian_notes, read_text, unguard_cell
from warpspace.units import Array

MAX_READINGS = 20_000  # rows that a file of readings may have
LABELS = ("session", "run")
"""Columns that hold a name; the first that is there tells sessions apart."""
TEXTS = (*LABELS, "time")
"""Columns that need not hold numbers."""
MAX_NUMBER = 1e9
FRAMES = {"machine": "r", "workpiece": "w"}
"""How names of columns spell the frame of vectors, in small letters."""
MAX_LABEL = 60
MAX_SESSIONS = 100  # set-ups in one file: each has unknowns of its own


@dataclass(frozen=True, slots=True)
class ReadingTable:
    """The rows of a file of readings."""

    source: str  # name of the file, for messages
    columns: Mapping[str, Array]  # [n]; numbers by the name of their column, in small letters
    labels: Mapping[str, tuple[str, ...]]  # (n,); words by column: `session`, `run`, `time`
    lines: tuple[int, ...]  # (n,); line of the file that each row stands on
    text: str = ""  # all of the file, for kinds that have columns of their own
    notes: tuple[str, ...] = ()  # what a reader should doubt
    frame: str | None = None  # of vectors whose columns do not say it, as the user says

    def __len__(self) -> int:
        return len(self.lines)

    def need(self, names: Sequence[str]) -> Array:
        """Give columns that must be there, [n, len(names)]; refuses a file that lacks one."""
        missing = [name for name in names if name not in self.columns]
        if missing:
            there = ", ".join((*self.labels, *self.columns)) or "none"
            found = f"has no column {', '.join(missing)}{near_miss(missing[0], self.columns)}"
            expected = f"expected {', '.join(names)} (the columns there are: {there})"
            raise SceneError(self.source, [f"{found}; {expected}"])
        return np.column_stack([self.columns[name] for name in names])

    @property
    def session(self) -> tuple[str, ...]:
        """Names of the sessions, (n,); empty where the file has no such column."""
        none = ("",) * len(self)
        return next((self.labels[name] for name in LABELS if name in self.labels), none)


def parse_table(text: str, source: str) -> ReadingTable:
    """Read the text of a CSV file with a header, or what ``field --json`` printed."""
    if text.lstrip().startswith("{"):
        return _parse_field(text, source)
    rows = CsvRows(io.StringIO(text, newline=""), source, MAX_READINGS, unique=True)
    header = [plain_heading(name).lower() for name in rows.header]
    if not header:
        raise SceneError(source, ["is empty; expected a header and rows of readings"])
    repeated = {name for name in header if header.count(name) > 1}
    if repeated:
        raise SceneError(source, [f"names column {min(repeated)!r} twice; expected each once"])
    numbers: dict[str, list[float]] = {name: [] for name in header if name not in TEXTS}
    labels: dict[str, list[str]] = {name: [] for name in header if name in TEXTS}
    lines: list[int] = []
    for line, row in rows:
        lines.append(line)
        for name, field in zip(header, row, strict=True):
            if name in labels:
                labels[name].append(unguard_cell(field)[:MAX_LABEL])
            else:
                numbers[name].append(rows.number(field, line, name, MAX_NUMBER))
    rows.check()
    if not lines:
        raise SceneError(source, ["has a header but no rows; expected readings below it"])
    table = ReadingTable(
        source,
        {name: np.array(values) for name, values in numbers.items()},
        {name: tuple(values) for name, values in labels.items()},
        tuple(lines),
        text,
        (*rows.notes, *radian_notes(numbers)),
    )
    named = len(set(table.session))
    if named > MAX_SESSIONS:
        found = f"names {named:,} sessions; expected at most {MAX_SESSIONS}"
        raise SceneError(source, [found])
    return table


def _parse_field(text: str, source: str) -> ReadingTable:
    try:
        found = json.loads(text)
        loop, frame, points = found["loop"], FRAMES[found["frame"]], found["points"]
        loop += "_placed" * ("placement" in found) + "_referenced" * ("reference" in found)
        axes = {name: "mm" if is_linear(name) else "deg" for name in points[0]["axes"]}
        columns = {
            f"axis_{name.lower()}_{unit}": np.array([float(one["axes"][name]) for one in points])
            for name, unit in axes.items()
        }
        errors = np.array([one["error_um"] for one in points], float).reshape(len(points), 3)
    except (ValueError, TypeError, LookupError, ArithmeticError, RecursionError):
        expected = "a CSV table of readings, or what `field --loop relative --json` printed"
        raise SceneError(source, [f"cannot be read; expected {expected}"]) from None
    if len(points) > MAX_READINGS or not all(
        map(np.all, map(np.isfinite, (*columns.values(), errors)))
    ):
        expected = f"at most {MAX_READINGS:,}, and finite numbers"
        raise SceneError(source, [f"has {len(points):,} points; expected {expected}"])
    columns |= {f"error_{loop}_{frame}_{x}_um": errors[:, at] for at, x in enumerate("xyz")}
    return ReadingTable(source, columns, {}, tuple(range(1, len(points) + 1)), text)


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle that the linear axes read while one rotary axis turned."""

    axis: str  # the rotary axis
    sessions: tuple[str, ...]  # the runs it was fitted to; each closes on the same circle
    plane: str  # for instance "XZ"
    centre_mm: tuple[float, float]  # in the plane, axis positions
    radius_mm: float
    rms_mm: float  # of the distances of the centres from the circle
    count: int  # readings
    against: bool  # whether the axis turned against the machine of the scene


@dataclass(frozen=True, slots=True)
class Readings:
    """The readings of one file."""

    kind: str  # name of the kind of measurement
    coordinates: Mapping[str, Array]  # [n], mm or degrees; commanded positions of all axes
    nominal_mm: Array  # [n, 3]; nominal tool point in the workpiece frame
    observed_mm: Array  # [n, d]; what was read
    sigma_mm: Array | None  # [n], or None; standard uncertainty of each reading
    session: tuple[str, ...]  # (n,); readings of one session share what is unknown about the set-up
    lines: tuple[int, ...]  # (n,); lines of the file
    source: str  # name of the file
    notes: tuple[str, ...] = ()  # what was assumed on reading it
    circles: tuple[Circle, ...] = ()  # about rotary axes, where the readings are such
    # "machine" or "workpiece": what vectors were read in; they are kept in the latter
    frame: str = ""
    plan: BenchPlan | None = None  # of the test they were taken with, along its path
    # what the set-up leaves unknown, as a first fit has it; where a kind makes one on reading
    first_fit: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.lines)


def find_data(name: str) -> Path:
    """Find a file of readings: a path, or the name of a bundled one such as ``tcp_on.csv``."""
    path = Path(name)
    if path.exists() or path.name != name:
        return path
    bundled = sorted((assets_dir() / "measurements").glob(f"*/{name}"))
    return bundled[0] if bundled else path


def bundled_data() -> tuple[str, ...]:
    return tuple(path.name for path in sorted((assets_dir() / "measurements").glob("*/*.csv")))


def read_readings(
    name: str, scene: Scene, kind: str | None = None, frame: str | None = None
) -> Readings:
    path = find_data(name)
    return parse_readings(read_text(path, MAX_CSV_BYTES), str(path), scene, kind, frame)


def parse_readings(
    text: str, source: str, scene: Scene, kind: str | None = None, frame: str | None = None
) -> Readings:
    from warpspace.calibration.registry import KINDS, find_kind, recognise

    found = None if kind is None else find_kind(kind)
    if found is not None and found.own_columns:
        return found.read(ReadingTable(source, {}, {}, (), text), scene)
    table = replace(parse_table(text, source), frame=frame)
    if found is None or (found.name == "points" and KINDS["positions"].fits(table, scene)):
        found = recognise(table, scene)
    readings = found.read(table, scene)
    return replace(readings, notes=(*readings.notes, *table.notes))


def axis_column(scene: Scene, name: str) -> str:
    """Name the column of the positions of an axis, such as ``b_deg`` or ``x_mm``."""
    head = scene.machine.columns.get(name, name).lower()
    return f"{head}_{'mm' if scene.machine.axes[name].is_linear else 'deg'}"


def axis_columns(
    table: ReadingTable, scene: Scene, names: Sequence[str], needed: Sequence[str] = ()
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Give positions of all axes, [n], out of columns such as ``b_deg`` and ``x_mm``, and notes."""
    axes = scene.machine.axes
    own = {name: axis_column(scene, name) for name in axes}
    coordinates: dict[str, Array] = {}
    notes: list[str] = []
    for name in names:
        for column in (own[name], f"axis_{name.lower()}_{own[name].rpartition('_')[2]}"):
            if column in table.columns:
                coordinates[name] = table.columns[column]
    if lacking := [own[n] for n in names if n in scene.machine.columns and n not in coordinates]:
        table.need(lacking)
    heads = [own[name].removesuffix("_deg") for name, axis in axes.items() if not axis.is_linear]
    for column in table.columns:
        head, _, unit = column.removeprefix("axis_").rpartition("_")
        if unit == "deg" and head not in heads and head.upper() not in axes:
            known = ", ".join(heads).upper()
            found = f"has column {column}, but the machine has no axis {head.upper()}"
            raise SceneError(table.source, [f"{found}; expected {known or 'no rotary axis'}"])
    if needed and not any(name in coordinates for name in needed):
        spelled = ", ".join(f"{name.lower()}_deg" for name in needed)
        raise SceneError(table.source, [f"has no axis positions; expected a column of {spelled}"])
    ranges = {name: (float(at.min()), float(at.max())) for name, at in coordinates.items()}
    notes += coverage_notes(scene, ranges)
    rest = [name for name in names if name not in coordinates]
    if rest:
        stands = ", ".join(f"{name} {scene.workspace.positions[name]:g}" for name in rest)
        notes.append(f"{Path(table.source).name}: axes without a column stand at {stands}")
    for name in axes:
        if name not in coordinates:
            coordinates[name] = np.full(len(table), scene.workspace.positions[name])
    return coordinates, tuple(notes)


def take_readings(
    kind: str,
    scene: Scene,
    table: ReadingTable,
    coordinates: Mapping[str, Array],
    observed_mm: Array,
    notes: tuple[str, ...],
) -> Readings:
    return Readings(
        kind,
        coordinates,
        ball_point(scene.model, coordinates),
        observed_mm,
        uncertainties_mm(table),
        table.session,
        table.lines,
        table.source,
        notes,
    )


def uncertainties_mm(table: ReadingTable) -> Array | None:
    """Give standard uncertainties, column ``u_um`` or ``u_mm``, [n], mm; None without one."""
    for name, factor in (("u_um", 1e-3), ("u_mm", 1.0)):
        if name in table.columns:
            values = table.columns[name] * factor
            for line, value in zip(table.lines, values, strict=True):
                if value <= 0.0:
                    found = f"line {line}, {name} = {value / factor:g}"
                    raise SceneError(table.source, [f"{found}; expected a number above 0"])
            return values
    return None


def check_poses(coordinates: Mapping[str, Array], source: str) -> None:
    """Refuse readings that were all taken at one pose."""
    if all(np.ptp(values) < 1e-9 for values in coordinates.values()):
        found = "has all readings at one pose: no error can be told from the place of the set-up"
        raise SceneError(source, [f"{found}; expected axes that move between readings"])


def check_spread(spread_mm: float, limit_mm: float, source: str, hint: str) -> None:
    """Refuse readings that lie further from the model than any machine: likely wrong units."""
    if spread_mm > limit_mm:
        raise OptionError(
            f"{source}: the readings lie {spread_mm:.4g} mm from what the nominal machine gives;"
            f" expected less than {limit_mm:g} mm. {hint}"
        )
