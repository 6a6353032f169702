"""SINUMERIK tables: `$AA_ENC_COMP` of an axis over itself, `$AN_CEC` of one axis over another.

Siemens SINUMERIK 840D sl/828D, Function Manual Extended Functions (03/2013, 6FC5397-1BP40-3BA1),
K3, pages 237 to 264: linear between equidistant points, end values held, or repeated with the
modulo function; a positive value of `$AA_ENC_COMP` makes the axis move in the negative direction.
`$AN_CEC` has tables for one direction of travel, and adds the product of two tables. Archives
assign system variables, `$NAME[index, …] = value ; comment`.

A table of `$AN_CEC` contains the mean of the correction over the other axes. The interaction of two
axes, such as an angle times a lever arm, is a sum of products of two tables. For errors that depend
on the direction of travel, two tables act in one direction each, with the values around their mean.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.grid import shares
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import ERROR, Files, Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import Source, SourceLine, format_comment, format_number, quote
from warpspace.formats.terms import AxisTable, Product, Tables, Term
from warpspace.machine.axes import TravelDirection, is_linear
from warpspace.units import Array

ENC, CEC = "AA_ENC_COMP", "AN_CEC"
AXES = ("INPUT_AXIS", "OUTPUT_AXIS")
RANGE = ("STEP", "MIN", "MAX")
DIRECTION, FACTOR, IS_MODULO = "DIRECTION", "MULT_BY_TABLE", "IS_MODULO"
MAX_TABLES = 62  # twice the axes of an NC (manual, "Compensation table index")
SIGN = "a positive value makes the axis move in the negative direction (manual, page 238)"
CEC_SIGN = (
    "a positive value makes the corrected axis move in the negative direction, as page 238 of the"
    " manual states for $AA_ENC_COMP, but not for $AN_CEC: verify it on the machine, or select"
    " the sign of a correction"
)
UNITS = "lengths mm, angles degrees (metric system)"
DIGITS = 7  # decimals of a value: a tenth of a nanometre
STEP_SHARE = 1e-4  # tolerance of the range for a whole number of steps, in steps
MAX_INDEX = 100_000
MAX_PRODUCTS = 3  # pairs of tables for one axis over two others
MIN_PRODUCT_MM = 1e-5  # smaller products of tables are omitted
MIN_TABLE_MM = 1e-7  # smaller tables are omitted
SWITCHES = {DIRECTION: (-1, 1), FACTOR: (0, MAX_TABLES), IS_MODULO: (-1, 1)}
"""Integer settings of a table, with their limits."""
CONSTANTS = {"TRUE": "1", "FALSE": "0"}
SETTINGS = {ENC: (*RANGE, IS_MODULO), CEC: (*AXES, *RANGE, *SWITCHES)}
INDICES = {
    ENC: ("[encoder, point, axis]", "[encoder, axis]"),
    CEC: ("[table, point]", "[table]"),
}
"""Indices of a value and of a setting."""
CorrectionsByAxes = Mapping[tuple[str, ...], Array]
"""Corrections by the corrected axis and the axes that they depend on."""
_ASSIGNMENT = re.compile(r"\$([A-Z_]+)\s*+\[([^\]]*)\]\s*+(=?)\s*+([^\s=].*)")
_QUIET = re.compile(r"(%.*|CHANDATA\(\d+\)|M0?[0-2]|M17|M30|RET|N\d+)", re.IGNORECASE)


@dataclass
class AssignmentTable:
    """The assignments to one table, collected line by line."""

    at: SourceLine  # of its first assignment
    values: dict[int, float] = field(default_factory=dict[int, float])  # by interpolation point
    numbers: dict[str, float] = field(default_factory=dict[str, float])  # STEP, MIN and MAX
    # DIRECTION, MULT_BY_TABLE and IS_MODULO; 0 where they are not set
    switches: dict[str, int] = field(default_factory=dict[str, int])
    axes: dict[str, str] = field(default_factory=dict[str, str])  # INPUT_AXIS and OUTPUT_AXIS

    def to_axis_table(
        self, axes: tuple[str, str], prefix: str, label: str, factor: float
    ) -> AxisTable:
        for setting in RANGE:
            if setting not in self.numbers:
                problem = f"{label}: ${prefix}_{setting} is missing"
                self.at.refuse(problem, "it (is the file truncated?)")
        step, start, end = (self.numbers[setting] for setting in RANGE)
        if step <= 0.0 or end <= start:
            problem = f"{label}: step {step:g} from {start:g} to {end:g}"
            self.at.refuse(problem, "a step above 0 and an end above the start")
        steps = (end - start) / step
        if abs(steps - round(steps)) > STEP_SHARE:
            problem = f"{label}: {start:g} to {end:g} is not a whole number of steps of {step:g}"
            self.at.refuse(f"{problem} ({steps:.4g})", "equal steps from start to end")
        if round(steps) > MAX_INDEX:
            self.at.refuse(f"{label}: {round(steps):,} steps", f"at most {MAX_INDEX:,}")
        if self.switches.get(IS_MODULO) == -1 and not is_linear(axes[0]):
            self.at.refuse(f"{label}: ${prefix}_{IS_MODULO} is -1", "0 or 1 for a rotary axis")
        last = round(steps)
        missing = next((index for index in range(last + 1) if index not in self.values), None)
        if missing is not None:
            expected = f"points 0 … {last}, according to start, end and step"
            self.at.refuse(f"{label}: interpolation point {missing} has no value", expected)
        if len(self.values) > last + 1:
            problem = f"{label}: interpolation point {max(self.values)}"
            self.at.refuse(problem, f"at most {last}, at the end position")
        return AxisTable(
            *axes,
            tuple((start + step * np.arange(last + 1, dtype=np.float64)).tolist()),
            tuple(factor * self.values[index] for index in range(last + 1)),
            is_modulo=self.switches.get(IS_MODULO) == 1,
            direction=self.switches.get("DIRECTION", 0),
        )


def _assigns(name: str) -> Callable[[str, str], bool]:
    return has_pattern(rf"^\s*(?:N\d+\s+)?\${name}[A-Z_]*\s*\[")


def _assignments(
    source: Source, prefix: str, notes: list[str]
) -> Iterator[tuple[SourceLine, str, list[str], str]]:
    """Yield line, setting (empty for a value), indices and value of each assignment."""
    names = (prefix, *(f"{prefix}_{setting}" for setting in SETTINGS[prefix]))
    without_sign = list[int]()
    is_empty = True
    for at, text in source.scan(";"):
        for bare in re.split(r"(?<!\s)\s++(?=\$)", re.sub(r"^N\d+\s+", "", text)):
            if _QUIET.fullmatch(bare):
                continue
            matched = _ASSIGNMENT.fullmatch(bare)
            if matched is None:
                at.refuse(quote(bare), "$VARIABLE[index, …] = value")
            name, inner, equals, number = matched.groups()
            if name not in names:
                at.refuse(f"variable ${name}", f"one of {', '.join(f'${n}' for n in names)}")
            parts = [part.strip() for part in re.split(r"[,.]", inner)]
            expected = INDICES[prefix][name != prefix]
            if len(parts) != expected.count(",") + 1:
                at.refuse(f"${name}[{', '.join(parts)}]", expected)
            is_empty = False
            if not equals:
                without_sign.append(at.line)
            yield at, name.removeprefix(prefix).removeprefix("_"), parts, number.strip()
    if is_empty:
        source.refuse(f"has no ${prefix}", "tables of this variable")
    if without_sign:
        notes.append(
            f"{len(without_sign)} assignments without =, the first in line {without_sign[0]}"
        )


def _index(text: str, at: SourceLine) -> int:
    return at.integer(text, "index", 0, MAX_INDEX)


def _axis_name(text: str, at: SourceLine) -> str:
    bare = text.strip().strip("()").strip().strip('"').strip()
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]{0,15}", bare):
        at.refuse(f"axis {quote(text)}", "the name of an axis")
    return bare.upper()


def _point_lines(prefix: str, point: Callable[[int], str], values: Array) -> list[str]:
    return [
        f"${prefix}[{point(i)}]={format_number(v, DIGITS)}" for i, v in enumerate(values.tolist())
    ]


def _range_lines(prefix: str, index: str, places: Array) -> list[str]:
    step = (places[-1] - places[0]) / (len(places) - 1)
    bounds = zip(RANGE, (step, places[0], places[-1]), strict=True)
    return [f"${prefix}_{setting}[{index}]={float(number)!r}" for setting, number in bounds]


def _archive(name: str, corrections: RequiredCorrections, sign: str, body: Sequence[str]) -> Files:
    remark = format_comment("; ", f"written by warpspace for {corrections.scene.title}")
    head = [f"%_N_{name}_INI", "CHANDATA(1)", remark]
    head.append(f"; {'sign: ' + corrections.sign if corrections.sign else sign}")
    return {"": "\n".join([*head, *body, "M17"]) + "\n"}


def _read(source: Source, prefix: str, notes: list[str]) -> dict[tuple[int, str], AssignmentTable]:
    """Read the tables of a variable by the first index and, of encoders, the axis."""
    tables: dict[tuple[int, str], AssignmentTable] = {}
    for at, setting, parts, text in _assignments(source, prefix, notes):
        name = f"${prefix}_{setting}" if setting else f"${prefix}"
        number = _index(parts[0], at)
        if prefix == CEC and number >= MAX_TABLES:
            at.refuse(f"table {number}", f"at most {MAX_TABLES - 1}")
        key = number, _axis_name(parts[-1], at) if prefix == ENC else ""
        table = tables.setdefault(key, AssignmentTable(at))
        if setting in {**table.axes, **table.numbers, **table.switches}:
            at.refuse(f"{name}[{', '.join(parts)}] is repeated", "it once")
        if setting in AXES:
            table.axes[setting] = _axis_name(text, at)
        elif setting in RANGE:
            table.numbers[setting] = at.number(text, name)
        elif setting:
            number_text = CONSTANTS.get(text.upper(), text) if setting == IS_MODULO else text
            table.switches[setting] = at.integer(number_text, name, *SWITCHES[setting])
            if setting == IS_MODULO and table.switches[setting] == -1:
                notes.append(f"line {at.line}: {name} is -1: the table does not repeat")
        else:
            index = _index(parts[1], at)
            if index in table.values:
                label = f"${ENC}" if prefix == ENC else f"table {number}"
                at.refuse(f"{label}: interpolation point {index} is repeated", "it once")
            table.values[index] = at.number(text, name)
    return tables


def _read_enc(sources: Sequence[Source], options: ReadOptions) -> Tables:
    terms: list[AxisTable] = []
    notes: list[str] = []
    for source in sources:
        for (encoder, name), table in _read(source, ENC, notes).items():
            axis = options.axis_named(name, table.at)
            label = f"table of {name}"
            if any(term.source == axis for term in terms):
                table.at.refuse(f"{label}: {axis} has a table already", "one per axis")
            terms.append(table.to_axis_table((axis, axis), ENC, label, options.factor(ERROR)))
            if encoder:
                notes.append(f"{name}: read the table of measuring system {encoder + 1}")
    return Tables(tuple(terms), (options.sign_statement(SIGN), UNITS), tuple(notes))


def _write_enc(corrections: RequiredCorrections) -> Files:
    body: list[str] = []
    for axis in corrections.axes:
        if axis not in corrections.corrector.moved:
            continue
        places = corrections.positions(axis)
        values = corrections.factor(ERROR) * corrections.averaged([axis])[axis]
        body += [
            f"; MD38000 $MA_MM_ENC_COMP_MAX_POINTS[0,{axis}] >= {len(places)}",
            *_point_lines(ENC, f"0,{{}},{axis}".format, corrections.round(values)),
            *_range_lines(ENC, f"0,{axis}", places),
            f"${ENC}_{IS_MODULO}[0,{axis}]=0",
        ]
    return _archive("AX_EEC", corrections, SIGN, body)


def _read_cec(sources: Sequence[Source], options: ReadOptions) -> Tables:
    terms: list[Term] = []
    notes: list[str] = []
    factor = options.factor(ERROR)
    for source in sources:
        tables = {index: table for (index, _), table in _read(source, CEC, notes).items()}
        lines: dict[int, AxisTable] = {}
        for index, table in tables.items():
            label = f"table {index}"
            for setting in AXES:
                if setting not in table.axes:
                    problem = f"{label}: ${CEC}_{setting} is missing"
                    table.at.refuse(problem, "it (is the file truncated?)")
            along, target = (options.axis_named(table.axes[role], table.at) for role in AXES)
            lines[index] = table.to_axis_table((along, target), CEC, label, factor)
        terms += lines.values()
        for index, table in tables.items():
            other = table.switches.get(FACTOR, 0) - 1
            if other < 0:
                continue
            if other not in lines:
                problem = f"table {index} is multiplied by table number {other + 1}"
                table.at.refuse(problem, "the file to contain it")
            terms.append(Product(lines[index], lines[other], factor))
    return Tables(tuple(terms), (options.sign_statement(CEC_SIGN), UNITS), tuple(notes))


def _write_cec(corrections: RequiredCorrections) -> Files:
    tables = _cross_tables(corrections, corrections.factor(ERROR), MAX_TABLES)
    if len(tables) > MAX_TABLES:
        raise OptionError(
            f"sinumerik-cec: {len(tables)} tables; expected at most {MAX_TABLES}, the limit of the"
            " control: correct fewer axes"
        )
    body: list[str] = []
    for index, table in enumerate(tables):
        places = corrections.positions(table.along)
        body += [
            f"; MD18342 $MN_MM_CEC_MAX_POINTS[{index}] = {len(places)}",
            *_point_lines(CEC, f"{index},{{}}".format, corrections.round(table.values)),
            f"${CEC}_INPUT_AXIS[{index}]=({table.along})",
            f"${CEC}_OUTPUT_AXIS[{index}]=({table.target})",
            *_range_lines(CEC, str(index), places),
            f"${CEC}_DIRECTION[{index}]={table.direction}",
            f"${CEC}_MULT_BY_TABLE[{index}]={index + table.partner + 1 if table.partner else 0}",
            f"${CEC}_IS_MODULO[{index}]=0",
        ]
    return _archive("NC_CEC", corrections, CEC_SIGN, body)


@dataclass(frozen=True)
class CrossTable:
    """One table to write."""

    along: str  # axis of the position; the target is the corrected axis
    target: str
    values: Array  # (n,)
    # 1 or −1 if it acts in one direction of travel only
    direction: int = 0
    partner: int = 0  # offset of the table with the other factor of a product, 0 for none


def _cross_tables(
    corrections: RequiredCorrections, factor: float, max_tables: int
) -> list[CrossTable]:
    mean, axes = corrections.for_direction(TravelDirection.MEAN), corrections.axes
    averages: dict[tuple[str, ...], Array] = {}
    for group in ((), *((axis,) for axis in axes), *combinations(axes, 2)):
        for target, moves in mean.averaged(group).items():
            averages[target, *group] = moves
    halves = {axis: _half_reversals(corrections, axis) for axis in corrections.directional_axes}
    for max_products in (MAX_PRODUCTS, 0):
        tables: list[CrossTable] = []
        for target in corrections.corrector.moved:
            tables += _tables_for(axes, factor, target, averages, halves, max_products)
        if len(tables) <= max_tables:
            break
    # without anything to correct: a table of zeros
    zeros = np.zeros(len(corrections.positions(axes[0])))
    return tables or [CrossTable(axes[0], corrections.corrector.moved[0], zeros)]


def _half_reversals(corrections: RequiredCorrections, axis: str) -> CorrectionsByAxes:
    base = corrections.for_direction(TravelDirection.MEAN)
    forward = base.for_direction(TravelDirection.FORWARD, axis)
    backward = base.for_direction(TravelDirection.BACKWARD, axis)
    halves: dict[tuple[str, ...], Array] = {}
    others = (other for other in corrections.axes if other != axis)
    for pair in ((axis,), *((axis, other) for other in others)):
        group = tuple(name for name in corrections.axes if name in pair)
        opposite = backward.averaged(group)
        for target, moves in forward.averaged(group).items():
            half = (moves - opposite[target]) / 2.0
            halves[target, *pair] = half if group == pair else half.T
    return halves


def _tables_for(
    axes: Sequence[str],
    factor: float,
    target: str,
    averages: CorrectionsByAxes,
    halves: Mapping[str, CorrectionsByAxes],
    max_products: int,
) -> list[CrossTable]:
    mean = float(averages[target,])
    along = {axis: averages[target, axis] - mean for axis in axes}
    home = target if target in axes else axes[0]
    along[home] = along[home] + mean
    products: list[CrossTable] = []
    for first, second in combinations(axes, 2):
        interaction = factor * _interaction(averages[target, first, second])
        for u, v in _factors(interaction, MAX_PRODUCTS):
            # both tables also act by themselves: the table of their axis compensates this
            along[first] = along[first] - factor * u
            along[second] = along[second] - factor * v
            products += [CrossTable(first, target, u, partner=1), CrossTable(second, target, v)]
    half = {axis: groups[target, axis] for axis, groups in halves.items()}
    for axis, groups in halves.items():
        for second in (other for other in axes if other != axis):
            interaction = groups[target, axis, second] - groups[target, axis][:, None]
            for u, v in _factors(factor * interaction, max_products):
                half[axis] = half[axis] - factor * u
                along[second] = along[second] - factor * v
                products += [
                    CrossTable(axis, target, u, 1, partner=2),
                    CrossTable(axis, target, -u, -1, partner=1),
                    CrossTable(second, target, v),
                ]
    axis_tables: list[CrossTable] = []
    for axis, moves in along.items():
        reversal = half.get(axis, np.zeros(()))
        is_directed = np.abs(reversal).max() > MIN_TABLE_MM
        axis_tables += [
            CrossTable(axis, target, factor * (moves + direction * reversal), direction)
            for direction in ((1, -1) if is_directed else (0,))
        ]
    effective = [table for table in axis_tables if np.abs(table.values).max() > MIN_TABLE_MM]
    return [*effective, *products]


def _factors(matrix: Array, max_rank: int) -> Iterator[tuple[Array, Array]]:
    """Yield the factors u, v of the products u·vᵀ that add up to a matrix, the largest first."""
    columns, sizes, rows = np.linalg.svd(matrix)
    for rank, root in enumerate(np.sqrt(sizes[:max_rank])):
        u, v = columns[:, rank] * root, rows[rank] * root
        if np.abs(u).max() * np.abs(v).max() < MIN_PRODUCT_MM:
            return
        yield u, v


def _interaction(matrix: Array) -> Array:
    """Subtract the means over each axis from the corrections over two axes."""
    rows, columns = (shares(count) for count in matrix.shape)
    row_means, column_means = matrix @ columns, rows @ matrix
    return matrix - row_means[:, None] - column_means + rows @ row_means


FORMATS = (
    Format(
        **describe("sinumerik-enc"), recognise=_assigns(ENC), tables=_read_enc, write=_write_enc
    ),
    Format(
        **describe("sinumerik-cec"), recognise=_assigns(CEC), tables=_read_cec, write=_write_cec
    ),
)
