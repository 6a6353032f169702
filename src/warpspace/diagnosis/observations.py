"""Readings and typed symptoms as observations of the causes."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.options import place_words
from warpspace.bench.kinds.ball_plate import BallPlate
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import TestReadings, find_kind
from warpspace.calibration.solve import FitParameters, MeasurementModel, project_out
from warpspace.diagnosis.causes import ErrorVariables, half_width_of
from warpspace.diagnosis.evidence import Observations
from warpspace.exceptions import OptionError
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

MAX_COMPONENTS = 10_000  # of all readings
SYMPTOM_SHARE = 0.2  # standard uncertainty of a symptom, as a share of its amount
CONTRADICTION = 3.0  # residual in standard uncertainties that no causes explain
MAX_SYMPTOMS, MAX_LETTERS = 8, 200


def smallest_tolerance_mm(scene: Scene) -> float:
    """Return the smallest half-width of a translation that is not zero, mm."""
    keys = [key for key in scene.parameter_keys if not parameter(key).is_rotation]
    half_widths = [half_width_of(scene, key) for key in keys]
    return min(filter(None, half_widths), default=1.0) * MM_PER_UM


def observe(variables: ErrorVariables, model: MeasurementModel, noise_mm: float) -> Observations:
    """Build the observations of readings; those without a stated uncertainty have `noise_mm`."""
    if model.size > MAX_COMPONENTS:
        raise OptionError(
            f"{model.size:,} components of readings; expected at most {MAX_COMPONENTS:,}"
        )
    by_variable, by_unknown = variables.respond(model)
    none = FitParameters((), ErrorSet(), np.zeros(0))
    residuals = model.residuals(none, none.start, model.start())
    deviations = np.concatenate([row.ravel() for row in residuals])
    deviations = deviations - by_variable @ variables.centre
    weights = model.weights(noise_mm)
    names = [r.source or r.kind for r in model.sets for _ in range(r.observed_mm.size)]
    bends = np.zeros((model.size, 0))
    start = 0
    for readings in model.sets:
        size = readings.observed_mm.size
        shapes = _bends(readings)
        padded = np.zeros((model.size, shapes.shape[1]))
        padded[start : start + size] = shapes
        bends, start = np.hstack([bends, padded]), start + size
    limit = smallest_tolerance_mm(variables.scene) * weights
    return Observations(
        weights[:, None] * by_variable,
        weights[:, None] * by_unknown,
        weights * deviations,
        tuple(names),
        limit,
        limit[:, None] * bends,
    )


def _bends(readings: Readings) -> Array:
    """Build bow and twist of a ball plate out of its plane, the same in all positions, [n, 3]."""
    kind, plan = find_kind(readings.kind), readings.plan
    if plan is None or not isinstance(kind, TestReadings) or not isinstance(kind.test, BallPlate):
        return np.zeros((readings.observed_mm.size, 0))
    row, column = (
        2.0 * plan.marks[name] / max(kind.test.balls - 1, 1) - 1.0 for name in ("row", "column")
    )
    count = len(row) // 3
    across = 3 - sum("XYZ".index(axis) for axis in kind.test.plane)
    is_across = np.repeat(np.arange(3), count) == across
    return np.stack([row**2, row * column, column**2], -1) * is_across[:, None]


# --- Symptoms -------------------------------------------------------------------------------------

NUMBER = r"(\d+(?:\.\d+)?)"
LENGTH = NUMBER + r"\s*(µm|um|mm)?"
UNITS_UM = {"µm": 1.0, "um": 1.0, "mm": 1e3}
PLANE = r"(?: (?:in )?(xy|xz|yz))?"
AXIS = r"([xyzuvw])"
FORMS = {
    "circle": (
        re.compile(
            rf"circle{PLANE} of {NUMBER} ?mm oval by {LENGTH} at {NUMBER}\s*(?:°|deg)"
            r"(?: (?:(same)|(opposite)) in both directions)?"
        ),
        "circle of 100 mm oval by 30 µm at 45°, same in both directions",
    ),
    "plate": (
        re.compile(rf"plate{PLANE}(?: of {NUMBER} x {NUMBER} ?mm)? diagonals differ by {LENGTH}"),
        "plate of 300 x 200 mm: diagonals differ by 0.2 mm",
    ),
    "taper": (
        re.compile(rf"taper {LENGTH} on {NUMBER}(?: ?mm)?(?: along {AXIS})?(?: across {AXIS})?"),
        "taper 0.03 on 300 along X across Y",
    ),
    "step": (
        re.compile(rf"step of {LENGTH} where {AXIS} reverses"),
        "step of 20 µm where Y reverses",
    ),
}
WORDS = frozenset(
    "circle of mm oval by at same opposite in both directions plate diagonals differ taper on along"
    " across step where reverses um µm deg x y z u v w xy xz yz".split()
)


@dataclass(frozen=True)
class Symptom:
    """Quantities of a symptom, each a sum of readings."""

    text: str
    assumed: str  # what the text does not state
    readings: Readings
    weights: Array  # [k, n]; of the readings
    values_um: Array  # [k]
    amount_um: float


def read_symptom(text: str, scene: Scene) -> Symptom:
    """Parse a symptom and place it in the working volume.

    Raises
    ------
    OptionError
        For unknown words, incomplete sentences, axes that the machine does not have, and lengths
        beyond the volume.
    """
    if len(text) > MAX_LETTERS:
        raise OptionError(f"{{symptoms}} of {len(text)} letters; expected at most {MAX_LETTERS}")
    plain = " ".join(
        re.sub(r"[,;:]", " ", text.lower().replace("×", "x").replace("μ", "µ")).split()
    )
    examples = "; ".join(f"“{example}”" for _, example in FORMS.values())
    for word in re.findall(r"[^\W\d_]+", plain):
        if word not in WORDS:
            raise OptionError(f"{{symptoms}} {text!r}: unknown word {word!r}; expected {examples}")
    for name, (pattern, example) in FORMS.items():
        matched = pattern.fullmatch(plain)
        if matched is not None:
            try:
                return _BUILDERS[name](scene, text, matched)
            except OptionError as error:
                raise OptionError(f"{{symptoms}} {text!r}: {error}") from None
        if plain.startswith(name):
            raise OptionError(f"{{symptoms}} {text!r}; expected for instance “{example}”")
    raise OptionError(f"{{symptoms}} {text!r}; expected one such as {examples}")


def _amount(number: str, unit: str | None, default: str = "mm") -> float:
    amount_um = float(number) * UNITS_UM[unit or default]
    if not 0.0 < amount_um <= 1e4:
        raise OptionError(f"{number}; expected an amount above 0 and at most 10 mm")
    return amount_um


def _read_circle(scene: Scene, text: str, matched: re.Match[str]) -> Symptom:
    plane, diameter, number, unit, angle, same, opposite = matched.groups()
    name, radius_mm = (plane or "xy").upper(), float(diameter) / 2.0
    readings = TestReadings(f"circular:plane={name}:radius={radius_mm:g}:points=72").plan_readings(
        scene
    )
    amount_um, marks = _amount(number, unit), readings.plan.marks if readings.plan else {}
    turn, sense = np.deg2rad(marks["angle_deg"]), marks["sense"]
    design = np.stack([np.ones(len(turn)), np.cos(turn), np.sin(turn),
                       np.cos(2.0 * turn), np.sin(2.0 * turn)], -1)  # fmt: skip
    each = [np.zeros((2, len(turn))), np.zeros((2, len(turn)))]
    for row, sign in enumerate((1.0, -1.0)):
        inside = sense == sign
        each[row][:, inside] = np.linalg.pinv(design[inside])[3:]
    # the diameter at 45° exceeds that at 135° by the amount: four amplitudes of the radius
    wave = amount_um / 4.0 * np.array([np.cos(2.0 * np.deg2rad(float(angle))),
                                       np.sin(2.0 * np.deg2rad(float(angle)))])  # fmt: skip
    mean, half = (each[0] + each[1]) / 2.0, (each[0] - each[1]) / 2.0
    weights, values = mean, wave
    if same or opposite:
        weights = np.vstack([mean, half])
        values = np.append(wave, 0.0 * wave) if same else np.append(0.0 * wave, wave)
    assumed = "" if plane else f"in plane {name}, "
    middle = place_words(scene.workspace.positions)
    note = f"{assumed}diameter {2.0 * radius_mm:g} mm about {middle}; the largest diameter exceeds"
    note += f" the smallest by {amount_um:g} µm"
    return Symptom(text, note, readings, weights, values, amount_um / 4.0)


def _read_plate(scene: Scene, text: str, matched: re.Match[str]) -> Symptom:
    plane, length, width, number, unit = matched.groups()
    name = (plane or "xy").upper()
    _check_axes(scene, name)
    size = [float(length), float(width)] if length else [0.8 * _range(scene, a) for a in name]
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    readings = _points(scene, name, size, corners)
    point = readings.nominal_mm
    weights = np.zeros((4, 3))
    for start, end, sign in ((0, 2, 1.0), (1, 3, -1.0)):
        along = (point[end] - point[start]) / np.linalg.norm(point[end] - point[start])
        weights[end] += sign * along
        weights[start] -= sign * along
    amount_um = _amount(number, unit)
    note = f"plane {name}, {size[0]:g} × {size[1]:g} mm in the middle of the volume; the diagonal"
    note += f" from low {name[0]} and {name[1]} is taken to be the longer one"
    return Symptom(text, note, readings, weights.reshape(1, -1), np.array([amount_um]), amount_um)


def _read_taper(scene: Scene, text: str, matched: re.Match[str]) -> Symptom:
    number, unit, length, along, across = matched.groups()
    first = (along or ("y" if across == "x" else "x")).upper()
    second = (across or ("x" if first == "Y" else "y")).upper()
    if first == second:
        raise OptionError(f"along {first} across {second}; expected two axes")
    _check_axes(scene, first + second)
    size = [float(length), 0.8 * _range(scene, second)]
    readings = _points(scene, first + second, size, [(-1, -1), (-1, 1), (1, -1), (1, 1)])
    apart = readings.nominal_mm[1] - readings.nominal_mm[0]
    signs = np.array([1.0, -1.0, -1.0, 1.0])
    weights = signs[:, None] * apart / np.linalg.norm(apart)
    amount_um = _amount(number, unit)
    note = f"width along {second} between two flanks {size[1]:g} mm apart, growing along +{first}"
    return Symptom(text, note, readings, weights.reshape(1, -1), np.array([amount_um]), amount_um)


def _read_step(scene: Scene, text: str, matched: re.Match[str]) -> Symptom:
    number, unit, axis = matched.groups()
    axis = axis.upper()
    _check_axes(scene, axis)
    readings = TestReadings(f"positioning:axis={axis}").plan_readings(scene)
    sign = readings.plan.marks["travel_sign"] if readings.plan else np.zeros(0)
    weights = 2.0 * sign[None] / len(sign)
    amount_um = _amount(number, unit)
    note = f"position of {axis} from below minus that from above"
    return Symptom(text, note, readings, weights, np.array([amount_um]), amount_um)


_BUILDERS = {
    "circle": _read_circle, "plate": _read_plate, "taper": _read_taper, "step": _read_step,
}  # fmt: skip


def _check_axes(scene: Scene, names: str) -> None:
    missing = [name for name in names if name not in scene.machine.axes]
    if missing:
        linear = [n for n, axis in scene.machine.axes.items() if axis.is_linear]
        raise OptionError(f"no axis {', '.join(missing)}; expected {', '.join(linear)}")


def _range(scene: Scene, axis: str) -> float:
    low, high = scene.workspace.ranges[axis]
    return high - low


def _points(
    scene: Scene, axes: str, size_mm: Sequence[float], corners: Sequence[tuple[int, int]]
) -> Readings:
    """Build points at the corners of a rectangle in the middle of the volume."""
    positions: Mapping[str, float] = scene.workspace.positions
    at = {name: np.full(len(corners), value) for name, value in positions.items()}
    for column, (axis, size) in enumerate(zip(axes, size_mm, strict=True)):
        if not 0.0 < size <= _range(scene, axis):
            raise OptionError(
                f"{size:g} mm along {axis}; expected above 0 and at most {_range(scene, axis):g} mm,"
                " the working volume"
            )
        at[axis] = at[axis] + 0.5 * size * np.array([corner[column] for corner in corners])
    count = len(corners)
    rows = ("",) * count, tuple(range(1, count + 1)), ""
    nominal_mm = relative_point(scene.model, at)
    return Readings("points", at, nominal_mm, np.zeros((count, 3)), None, *rows)


def observe_symptoms(variables: ErrorVariables, symptoms: Sequence[Symptom]) -> Observations:
    """Build the observations of symptoms; raise OptionError where they contradict each other."""
    rows: list[Array] = []
    values: list[Array] = []
    names: list[str] = []
    sigmas: list[Array] = []
    for symptom in symptoms:
        model = MeasurementModel.of(variables.scene, [symptom.readings])
        by_variable, _ = variables.respond(model)
        rows.append(symptom.weights @ by_variable)
        values.append(symptom.values_um * MM_PER_UM)
        sigma = max(SYMPTOM_SHARE * symptom.amount_um, 1e-3) * MM_PER_UM
        sigmas.append(np.full(len(symptom.values_um), sigma))
        names += [symptom.text] * len(symptom.values_um)
    sigma = np.concatenate(sigmas)
    matrix, value = np.vstack(rows) / sigma[:, None], np.concatenate(values) / sigma
    basis, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    residual = project_out(value, basis[:, singular > 1e-6 * singular.max(initial=1e-300)])
    conflicting = dict.fromkeys(
        name for name, size in zip(names, residual, strict=True) if abs(size) > CONTRADICTION / 2.0
    )
    if float(np.linalg.norm(residual)) > CONTRADICTION:
        quoted = " and ".join(f"“{name}”" for name in conflicting or dict.fromkeys(names))
        verb = "contradict each other" if len(conflicting) > 1 else "has no cause on this machine"
        raise OptionError(f"{{symptoms}}: {quoted} {verb}; expected symptoms of one machine")
    deviations = value - matrix @ variables.centre
    limit = smallest_tolerance_mm(variables.scene) / sigma
    none = np.zeros((len(value), 0))
    return Observations(matrix, none, deviations, tuple(names), limit, none)
