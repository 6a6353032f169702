"""Conversion of imported errors to a scene: curves, measuring runs and uncertainties."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from warpspace.exceptions import OptionError, SceneError
from warpspace.formats.measured import (
    BACKWARD,
    FORWARD,
    SIGNS,
    ErrorSeries,
    ErrorSurface,
    ImportedErrors,
)
from warpspace.formats.registry import Reading
from warpspace.kinematics.model import Model
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.simple import Constant, Directional
from warpspace.machine.curves.table import TableCurve, TwoArguments
from warpspace.machine.errors import Covariance, ErrorSet, Measurement, TravelRun
from warpspace.machine.limits import MAX_POINTS, MAX_SCENE_BYTES, MAX_TEXT, MIN_SPAN
from warpspace.scene.curve_reader import CurveReader
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.machine_library import machine_names
from warpspace.scene.model import Scene, coverage_notes
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.schema import Problems
from warpspace.scene.text_files import one_line, radian_notes

TRAVEL_TOLERANCE = 1e-6  # mm or degrees; tolerance of positions beyond the travel
IMPLAUSIBLE = {False: 1000.0, True: 5000.0}
"""µm of a translation and µrad of a rotation above which a note questions the unit of the file."""
T = TypeVar("T")


@dataclass(frozen=True)
class ImportedScene:
    """A scene with imported errors."""

    scene: Scene
    text: str  # of its file
    notes: tuple[str, ...]  # about replaced errors and assumptions


def base_scene(machine: str) -> Scene:
    """Load the scene for an import: a machine of the library, or a scene."""
    if machine in machine_names():
        return parse_scene(f'title = "{machine}"\nmachine = "{machine}"\n', machine)
    return load_scene(machine)


def default_scene(imported: ImportedErrors) -> Scene:
    other = [axis for axis in imported.axes if axis not in ("X", "Y", "Z")]
    if other:
        raise OptionError(
            f"the errors are of {', '.join(imported.axes)}; expected {{machine}}: the files do not"
            f" state the position of {other[0]} in the machine"
        )
    spans = {axis: ends for axis, ends in _ranges(imported).items() if ends[1] - ends[0] > MIN_SPAN}
    travel = "".join(f"{axis} = [{low!r}, {high!r}]\n" for axis, (low, high) in spans.items())
    text = f'title = "imported"\n[machine]\nchain = "wFXYZt"\n[machine.travel]\n{travel}'
    return parse_scene(text, "imported")


def build_imported_scene(
    reading: Reading, base: Scene | None, title: str, name: str
) -> ImportedScene:
    imported = reading.imported
    notes: list[str] = []
    if base is None:
        base = default_scene(imported)
        base = replace(base, title=one_line(title)[:MAX_TEXT])
        notes.append("assumes that X, Y and Z carry the tool, with the travels of the data")
    _check_keys(imported, base, name)
    _check_travel(imported, base, name)
    notes += _plausibility_notes(imported, base)
    curves = _curves(imported, base, name)
    replaced = [key for key in curves if key in base.errors]
    if replaced:
        notes.append(f"replaced: {', '.join(replaced)}")
    retained = [key for key in base.errors if key not in curves]
    if retained:
        notes.append(f"unchanged from {base.name}: {', '.join(retained)}")
    uncertainty, measured = _measured(imported, base, keep_runs=reading.format.measured)
    model, convention_notes = _convention(imported, base)
    remarks = [*imported.assumed, *notes, *convention_notes, *imported.notes]
    heading = f"Imported from {name} ({reading.format.name})."
    description = "\n".join([heading, *remarks])[:MAX_TEXT]
    covariance = base.covariance and base.covariance.without(curves)
    if uncertainty:
        covariance = (covariance or Covariance((), ())).extended(_ranges(imported))
    scene = replace(
        base,
        model=model,
        covariance=covariance,
        errors=ErrorSet({**base.errors.functions, **curves}),
        uncertainty={**_without(base.uncertainty, curves), **uncertainty},
        measured={**_without(base.measured, curves), **measured},
        description=description,
    )
    text = scene_to_toml(scene)
    size = len(text.encode())
    if size > MAX_SCENE_BYTES:
        limit = f"expected at most {MAX_SCENE_BYTES / 1e6:.1f} MB"
        raise SceneError(name, [f"results in a scene of {size / 1e6:.1f} MB; {limit}"])
    parsed = parse_scene(text, base.name, name)
    return ImportedScene(parsed, text, (*notes, *convention_notes))


def _without(table: Mapping[str, T], curves: Mapping[str, ErrorFunction]) -> dict[str, T]:
    return {key: value for key, value in table.items() if key not in curves}


def _check_keys(imported: ImportedErrors, base: Scene, name: str) -> None:
    machine = base.machine
    expected = f"expected errors of {', '.join(machine.axes)}"
    pairs = [(key, parameter(key).axis) for key in imported.keys]
    pairs += [(surface.key, axis) for surface in imported.surfaces for axis in surface.axes]
    problems = [
        f"{key}: the machine {machine.chain} has no axis {axis}; {expected}"
        for key, axis in pairs
        if axis not in machine.axes
    ]
    if problems:
        raise SceneError(name, list(dict.fromkeys(problems)))


def _ranges(imported: ImportedErrors) -> dict[str, tuple[float, float]]:
    at: dict[str, list[float]] = {}
    for series in imported.series:
        at.setdefault(parameter(series.key).axis, []).extend(series.positions)
    for surface in imported.surfaces:
        for axis, places in zip(surface.axes, (surface.first, surface.second), strict=True):
            at.setdefault(axis, []).extend(places)
    return {axis: (min(places), max(places)) for axis, places in at.items()}


def _check_travel(imported: ImportedErrors, base: Scene, name: str) -> None:
    problems: list[str] = []
    for axis, (low, high) in _ranges(imported).items():
        start, end = base.machine.axes[axis].travel
        if not is_linear(axis) and end - start >= 360.0 - TRAVEL_TOLERANCE:
            continue
        if low < start - TRAVEL_TOLERANCE or high > end + TRAVEL_TOLERANCE:
            unit = f"{' ' if is_linear(axis) else ''}{base.machine.axes[axis].unit}"
            problems.append(
                f"positions of {axis} {low:g} … {high:g}{unit} are beyond its travel"
                f" {start:g} … {end:g}{unit}; expected positions within it (check the machine and"
                " the units)"
            )
    if problems:
        raise SceneError(name, problems)


def _plausibility_notes(imported: ImportedErrors, base: Scene) -> list[str]:
    notes = list(coverage_notes(base, _ranges(imported)))
    for series in imported.series:
        axis = parameter(series.key).axis
        if not is_linear(axis):
            notes += radian_notes({f"{series.key} over {axis}_deg": series.positions})
    errors = (*imported.series, *imported.surfaces)
    maxima = {error.key: float(np.abs(error.values).max()) for error in errors}
    maxima |= {key: abs(constant) for key, constant in imported.constants.items()}
    for key, maximum in maxima.items():
        if maximum > IMPLAUSIBLE[parameter(key).is_rotation]:
            units = f", read in {', '.join(imported.units)}" if imported.units else ""
            notes.append(f"{key} reaches {maximum:g} {parameter(key).unit}{units}: check the unit")
    return notes


def _curves(imported: ImportedErrors, base: Scene, name: str) -> dict[str, ErrorFunction]:
    curves: dict[str, ErrorFunction] = {}
    for key, constant in imported.constants.items():
        curves[key] = Constant(base.axis_span(parameter(key).axis), constant)
    for error in (*imported.series, *imported.surfaces):
        if error.key in curves:
            raise SceneError(name, [f"{error.key} is repeated; expected each error once"])
        is_series = isinstance(error, ErrorSeries)
        curves[error.key] = _curve(error, base) if is_series else _surface(error, base, name)
    problems = Problems()
    for key, description in imported.curves.items():
        axis = parameter(key).axis
        curve = CurveReader(problems, base.axis_span(axis), axis).read(description, key)
        if curve is not None:
            curves[key] = curve
    if problems.lines:
        raise SceneError(name, problems.lines)
    return curves


def _curve(series: ErrorSeries, base: Scene) -> ErrorFunction:
    span = base.axis_span(parameter(series.key).axis)
    forward, backward = series.mean(FORWARD), series.mean(BACKWARD)
    if forward is not None and backward is not None and np.any(forward != backward):
        tables = (_table(span, series.positions, at.tolist()) for at in (forward, backward))
        return Directional(span, *tables)
    return _table(span, series.positions, series.values.tolist())


def _table(span: tuple[float, float], at: Sequence[float], values: Sequence[float]) -> TableCurve:
    return TableCurve(span, tuple(zip(at, values, strict=True)))


def _surface(surface: ErrorSurface, base: Scene, name: str) -> ErrorFunction:
    if len(surface.first) * len(surface.second) > MAX_POINTS:
        problem = f"{surface.key} has {len(surface.first)} × {len(surface.second)} values"
        raise SceneError(name, [f"{problem}; expected at most {MAX_POINTS:,}"])
    span = base.axis_span(parameter(surface.key).axis)
    at = (surface.first, surface.second)
    forward = TwoArguments(span, surface.axes, at, surface.values)
    if not surface.backward:
        return forward
    return Directional(span, forward, replace(forward, values=surface.backward))


def _measured(
    imported: ImportedErrors, base: Scene, *, keep_runs: bool
) -> tuple[dict[str, ErrorFunction], dict[str, Measurement]]:
    uncertainty: dict[str, ErrorFunction] = {
        key: Constant(base.axis_span(parameter(key).axis), value)
        for key, value in imported.uncertainty.items()
    }
    measured: dict[str, Measurement] = {}
    for series in imported.series:
        if series.uncertainty:
            span = base.axis_span(parameter(series.key).axis)
            uncertainty[series.key] = _table(span, series.positions, series.uncertainty)
        if keep_runs and len(series.runs) > 1:
            runs: list[TravelRun] = []
            for run in series.runs:
                pairs = zip(series.positions, run.values, strict=True)
                points = tuple((q, error) for q, error in pairs if not math.isnan(error))
                runs.append(TravelRun(SIGNS[run.direction], points))
            measured[series.key] = Measurement(tuple(runs))
    return uncertainty, measured


def _convention(imported: ImportedErrors, base: Scene) -> tuple[Model, list[str]]:
    model = base.model
    conventions = dict(model.own_component_errors)
    notes: list[str] = []
    axes = dict.fromkeys(
        parameter(key).axis for key in imported.keys if not parameter(key).is_constant
    )
    for axis in axes:
        convention = imported.convention.get("linear" if is_linear(axis) else "rotary", "")
        if convention and model.convention(axis).name != convention:
            conventions[axis] = convention
            notes.append(f"component errors of {axis}: {convention}, as in the file")
    return replace(model, own_component_errors=tuple(conventions.items())), notes
