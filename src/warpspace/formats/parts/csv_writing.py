"""Measurement tables written: one to fill in, and those of the errors of a scene."""

from collections.abc import Sequence

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files
from warpspace.formats.measured import BACKWARD, FORWARD, Plane
from warpspace.formats.numbers import spell
from warpspace.formats.parts.csv_header import DIRECTION, RUN
from warpspace.formats.parts.parametric import sampled, table_of, zero_key
from warpspace.machine.axes import is_linear
from warpspace.machine.parameters import parameter

DIGITS = 6
"""Behind the point of a value, µm or µrad."""


def usual_places(axis: str) -> tuple[float, ...]:
    """Give positions of a table to fill in, mm or degrees."""
    return (-250, -125, 0, 125, 250) if is_linear(axis) else (0, 90, 180, 270, 360)


def surface_template(axes: tuple[str, str], places: tuple[Sequence[float], Sequence[float]]) -> str:
    """Write a table to fill in for the errors of the first axis over it and a second one."""
    axis, other = axes
    keys = [f"E{letter}{axis}" for letter in "XYZABC"]
    heads = [f"{name} [{'mm' if is_linear(name) else 'deg'}]" for name in axes]
    units = ["urad" if parameter(key).is_rotation else "um" for key in keys]
    lines = [
        f"# Errors of the {axis} axis over {axis} and {other}: actual - nominal, a row a point.",
        "# Units stand in brackets and may be changed: um mm nm in, urad mrad rad arcsec deg.",
        "# Every point of the grid stands there once, in any order; between them the value is",
        "# bilinear, beyond them that of the edge. Columns that are not needed may be left out.",
        *(f"# {key}: {parameter(key).name}" for key in keys),
        ",".join([*heads, *(f"{key} [{unit}]" for key, unit in zip(keys, units, strict=True))]),
    ]
    blank = "," * len(keys)
    lines += [f"{first:g},{second:g}{blank}" for first in places[0] for second in places[1]]
    return "\n".join(lines) + "\n"


def template(axis: str, places: Sequence[float] = ()) -> str:
    """Write a table to fill in for an axis."""
    linear = is_linear(axis)
    keys = [f"E{letter}{axis}" for letter in "XYZABC"]
    spans = places or usual_places(axis)
    unit = {key: "urad" if parameter(key).is_rotation else "um" for key in keys}
    header = [
        f"{axis} [{'mm' if linear else 'deg'}]",
        RUN,
        DIRECTION,
        *(f"{key} [{unit[key]}]" for key in keys),
        *(f"u({key}) [{unit[key]}]" for key in keys),
    ]
    lines = [
        f"# Errors of the {axis} axis: actual - nominal, a row a position of a run.",
        "# Units stand in brackets and may be changed: um mm nm in, urad mrad rad arcsec deg.",
        "# run: 1, 2, 3 …; direction: + towards growing positions, - towards falling ones.",
        "# u(…): standard uncertainties (k = 1). Columns that are not needed may be left out.",
        *(f"# {key}: {parameter(key).name}" for key in keys),
        ",".join(header),
    ]
    blank = "," * (2 * len(keys))
    for direction, ordered in (("+", spans), ("-", tuple(reversed(spans)))):
        lines += [f"{q:g},1,{direction}{blank}" for q in ordered]
    return "\n".join(lines) + "\n"


def _surface(plane: Plane) -> str:
    """Spell an error over two axes: a row a point, the second axis fastest."""
    unit = "urad" if parameter(plane.key).is_rotation else "um"
    heads = [f"{axis} [{'mm' if is_linear(axis) else 'deg'}]" for axis in plane.axes]
    directed = [DIRECTION] if plane.backward else []
    lines = [",".join([*heads, *directed, f"{plane.key} [{unit}]"])]
    for sign, table in (("+", plane.values), ("-", plane.backward)):
        told = [sign] if directed else []
        for first, row in zip(plane.first, table, strict=False):
            lines += [
                ",".join([repr(first), repr(second), *told, spell(value, DIGITS)])
                for second, value in zip(plane.second, row, strict=True)
            ]
    return "\n".join(lines) + "\n"


def write(wanted: Wanted) -> Files:
    """Write the errors of a scene: constants in the main file, one file an axis beside it."""
    held = sampled(wanted)
    files: dict[str, str] = {}
    if held.constants:
        keys = list(held.constants)
        units = ["urad" if parameter(key).is_rotation else "um" for key in keys]
        head = ",".join(f"{key} [{unit}]" for key, unit in zip(keys, units, strict=True))
        files["_constant.csv"] = (
            head + "\n" + ",".join(spell(held.constants[key], DIGITS) for key in keys) + "\n"
        )
    for axis in dict.fromkeys(parameter(one.key).axis for one in held.series):
        rows = table_of([one for one in held.series if parameter(one.key).axis == axis])
        unit = "mm" if is_linear(axis) else "deg"
        heads = [f"{key} [{'urad' if parameter(key).is_rotation else 'um'}]" for key in rows.keys]
        lines = [",".join([f"{axis} [{unit}]", *([DIRECTION] if rows.directed else []), *heads])]
        for position, way, values in rows.rows:
            told = [{FORWARD: "+", BACKWARD: "-"}.get(way, "")] if rows.directed else []
            lines.append(",".join([repr(position), *told, *(spell(v, DIGITS) for v in values)]))
        files[f"_{axis}.csv"] = "\n".join(lines) + "\n"
    for plane in held.planes:
        files[f"_{plane.key}.csv"] = _surface(plane)
    names = list(files)
    if not names:
        key = zero_key(wanted.scene)
        return {"": f"{key} [{'urad' if parameter(key).is_rotation else 'um'}]\n0.0\n"}
    files[""] = files.pop(names[0])
    return files
