"""SINUMERIK sag and angularity compensation, `$AN_CEC`: one axis corrected over another.

Siemens SINUMERIK 840D sl/828D, Function Manual Extended Functions (03/2013, 6FC5397-1BP40-3BA1),
K3, pages 243 to 264: linear between equidistant points, end values held, or repeated with the
modulo function; tables for one direction of travel; the product of two tables is added.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from warpspace.exceptions import OptionError
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import ERROR, Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported, merge
from warpspace.formats.numbers import read_whole
from warpspace.formats.parts import sinumerik_text as text
from warpspace.formats.parts.cross_tables import CrossTable, cross_tables
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import Line, Product, Tables, Term

PREFIX = "AN_CEC"
AXES = ("INPUT_AXIS", "OUTPUT_AXIS")
SWITCHES = ("DIRECTION", "MULT_BY_TABLE", "IS_MODULO")
NAMES = (PREFIX, *(f"{PREFIX}_{name}" for name in (*AXES, *text.NUMBERS, *SWITCHES)))
MOST_TABLES = 62
"""Twice the axes of an NC (manual, "Compensation table index")."""
SIGN = (
    "a positive value makes the corrected axis move in the negative direction, as page 238 of the"
    " manual says of $AA_ENC_COMP; it does not say so of $AN_CEC: try it on the machine, or give"
    " --sign correction"
)


@dataclass
class _Table(text.Table):
    """What a file says of one table, with its axes."""

    axes: dict[str, str] = field(default_factory=dict[str, str])


def recognise(head: str, name: str) -> bool:
    """Tell it by its variables."""
    del name
    return text.assigns(PREFIX, head)


def _tables(source: Source) -> dict[int, _Table]:
    """Collect the tables of a file by their index."""
    found: dict[int, _Table] = {}
    for one in text.assignments(source, NAMES):
        plain = one.name == PREFIX
        if len(one.indices) != (2 if plain else 1):
            expected = "[table, point]" if plain else "[table]"
            source.refuse(f"${one.name}[{', '.join(one.indices)}]; expected {expected}", one.line)
        index = text.index_of(one.indices[0], source, one.line)
        if index >= MOST_TABLES:
            source.refuse(f"table {index}; expected at most {MOST_TABLES - 1}", one.line)
        table = found.setdefault(index, _Table(one.line))
        setting = one.name.removeprefix(f"{PREFIX}_")
        if plain:
            point = text.index_of(one.indices[1], source, one.line)
            value = text.number_of(one, source)
            text.set_once(table.values, point, value, source, one.line, f"table {index}")
        elif setting in AXES:
            table.axes[setting] = text.name_of(one.value, source, one.line)
        elif setting in text.NUMBERS:
            table.numbers[setting] = text.number_of(one, source)
        else:
            low, high = (-1, 1) if setting == "DIRECTION" else (0, MOST_TABLES)
            table.switches[setting] = read_whole(
                one.value, source, one.line, f"${one.name}", low, high
            )
    if not found:
        source.refuse(f"has no ${PREFIX}; expected tables of this variable")
    return found


def _line(table: _Table, index: int, source: Source, options: ReadOptions) -> Line:
    """Build one table as the controller evaluates it."""
    what = f"table {index}"
    for setting in AXES:
        if setting not in table.axes:
            found = f"{what}: ${PREFIX}_{setting} is missing; expected it (is the file cut off?)"
            source.refuse(found, table.line)
    along, target = (
        resolve_axis(table.axes[setting], source, table.line, options) for setting in AXES
    )
    return text.line_of(table, (along, target), PREFIX, what, source, options.factor(ERROR))


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the tables as the controller holds them."""
    terms: list[Term] = []
    for source in sources:
        tables = _tables(source)
        lines = {index: _line(one, index, source, options) for index, one in tables.items()}
        terms += lines.values()
        for index, table in tables.items():
            other = table.switches.get("MULT_BY_TABLE", 0) - 1
            if other < 0:
                continue
            if other not in lines:
                found = f"table {index} is multiplied by table number {other + 1}"
                source.refuse(f"{found}, which the file does not have", table.line)
            terms.append(Product(lines[index], lines[other], options.factor(ERROR)))
    said = f"sign: {options.sign}" if options.sign else SIGN
    return Tables(tuple(terms), (said, "lengths mm, angles degrees (metric system)"))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the errors that the tables correct."""
    parts = [errors_of(read_tables([one], options), FORMAT.name, one, options) for one in sources]
    return merge(parts)


def write(wanted: Wanted) -> Files:
    """Write tables of every axis over every axis, and products of two where they help."""
    tables = cross_tables(wanted, wanted.factor(ERROR), MOST_TABLES)
    if len(tables) > MOST_TABLES:
        raise OptionError(
            f"sinumerik-cec: {len(tables)} tables; expected at most {MOST_TABLES}, as the control"
            " takes: correct fewer axes"
        )
    body = [
        f"; written by warpspace for {wanted.title}",
        f"; {SIGN if not wanted.sign else 'sign: ' + wanted.sign}",
    ]
    for index, table in enumerate(tables):
        body += _spelled(wanted, index, table)
    return text.archive("NC_CEC", body)


def _spelled(wanted: Wanted, index: int, table: CrossTable) -> list[str]:
    """Spell one table."""
    places = wanted.places(table.along)
    return [
        f"; MD18342 $MN_MM_CEC_MAX_POINTS[{index}] = {len(places)}",
        *text.point_lines(PREFIX, f"{index},{{}}".format, wanted.round(table.values)),
        f"${PREFIX}_INPUT_AXIS[{index}]=({table.along})",
        f"${PREFIX}_OUTPUT_AXIS[{index}]=({table.target})",
        *text.range_lines(PREFIX, str(index), places),
        f"${PREFIX}_DIRECTION[{index}]={table.direction}",
        f"${PREFIX}_MULT_BY_TABLE[{index}]={index + table.number + 1 if table.number else 0}",
        f"${PREFIX}_IS_MODULO[{index}]=0",
    ]


FORMAT = Format(
    name="sinumerik-cec",
    title="SINUMERIK $AN_CEC, sag and angularity compensation",
    source="Siemens, SINUMERIK 840D sl Function Manual Extended Functions, K3, 6FC5397-1BP40-3BA1",
    endings=(".ini", ".spf", ".mpf", ".arc", ".txt"),
    holds="displacements of any axis over any axis, by direction of travel, and products of two",
    units="mm, degrees",
    grid="equal steps along the axis looked up",
    limits="62 tables, as many points as MD18342 keeps; end values held, or modulo",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
    orientation=True,
)
