"""Readings of a measurement for a calibration: axis positions, observations, uncertainties."""

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from warpspace.bench.plan import BenchPlan
from warpspace.exceptions import OptionError, SceneError, near_miss
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.parts.part_shape import PartShape
from warpspace.resources import assets_dir
from warpspace.scene.model import Scene, coverage_notes
from warpspace.scene.text_files import (
    CsvRows,
    list_repeated,
    match_column,
    plain_heading,
    radian_notes,
    unguard_cell,
)
from warpspace.units import Array

MAX_READINGS = 20_000  # rows that a file of readings may have
LABELS = ("session", "run")
"""Columns that hold a name; the first of them in a file names the session."""
TEXTS = (*LABELS, "time")
"""Columns that need not hold numbers."""
MAX_NUMBER = 1e9
FRAMES = {"machine": "r", "workpiece": "w"}
"""Frame of vectors in column names, in lower case."""
MAX_LABEL = 60
MAX_SESSIONS = 100  # set-ups in one file, each with its unknowns


@dataclass(frozen=True, slots=True)
class ReadingTable:
    """The rows of a file of readings."""

    source: str  # name of the file, for messages
    columns: Mapping[str, Array]  # [n]; numbers by column name, in lower case; see `column`
    labels: Mapping[str, tuple[str, ...]]  # (n,); text by column: `session`, `run`, `time`
    lines: tuple[int, ...]  # (n,); line of each row in the file
    text: str = ""  # the entire file, for kinds that parse it themselves
    notes: tuple[str, ...] = ()  # warnings on the file
    frame: str | None = None  # of vectors whose columns do not name it, as stated by the user
    # problems of columns with cells that are not numbers, raised where such a column is needed
    problems: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])

    def __len__(self) -> int:
        return len(self.lines)

    def refuse(self, problem: str) -> SceneError:
        return SceneError(self.source, [problem])

    def column(self, name: str) -> Array | None:
        """Return a column, [n], converted to the unit in the name; None where it is missing."""
        headings = list(self.columns)
        match = match_column(name, headings)
        if match is None:
            return None
        heading = headings[match[0]]
        if heading in self.problems:
            raise SceneError(self.source, self.problems[heading])
        return match[1] * self.columns[heading]

    def require(self, names: Sequence[str]) -> Array:
        """Return required columns, [n, len(names)]; raise SceneError where one is missing."""
        arrays = {name: self.column(name) for name in names}
        missing = [name for name, column in arrays.items() if column is None]
        if missing:
            present = ", ".join((*self.labels, *self.columns)) or "none"
            hint = near_miss(missing[0], self.columns)
            hint = hint if "did you mean" in hint else ""
            expected = f"expected {', '.join(names)} (columns in the file: {present})"
            raise self.refuse(f"has no column {', '.join(missing)}{hint}; {expected}")
        return np.column_stack([column for column in arrays.values() if column is not None])

    @property
    def session(self) -> tuple[str, ...]:
        """Names of the sessions, (n,); empty where the file has no such column."""
        none = ("",) * len(self)
        return next((self.labels[name] for name in LABELS if name in self.labels), none)


def parse_reading_table(text: str, source: str) -> ReadingTable:
    """Parse a CSV file with a header, or the output of ``field --json``."""
    if text.lstrip().startswith("{"):
        return _parse_field(text, source)
    rows = CsvRows(io.StringIO(text, newline=""), source, MAX_READINGS, unique=True)
    header = [plain_heading(name).lower() for name in rows.header]
    if not header:
        raise SceneError(source, ["is empty; expected a header and rows of readings"])
    repeated = list_repeated(header)
    if repeated:
        raise SceneError(source, [f"names column {min(repeated)!r} twice; expected each once"])
    problems: dict[str, list[str]] = {}
    numbers: dict[str, list[float]] = {name: [] for name in header if name not in TEXTS}
    labels: dict[str, list[str]] = {name: [] for name in header if name in TEXTS}
    lines: list[int] = []
    for line, row in rows:
        lines.append(line)
        for name, cell in zip(header, row, strict=True):
            if name in labels:
                labels[name].append(unguard_cell(cell)[:MAX_LABEL])
            else:
                count = len(rows.problems)
                numbers[name].append(rows.number(cell, line, name, MAX_NUMBER))
                problems.setdefault(name, []).extend(rows.problems[count:])
                del rows.problems[count:]
    rows.check()
    if not lines:
        raise SceneError(source, ["has a header but no rows; expected readings below it"])
    readable = {name: values for name, values in numbers.items() if not problems[name]}
    table = ReadingTable(
        source,
        {name: np.array(values) for name, values in numbers.items()},
        {name: tuple(values) for name, values in labels.items()},
        tuple(lines),
        text,
        (*rows.notes, *radian_notes(readable)),
        problems={name: texts for name, texts in problems.items() if texts},
    )
    count = len(set(table.session))
    if count > MAX_SESSIONS:
        raise table.refuse(f"names {count:,} sessions; expected at most {MAX_SESSIONS}")
    return table


def _parse_field(text: str, source: str) -> ReadingTable:
    try:
        field = json.loads(text)
        loop, frame, points = field["loop"], FRAMES[field["frame"]], field["points"]
        loop += "_placed" * ("placement" in field) + "_referenced" * ("reference" in field)
        axes = {name: "mm" if is_linear(name) else "deg" for name in points[0]["axes"]}
        columns = {
            f"axis_{name.lower()}_{unit}": np.array(
                [float(point["axes"][name]) for point in points]
            )
            for name, unit in axes.items()
        }
        errors = np.array([point["error_um"] for point in points], float).reshape(len(points), 3)
    except (ValueError, TypeError, LookupError, ArithmeticError, RecursionError):
        expected = "a CSV table of readings, or the JSON output of `field` in the relative loop"
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
    """Circle through the positions of the linear axes while one rotary axis turned."""

    axis: str  # the rotary axis
    sessions: tuple[str, ...]  # the runs it was fitted to, all on the same circle
    plane: str  # for instance "XZ"
    centre_mm: tuple[float, float]  # in the plane, axis positions
    radius_mm: float
    rms_mm: float  # of the distances of the centres from the circle
    count: int  # readings
    against: bool  # true where the axis turned opposite to that of the scene


@dataclass(frozen=True, slots=True)
class MeasuredPart:
    """A part and its inspection report."""

    shape: PartShape
    rotation: Array  # [3, 3], from the frame of the report to that of the workpiece
    alignment: Array  # [4, 4], removed from the readings: from nominal to measured points
    # session terms, by report, that its shape is made of, with factors; see `couple_parts`
    terms: tuple[tuple[str, float], ...] = ()

    @property
    def axes(self) -> Array:
        """Directions of its readings, [d, 3], unit vectors in the frame of the workpiece."""
        return self.rotation.T[: self.shape.size]


@dataclass(frozen=True, slots=True)
class Readings:
    """The readings of one file."""

    kind: str  # name of the kind of measurement
    coordinates: Mapping[str, Array]  # [n], mm or degrees; commanded positions of all axes
    nominal_mm: Array  # [n, 3]; nominal tool point in the workpiece frame
    observed_mm: Array  # [n, d]; what was read
    sigma_mm: Array | None  # [n], or None; standard uncertainty of each reading
    session: tuple[str, ...]  # (n,); readings of one session share the unknowns of the set-up
    lines: tuple[int, ...]  # (n,); lines of the file
    source: str  # name of the file
    notes: tuple[str, ...] = ()  # assumptions made on reading it
    circles: tuple[Circle, ...] = ()  # about rotary axes, of sphere centres
    # "machine" or "workpiece": frame in which vectors were read; they are stored in the latter
    frame: str = ""
    plan: BenchPlan | None = None  # of the standard test, along its path
    # start values of the unknowns of the set-up, where a kind fits them on reading
    first_fit: tuple[float, ...] = ()
    part: MeasuredPart | None = None  # of an inspection report

    def __len__(self) -> int:
        return len(self.lines)


def bundled_data() -> tuple[str, ...]:
    return tuple(path.name for path in sorted((assets_dir() / "measurements").glob("*/*.csv")))


def axis_column(scene: Scene, name: str) -> str:
    """Return the column name of the positions of an axis, such as ``b_deg`` or ``x_mm``."""
    head = scene.machine.columns.get(name, name).lower()
    return f"{head}_{'mm' if scene.machine.axes[name].is_linear else 'deg'}"


def axis_columns(
    table: ReadingTable, scene: Scene, names: Sequence[str] = (), turning: Sequence[str] = ()
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Read the positions of all axes, [n], from columns such as ``b_deg``, and notes on them.

    By default all axes may have a column. Some axis, of those that turn where these are named, has
    to move.
    """
    axes = scene.machine.axes
    names = names or tuple(axes)
    columns = {name: axis_column(scene, name) for name in axes}
    coordinates: dict[str, Array] = {}
    notes: list[str] = []
    for name in names:
        for column in (columns[name], f"axis_{name.lower()}_{columns[name].rpartition('_')[2]}"):
            positions = table.column(column)
            if positions is not None:
                coordinates[name] = positions
    missing = [name for name in names if name not in coordinates]
    required = [columns[name] for name in missing if name in scene.machine.columns]
    if required:
        table.require(required)
    heads = [columns[name].removesuffix("_deg") for name in axes if not axes[name].is_linear]
    for column in table.columns:
        head, _, unit = column.removeprefix("axis_").rpartition("_")
        if unit == "deg" and head not in heads and head.upper() not in axes:
            raise table.refuse(
                f"has column {column}, but the machine has no axis {head.upper()}; expected"
                f" {', '.join(heads).upper() or 'no rotary axis'}"
            )
    if turning and not any(name in coordinates for name in turning):
        names_deg = ", ".join(f"{name.lower()}_deg" for name in turning)
        raise table.refuse(f"has no axis positions; expected a column of {names_deg}")
    ranges = {name: (float(at.min()), float(at.max())) for name, at in coordinates.items()}
    notes += coverage_notes(scene, ranges)
    if missing:
        assumed = ", ".join(f"{name} {scene.workspace.positions[name]:g}" for name in missing)
        notes.append(f"{Path(table.source).name}: axes without a column stand at {assumed}")
    for name in axes:
        if name not in coordinates:
            coordinates[name] = np.full(len(table), scene.workspace.positions[name])
    if all(np.ptp(coordinates[name]) < 1e-9 for name in turning or axes):
        raise table.refuse(
            "has all readings at one pose: errors are confounded with the set-up; expected axes"
            " that move between readings"
        )
    return coordinates, tuple(notes)


def build_readings(
    kind: str,
    scene: Scene,
    table: ReadingTable,
    coordinates: Mapping[str, Array],
    observed_mm: Array,
    notes: tuple[str, ...],
) -> Readings:
    nominal_mm, sigma_mm = relative_point(scene.model, coordinates), uncertainties_mm(table)
    rows = table.session, table.lines, table.source
    return Readings(kind, coordinates, nominal_mm, observed_mm, sigma_mm, *rows, notes)


def uncertainties_mm(table: ReadingTable) -> Array | None:
    """Read standard uncertainties, column ``u_um`` or ``u_mm``, [n], mm; None without one."""
    for name, factor in (("u_um", 1e-3), ("u_mm", 1.0)):
        column = table.column(name)
        if column is not None:
            values = column * factor
            for line, value in zip(table.lines, values, strict=True):
                if value <= 0.0:
                    problem = f"line {line}, {name} = {value / factor:g}"
                    raise table.refuse(f"{problem}; expected a number above 0")
            return values
    return None


def check_spread(spread_mm: float, limit_mm: float, source: str, hint: str) -> None:
    """Raise OptionError where readings are too far from the model, likely in a wrong unit."""
    if spread_mm > limit_mm:
        raise OptionError(
            f"{source}: the readings deviate by {spread_mm:.4g} mm from the nominal machine;"
            f" expected less than {limit_mm:g} mm. {hint}"
        )
