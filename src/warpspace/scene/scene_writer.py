"""Writer of scene files: the text is read back as the identical scene, in any notation."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from io import BytesIO
from math import isinf
from typing import cast

import numpy as np
import tomli_w
from numpy.typing import ArrayLike

from warpspace.exceptions import OptionError, SceneError
from warpspace.field.grid import Workspace
from warpspace.kinematics.conversion import SquarenessSign, convert_squareness, move_measuring_line
from warpspace.kinematics.model import Model
from warpspace.machine.axes import PARAMETERS, Parameter, TravelDirection, parameter
from warpspace.machine.curves.curve import Span
from warpspace.machine.definition import ORIGIN, BodySource, Machine, Vector, default_travel
from warpspace.machine.errors import Constant, Covariance, ErrorSet
from warpspace.machine.limits import MIN_NUMBER
from warpspace.scene.machine_library import load_machine, machine_names
from warpspace.scene.model import Scene, curve_span
from warpspace.scene.notes import Note, note_to_toml
from warpspace.scene.text_files import spell_key


@dataclass(frozen=True, slots=True)
class Notation:
    """Notation of errors in a scene file."""

    # sign convention of squareness, one of `SquarenessSign`
    squareness: str = SquarenessSign.RIGHT_HAND
    # per axis the point of its moving body, in the frame of the axis, whose displacement its
    # translations are; axes left out have the origin of their frame
    measuring_line_mm: Mapping[str, Vector] = field(default_factory=dict[str, Vector])

    def to_toml(self) -> dict[str, object]:
        entries: dict[str, object] = {}
        if self.squareness != SquarenessSign.RIGHT_HAND:
            entries["squareness"] = str(self.squareness)
        if self.measuring_line_mm:
            lines = {axis: list(place) for axis, place in self.measuring_line_mm.items()}
            entries["measuring_line_mm"] = lines
        return entries


def covered_spans(model: Model, workspace: Workspace) -> dict[str, Span]:
    """Return the range of each axis, mm or degrees, that covers travel and volume."""
    spans: dict[str, Span] = {}
    for name, axis in model.machine.axes.items():
        low, high = workspace.ranges.get(name, axis.travel)
        spans[name] = (min(low, axis.travel[0]), max(high, axis.travel[1]))
    return spans


def extend_to_ranges(errors: ErrorSet, model: Model, workspace: Workspace) -> ErrorSet:
    """Return errors whose curves have the ranges of a scene, with the same values."""
    functions = dict(errors.functions)
    for key, function in errors.functions.items():
        span = curve_span(model.machine, workspace, parameter(key).axis)
        if function.span != span:
            functions[key] = replace(function.for_span(span), span=span)
    return ErrorSet(functions)


def read_errors(
    model: Model, errors: ErrorSet, workspace: Workspace, notation: Notation, source: str
) -> ErrorSet:
    errors = convert_squareness(model.machine, errors, notation.squareness)
    try:
        return _move_errors(model, errors, workspace, notation, to_origin=True)
    except OptionError as error:
        raise SceneError(source, [f"convention.measuring_line_mm: {error}"]) from None


def write_errors(scene: Scene, notation: Notation) -> ErrorSet:
    moved = _move_errors(scene.model, scene.errors, scene.workspace, notation, to_origin=False)
    return convert_squareness(scene.machine, moved, notation.squareness)


def _move_errors(
    model: Model, errors: ErrorSet, workspace: Workspace, notation: Notation, *, to_origin: bool
) -> ErrorSet:
    lines = notation.measuring_line_mm
    if not lines:
        return errors
    spans = covered_spans(model, workspace)
    moved = move_measuring_line(model, errors, spans, lines, to_origin=to_origin)
    return extend_to_ranges(moved, model, workspace)


def convert_covariance(
    machine: Machine, covariance: Covariance | None, sign: SquarenessSign | str
) -> Covariance | None:
    """Convert a covariance to another sign of squareness, or back."""
    if covariance is None:
        return None
    ones = ErrorSet({key: Constant((0.0, 1.0), 1.0) for key in covariance.keys})
    converted = convert_squareness(machine, ones, sign)
    signs = [converted.amplitude(key) for key in covariance.keys]
    matrix = covariance.matrix * np.outer(signs, signs)
    return replace(covariance, rows=tuple(map(tuple, matrix.tolist())))


MAX_INLINE_ERRORS = 30  # errors whose covariance is written in the scene itself
_WRAP = 8  # entries of a list on one line


def scene_files(scene: Scene, stem: str) -> dict[str, str | bytes]:
    """Write a scene as files by their endings; a large covariance is a file of its own."""
    joint = convert_covariance(scene.machine, scene.covariance, Notation().squareness)
    if joint is None or len(joint.keys) <= MAX_INLINE_ERRORS:
        return {"": scene_to_toml(scene)}
    packed = BytesIO()
    np.savez_compressed(packed, keys=joint.keys, matrix=joint.matrix)
    text = scene_to_toml(scene, matrix=f"{stem}.npz")
    return {"": text, ".npz": packed.getvalue()}


def matrix_digest(matrix: ArrayLike) -> str:
    """Compute the SHA-256 of a matrix in a file of its own."""
    from hashlib import sha256  # slow to import, and few scenes have one

    return sha256(np.asarray(matrix, "<f8").tobytes()).hexdigest()


def scene_to_toml(scene: Scene, notation: Notation | None = None, matrix: str = "") -> str:
    """Write a scene as the text of a scene file.

    Notes
    -----
    `warpspace.scene.library.parse_scene` with the same name gives an equal scene back, every number
    to the last bit. A ramp over another range than that of its axis in the working
    volume is written as a polynomial.
    """
    bundled = _bundled(scene.machine)
    notation = notation or Notation()
    scene = replace(scene, errors=write_errors(scene, notation))
    head: dict[str, object] = {"title": scene.title}
    if bundled is not None:
        head["machine"] = scene.machine.name
    if scene.description:
        head["description"] = scene.description
    parts = [tomli_w.dumps(head, multiline_strings="\r" not in scene.description)]
    if bundled is None:
        parts += _machine_sections(scene.machine)
    parts.append(_bodies_section(scene.machine, bundled))
    convention: dict[str, object] = {"component_errors": scene.model.convention_value}
    if {*scene.machine.reference_keys} & {*scene.errors, *scene.tolerances.individual}:
        convention["reference_axis"] = "free"
    if scene.model.direction != TravelDirection.MEAN:
        convention["direction"] = str(scene.model.direction)
    convention |= notation.to_toml()
    parts.append(spell_section("convention", convention))
    parts.append(spell_section("workspace", _ranges(scene.workspace.ranges)))
    points = {
        "tool": scene.model.tool_point_mm,
        "workpiece": scene.model.workpiece_point_mm,
        "traces": scene.trace_points_mm,
    }
    parts.append(spell_section("points_mm", points))
    functions = {
        key: function.for_span(scene.axis_span(PARAMETERS[key].axis)).to_toml()
        for key, function in scene.errors.functions.items()
    }
    parts += [spell_section("errors", functions, PARAMETERS), _tolerances_section(scene)]
    joint = convert_covariance(scene.machine, scene.covariance, notation.squareness)
    uncertain = {key: function.to_toml() for key, function in scene.uncertainty.items()}
    parts.append(spell_section("uncertainty", uncertain | _covariance(joint, matrix), PARAMETERS))
    for key, measurement in scene.measured.items():
        runs = [asdict(run) for run in measurement.runs]
        parts.append(spell_section(f"measured.{key}", {"runs": runs}))
    view = {
        "exaggeration": "auto" if scene.exaggeration is None else scene.exaggeration,
        "reference": "absolute" if scene.reference is None else scene.reference,
        **({"placed": True} if scene.placed else {}),
        **({} if scene.limit_um is None else {"limit_um": scene.limit_um}),
    }
    parts.append(spell_section("view", view))
    part = asdict(replace(scene.part, folder=""))
    parts.append(spell_section("part", {name: value for name, value in part.items() if value}))
    parts += map(spell_note, scene.review)
    return "\n".join(part for part in parts if part)


def _covariance(covariance: Covariance | None, matrix: str) -> dict[str, object]:
    """Return the entries of a covariance: the file of its matrix, or its lower triangle."""
    if covariance is None:
        return {}
    values: dict[str, object] = {
        "keys": covariance.keys,
        "sha256": matrix_digest(covariance.matrix) if matrix else "",
        "matrix": matrix or [row[: at + 1] for at, row in enumerate(covariance.rows)],
        "dof": 0.0 if isinf(covariance.dof) else covariance.dof,
        "measured_range": _ranges(covariance.measured_range),
        "undetermined": covariance.undetermined,
        "lack_of_fit": covariance.lack_of_fit,
    }
    return {"covariance": {name: value for name, value in values.items() if value}}


def _ranges(ranges: Mapping[str, Span]) -> dict[str, object]:
    return {axis: low if low == high else [low, high] for axis, (low, high) in ranges.items()}


def spell_note(note: Note) -> str:
    """Write a note as a table of a scene file, one entry per line."""
    return spell_section("[notes]", note_to_toml(note))


def _bundled(machine: Machine) -> Machine | None:
    if machine.name not in machine_names():
        return None
    try:
        bundled = load_machine(machine.name)
    except SceneError:
        return None
    return bundled if replace(bundled, bodies=machine.bodies) == machine else None


def _bodies_section(machine: Machine, bundled: Machine | None) -> str:
    values: dict[str, object] = {}
    for frame, source in machine.bodies.items():
        if bundled is not None and bundled.bodies.get(frame) == source:
            continue
        plain = BodySource(source.file, source.path)
        entries = asdict(source)
        del entries["path"]
        values[frame] = source.file if source == plain else {k: v for k, v in entries.items() if v}
    return spell_section("bodies", values)


def _machine_sections(machine: Machine) -> list[str]:
    offsets = {name: axis.offset_mm for name, axis in machine.axes.items()} | dict(machine.fixed_mm)
    turned = {name: axis.rotation_deg for name, axis in machine.axes.items()}
    turned |= dict(machine.fixed_deg)
    travel = {
        name: axis.travel
        for name, axis in machine.axes.items()
        if axis.travel != default_travel(name)
    }
    direction = {
        name: axis.direction
        for name, axis in machine.axes.items()
        if axis.direction != 1 or axis.direction_given
    }
    gantry = {
        name: {"span_mm": one.span_mm, "across": one.across}
        for name, one in machine.gantries.items()
    }
    source = {"source": machine.source} if machine.source else {}
    return [
        spell_section("machine", {"title": machine.title, "chain": str(machine.chain)} | source),
        spell_section("machine.offset_mm", {k: v for k, v in offsets.items() if v != ORIGIN}),
        spell_section("machine.rotation_deg", {k: v for k, v in turned.items() if v != ORIGIN}),
        spell_section("machine.travel", travel),
        spell_section("machine.direction", direction),
        spell_section("machine.gantry", gantry),
        spell_section("machine.columns", machine.columns),
        *(
            spell_section("[machine.adjusters]", {k: v for k, v in asdict(one).items() if v})
            for one in machine.adjusters
        ),
    ]


def _tolerances_section(scene: Scene) -> str:
    values: dict[str, object] = {}
    if scene.tolerances.default:
        values["default"] = scene.tolerances.default
    for key, tolerance in scene.tolerances.individual.items():
        values[key] = asdict(tolerance) if tolerance.centre else tolerance.half_width
    return spell_section("tolerances", values, PARAMETERS)


def spell_section(
    name: str, values: Mapping[str, object], remarks: Mapping[str, Parameter] | None = None
) -> str:
    """Write a table of a scene file; an empty text for an empty table."""
    if not values:
        return ""
    lines = [f"[{name}]"]
    for key, value in values.items():
        row = (remarks or {}).get(key)
        remark = f"  # {row.symbol}, {row.name}, {row.unit}" if row else ""
        lines.append(f"{key} = {_inline(value)}{remark}")
    return "\n".join(lines) + "\n"


def _inline(value: object) -> str:
    if isinstance(value, Mapping):
        table = cast("Mapping[str, object]", value)
        pairs = ", ".join(f"{spell_key(key)} = {_inline(entry)}" for key, entry in table.items())
        return f"{{ {pairs} }}"
    if isinstance(value, (list, tuple)):
        entries = [_inline(entry) for entry in cast("Sequence[object]", value)]
        if len(entries) <= _WRAP:
            return "[" + ", ".join(entries) + "]"
        return "[\n" + "".join(f"  {entry},\n" for entry in entries) + "]"
    if isinstance(value, datetime):
        return value.isoformat().replace("+00:00", "Z")
    if isinstance(value, str):
        return tomli_w.dumps({"value": value}).split("=", 1)[1].strip()
    if isinstance(value, int):
        return repr(value).lower()
    number = float(cast("float", value))
    # numbers of scaled curves may be too small for readers
    return repr(0.0 if 0.0 < abs(number) < MIN_NUMBER else number)
