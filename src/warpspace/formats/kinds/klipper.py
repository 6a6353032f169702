"""Klipper: `[skew_correction]` (SET_SKEW, saved profiles) and `[axis_twist_compensation]`.

Klipper documentation, Skew_Correction, and klippy/extras/skew_correction.py,
axis_twist_compensation.py: the twist is a height that a probe is off by, along X, its mean taken
out; it corrects the probe, not the nozzle.
"""

import re
from collections.abc import Sequence

import numpy as np

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import BOTH, Imported, Run, Series, merge
from warpspace.formats.numbers import RAD_TO_URAD, read_number
from warpspace.formats.parts.skew import (
    PLANES,
    factor_of,
    fitted_factors,
    skew_lengths,
    skew_term,
)
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import Tables

LEAST_OFFSET_MM = 1.0
"""Between probe and nozzle: below it a twist cannot be told from the height."""
_SET = re.compile(r"\b(XY|XZ|YZ)=([^\s]+)")
_SAVED = re.compile(r"(xy|xz|yz)_skew\s*[=:]\s*(\S+)")
_SECTION = re.compile(r"\[([a-z_]+)(?:\s+[^\]]*)?\]")
Section = dict[str, tuple[int, str]]


def recognise(head: str, name: str) -> bool:
    """Tell it by its commands or sections."""
    del name
    return "SET_SKEW" in head or "[skew_correction" in head or "[axis_twist_compensation" in head


def _sections(source: Source) -> dict[str, Section]:
    """Read the sections of a configuration: values with their lines, by name."""
    found: dict[str, Section] = {}
    section: Section = {}
    for number, text in enumerate(source.lines, start=1):
        bare = text.removeprefix("#*#").split(" ;")[0].strip()
        if matched := _SECTION.fullmatch(bare):
            section = found.setdefault(matched[1], {})
        elif not bare.startswith(("#", ";")) and (pair := re.match(r"(\w+)\s*[:=]\s*(.*)", bare)):
            section[pair[1]] = (number, pair[2].strip())
    return found


def _factors(source: Source, options: ReadOptions) -> dict[str, float]:
    """Read the skew factors of a file."""
    found: dict[str, float] = {}
    for number, text in enumerate(source.lines, start=1):
        bare = text.removeprefix("#*#").strip()
        if "SET_SKEW" in bare and not bare.startswith((";", "#")):
            if re.search(r"CLEAR\s*=\s*1", bare):
                found.clear()
                continue
            for plane, value in _SET.findall(bare):
                parts = value.split(",")
                if len(parts) != 3:
                    expected = "expected three lengths AC,BD,AD in mm"
                    source.refuse(f"{plane}={value}; {expected}", number)
                ac, bd, ad = (read_number(part, source, number, plane) for part in parts)
                found[plane] = factor_of((ac, bd, ad), source, number, plane)
        elif matched := _SAVED.fullmatch(bare):
            found[matched[1].upper()] = read_number(matched[2], source, number, matched[1])
    for plane in found:
        for axis in plane:
            resolve_axis(axis, source, None, options)
    return found


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the skew factors as the firmware holds them."""
    factors: dict[str, float] = {}
    for source in sources:
        factors |= _factors(source, options)
    if not factors:
        sources[0].refuse("has no skew factors; expected SET_SKEW XY=AC,BD,AD or a saved profile")
    return Tables((skew_term(factors),), (), (), ("mm", "rad"))


def _twist(source: Source, options: ReadOptions) -> Imported | None:
    """Read the twist of X from the heights that a probe is off by."""
    sections = _sections(source)
    twist = sections.get("axis_twist_compensation")
    if twist is None or "z_compensations" not in twist:
        return None
    line, text = twist["z_compensations"]
    heights = [read_number(part, source, line, "z_compensations") for part in text.split(",")]
    ends: list[float] = []
    for key in ("start_x", "end_x"):
        named = next(
            (name for name in (f"compensation_{key}", f"calibrate_{key}", key) if name in twist),
            None,
        )
        if named is None:
            source.refuse(f"[axis_twist_compensation] has no calibrate_{key}; expected it", line)
        ends.append(read_number(twist[named][1], source, twist[named][0], named))
    if len(heights) < 2 or ends[1] <= ends[0]:
        found = f"{len(heights)} z_compensations from {ends[0]:g} to {ends[1]:g}"
        source.refuse(f"{found}; expected two or more along a range", line)
    probe = next(
        (
            name
            for name in ("probe", "bltouch", "beacon", "cartographer", "smart_effector")
            if "y_offset" in sections.get(name, {})
        ),
        None,
    )
    if probe is None:
        expected = "expected y_offset in [probe]: without it a height tells no twist"
        source.refuse(f"[axis_twist_compensation] without a probe; {expected}", line)
    place, offset_text = sections[probe]["y_offset"]
    offset = read_number(offset_text, source, place, "y_offset")
    if abs(offset) < LEAST_OFFSET_MM:
        found = f"y_offset {offset:g} mm"
        source.refuse(f"{found}; expected {LEAST_OFFSET_MM:g} mm or more to tell a twist", place)
    resolve_axis("X", source, line, options)
    places = np.linspace(ends[0], ends[1], len(heights))
    values = np.array(heights) / offset * RAD_TO_URAD
    run = Run(1, BOTH, tuple(values.tolist()))
    said = (
        f"the heights that the probe is off by, {offset:g} mm behind the nozzle, are taken for"
        " roll of X; their mean is not in the file"
    )
    series = Series("EAX", tuple(places.tolist()), (run,))
    return Imported(FORMAT.name, (series,), units=("mm",), assumed=(said,))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read squareness errors from skew factors, and roll of X from a twist."""
    parts: list[Imported] = []
    for source in sources:
        twist = _twist(source, options)
        parts += [twist] if twist else []
        if not twist or _factors(source, options):
            tables = read_tables([source], options)
            parts.append(errors_of(tables, FORMAT.name, source, options))
    return merge(parts)


def write(wanted: Wanted) -> Files:
    """Write the command that sets the factors."""
    parts = [
        f"{plane}=" + ",".join(f"{length:.6f}" for length in skew_lengths(factor))
        for plane, factor in fitted_factors(wanted).items()
    ]
    head = f"# {wanted.title}\n# [skew_correction] must stand in printer.cfg\n"
    return {"": f"{head}SET_SKEW {' '.join(parts)}\n"}


FORMAT = Format(
    name="klipper",
    title="Klipper skew correction and axis twist compensation",
    source="Klipper documentation, Skew Correction and Axis Twist Compensation",
    endings=(".cfg", ".gcode"),
    holds="squareness in XY, XZ and YZ; roll of X (read only)",
    units="mm",
    grid="none: the same everywhere",
    limits=f"three factors: {', '.join(PLANES)}",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
)
