"""Skew factors of printer firmware: Klipper and Marlin evaluate them alike, RepRapFirmware adds.

Klipper, klippy/extras/skew_correction.py, a port of Marlin's planner: of the diagonals AC and BD
and the side AD of a printed part, with side = √(2·AC² + 2·BD² − 4·AD²) / 2, the factor is
tan(π/2 − acos((AC² − side² − AD²) / (2·side·AD))); x is moved by −y·XY − z·(XZ − XY·YZ), and y by
−z·YZ.

Klipper documentation, Skew_Correction: a profile [skew_correction NAME] acts once SKEW_PROFILE
LOAD=NAME is executed; axis_twist_compensation.py: the twist is the height error of a probe along X
without its mean; it corrects the probe, not the nozzle. Marlin documentation, M852 (I, J, K
are the factors of XY, XZ, YZ; S that of XY), and Marlin/src/inc/Conditionals_post.h.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpspace.formats.compensation.corrections import AXES, RequiredCorrections
from warpspace.formats.measured import ErrorSeries, ImportedErrors, errors_of_readings, merge
from warpspace.formats.registry import Files, Format, ReadOptions, describe, has_pattern
from warpspace.formats.source import Source, SourceLine, format_comment, format_number, unread_notes
from warpspace.formats.terms import Affine, Tables, errors_from_tables
from warpspace.units import URAD_PER_RAD

PLANES = ("XY", "XZ", "YZ")
MAX_FACTOR = 1.0  # of a factor (Marlin, SKEW_FACTOR_MAX)
CLOSURE_TOLERANCE = 0.02
"""Largest relative difference without a note between a side and the one that closes the part."""
SIDE_MM = 100.0  # side of the part whose lengths express a factor


def skew_factor(ac: float, bd: float, ad: float) -> float:
    """Compute the skew factor of a part from its lengths, mm."""
    side = other_side(ac, bd, ad)
    cosine = (ac * ac - side * side - ad * ad) / (2.0 * side * ad)
    return math.tan(math.pi / 2.0 - math.acos(cosine))


def other_side(ac: float, bd: float, ad: float) -> float:
    """Compute the side AB that closes a part, mm."""
    return math.sqrt(2.0 * ac * ac + 2.0 * bd * bd - 4.0 * ad * ad) / 2.0


def skew_lengths(factor: float) -> tuple[float, float, float]:
    """Compute diagonals and side of a rhombus with a skew factor, mm: AC, BD, AD."""
    angle = math.pi / 2.0 - math.atan(factor)
    return 2.0 * SIDE_MM * math.cos(angle / 2.0), 2.0 * SIDE_MM * math.sin(angle / 2.0), SIDE_MM


def factor_of_part(
    lengths: tuple[float, float, float], at: SourceLine, plane: str, notes: list[str]
) -> float:
    """Compute the skew factor of a part; add a note if its lengths contradict a square part."""
    ac, bd, ad = lengths
    # twice a side is shorter than the sum of the diagonals, and longer than their difference
    if not (min(lengths) > 0.0 and ac + bd > 2.0 * ad > abs(ac - bd)):
        problem = f"{plane}: AC {ac:g}, BD {bd:g}, AD {ad:g} mm do not form a parallelogram"
        at.refuse(problem, "two diagonals and a side")
    side = other_side(ac, bd, ad)
    if abs(side / ad - 1.0) >= CLOSURE_TOLERANCE:
        notes.append(
            f"{plane}: AC {ac:g}, BD {bd:g} and AD {ad:g} mm imply a side AB of {side:.4g} mm,"
            f" {100.0 * (side / ad - 1.0):+.1f} % from AD; check the lengths (the part must be"
            " square)"
        )
    return skew_factor(ac, bd, ad)


def skew_term(factors: Mapping[str, float]) -> Affine:
    xy, xz, yz = (factors.get(plane, 0.0) for plane in PLANES)
    return Affine(AXES, ((0.0, -xy, -(xz - xy * yz)), (0.0, 0.0, -yz), (0.0, 0.0, 0.0)))


def fitted_factors(corrections: RequiredCorrections) -> dict[str, float]:
    """Fit the factors that minimise the RMS residual error over the volume."""
    coefficients = corrections.linear_fit((("X", "Y"), ("X", "Z"), ("Y", "Z")))
    xy, yz = -coefficients.get(("X", "Y"), 0.0), -coefficients.get(("Y", "Z"), 0.0)
    xz = -coefficients.get(("X", "Z"), 0.0) + xy * yz
    return {"XY": xy, "XZ": xz, "YZ": yz}


MIN_OFFSET_MM = 1.0  # between probe and nozzle: with less, a twist is not estimable
TWIST = "axis_twist_compensation"
TWISTS = {
    "z_compensations": ("x", "EAX", "y_offset", 1.0),
    "zy_compensations": ("y", "EBY", "x_offset", -1.0),
}
"""Axis, roll, lever arm of the probe and its sign (rotation × lever arm) of height errors."""
_TWIST_KEY = re.compile(
    r"zy?_compensations|((compensation|calibrate)_)?(start|end)_[xy]|(calibrate_)?[xy]|speed"
    r"|horizontal_move_z"
)
_SAVED_KEY = re.compile(r"(xy|xz|yz)_skew")
_COMMAND = re.compile(r"SET_SKEW|SKEW_PROFILE")
READ_SECTIONS = (TWIST, "skew_correction", "bed_mesh", "gcode_macro")
OFFSETS = {"x_offset", "y_offset"}
_SET = re.compile(r"\b(XY|XZ|YZ)=([^\s]+)")
_PROFILE = re.compile(r"\[skew_correction\s++([^\]]+)\]")
_LOAD = re.compile(r"\bSKEW_PROFILE\s+LOAD=\"?([^\s\"]+)")
_SAVED = re.compile(r"(xy|xz|yz)_skew\s*[=:]\s*(\S+)")
_SECTION = re.compile(r"\[([a-z_]+)(?:\s[^\]]*)?\]")
Section = dict[str, tuple[SourceLine, str]]
Settings = dict[str, tuple[SourceLine, float]]


def _sections(source: Source) -> dict[str, Section]:
    sections: dict[str, Section] = {}
    section: Section = {}
    for number, text in enumerate(source.lines, start=1):
        bare = text.removeprefix("#*#").split(" ;")[0].strip()
        heading, setting = _SECTION.fullmatch(bare), re.match(r"(\w+)\s*[:=]\s*(.*)", bare)
        if heading:
            section = sections.setdefault(heading[1], {})
        elif setting:
            section[setting[1]] = (source.at(number), setting[2].strip())
    return sections


def _factors(source: Source, options: ReadOptions, notes: list[str]) -> dict[str, float]:
    factors: dict[str, float] = {}
    profiles: dict[str, dict[str, float]] = {}
    loaded, profile = options.variant, ""
    for number, text in enumerate(source.lines, start=1):
        at, bare = source.at(number), text.removeprefix("#*#").strip()
        is_command = not bare.startswith((";", "#"))
        section, load, saved = _PROFILE.fullmatch(bare), _LOAD.search(bare), _SAVED.fullmatch(bare)
        if section:
            profile = section[1].rstrip()
        elif load and is_command:
            loaded = options.variant or load[1]
        elif "SET_SKEW" in bare and is_command:
            _set_skew(at, bare, factors, notes)
        elif saved:
            factor = at.number(saved[2], saved[1])
            profiles.setdefault(profile, {})[saved[1].upper()] = factor
    if profiles and (loaded or not factors):
        factors |= _loaded_profile(source, profiles, loaded, notes)
    for axis in "".join(factors):
        options.axis_named(axis, source)
    return factors


def _set_skew(at: SourceLine, command: str, factors: dict[str, float], notes: list[str]) -> None:
    if re.search(r"CLEAR\s*=\s*1", command):
        factors.clear()
        return
    parameters = re.split("[;#]", command.partition("SET_SKEW")[2])[0]
    if _SET.sub("", parameters).strip():
        at.refuse(at.quoted, "SET_SKEW with XY=, XZ=, YZ= or CLEAR=1")
    for plane, value in _SET.findall(parameters):
        parts = value.split(",")
        if len(parts) != 3:
            at.refuse(f"{plane}={value}", "three lengths AC,BD,AD in mm")
        ac, bd, ad = (at.number(part, plane) for part in parts)
        factors[plane] = factor_of_part((ac, bd, ad), at, plane, notes)


def _loaded_profile(
    source: Source, profiles: Mapping[str, dict[str, float]], loaded: str, notes: list[str]
) -> dict[str, float]:
    names = ", ".join(profiles)
    if len(profiles) == 1 and not loaded:
        loaded = names
    if loaded not in profiles:
        problem = f"no profile {loaded!r} among" if loaded else "several skew profiles:"
        source.refuse(f"{problem} {names}", "one of them (--variant NAME)")
    notes.append(
        f"profile {loaded!r} is assumed to be loaded: Klipper loads no profile without"
        f" SKEW_PROFILE LOAD={loaded}"
    )
    return profiles[loaded]


def _klipper_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    factors: dict[str, float] = {}
    notes: list[str] = []
    for source in sources:
        factors |= _factors(source, options, notes)
    if not factors:
        sources[0].refuse("has no skew factors", "SET_SKEW XY=AC,BD,AD or a saved profile")
    return Tables((skew_term(factors),), (), tuple(notes), ("mm", "rad"))


def _twist(source: Source, options: ReadOptions) -> ImportedErrors | None:
    sections = _sections(source)
    twist = sections.get(TWIST, {})
    assumed: list[str] = []
    notes: list[str] = []
    series: list[ErrorSeries] = []
    for heights_key, (axis, key, offset_key, sign) in TWISTS.items():
        if heights_key not in twist:
            continue
        at, text = twist[heights_key]
        options.axis_named(axis.upper(), at)
        if len({*re.findall(r",\s*", text)}) > 1:
            at.refuse(f"{heights_key} {text}", "numbers with a point, all separated alike")
        heights = [at.number(part, heights_key) for part in text.split(",")]
        ends = [_twist_end(twist, f"{end}_{axis}", at) for end in ("start", "end")]
        if len(heights) < 2 or ends[1] <= ends[0]:
            problem = f"{len(heights)} {heights_key} from {ends[0]:g} to {ends[1]:g}"
            at.refuse(problem, "two or more along a range")
        probe, place, offset = _probe_offset(sections, offset_key, at)
        if abs(offset) < MIN_OFFSET_MM:
            expected = f"{MIN_OFFSET_MM:g} mm or more to compute the twist"
            if len(TWISTS.keys() & twist.keys()) == 1:
                place.refuse(f"{offset_key} {offset:g} mm", expected)
            notes.append(f"ignored {heights_key}: {offset_key} {offset:g} mm; expected {expected}")
            continue
        places = np.linspace(ends[0], ends[1], len(heights))
        angles = sign * np.array(heights) / offset * URAD_PER_RAD
        series.append(ErrorSeries.undirected(key, places, angles))
        assumed.append(
            f"the height errors of [{probe}], {offset_key} {offset:g} mm from the nozzle, are due"
            f" to roll of {axis.upper()}; their mean is not in the file"
        )
    if not series:
        return None
    readings = ImportedErrors(
        "klipper", tuple(series), units=("mm",), assumed=tuple(assumed), notes=tuple(notes)
    )
    return errors_of_readings(readings, options.machine)


def _twist_end(twist: Section, name: str, at: SourceLine) -> float:
    names = (f"compensation_{name}", f"calibrate_{name}", name)
    present = next((key for key in names if key in twist), None)
    if present is None:
        at.refuse(f"[{TWIST}] is incomplete", f"calibrate_{name}")
    place, text = twist[present]
    return place.number(text, present)


def _probe_offset(
    sections: Mapping[str, Section], key: str, at: SourceLine
) -> tuple[str, SourceLine, float]:
    """Find the offset of the probe: of whichever section has one."""
    probes = [name for name, section in sections.items() if key in section]
    if len(probes) != 1:
        problem = f"[{TWIST}] with {', '.join(probes)}" if probes else f"[{TWIST}] without a probe"
        at.refuse(problem, f"{key} in one section such as [probe], needed to compute the twist")
    place, text = sections[probes[0]][key]
    return probes[0], place, place.number(text, key)


def _unread(source: Source) -> tuple[str, ...]:
    """Return notes on the contents of sections that are not read."""
    sections = _sections(source)
    notes = [
        f"{source.base}: ignored [bed_mesh]: the shape of the bed, not an error of an axis"
        for _ in sections.keys() & {"bed_mesh"}
    ]
    unread_lines: list[SourceLine] = []
    is_outside = True
    for at, bare in source.scan(";"):
        heading = _SECTION.fullmatch(bare.removeprefix("#*#").strip())
        is_outside = is_outside and heading is None
        if heading:
            is_read = heading[1] in READ_SECTIONS or OFFSETS & sections[heading[1]].keys()
        else:
            is_read = not is_outside or bare.startswith("#") or _COMMAND.search(bare)
        if not is_read:
            unread_lines.append(at)
    notes += unread_notes(unread_lines)
    for name, expression in ((TWIST, _TWIST_KEY), ("skew_correction", _SAVED_KEY)):
        unread = [key for key in sections.get(name, {}) if not expression.fullmatch(key)]
        if unread:
            notes.append(f"{source.base}: ignored in [{name}]: {', '.join(unread)}")
    return tuple(notes)


def _read_klipper(sources: Sequence[Source], options: ReadOptions) -> ImportedErrors:
    parts: list[ImportedErrors] = []
    for source in sources:
        twist = _twist(source, options)
        if twist:
            parts.append(twist)
        if not twist or _factors(source, options, []):
            tables = _klipper_tables([source], options)
            parts.append(errors_from_tables(tables, "klipper", source, options.machine))
        parts[-1] = replace(parts[-1], notes=(*parts[-1].notes, *_unread(source)))
    return merge(parts)


def _write_klipper(corrections: RequiredCorrections) -> Files:
    parts = [
        f"{plane}=" + ",".join(f"{length:.6f}" for length in skew_lengths(factor))
        for plane, factor in fitted_factors(corrections).items()
    ]
    head = format_comment("# ", corrections.scene.title)
    head += "\n# [skew_correction] is required in printer.cfg\n"
    return {"": f"{head}SET_SKEW {' '.join(parts)}\n"}


DIGITS = 6  # decimals of a factor, as in the report of the firmware
LETTERS = {"I": "XY", "J": "XZ", "K": "YZ", "S": "XY"}
_WORD = re.compile(r"([A-Z])\s*([^A-Z\s]*)")
_DEFINE = re.compile(r"#\s*define\s+(XY|XZ|YZ)_(DIAG_AC|DIAG_BD|SIDE_AD|SKEW_FACTOR)\s+(\S+)")
_SWITCH = re.compile(r"#\s*define\s+(SKEW_CORRECTION(?:_FOR_Z)?)\b")
_ECHO = re.compile(r"^(Recv:\s*+)?echo:\s*+")
_IDLE = re.compile(r"#\s*(?:if|ifdef|endif|else)\b|> ?M852$|(?:Recv: *)?ok$|echo:;")
"""Lines around skew factors that state nothing."""
_REPORTED = re.compile(r"\b(XY|XZ|YZ):\s*([^\s,]+)")
_COMMENT = re.compile(r"/\*.*?(?:\*/|$)|//[^\n]*", re.DOTALL)


def _is_marlin(head: str, name: str) -> bool:
    match = re.search(
        r"^(?:> ?)?(?:Recv:\s*+)?(?:echo:\s*+)?M852\b|SKEW_CORRECTION|Skew Factor:",
        head,
        re.MULTILINE,
    )
    return match is not None or (name.endswith("Configuration.h") and "#define" in head)


def _marlin_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    factors: Settings = {}
    defined: dict[str, Settings] = {}
    notes: list[str] = []
    for source in sources:
        switches = _read_marlin(source, factors, defined, notes)
        if defined and "SKEW_CORRECTION" not in switches:
            at, _ = next(iter(next(iter(defined.values())).values()))
            expected = "#define SKEW_CORRECTION, not commented out"
            at.refuse("Marlin does not use these lengths", expected)
        if "SKEW_CORRECTION_FOR_Z" not in switches:
            for plane in [plane for plane in defined if plane != "XY"]:
                del defined[plane]
                notes.append(f"{plane}: ignored, SKEW_CORRECTION_FOR_Z is not defined")
        for plane, settings in defined.items():
            factors[plane] = _defined_factor(plane, settings, defined, notes)
        for plane, (at, factor) in factors.items():
            if abs(factor) > MAX_FACTOR:
                at.refuse(f"factor {factor:g} of {plane}", f"at most ±{MAX_FACTOR:g}")
            for axis in plane:
                options.axis_named(axis, at)
    if not factors:
        sources[0].refuse("has no skew factors", "M852 I… J… K… or XY_SKEW_FACTOR")
    skew = skew_term({plane: factor for plane, (_, factor) in factors.items()})
    return Tables((skew,), (), tuple(notes), ("mm", "rad"))


def _read_marlin(
    source: Source, factors: Settings, defined: dict[str, Settings], notes: list[str]
) -> set[str]:
    """Read the factors of M852 and the lengths by plane; return the switches that are defined."""
    switches: set[str] = set()
    unread: list[SourceLine] = []
    text = _COMMENT.sub(lambda comment: "\n" * comment[0].count("\n"), source.text)
    for at, line in replace(source, lines=tuple(text.split("\n"))).scan(";"):
        bare = _ECHO.sub("", line)
        switch, define = _SWITCH.match(bare), _DEFINE.match(bare)
        if switch:
            switches.add(switch[1])
        elif define:
            number = at.number(define[3].rstrip("f"), define[2])
            settings = defined.setdefault(define[1], {})
            if define[2] in settings:
                at.refuse(f"{define[1]}_{define[2]} is defined twice", "it once")
            settings[define[2]] = (at, number)
        elif bare.startswith("Skew Factor:"):
            if _REPORTED.sub("", bare.partition(":")[2]).strip():
                at.refuse(at.quoted, "XY: number XZ: number YZ: number")
            for plane, number in _REPORTED.findall(bare):
                factors[plane] = (at, at.number(number, plane))
        elif re.match(r"M852\b", bare):
            planes: set[str] = set()
            for letter, factor in _parameters(at, bare, LETTERS).items():
                plane = LETTERS[letter]
                if plane in planes:
                    at.refuse(f"M852 sets {plane} twice", "it once")
                planes.add(plane)
                factors[plane] = (at, factor)
        elif not _IDLE.match(line):
            unread.append(at)
    notes += unread_notes(unread)
    return switches


def _parameters(at: SourceLine, command: str, letters: Collection[str]) -> dict[str, float]:
    """Read the letters of a command with their numbers, each once."""
    name, text = command[:4], command[4:]
    parameters = _WORD.findall(text)
    numbers = {letter: at.number(number, f"{name} {letter}") for letter, number in parameters}
    is_unknown = _WORD.sub("", text).strip() or not numbers.keys() <= {*letters}
    if is_unknown or len(numbers) < len(parameters):
        *before, last = letters
        at.refuse(at.quoted, f"{name} with {', '.join(before)} or {last}, each once")
    return numbers


def _defined_factor(
    plane: str, settings: Settings, defined: Mapping[str, Settings], notes: list[str]
) -> tuple[SourceLine, float]:
    if "SKEW_FACTOR" in settings:
        at, factor = settings["SKEW_FACTOR"]
        lengths = ", ".join(f"{plane}_{name}" for name in settings if name != "SKEW_FACTOR")
        if lengths:
            notes.append(f"{plane}_SKEW_FACTOR {factor:g} overrides {lengths}, as in Marlin")
        return at, factor
    side = settings.get("SIDE_AD")
    if side is None and plane == "XZ":
        side = defined.get("XY", {}).get("SIDE_AD")
    if side is None or not {"DIAG_AC", "DIAG_BD"} <= settings.keys():
        at, _ = next(iter(settings.values()))
        at.refuse(f"{plane}: {', '.join(settings)}", f"{plane}_DIAG_AC, {plane}_DIAG_BD and a side")
    at, ac = settings["DIAG_AC"]
    lengths = (ac, settings["DIAG_BD"][1], side[1])
    return at, factor_of_part(lengths, at, plane, notes)


def _write_marlin(corrections: RequiredCorrections) -> Files:
    factors = fitted_factors(corrections)
    parameters = [
        f"{letter}{format_number(float(corrections.round(factors[plane])), DIGITS)}"
        for letter, plane in zip("IJK", PLANES, strict=True)
    ]
    head = format_comment("; ", corrections.scene.title)
    head += "\n; SKEW_CORRECTION_FOR_Z and SKEW_CORRECTION_GCODE must be enabled\n"
    return {"": f"{head}M852 {' '.join(parameters)}\n"}


TANGENTS = {"X": ("X", "Y"), "Y": ("Y", "Z"), "Z": ("X", "Z")}
"""Corrected axis and axis of the position of each letter of M556."""


def _read_m556(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read M556 of RepRapFirmware, Move::AxisTransform: X += tan XY·Y + tan XZ·Z."""
    matrix = np.zeros((3, 3))
    is_empty = True
    notes: list[str] = []
    for source in sources:
        unread: list[SourceLine] = []
        for at, bare in source.scan(";"):
            command = bare.upper()
            if not re.match(r"M556\s*[A-Z]", command):
                unread.append(at)
                continue
            numbers = _parameters(at, command, "SXYZP")
            length = numbers.pop("S", 0.0)
            if length <= 0.0:
                at.refuse(
                    f"{at.quoted} without a length", "S above 0, the length of the part in mm"
                )
            is_reversed = bool(at.integer(str(numbers.pop("P", 0.0)), "M556 P", 0, 1))
            for letter, deviation in numbers.items():
                row, column = TANGENTS[letter][:: -1 if is_reversed and letter == "X" else 1]
                if abs(deviation) > MAX_FACTOR * length:
                    at.refuse(f"{letter}{deviation:g} over S{length:g}", "a deviation below S")
                for axis in (row, column):
                    options.axis_named(axis, at)
                matrix[AXES.index(row), AXES.index(column)] = deviation / length
            is_empty = False
        notes += unread_notes(unread)
    if is_empty:
        sources[0].refuse("has no axis compensation", "M556 S… X… Y… Z…")
    return Tables((Affine(AXES, tuple(map(tuple, matrix.tolist()))),), (), tuple(notes), ("mm",))


KLIPPER = Format(
    **describe("klipper"),
    limits=f"three factors: {', '.join(PLANES)}",
    recognise=has_pattern(r"SET_SKEW|\[skew_correction|\[axis_twist_compensation"),
    read=_read_klipper,
    tables=_klipper_tables,
    write=_write_klipper,
)
MARLIN = Format(
    **describe("marlin"), recognise=_is_marlin, tables=_marlin_tables, write=_write_marlin
)
REPRAP = Format(
    **describe("reprapfirmware"),
    recognise=has_pattern(r"(?i)^\s*M556\b"),
    tables=_read_m556,
)
FORMATS = (KLIPPER, MARLIN, REPRAP)
