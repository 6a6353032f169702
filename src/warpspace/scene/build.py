"""From a raw document to a scene: every section validated, everything cross-checked."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from warpspace.exceptions import SceneError, near_miss
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Model
from warpspace.machine.axes import is_linear
from warpspace.machine.description import Machine, Range, build_machine
from warpspace.machine.errors import ErrorFunction, ErrorSet
from warpspace.machine.limits import MAX_ERROR
from warpspace.machine.parameters import PARAMETERS
from warpspace.machine.tolerances import TOLERANCE_CLASSES, Tolerance, ToleranceSet
from warpspace.scene.bodies import body_notes, read_bodies
from warpspace.scene.conventions import component_orders, measuring_lines
from warpspace.scene.curves import read_curve
from warpspace.scene.guides import is_guides, read_guides
from warpspace.scene.measurements import read_measurements, read_uncertainties
from warpspace.scene.model import Scene
from warpspace.scene.notation import Notation, read_errors
from warpspace.scene.notes import scene_notes
from warpspace.scene.sections import Problems
from warpspace.scene.volume import read_workspace

SECTIONS = (
    "title",
    "description",
    "machine",
    "bodies",
    "convention",
    "workspace",
    "points_mm",
    "errors",
    "tolerances",
    "uncertainty",
    "measured",
    "view",
)
Raw = Mapping[str, object]
STAND_IN = build_machine("wFXYZABCt")
"""Has every axis there is: with it the rest of a document is checked whose machine is unusable."""


def build_scene(
    raw: Raw,
    name: str,
    source: str,
    machine: Machine | None,
    folder: Path | None,
    problems: Problems,
) -> Scene:
    """Build a scene from a parsed document.

    Parameters
    ----------
    raw : mapping of str to object
        The document.
    name : str
        Name of the scene.
    source : str
        What the document is called in messages.
    machine : Machine or None
        The machine of the scene; None where it is unusable, which is among the problems.
    folder : Path or None
        Folder that CSV names are relative to; None where CSV files are not allowed.
    problems : Problems
        What was found so far.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        With all problems of the document.
    """
    for key in raw:
        if key not in SECTIONS:
            problems.unknown("", key, SECTIONS, "key")
    if machine is not None and "bodies" in raw:
        own = read_bodies(raw["bodies"], machine, folder, problems)
        machine = replace(machine, bodies={**machine.bodies, **own})
    machine = machine or STAND_IN
    texts = {
        key: problems.validate("text", key, raw[key])
        for key in ("title", "description")
        if key in raw
    }
    convention = problems.validate("convention", "convention", raw.get("convention", {}))
    points = problems.validate("points_mm", "points_mm", raw.get("points_mm", {}))
    view = problems.validate("view", "view", raw.get("view", {}))
    workspace = read_workspace(problems.table("workspace", raw.get("workspace")), machine, problems)
    fixed = getattr(convention, "reference_axis", "free") == "fixed"
    refused = machine.reference_keys if fixed else ()
    spans = _spans(machine, workspace)
    errors = _errors(raw.get("errors"), machine, refused, spans, folder, problems)
    tolerances = _tolerances(raw.get("tolerances"), machine, refused, problems)
    uncertainty = read_uncertainties(
        _known_parameters(raw.get("uncertainty"), "uncertainty", machine, refused, problems),
        spans,
        folder,
        problems,
    )
    measured = read_measurements(
        _known_parameters(raw.get("measured"), "measured", machine, refused, problems),
        folder,
        problems,
    )
    reference = _reference(view, workspace, problems)
    order, own_orders = component_orders(convention, machine, problems)
    lines = measuring_lines(convention, machine, problems)
    if problems.lines:
        raise SceneError(source, problems.lines)
    points_mm = (points.tool, points.workpiece)
    model = Model(machine, order, *points_mm, own_orders, convention.direction)
    notation = Notation(convention.squareness, lines)
    errors = read_errors(model, errors, workspace, notation, source)
    return Scene(
        name=name,
        title=texts.get("title") or name,
        model=model,
        workspace=workspace,
        errors=errors,
        tolerances=tolerances,
        trace_points_mm=tuple(points.traces),
        exaggeration=None if view.exaggeration == "auto" else float(view.exaggeration),
        reference=reference,
        description=texts.get("description") or "",
        notes=(
            *scene_notes(machine, workspace, errors),
            *body_notes(machine),
        ),
        uncertainty=uncertainty,
        measured=measured,
    )


def _known_parameters(
    raw: object, section: str, machine: Machine, refused: Sequence[str], problems: Problems
) -> Raw:
    """Give the entries of a table whose keys are parameters of the machine.

    Refused are the rotations of the reference axis, nearly always a slip, unless the file frees it.
    """
    known: dict[str, object] = {}
    for key, value in problems.table(section, raw).items():
        if section == "tolerances" and key == "default":
            continue
        if key not in PARAMETERS:
            problems.unknown(section, key, machine.allowed_keys, "error parameter")
        elif key not in machine.allowed_keys:
            axis = PARAMETERS[key].axis
            problems.add(f"{section}.{key}", f"the machine {machine.chain} has no axis {axis}")
        else:
            known[key] = value
        if key in refused:
            reference = PARAMETERS[key].axis
            usual = [name for name in machine.parameter_keys if PARAMETERS[name].is_constant]
            problems.add(
                f"{section}.{key}",
                f"is zero by definition of the frame, {reference} being the reference axis"
                f'{near_miss(key, usual)} ([convention] reference_axis = "free" allows it)',
                value,
            )
    return known


def _spans(machine: Machine, workspace: Workspace) -> dict[str, Range]:
    """Give the range over which curves of each axis run, see `Scene.axis_span`."""
    return {
        name: (low, high) if low < high else machine.axes[name].travel
        for name, (low, high) in workspace.ranges.items()
    }


def _errors(
    raw: object,
    machine: Machine,
    refused: Sequence[str],
    spans: Mapping[str, Range],
    folder: Path | None,
    problems: Problems,
) -> ErrorSet:
    """Read the error functions, each over the range of its axis."""
    found: dict[str, ErrorFunction] = {}
    for key, value in _known_parameters(raw, "errors", machine, refused, problems).items():
        where, row = f"errors.{key}", PARAMETERS[key]
        span = spans[row.axis]
        if is_guides(value):
            given = {name for name in problems.table("", raw) if name != key}
            curves = read_guides(key, value, span, where, folder, problems, machine, given)
        else:
            curve = read_curve(
                value,
                span,
                where,
                folder,
                problems,
                constant=row.is_constant,
                axis=row.axis,
                axes=machine.axes,
            )
            curves = {} if curve is None else {key: curve}
        for name, function in curves.items():
            peak = function.amplitude
            if machine is not STAND_IN and not abs(peak) <= MAX_ERROR:
                which = "" if name == key else f"gives {name}, which "
                problems.add(
                    where,
                    f"{which}reaches {peak:g} {PARAMETERS[name].unit} within {span[0]:g} …"
                    f" {span[1]:g}; expected at most ±{MAX_ERROR:g}",
                )
        found |= curves
    return ErrorSet(found)


def _tolerances(
    raw: object, machine: Machine, refused: Sequence[str], problems: Problems
) -> ToleranceSet:
    """Read the tolerance set."""
    table = problems.table("tolerances", raw)
    default: dict[str, float] = {}
    if "default" in table:
        section = problems.validate("default", "tolerances.default", table["default"])
        if section is not None:
            values = {name: getattr(section, name) for name in TOLERANCE_CLASSES}
            default = {name: value for name, value in values.items() if value is not None}
    own: dict[str, Tolerance] = {}
    for key, value in _known_parameters(table, "tolerances", machine, refused, problems).items():
        valid = problems.validate("tolerance", f"tolerances.{key}", value)
        if valid is not None:
            narrow = isinstance(valid, float | int)
            own[key] = (
                Tolerance(0.0, float(valid))
                if narrow
                else Tolerance(valid.centre, valid.half_width)
            )
    return ToleranceSet(default, own)


def _reference(view: Any, workspace: Workspace, problems: Problems) -> dict[str, float] | None:
    """Read the point held still: a linear axis that is not given stands in its middle."""
    if view is None or view.reference == "absolute":
        return None
    for axis in view.reference:
        if axis not in workspace.ranges:
            problems.unknown("view.reference", axis, workspace.ranges, "axis of this machine")
    spanning = workspace.volume_axes
    middle = {
        name: q for name, q in workspace.positions.items() if is_linear(name) or name in spanning
    }
    return {**middle, **view.reference}
