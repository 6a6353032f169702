"""SINUMERIK tables: `$AA_ENC_COMP` of an axis for itself, `$AN_CEC` of one axis over another.

Siemens SINUMERIK 840D sl/828D, Function Manual Extended Functions (03/2013, 6FC5397-1BP40-3BA1),
K3, pages 237 to 264: linear between equidistant points, end values held, or repeated with the
modulo function; a positive value of `$AA_ENC_COMP` makes the axis move in the negative direction.
`$AN_CEC` has tables for one direction of travel, and adds the product of two tables. Archives
assign system variables, `$NAME[index, …] = value ; comment`.

A table of `$AN_CEC` holds the mean of the correction over the other axes. What two axes do together
beyond that, such as an angle times a lever, is a sum of products of two tables. Where errors depend
on the direction of travel, two tables act in one direction each, the values around their mean.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.grid import shares
from warpspace.formats.compensation.corrections import RequiredCorrections
from warpspace.formats.registry import (
    ERROR,
    Files,
    Format,
    ReadOptions,
    format_description,
    head_matcher,
)
from warpspace.formats.source import Source, SourceLine, format_comment, format_number, quote
from warpspace.formats.terms import HOLD_ENDS, MODULO, AxisTable, Product, Tables, Term
from warpspace.machine.axes import TravelDirection
from warpspace.units import Array

ENC, CEC = "AA_ENC_COMP", "AN_CEC"
AXES = ("INPUT_AXIS", "OUTPUT_AXIS")
RANGE = ("STEP", "MIN", "MAX")
DIRECTION, FACTOR, IS_MODULO = "DIRECTION", "MULT_BY_TABLE", "IS_MODULO"
MAX_TABLES = 62  # twice the axes of an NC (manual, "Compensation table index")
SIGN = "a positive value makes the axis move in the negative direction (manual, page 238)"
CEC_SIGN = (
    "a positive value makes the corrected axis move in the negative direction, as page 238 of the"
    " manual says of $AA_ENC_COMP; it does not say so of $AN_CEC: try it on the machine, or give"
    " --sign correction"
)
UNITS = "lengths mm, angles degrees (metric system)"
DIGITS = 7  # digits behind the point of a value: a tenth of a nanometre
STEP_SHARE = 1e-4  # share of a step by which start, end and step may disagree
MAX_INDEX = 100_000
MAX_PRODUCTS = 3  # pairs of tables for one axis over two others
MIN_PRODUCT_MM = 1e-5  # A product of tables below it is not worth two tables
SWITCHES = {DIRECTION: (-1, 1), FACTOR: (0, MAX_TABLES), IS_MODULO: (0, 1)}
"""Whole numbers of a table, each between limits."""
CorrectionsByAxes = Mapping[tuple[str, ...], Array]
"""Corrections by the axis that is corrected and those that they are over."""
_ASSIGNMENT = re.compile(r"\$([A-Z_]+)\s*\[([^\]]*)\]\s*=\s*(.+)")
_QUIET = re.compile(r"(%.*|CHANDATA\(\d+\)|M17|M30|M02|N\d+)", re.IGNORECASE)


@dataclass
class AssignmentTable:
    """What a file says of one table, as it is read line by line."""

    at: SourceLine  # where it begins
    values: dict[int, float] = field(default_factory=dict[int, float])  # by interpolation point
    numbers: dict[str, float] = field(default_factory=dict[str, float])  # STEP, MIN and MAX
    # IS_MODULO and the like; 0 where they are not set
    switches: dict[str, int] = field(default_factory=dict[str, int])
    axes: dict[str, str] = field(default_factory=dict[str, str])  # where the file names them

    def to_axis_table(
        self, axes: tuple[str, str], prefix: str, label: str, factor: float
    ) -> AxisTable:
        for setting in RANGE:
            if setting not in self.numbers:
                problem = f"{label}: ${prefix}_{setting} is missing"
                self.at.refuse(problem, "it (is the file cut off?)")
        step, start, end = (self.numbers[setting] for setting in RANGE)
        if step <= 0.0 or end <= start:
            problem = f"{label}: step {step:g} from {start:g} to {end:g}"
            self.at.refuse(problem, "a step above 0 and an end above the start")
        steps = (end - start) / step
        if abs(steps - round(steps)) > STEP_SHARE:
            problem = f"{label}: {start:g} to {end:g} is no whole number of steps of {step:g}"
            self.at.refuse(f"{problem} ({steps:.4g})", "equal steps from start to end")
        if round(steps) > MAX_INDEX:
            self.at.refuse(f"{label}: {round(steps):,} steps", f"at most {MAX_INDEX:,}")
        last = round(steps)
        missing = next((index for index in range(last + 1) if index not in self.values), None)
        if missing is not None:
            expected = f"points 0 … {last}, as start, end and step say"
            self.at.refuse(f"{label}: interpolation point {missing} has no value", expected)
        if len(self.values) > last + 1:
            problem = f"{label}: interpolation point {max(self.values)}"
            self.at.refuse(problem, f"the last one to be {last} at the end position")
        return AxisTable(
            *axes,
            tuple((start + step * np.arange(last + 1, dtype=np.float64)).tolist()),
            tuple(factor * self.values[index] for index in range(last + 1)),
            MODULO if self.switches.get(IS_MODULO) else HOLD_ENDS,
            direction=self.switches.get("DIRECTION", 0),
        )


def _assigns(name: str) -> Callable[[str, str], bool]:
    return head_matcher(rf"^\s*(?:N\d+\s+)?\${name}[A-Z_]*\s*\[")


def _assignments(
    source: Source, prefix: str, settings: Sequence[str], indices: tuple[str, str]
) -> Iterator[tuple[SourceLine, str, list[str], str]]:
    """Give place, setting (empty for a value), indices and value of each assignment."""
    names = (prefix, *(f"{prefix}_{setting}" for setting in settings))
    any_found = False
    for at, text in source.scan(";"):
        bare = re.sub(r"^N\d+\s+", "", text)
        if _QUIET.fullmatch(bare):
            continue
        matched = _ASSIGNMENT.fullmatch(bare)
        if matched is None:
            at.refuse(at.quoted, "$VARIABLE[index, …] = value")
        name, inner, value = matched.groups()
        if name not in names:
            at.refuse(f"variable ${name}", f"one of {', '.join(f'${known}' for known in names)}")
        parts = [part.strip() for part in re.split(r"[,.]", inner)]
        expected = indices[name != prefix]
        if len(parts) != expected.count(",") + 1:
            at.refuse(f"${name}[{', '.join(parts)}]", expected)
        any_found = True
        yield at, name.removeprefix(prefix).removeprefix("_"), parts, value.strip()
    if not any_found:
        source.refuse(f"has no ${prefix}", "tables of this variable")


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


def _read(
    source: Source,
    prefix: str,
    indices: tuple[str, str],
    key_of: Callable[[list[str], SourceLine], tuple[Any, str]],
    settings: Sequence[str] = (*RANGE, IS_MODULO),
) -> dict[Any, AssignmentTable]:
    tables: dict[Any, AssignmentTable] = {}
    for at, setting, parts, value in _assignments(source, prefix, settings, indices):
        name = f"${prefix}_{setting}" if setting else f"${prefix}"
        key, what = key_of(parts, at)
        table = tables.setdefault(key, AssignmentTable(at))
        if setting in AXES:
            table.axes[setting] = _axis_name(value, at)
        elif setting in RANGE:
            table.numbers[setting] = at.number(value, name)
        elif setting:
            table.switches[setting] = at.integer(value, name, *SWITCHES[setting])
        elif (index := _index(parts[1], at)) in table.values:
            at.refuse(f"{what}: interpolation point {index} is given twice", "it once")
        else:
            table.values[index] = at.number(value, name)
    return tables


def _read_enc(sources: Sequence[Source], options: ReadOptions) -> Tables:
    terms: list[AxisTable] = []
    notes: list[str] = []

    def key_of(parts: list[str], at: SourceLine) -> tuple[tuple[int, str], str]:
        return (_index(parts[0], at), _axis_name(parts[-1], at)), f"${ENC}"

    for source in sources:
        indices = ("[encoder, point, axis]", "[encoder, axis]")
        for (encoder, name), table in _read(source, ENC, indices, key_of).items():
            axis = options.axis_named(name, table.at)
            what = f"table of {name}"
            if any(term.source == axis for term in terms):
                table.at.refuse(f"{what}: {axis} has a table already", "one an axis")
            terms.append(table.to_axis_table((axis, axis), ENC, what, options.factor(ERROR)))
            if encoder:
                notes.append(f"{name}: the table of measuring system {encoder + 1} was taken")
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
    factor = options.factor(ERROR)

    def key_of(parts: list[str], at: SourceLine) -> tuple[int, str]:
        index = _index(parts[0], at)
        if index >= MAX_TABLES:
            at.refuse(f"table {index}", f"at most {MAX_TABLES - 1}")
        return index, f"table {index}"

    for source in sources:
        settings = (*AXES, *RANGE, *SWITCHES)
        tables = _read(source, CEC, ("[table, point]", "[table]"), key_of, settings)
        lines = {}
        for index, table in tables.items():
            what = f"table {index}"
            for setting in AXES:
                if setting not in table.axes:
                    problem = f"{what}: ${CEC}_{setting} is missing"
                    table.at.refuse(problem, "it (is the file cut off?)")
            along, target = (options.axis_named(table.axes[one], table.at) for one in AXES)
            lines[index] = table.to_axis_table((along, target), CEC, what, factor)
        terms += lines.values()
        for index, table in tables.items():
            other = table.switches.get(FACTOR, 0) - 1
            if other < 0:
                continue
            if other not in lines:
                problem = f"table {index} is multiplied by table number {other + 1}"
                table.at.refuse(f"{problem}, which the file does not have")
            terms.append(Product(lines[index], lines[other], factor))
    return Tables(tuple(terms), (options.sign_statement(CEC_SIGN), UNITS))


def _write_cec(corrections: RequiredCorrections) -> Files:
    tables = _cross_tables(corrections, corrections.factor(ERROR), MAX_TABLES)
    if len(tables) > MAX_TABLES:
        raise OptionError(
            f"sinumerik-cec: {len(tables)} tables; expected at most {MAX_TABLES}, as the control"
            " takes: correct fewer axes"
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
            f"${CEC}_MULT_BY_TABLE[{index}]={index + table.number + 1 if table.number else 0}",
            f"${CEC}_IS_MODULO[{index}]=0",
        ]
    return _archive("NC_CEC", corrections, CEC_SIGN, body)


@dataclass(frozen=True)
class CrossTable:
    """One table to write."""

    along: str  # axis looked up, and corrected axis
    target: str
    values: Array  # (n,)
    # 1 or −1 where it acts in one direction of travel of the axis looked up only
    direction: int = 0
    number: int = 0  # how many tables further the other factor of a product stands, 0 for none


def _cross_tables(
    corrections: RequiredCorrections, factor: float, max_tables: int
) -> list[CrossTable]:
    mean, axes = corrections.for_direction(TravelDirection.MEAN), corrections.axes
    needed = {
        (target, *group): values
        for group in ((), *((axis,) for axis in axes), *combinations(axes, 2))
        for target, values in mean.averaged(group).items()
    }
    halves = {axis: _half_reversals(corrections, axis) for axis in corrections.directional_axes}
    for most_products in (MAX_PRODUCTS, 0):
        tables = [
            table
            for target in corrections.corrector.moved
            for table in _tables_for(corrections, factor, target, needed, halves, most_products)
        ]
        if len(tables) <= max_tables:
            break
    # where there is nothing to correct: a table of zeros
    zeros = np.zeros(len(corrections.positions(axes[0])))
    return tables or [CrossTable(axes[0], corrections.corrector.moved[0], zeros)]


def _half_reversals(corrections: RequiredCorrections, axis: str) -> CorrectionsByAxes:
    base = corrections.for_direction(TravelDirection.MEAN)
    directions = [
        base.for_direction(way, axis) for way in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
    ]
    found: dict[tuple[str, ...], Array] = {}
    for other in ("", *corrections.axes):
        if other == axis:
            continue
        group = tuple(name for name in corrections.axes if name in (axis, other))
        forward, backward = (way.averaged(group) for way in directions)
        for target in forward:
            half = (forward[target] - backward[target]) / 2.0
            half = half.T if other and group[0] != axis else half
            found[(target, axis, other) if other else (target, axis)] = half
    return found


def _tables_for(
    corrections: RequiredCorrections,
    factor: float,
    target: str,
    needed: CorrectionsByAxes,
    halves: Mapping[str, CorrectionsByAxes],
    most_products: int,
) -> list[CrossTable]:
    axes = corrections.axes
    mean = float(needed[target,])
    along = {axis: needed[target, axis] - mean for axis in axes}
    home = target if target in axes else axes[0]
    along[home] = along[home] + mean
    products: list[CrossTable] = []
    for first, second in combinations(axes, 2):
        for first_factor, second_factor in _factors(
            factor * _interaction(needed[target, first, second]), MAX_PRODUCTS
        ):
            # both tables also act by themselves: their axis' own table takes that back
            along[first] = along[first] - factor * first_factor
            along[second] = along[second] - factor * second_factor
            products += [
                CrossTable(first, target, first_factor, number=1),
                CrossTable(second, target, second_factor),
            ]
    half = {axis: groups[target, axis] for axis, groups in halves.items()}
    for axis, groups in halves.items():
        for second in (other for other in axes if other != axis):
            interaction = groups[target, axis, second] - groups[target, axis][:, None]
            for first_factor, second_factor in _factors(factor * interaction, most_products):
                half[axis] = half[axis] - factor * first_factor
                along[second] = along[second] - factor * second_factor
                products += [
                    CrossTable(axis, target, first_factor, 1, number=2),
                    CrossTable(axis, target, -first_factor, -1, number=1),
                    CrossTable(second, target, second_factor),
                ]
    axis_tables: list[CrossTable] = []
    for axis, values in along.items():
        reversal = half.get(axis, np.zeros(()))
        if np.abs(reversal).max() > MIN_PRODUCT_MM / 100.0:
            axis_tables += [
                CrossTable(axis, target, factor * (values + way * reversal), way) for way in (1, -1)
            ]
        else:
            axis_tables.append(CrossTable(axis, target, factor * values))
    single_tables = [
        table for table in axis_tables if np.abs(table.values).max() > MIN_PRODUCT_MM / 100.0
    ]
    return [*single_tables, *products]


def _factors(matrix: Array, max_rank: int) -> Iterator[tuple[Array, Array]]:
    left_vectors, sizes, right_vectors = np.linalg.svd(matrix)
    for rank, size in enumerate(sizes[:max_rank].tolist()):
        first_factor, second_factor = (
            left_vectors[:, rank] * np.sqrt(size),
            right_vectors[rank] * np.sqrt(size),
        )
        if np.abs(first_factor).max() * np.abs(second_factor).max() < MIN_PRODUCT_MM:
            return
        yield first_factor, second_factor


def _interaction(matrix: Array) -> Array:
    first_weights, second_weights = (shares(count) for count in matrix.shape)
    first, second = matrix @ second_weights, first_weights @ matrix
    return matrix - first[:, None] - second + first_weights @ first


FORMATS = (
    Format(
        **format_description("sinumerik-enc"),
        recognise=_assigns(ENC),
        tables=_read_enc,
        write=_write_enc,
    ),
    Format(
        **format_description("sinumerik-cec"),
        recognise=_assigns(CEC),
        tables=_read_cec,
        write=_write_cec,
    ),
)
