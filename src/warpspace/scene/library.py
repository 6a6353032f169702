"""Scenes: bundled by name, or read from a file."""

import math
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from warpspace.exceptions import OptionError, SceneError, near_miss
from warpspace.field.grid import Workspace, find_volume_axes
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine import limits
from warpspace.machine.axes import PARAMETERS, is_linear, sort_axes
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.simple import Constant
from warpspace.machine.curves.table import TableCurve
from warpspace.machine.definition import BODY_FRAMES, Machine, Range, build_machine
from warpspace.machine.errors import (
    Covariance,
    ErrorSet,
    Measurement,
    Tolerance,
    ToleranceSet,
    TravelRun,
)
from warpspace.resources import scenes_dir
from warpspace.scene import machine_library, schema
from warpspace.scene.curve_reader import GUIDES, CurveReader, read_csv_runs
from warpspace.scene.model import PartSource, Scene, curve_span, scene_notes, spanning_axes
from warpspace.scene.notes import TOLERANCES, Note
from warpspace.scene.scene_writer import Notation, convert_covariance, matrix_digest, read_errors
from warpspace.scene.schema import Problems
from warpspace.scene.text_files import one_line, parse_toml, read_bytes, read_text


def scene_names() -> tuple[str, ...]:
    """List the bundled scenes, the reference machine's first."""
    names = (path.stem for path in scenes_dir().glob("*.toml"))
    return tuple(sorted(names, key=lambda name: (not name.startswith("dvf"), name)))


def scene_path(name_or_path: str | Path) -> Path:
    text = str(name_or_path)
    if text in scene_names():
        return scenes_dir() / f"{text}.toml"
    path = Path(name_or_path)
    try:
        exists = bool(text) and path.exists()
    except (OSError, ValueError):
        exists = False
    if not exists:
        names = scene_names()
        hint = near_miss(text, names) or f"; bundled scenes: {', '.join(names)}"
        raise SceneError(text or '""', [f"no such scene or file{hint}"])
    return path


def load_scene(name_or_path: str | Path) -> Scene:
    """Load a scene by its bundled name or its path.

    Parameters
    ----------
    name_or_path : str or Path

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        With every problem of the file: key, value and what was expected.

    Examples
    --------
    >>> scene = load_scene("dvf5000_first")
    >>> scene.title
    'DVF5000, first machine measured'
    >>> str(scene.machine.chain)
    'wCBFXYZt'
    """
    path = scene_path(name_or_path)
    name = path.stem.encode(errors="replace").decode()  # bytes that are not text become "?"
    return parse_scene(read_text(path, limits.MAX_SCENE_BYTES), name, str(path), path.parent)


SECTIONS = (
    "title", "description", "machine", "bodies", "convention", "workspace", "points_mm", "errors",
    "tolerances", "uncertainty", "measured", "view", "part", "notes",
)  # fmt: skip
ROUNDED = 1e-9  # relative tolerance of symmetry and of positive eigenvalues of a covariance
OF_MACHINE = "axis of this machine"  # in messages
STAND_IN = build_machine("wFXYZABCt")
"""Machine with every axis, to check the remainder of a document with an invalid machine."""


def parse_scene(
    text: str, name: str, source: str | None = None, folder: Path | None = None
) -> Scene:
    source = source or name
    raw, problems = parse_toml(text, source), Problems()
    machine = _machine(raw, name, folder, problems)
    title = problems.read(schema.TITLE, "title", raw.get("title", ""))
    description = problems.read(schema.TEXT, "description", raw.get("description", ""))
    convention = problems.read(schema.CONVENTION, "convention", raw.get("convention", {}))
    points = problems.read(schema.POINTS, "points_mm", raw.get("points_mm", {}))
    view = problems.read(schema.VIEW, "view", raw.get("view", {}))
    part = problems.read(schema.PART, "part", raw.get("part", {})) or {}
    for name_key in filter(part.get, ("file", "features", "program")):
        machine_library.path_beside(part[name_key], f"part.{name_key}", folder, problems)
    workspace = _workspace(problems.table("workspace", raw.get("workspace")), machine, problems)
    fixed = (convention or {}).get("reference_axis") == "fixed"
    document = _Document(raw, machine, workspace, machine.reference_keys * fixed, folder, problems)
    errors, tolerances = document.errors(), document.tolerances()
    uncertainty, measured = document.uncertainties(), document.measurements()
    covariance = document.covariance(uncertainty)
    reference = _reference(view, workspace, problems)
    review = _review(raw.get("notes", []), machine, problems)
    orders, lines = _conventions(convention or {}, machine, problems)
    if lines and (uncertainty or covariance):
        expected = "expected uncertainties and errors of the origins of the frames"
        problems.add(
            "convention.measuring_line_mm", f"would move the errors of [uncertainty]; {expected}"
        )
    if problems.lines:
        raise SceneError(source, problems.lines)
    model = Model(
        machine, orders[0], points["tool"], points["workpiece"], orders[1], convention["direction"]
    )
    errors = read_errors(
        model, errors, workspace, Notation(convention["squareness"], lines), source
    )
    return Scene(
        name=name,
        title=title or one_line(name),
        model=model,
        workspace=workspace,
        errors=errors,
        tolerances=tolerances,
        trace_points_mm=points["traces"],
        exaggeration=view["exaggeration"],
        reference=reference,
        placed=view["placed"],
        limit_um=view["limit_um"],
        description=description,
        notes=(*scene_notes(machine, workspace, errors), *machine_library.body_notes(machine)),
        uncertainty=uncertainty,
        covariance=convert_covariance(machine, covariance, convention["squareness"]),
        measured=measured,
        review=review,
        part=PartSource(**part, folder=str(folder or "")),
    )


def _machine(
    raw: Mapping[str, object], name: str, folder: Path | None, problems: Problems
) -> Machine:
    source, machine = raw.get("machine"), None
    if not isinstance(source, str):
        machine = machine_library.read_machine(source, "machine", name, problems, folder=folder)
    elif source in machine_library.machine_names():
        machine = machine_library.load_machine(source)
    else:
        hint = near_miss(source, machine_library.machine_names())
        problems.add("machine", f"unknown machine{hint}", source)
    problems.only("", raw, SECTIONS, "key")
    if machine is not None and "bodies" in raw:
        bodies = machine_library.read_bodies(raw["bodies"], machine, folder, problems)
        machine = replace(machine, bodies={**machine.bodies, **bodies})
    return machine or STAND_IN


def _conventions(
    convention: Mapping[str, Any], machine: Machine, problems: Problems
) -> tuple[tuple[str, tuple[tuple[str, str], ...]], dict[str, Any]]:
    kinds, default = ("linear", "rotary"), str(ComponentErrors.AFTER_MOTION)
    setting = convention.get("component_errors", default)
    table: Mapping[str, str] = {} if isinstance(setting, str) else setting
    allowed = (*kinds, *machine.axes)
    problems.only("convention.component_errors", table, allowed, "kind or axis")
    lines = dict(convention.get("measuring_line_mm", {}))
    problems.only("convention.measuring_line_mm", lines, machine.axes, OF_MACHINE)
    if isinstance(setting, str):
        return (setting, ()), lines
    order_of = {
        name: table.get(name, table.get(kinds[not axis.is_linear], default))
        for name, axis in machine.axes.items()
    }
    names = list(order_of.values())
    main = max(dict.fromkeys(names), key=names.count)
    return (main, tuple(pair for pair in order_of.items() if pair[1] != main)), lines


def _reference(view: Any, workspace: Workspace, problems: Problems) -> dict[str, float] | None:
    reference = None if view is None else view["reference"]
    if reference is None:
        return None
    problems.only("view.reference", reference, workspace.ranges, OF_MACHINE)
    spanning = workspace.volume_axes
    middle = {
        name: q for name, q in workspace.positions.items() if is_linear(name) or name in spanning
    }
    return {**middle, **reference}


def _review(raw: object, machine: Machine, problems: Problems) -> tuple[Note, ...]:
    notes: tuple[Note, ...] = problems.read(schema.NOTES, "notes", raw) or ()
    ids, bodies = [note.id for note in notes], ("", *machine.axes, *BODY_FRAMES)
    for index, note in enumerate(notes):
        where = f"notes[{index}]"
        if note.id in ids[:index]:
            expected = "another note has this id; expected one of its own"
            problems.add(f"{where}.id", expected, note.id)
        for version in (note, *note.versions):
            if version.id != note.id:
                problems.add(f"{where}.versions", f"expected versions of {note.id}", version.id)
            if version.on:
                problems.only(f"{where}.on.body", [version.on.body], bodies, "body")
            if machine is not STAND_IN:
                problems.only(f"{where}.at", version.at, machine.axes, OF_MACHINE)
            keys = [key.removeprefix(TOLERANCES) for key in version.change]
            problems.only(f"{where}.change", keys, PARAMETERS, "error parameter")
    return notes


def _workspace(raw: Mapping[str, object], machine: Machine, problems: Problems) -> Workspace:
    stated: dict[str, Range] = {}
    for name, value in raw.items():
        if name not in machine.axes:
            problems.only("workspace", [name], machine.axes, OF_MACHINE)
            continue
        span = problems.read(schema.workspace_range, f"workspace.{name}", value)
        if span:
            stated[name] = span
    ranges = _complete(stated, machine)
    moving = [name for name in reversed(sort_axes(stated)) if stated[name][0] < stated[name][1]]
    problem = ""
    for name in (*moving, ""):
        try:
            find_volume_axes(ranges)
            break
        except OptionError as error:
            problem = problem or str(error)
        if name:
            middle = sum(ranges[name]) / 2.0
            ranges[name] = (middle, middle)
            still = (
                "expected one position in degrees for a rotary axis of a machine whose linear axes"
                " span the volume"
            )
            problems.add(f"workspace.{name}", problem if is_linear(name) else still, raw[name])
    return Workspace(ranges)


def _complete(stated: Mapping[str, Range], machine: Machine) -> dict[str, Range]:
    moving = [name for name, (low, high) in stated.items() if low < high]
    spanning = spanning_axes([*moving, *(name for name in machine.axes if name not in stated)])
    ranges: dict[str, Range] = {}
    for name, axis in machine.axes.items():
        low, high = axis.travel
        at = min(max(0.0, low), high) if axis.is_linear else 0.0
        ranges[name] = stated.get(name, axis.travel if name in spanning else (at, at))
    return ranges


NPZ_ARRAYS = {"keys.npy": (1, "U", 4 * 64), "matrix.npy": (2, "fiu", 8)}
"""Arrays of an npz file: dimensions, kinds and largest size of an entry, bytes."""


def read_npz(path: Path, where: str, problems: Problems) -> dict[str, Any] | None:
    """Read the arrays of a covariance as lists; note a problem for any other file."""
    from zipfile import ZipFile

    data = BytesIO(read_bytes(path, limits.MAX_SCENE_BYTES))
    with suppress(Exception), ZipFile(data) as packed:  # any error of a damaged file
        if {"matrix.npy"} <= {*packed.namelist()} <= {*NPZ_ARRAYS}:
            return {name[:-4]: _read_array(packed.open(name), name) for name in packed.namelist()}
    problems.add(where, "expected a file of numpy with the arrays keys and matrix", path.name)
    return None


def _read_array(member: IO[bytes], name: str) -> list[Any]:
    """Read an array with the dimensions and kinds of a covariance."""
    dimensions, kinds, max_bytes = NPZ_ARRAYS[name]
    with member as file:
        is_usual = np.lib.format.read_magic(file) == (1, 0)
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file, max_header_size=1000)
        fits = len(shape) == dimensions and max(shape) <= limits.MAX_COVARIANCE
        fits = fits and dtype.kind in kinds and 0 < dtype.itemsize <= max_bytes
        if not (is_usual and fits):
            raise ValueError(f"{name}: {dtype} {shape}")
        content = file.read(math.prod(shape) * dtype.itemsize)
    return np.frombuffer(content, dtype).reshape(shape, order="F" if is_fortran else "C").tolist()


@dataclass(frozen=True)
class _Document:
    """A document with its machine and working volume."""

    raw: Mapping[str, object]
    machine: Machine
    workspace: Workspace
    refused: Sequence[str]  # parameters that are zero by definition
    folder: Path | None
    problems: Problems

    def parameter_entries(self, section: str) -> dict[str, object]:
        entries: dict[str, object] = {}
        machine, problems = self.machine, self.problems
        for key, value in problems.table(section, self.raw.get(section)).items():
            if (section, key) in {("tolerances", "default"), ("uncertainty", "covariance")}:
                continue
            if key not in PARAMETERS:
                problems.only(section, [key], machine.allowed_keys, "error parameter")
            elif key not in machine.allowed_keys:
                axis = PARAMETERS[key].axis
                problems.add(f"{section}.{key}", f"the machine {machine.chain} has no axis {axis}")
            else:
                entries[key] = value
            self.check_free(f"{section}.{key}", key, value)
        return entries

    def check_free(self, where: str, key: str, value: object) -> None:
        """Note a problem for an error that is zero by definition of the frame."""
        if key in self.refused:
            reference = PARAMETERS[key].axis
            usual = [name for name in self.machine.parameter_keys if PARAMETERS[name].is_constant]
            self.problems.add(
                where,
                f"is zero by definition of the frame, {reference} being the reference axis"
                f'{near_miss(key, usual)} ([convention] reference_axis = "free" allows it)',
                value,
            )

    def curves(self, key: str) -> CurveReader:
        """Return the reader of the curves of an error, over `Scene.axis_span`."""
        axis = PARAMETERS[key].axis
        span = curve_span(self.machine, self.workspace, axis)
        return CurveReader(self.problems, span, axis, self.machine.axes, self.folder)

    def errors(self) -> ErrorSet:
        functions: dict[str, ErrorFunction] = {}
        problems, entries = self.problems, self.parameter_entries("errors")
        stated = cast("dict[str, object]", self.raw.get("errors") or {})
        for key, value in entries.items():
            where, row, reader = f"errors.{key}", PARAMETERS[key], self.curves(key)
            if isinstance(value, dict) and GUIDES in value:
                gantry, raw = self.machine.gantries.get(row.axis), cast("dict[str, object]", value)
                curves = reader.guides(key, raw, where, gantry, stated)
            else:
                curve = reader.read(value, where, constant=row.is_constant)
                curves = {} if curve is None else {key: curve}
            for name, function in curves.items():
                peak, (low, high) = function.amplitude, reader.span
                if self.machine is not STAND_IN and not abs(peak) <= limits.MAX_ERROR:
                    which = "" if name == key else f"gives {name}, which "
                    problems.add(
                        where,
                        f"{which}reaches {peak:g} {PARAMETERS[name].unit} within {low:g} …"
                        f" {high:g}; expected at most ±{limits.MAX_ERROR:g}",
                    )
            functions |= curves
        return ErrorSet(functions)

    def tolerances(self) -> ToleranceSet:
        problems, table, default = self.problems, self.raw.get("tolerances"), None
        if isinstance(table, dict) and "default" in table:
            default = problems.read(schema.DEFAULTS, "tolerances.default", table["default"])
        ranges: dict[str, Tolerance] = {}
        for key, value in self.parameter_entries("tolerances").items():
            tolerance = problems.read(schema.tolerance, f"tolerances.{key}", value)
            if tolerance:
                ranges[key] = tolerance
        return ToleranceSet(default or {}, ranges)

    def uncertainties(self) -> dict[str, ErrorFunction]:
        curves: dict[str, ErrorFunction] = {}
        for key, raw in self.parameter_entries("uncertainty").items():
            where, constant = f"uncertainty.{key}", PARAMETERS[key].is_constant
            curve = self.curves(key).read(raw, where, constant=constant)
            if curve is None:
                continue
            if not isinstance(curve, Constant | TableCurve):
                expected = "expected a number or { table = [[position, uncertainty], …] }"
                self.problems.add(where, expected, raw)
                continue
            values = [curve.value] if isinstance(curve, Constant) else [v for _, v in curve.points]
            if min(values) <= 0.0:
                expected = "expected a number above 0; omit unknown uncertainties"
                self.problems.add(where, expected, min(values))
            curves[key] = curve
        return curves

    def covariance(self, independent_keys: Collection[str]) -> Covariance | None:
        """Read the covariance of errors other than the independent ones."""
        where, problems = "uncertainty.covariance", self.problems
        section = self.raw.get("uncertainty")
        raw = section.get("covariance") if isinstance(section, dict) else None
        stated = raw if isinstance(raw, dict) else {"matrix": raw}
        name = stated.get("matrix")
        if isinstance(name, str):
            path = machine_library.path_beside(name, where, self.folder, problems)
            raw = read_npz(Path(path), where, problems) if path else None
            if raw and stated.get("sha256", "") not in ("", matrix_digest(raw["matrix"])):
                expected = "is not the matrix of this scene (its SHA-256 differs); expected the"
                problems.add(f"{where}.matrix", f"{expected} file written with the scene", name)
            raw = raw and raw | stated | {"matrix": raw["matrix"]}
        if raw is None:
            return None
        before = len(problems.lines)
        entries: dict[str, Any] | None = problems.read(schema.COVARIANCE, where, raw)
        if entries is None:
            return None
        keys, rows, count = entries["keys"], entries["matrix"], len(entries["keys"])
        all_keys = *keys, *entries["undetermined"]
        problems.only(f"{where}.keys", all_keys, self.machine.allowed_keys, "error parameter")
        problems.only(
            f"{where}.measured_range", entries["measured_range"], self.machine.axes, OF_MACHINE
        )
        for at, key in enumerate(all_keys):
            self.check_free(f"{where}.keys", key, key)
            if key in all_keys[:at] or key in independent_keys:
                expected = "expected each error once, here or as uncertainty.KEY"
                problems.add(f"{where}.keys", expected, key)
        lengths, where = [*map(len, rows)], f"{where}.matrix"
        is_whole = lengths == [count] * count
        if not is_whole and lengths != [*range(1, count + 1)]:
            problems.add(where, f"expected {count} rows of {count} numbers, or of 1 to {count}")
            return None
        half = np.zeros((count, count))
        for at, row in enumerate(rows):
            half[at, : len(row)] = row
        matrix = np.tril(half) + np.tril(half, -1).T
        not_positive = np.flatnonzero(np.diag(matrix) <= 0.0)
        if not_positive.size:
            at = int(not_positive[0])
            expected = (
                f"is no square of an uncertainty of {keys[at]}; expected its diagonal above 0"
            )
            problems.add(f"{where}[{at}][{at}]", expected, float(half[at, at]))
            return None
        scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        for a, b in np.argwhere(np.abs(half - matrix) > ROUNDED * scale) if is_whole else ():
            other = f"is not symmetric; expected {float(half[b, a])!r} as in [{b}][{a}]"
            problems.add(f"{where}[{a}][{b}]", other, float(half[a, b]))
        values, vectors = np.linalg.eigh(matrix / scale)
        if values.min(initial=0.0) < -ROUNDED:
            at = int(np.argmax(np.abs(vectors[:, 0])))
            expected = f"is no covariance of {keys[at]} and others; expected a positive matrix"
            problems.add(f"{where}[{at}]", expected, rows[at])
        if len(problems.lines) > before:
            return None
        del entries["matrix"], entries["sha256"]
        return Covariance(**entries, rows=tuple(map(tuple, matrix.tolist())))

    def measurements(self) -> dict[str, Measurement]:
        measured: dict[str, Measurement] = {}
        for key, raw in self.parameter_entries("measured").items():
            where = f"measured.{key}"
            if isinstance(raw, dict) and "csv" in raw:
                columns = self.problems.read(schema.CSV_RUNS, where, raw)
                runs = self._csv_runs(where, **columns) if columns else ()
            else:
                table = self.problems.read(schema.RUNS, where, raw)
                runs: tuple[TravelRun, ...] = table["runs"] if table else ()
            measured[key] = Measurement(runs)
            count = measured[key].count
            if count > limits.MAX_POINTS:
                expected = f"expected at most {limits.MAX_POINTS:,}"
                self.problems.add(f"{where}.runs", f"have {count:,} readings; {expected}")
        return measured

    def _csv_runs(self, where: str, csv: str, column: str) -> tuple[TravelRun, ...]:
        if self.folder is None:
            expected = "expected the readings as runs = [ … ]"
            self.problems.add(where, f"CSV files are not read here; {expected}")
            return ()
        try:
            return read_csv_runs(self.folder / csv, column, where)
        except SceneError as error:
            for problem in error.problems:
                self.problems.add(where, f"{error.source}: {problem}")
            return ()
