"""Scenes back into the file format: the text reloads to the identical scene."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import cast

import tomli_w

from warpspace.exceptions import SceneError
from warpspace.machine.body_source import BodySource
from warpspace.machine.description import ORIGIN, Machine, default_travel
from warpspace.machine.limits import MIN_NUMBER
from warpspace.machine.parameters import PARAMETERS, Parameter
from warpspace.machine.tolerances import Tolerance
from warpspace.machine.travel import TravelDirection
from warpspace.scene.machines import load_machine, machine_names
from warpspace.scene.model import Scene
from warpspace.scene.notation import Notation, write_errors

_WRAP = 8
"""Entries of a list that stand on one line."""


def scene_to_toml(scene: Scene, notation: Notation | None = None) -> str:
    """Spell a scene as the text of a scene file.

    Parameters
    ----------
    scene : Scene
    notation : Notation, optional
        Convention that the numbers of the errors are written in, and that the text then says; that
        of the program by default.

    Returns
    -------
    str
        TOML. A bundled machine is named, any other is written inline; errors that came from CSV
        files are written as tables, so that the text needs no other file.

    Notes
    -----
    `warpspace.scene.library.parse_scene` with the same name gives an equal scene back, every number
    to the last bit. One thing the format cannot say is a ramp over another range than that of its
    axis in the working volume; it is written as the polynomial it is.
    """
    known = _bundled(scene.machine)
    notation = notation or Notation()
    scene = replace(scene, errors=write_errors(scene, notation))
    head: dict[str, object] = {"title": scene.title}
    if known is not None:
        head["machine"] = scene.machine.name
    if scene.description:
        head["description"] = scene.description
    parts = [tomli_w.dumps(head, multiline_strings="\r" not in scene.description)]
    if known is None:
        parts += _machine_sections(scene.machine)
    parts.append(_bodies_section(scene.machine, known))
    convention: dict[str, object] = {"component_errors": scene.model.convention_value}
    if {*scene.machine.reference_keys} & {*scene.errors, *scene.tolerances.own}:
        convention["reference_axis"] = "free"
    if scene.model.direction != TravelDirection.MEAN:
        convention["direction"] = str(scene.model.direction)
    convention |= notation.to_toml()
    parts.append(_section("convention", convention))
    ranges = {
        axis: low if low == high else [low, high]
        for axis, (low, high) in scene.workspace.ranges.items()
    }
    parts.append(_section("workspace", ranges))
    points = {
        "tool": scene.model.tool_point_mm,
        "workpiece": scene.model.workpiece_point_mm,
        "traces": scene.trace_points_mm,
    }
    parts.append(_section("points_mm", points))
    parts += [_errors_section(scene), _tolerances_section(scene)]
    uncertain = {key: function.to_toml() for key, function in scene.uncertainty.items()}
    parts.append(_section("uncertainty", uncertain, PARAMETERS))
    for key, measurement in scene.measured.items():
        runs = [asdict(run) for run in measurement.runs]
        parts.append(_section(f"measured.{key}", {"runs": runs}))
    view = {
        "exaggeration": "auto" if scene.exaggeration is None else scene.exaggeration,
        "reference": "absolute" if scene.reference is None else scene.reference,
    }
    parts.append(_section("view", view))
    return "\n".join(part for part in parts if part)


def _bundled(machine: Machine) -> Machine | None:
    """Give the bundled machine that need only be named; None where there is none such."""
    if machine.name not in machine_names():
        return None
    try:
        known = load_machine(machine.name)
    except SceneError:
        return None
    return known if replace(known, bodies=machine.bodies) == machine else None


def _bodies_section(machine: Machine, known: Machine | None) -> str:
    """Spell the bodies that are not those of the bundled machine."""
    values: dict[str, object] = {}
    for frame, source in machine.bodies.items():
        if known is not None and known.bodies.get(frame) == source:
            continue
        plain = BodySource(source.file, source.path)
        entries = asdict(source)
        del entries["path"]
        values[frame] = source.file if source == plain else {k: v for k, v in entries.items() if v}
    return _section("bodies", values)


def _machine_sections(machine: Machine) -> list[str]:
    """Spell a machine inline."""
    offsets = {name: axis.offset_mm for name, axis in machine.axes.items()} | dict(machine.fixed_mm)
    turned = {name: axis.rotation_deg for name, axis in machine.axes.items()}
    turned |= dict(machine.fixed_deg)
    travel = {
        name: axis.travel
        for name, axis in machine.axes.items()
        if axis.travel != default_travel(name)
    }
    direction = {name: axis.direction for name, axis in machine.axes.items() if axis.direction != 1}
    gantry = {
        name: {"span_mm": one.span_mm, "across": one.across}
        for name, one in machine.gantries.items()
    }
    source = {"source": machine.source} if machine.source else {}
    return [
        _section("machine", {"title": machine.title, "chain": str(machine.chain)} | source),
        _section("machine.offset_mm", {k: v for k, v in offsets.items() if v != ORIGIN}),
        _section("machine.rotation_deg", {k: v for k, v in turned.items() if v != ORIGIN}),
        _section("machine.travel", travel),
        _section("machine.direction", direction),
        _section("machine.gantry", gantry),
    ]


def _errors_section(scene: Scene) -> str:
    """Spell the error functions, each with its thesis symbol and unit behind it."""
    values = {key: _function(scene, key) for key in scene.errors}
    return _section("errors", values, PARAMETERS)


def _function(scene: Scene, key: str) -> object:
    """Spell one error function."""
    span = scene.axis_span(PARAMETERS[key].axis)
    return scene.errors.functions[key].for_span(span).to_toml()


def _tolerances_section(scene: Scene) -> str:
    """Spell the tolerance set."""
    values: dict[str, object] = {}
    if scene.tolerances.default:
        values["default"] = scene.tolerances.default
    for key, own in scene.tolerances.own.items():
        values[key] = (
            own.half_width
            if own == Tolerance(0.0, own.half_width)
            else {
                "centre": own.centre,
                "half_width": own.half_width,
            }
        )
    return _section("tolerances", values, PARAMETERS)


def _section(
    name: str, values: Mapping[str, object], remarks: Mapping[str, Parameter] | None = None
) -> str:
    """Spell a table with one entry a line; empty where there is none."""
    if not values:
        return ""
    lines = [f"[{name}]"]
    for key, value in values.items():
        row = (remarks or {}).get(key)
        remark = f"  # {row.symbol}, {row.name}, {row.unit}" if row else ""
        lines.append(f"{key} = {_inline(value)}{remark}")
    return "\n".join(lines) + "\n"


def _inline(value: object) -> str:
    """Spell a value on one line (a long list on several)."""
    if isinstance(value, Mapping):
        table = cast("Mapping[str, object]", value)
        return "{ " + ", ".join(f"{key} = {_inline(entry)}" for key, entry in table.items()) + " }"
    if isinstance(value, (list, tuple)):
        entries = [_inline(entry) for entry in cast("Sequence[object]", value)]
        if len(entries) <= _WRAP:
            return "[" + ", ".join(entries) + "]"
        return "[\n" + "".join(f"  {entry},\n" for entry in entries) + "]"
    if isinstance(value, str):
        return tomli_w.dumps({"value": value}).split("=", 1)[1].strip()
    if isinstance(value, int):
        return repr(value)
    number = float(cast("float", value))
    # a scaled curve may hold numbers so small that no reader takes them
    return repr(0.0 if 0.0 < abs(number) < MIN_NUMBER else number)
