"""SINUMERIK measuring system error compensation, `$AA_ENC_COMP`: a table an axis for itself.

Siemens SINUMERIK 840D sl/828D, Function Manual Extended Functions (03/2013, 6FC5397-1BP40-3BA1),
K3, pages 237 to 242: linear between equidistant points, end values held, or repeated with the
modulo function; a positive value makes the axis move in the negative direction.
"""

from collections import defaultdict
from collections.abc import Sequence

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import ERROR, Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported, merge
from warpspace.formats.parts import sinumerik_text as text
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import Line, Tables

PREFIX = "AA_ENC_COMP"
MODULO = "IS_MODULO"
NAMES = (PREFIX, *(f"{PREFIX}_{name}" for name in (*text.NUMBERS, MODULO)))
SIGN = "a positive value makes the axis move in the negative direction (manual, page 238)"


def recognise(head: str, name: str) -> bool:
    """Tell it by its variables."""
    del name
    return text.assigns(PREFIX, head)


def _tables(source: Source) -> dict[tuple[int, str], text.Table]:
    """Collect the tables of a file, by encoder and axis."""
    found: defaultdict[tuple[int, str], text.Table] = defaultdict(lambda: text.Table(0))
    for one in text.assignments(source, NAMES):
        plain = one.name == PREFIX
        if len(one.indices) != (3 if plain else 2):
            expected = "[encoder, point, axis]" if plain else "[encoder, axis]"
            source.refuse(f"${one.name}[{', '.join(one.indices)}]; expected {expected}", one.line)
        encoder = text.index_of(one.indices[0], source, one.line)
        table = found[encoder, text.name_of(one.indices[-1], source, one.line)]
        table.line = table.line or one.line
        if plain:
            index = text.index_of(one.indices[1], source, one.line)
            value = text.number_of(one, source)
            text.set_once(table.values, index, value, source, one.line, f"${PREFIX}")
        elif (setting := one.name.removeprefix(f"{PREFIX}_")) == MODULO:
            flag = text.flag_of(one.value, source, one.line, f"${one.name}")
            table.switches[MODULO] = int(flag)
        else:
            table.numbers[setting] = text.number_of(one, source)
    if not found:
        source.refuse(f"has no ${PREFIX}; expected tables of this variable")
    return dict(found)


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the tables as the controller holds them."""
    terms: list[Line] = []
    notes: list[str] = []
    for source in sources:
        for (encoder, name), table in _tables(source).items():
            axis = resolve_axis(name, source, table.line, options)
            what = f"table of {name}"
            if any(term.source == axis for term in terms):
                source.refuse(
                    f"{what}: {axis} has a table already; expected one an axis", table.line
                )
            factor = options.factor(ERROR)
            terms.append(text.line_of(table, (axis, axis), PREFIX, what, source, factor))
            if encoder:
                notes.append(f"{name}: the table of measuring system {encoder + 1} was taken")
    said = f"sign: {options.sign}" if options.sign else SIGN
    return Tables(tuple(terms), (said, "lengths mm, angles degrees (metric system)"), tuple(notes))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read the positioning errors that the tables correct."""
    parts = [errors_of(read_tables([one], options), FORMAT.name, one, options) for one in sources]
    return merge(parts)


def write(wanted: Wanted) -> Files:
    """Write a table for each axis that spans the volume and can be corrected."""
    body: list[str] = [
        f"; written by warpspace for {wanted.title}",
        f"; {SIGN if not wanted.sign else 'sign: ' + wanted.sign}",
    ]
    for axis in wanted.axes:
        if axis not in wanted.corrector.moved:
            continue
        places = wanted.places(axis)
        values = wanted.factor(ERROR) * wanted.averaged([axis])[axis]
        body += [
            f"; MD38000 $MA_MM_ENC_COMP_MAX_POINTS[0,{axis}] >= {len(places)}",
            *text.point_lines(PREFIX, f"0,{{}},{axis}".format, wanted.round(values)),
            *text.range_lines(PREFIX, f"0,{axis}", places),
            f"${PREFIX}_{MODULO}[0,{axis}]=0",
        ]
    return text.archive("AX_EEC", body)


FORMAT = Format(
    name="sinumerik-enc",
    title="SINUMERIK $AA_ENC_COMP, measuring system error compensation",
    source="Siemens, SINUMERIK 840D sl Function Manual Extended Functions, K3, 6FC5397-1BP40-3BA1",
    endings=(".ini", ".spf", ".mpf", ".arc", ".txt"),
    holds="the positioning error of each axis (EXX, EYY, ECC …)",
    units="mm, degrees",
    grid="equal steps along each axis",
    limits="as many points as MD38000 keeps; end values held, or modulo",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
)
