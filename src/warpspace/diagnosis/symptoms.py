"""Readings and symptoms in words as observations of causes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.options import place_words
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import TestReadings
from warpspace.calibration.solve import (
    CheckCancelled,
    MeasurementModel,
    never_cancelled,
    project_out,
)
from warpspace.diagnosis.causes import CauseSet
from warpspace.diagnosis.evidence import Observations
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.relative_motion import relative_point
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

MAX_COMPONENTS = 5_000  # of all readings
SYMPTOM_SHARE = 0.2  # standard uncertainty of a symptom, relative to its amount
CONTRADICTION = 3.0  # length of the residual, in standard uncertainties
MIN_SHARE = 0.05  # of it, of a symptom that contradicts another one
MAX_LETTERS, MAX_AMOUNT_UM = 200, 1e4
SHARE_OF_RANGE = 0.8  # of a length that a symptom does not state
UNITS_UM = {"µm": 1.0, "um": 1.0, "mm": 1e3, None: 1e3}

_NUMBER, _AXIS = r"\d+(?:\.\d+)?", r"[xyzuvw]"
_PLANE = "(?: (?:in )?(?P<plane>xy|xz|yz))?"
_AMOUNT = rf"(?P<amount>{_NUMBER}) ?(?P<unit>µm|um|mm)?"
FORMS = {
    "circle of 100 mm oval by 30 µm at 45°, same in both directions": re.compile(
        rf"circle{_PLANE} of (?P<length>{_NUMBER}) ?mm oval by {_AMOUNT} at (?P<angle>{_NUMBER})"
        " ?(?:°|deg)(?: (?P<directions>same|opposite) in both directions)?"
    ),
    "plate of 300 x 200 mm: diagonals differ by 0.2 mm": re.compile(
        rf"plate{_PLANE}(?: of (?P<length>{_NUMBER}) ?x ?(?P<width>{_NUMBER}) ?mm)? diagonals"
        rf" differ by {_AMOUNT}"
    ),
    "taper 0.03 on 300 along X across Y": re.compile(
        rf"taper {_AMOUNT} on (?P<length>{_NUMBER})(?: ?mm)?(?: along (?P<along>{_AXIS}))?"
        rf"(?: across (?P<across>{_AXIS}))?"
    ),
    "step of 20 µm where Y reverses": re.compile(
        rf"step of {_AMOUNT} where (?P<axis>{_AXIS}) reverses"
    ),
}
"""Patterns of symptoms by an example with the same first word."""
WORDS = {
    *re.findall(r"[^\W\d_]+", " ".join(FORMS).lower()),
    *("um", "in", "opposite", "deg", "xy", "xz", "yz"),
    *"xyzuvw",
}


def observe(
    causes: CauseSet,
    sets: Sequence[Readings],
    noise_mm: float,
    check_cancelled: CheckCancelled = never_cancelled,
) -> Observations:
    """Build the observations of readings; those without a stated uncertainty have `noise_mm`."""
    model = MeasurementModel.of(causes.scene, sets, check_cancelled)
    if model.size > MAX_COMPONENTS:
        raise OptionError(f"{model.size:,} readings; expected at most {MAX_COMPONENTS:,}")
    by_variable, by_unknown = causes.respond(model)
    residuals = model.residuals(causes.none, causes.none.start, model.start())
    deviations = np.concatenate([row.ravel() for row in residuals]) - by_variable @ causes.centre
    weights = model.weights(noise_mm)
    names = [readings.source for readings in model.sets for _ in range(readings.observed_mm.size)]
    return Observations(
        weights[:, None] * (by_variable @ causes.basis),
        weights[:, None] * by_unknown,
        weights * deviations,
        tuple(names),
        causes.smallest_um * MM_PER_UM * weights,
    )


# --- Symptoms -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Symptom:
    """Quantities, each a sum of readings."""

    readings: Readings
    weights: Array  # [k, n]
    values_um: Array  # [k]
    assumed: str  # what the text does not state
    text: str = ""

    def observe(self, causes: CauseSet) -> Observations:
        model = MeasurementModel.of(causes.scene, [self.readings])
        weight = 1.0 / (SYMPTOM_SHARE * float(np.linalg.norm(self.values_um)) * MM_PER_UM)
        by_variable = weight * self.weights @ causes.respond(model)[0]
        deviations = weight * MM_PER_UM * self.values_um - by_variable @ causes.centre
        count = len(deviations)
        tolerance = np.full(count, causes.smallest_um * MM_PER_UM * weight)
        columns, none = by_variable @ causes.basis, np.zeros((count, 0))
        return Observations(columns, none, deviations, (self.text,) * count, tolerance)


def read_symptom(text: str, scene: Scene) -> Symptom:
    """Parse a symptom and place it in the middle of the working volume.

    Raises
    ------
    OptionError
        For unknown words, incomplete sentences, and lengths beyond the volume.
    """
    plain = re.sub(r"[\s,;:]+", " ", text.lower().replace("×", "x").replace("μ", "µ")).strip()
    examples = [form for form in FORMS if form.split()[0] == plain.partition(" ")[0]] or [*FORMS]
    expected = f"expected for instance {'; '.join(examples)}"
    if len(text) > MAX_LETTERS:
        raise OptionError(f"{{symptoms}} of {len(text)} letters; expected at most {MAX_LETTERS}")
    for word in re.findall(r"[^\W\d_]+", plain):
        if word not in WORDS:
            raise OptionError(f"{{symptoms}} {text!r}: unknown word {word!r}; {expected}")
    builders = (_build_circle, _build_plate, _build_taper, _build_step)
    for pattern, build in zip(FORMS.values(), builders, strict=True):
        matched = pattern.fullmatch(plain)
        if matched is None:
            continue
        amount_um = float(matched["amount"]) * UNITS_UM[matched["unit"]]
        if not 0.0 < amount_um <= MAX_AMOUNT_UM:
            raise OptionError(
                f"{{symptoms}} {text!r}: {amount_um:g} µm; expected above 0, at most"
                f" {MAX_AMOUNT_UM:g} µm"
            )
        try:
            return replace(build(scene, amount_um, matched), text=text)
        except WarpspaceError as error:
            raise OptionError(f"{{symptoms}} {text!r}: {error}") from None
    raise OptionError(f"{{symptoms}} {text!r}; {expected}")


def _build_circle(scene: Scene, amount_um: float, sentence: re.Match[str]) -> Symptom:
    plane, radius_mm = (sentence["plane"] or "xy").upper(), float(sentence["length"]) / 2.0
    kind = f"circular:plane={plane}:radius={radius_mm:g}:points=72"
    readings = TestReadings(kind).plan_readings(scene)
    marks = readings.plan.marks if readings.plan else {}
    turn, sense = np.deg2rad(marks["angle_deg"]), marks["sense"]
    waves = [np.cos(2.0 * turn), np.sin(2.0 * turn)]
    design = [np.ones(len(turn)), np.cos(turn), np.sin(turn), *waves, *(sense * w for w in waves)]
    # the largest diameter exceeds the smallest by four amplitudes of the radius
    wave = amount_um / 4.0 * np.exp(2j * np.deg2rad(float(sentence["angle"])))
    values, zero = np.array([wave.real, wave.imag]), np.zeros(2)
    rows = {None: (values,), "same": (values, zero), "opposite": (zero, values)}
    values_um = np.concatenate(rows[sentence["directions"]])
    inverse = np.asarray(np.linalg.pinv(np.stack(design, -1)), dtype=np.float64)
    weights = inverse[3 : 3 + len(values_um)]
    assumed = f"{plane}, about {place_words(scene.workspace.positions)}; largest diameter minus"
    return Symptom(readings, weights, values_um, f"{assumed} smallest")


def _build_plate(scene: Scene, amount_um: float, sentence: re.Match[str]) -> Symptom:
    plane = (sentence["plane"] or "xy").upper()
    readings, size = _build_corners(scene, plane, [sentence["length"], sentence["width"]])
    weights = np.zeros((4, 3))
    for start, end, sign in ((0, 3, 1.0), (1, 2, -1.0)):
        along = readings.nominal_mm[end] - readings.nominal_mm[start]
        weights[end] = sign * along / np.linalg.norm(along)
        weights[start] = -weights[end]
    assumed = f"{size}; the diagonal from low {plane[0]}, low {plane[1]} is the longer one"
    return Symptom(readings, weights.reshape(1, -1), np.array([amount_um]), assumed)


def _build_taper(scene: Scene, amount_um: float, sentence: re.Match[str]) -> Symptom:
    first = sentence["along"] or ("y" if sentence["across"] == "x" else "x")
    second = sentence["across"] or ("x" if first == "y" else "y")
    readings, size = _build_corners(scene, (first + second).upper(), [sentence["length"], None])
    apart = readings.nominal_mm[1] - readings.nominal_mm[0]
    weights = np.outer([1.0, -1.0, -1.0, 1.0], apart / np.linalg.norm(apart))
    assumed = f"{size}; two flanks, their distance growing along +{first.upper()}"
    return Symptom(readings, weights.reshape(1, -1), np.array([amount_um]), assumed)


def _build_step(scene: Scene, amount_um: float, sentence: re.Match[str]) -> Symptom:
    axis = sentence["axis"].upper()
    readings = TestReadings(f"positioning:axis={axis}").plan_readings(scene)
    sign = readings.plan.marks["travel_sign"] if readings.plan else np.zeros(1)
    assumed = f"{axis} approached from below minus from above"
    return Symptom(readings, 2.0 * sign[None] / len(sign), np.array([amount_um]), assumed)


def _build_corners(scene: Scene, axes: str, sizes: Sequence[str | None]) -> tuple[Readings, str]:
    """Build readings at the corners of a rectangle in the middle of the volume; describe it."""
    at = {name: np.full(4, value) for name, value in scene.workspace.positions.items()}
    lengths: list[str] = []
    for axis, size, signs in zip(axes, sizes, ([-1, -1, 1, 1], [-1, 1, -1, 1]), strict=True):
        if axis not in at or len({*axes}) < 2:
            raise OptionError(f"{', '.join(axes)}; expected two of {', '.join(at)}")
        reach = float(np.ptp(scene.workspace.ranges[axis]))
        length = SHARE_OF_RANGE * reach if size is None else float(size)
        if not 0.0 < length <= reach:
            raise OptionError(f"{length:g} mm along {axis}; expected above 0, at most {reach:g} mm")
        at[axis] = at[axis] + 0.5 * length * np.array(signs)
        lengths.append(f"{length:g} mm along {axis}")
    rows = ("",) * 4, (1, 2, 3, 4), ""
    nominal_mm = relative_point(scene.model, at)
    return Readings("points", at, nominal_mm, np.zeros((4, 3)), None, *rows), ", ".join(lengths)


def check_symptoms(observations: Observations) -> None:
    """Raise OptionError for symptoms that no machine has together."""
    basis, singular, _ = np.linalg.svd(observations.columns, full_matrices=False)
    basis = basis[:, singular > 1e-9 * singular.max()]
    residual = np.abs(project_out(observations.deviations, basis))
    size = float(np.linalg.norm(residual))
    named = zip(observations.sets, residual > MIN_SHARE * size, strict=True)
    involved = dict.fromkeys(name for name, is_involved in named if is_involved)
    if size > CONTRADICTION and len(involved) > 1:
        quoted = " and ".join(map(repr, involved))
        raise OptionError(f"{{symptoms}} {quoted} contradict each other; expected one machine")
