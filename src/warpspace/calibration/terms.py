"""The errors a calibration looks for: each a parameter with the curve its amplitude scales."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.calibration.readings import Readings
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import direction_index, is_linear
from warpspace.machine.errors import Constant, ErrorSet, Ramp
from warpspace.machine.parameters import PARAMETERS, Parameter, parameter
from warpspace.scene.model import Scene
from warpspace.units import Array

AUTO = "auto"
CURVES = ("constant", "ramp")


@dataclass(frozen=True, slots=True)
class Terms:
    """Parameters to be found, and the errors that their amplitudes give.

    Attributes
    ----------
    keys : tuple of str, (K,)
    errors : ErrorSet
        The scene's errors, with a curve for each parameter.
    start : ndarray, [K], µm or µrad
        Amplitudes of the scene.
    """

    keys: tuple[str, ...]
    errors: ErrorSet
    start: Array

    def errors_with(self, amplitudes: Array) -> ErrorSet:
        """Give the error set with these amplitudes, [K], µm or µrad."""
        functions = dict(self.errors.functions)
        for key, value in zip(self.keys, amplitudes, strict=True):
            functions[key] = functions[key].with_amplitude(float(value))
        return ErrorSet(functions)

    def only(self, keys: Sequence[str]) -> "Terms":
        """Give the same for some of the parameters."""
        start = np.array([self.start[self.keys.index(key)] for key in keys], dtype=float)
        return replace(self, keys=tuple(keys), start=start)

    @property
    def slopes(self) -> frozenset[str]:
        """Parameters of which a slope is looked for."""
        ramps = (key for key in self.keys if isinstance(self.errors.functions[key], Ramp))
        return frozenset(ramps)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The rows of the parameter table."""
        return tuple(parameter(key) for key in self.keys)


def build_terms(scene: Scene, keys: Sequence[str]) -> Terms:
    """Give each parameter a curve: the scene's own, else what its kind suggests.

    A component error that the scene does not have is a ramp over a linear axis and constant over a
    rotary one; constants are constant. ``EXY:constant`` and ``EXY:ramp`` choose otherwise.

    Parameters
    ----------
    scene : Scene
    keys : sequence of str

    Returns
    -------
    Terms

    Raises
    ------
    OptionError, UnknownNameError
        If a key is no parameter, one that the machine does not have, or one given twice.
    """
    functions = dict(scene.errors.functions)
    names: list[str] = []
    for text in keys:
        key, _, curve = text.partition(":")
        row = parameter(key)
        if row.axis not in scene.machine.axes:
            raise UnknownNameError("error parameter", key, scene.machine.allowed_keys)
        if key in names:
            raise OptionError(f"--fit {key} is given twice; expected each parameter once")
        if curve and curve not in CURVES:
            raise OptionError(f"--fit {text!r}; expected {key} with :constant or :ramp behind it")
        names.append(key)
        linear = scene.machine.axes[row.axis].is_linear
        if curve or key not in functions:
            ramp = curve == "ramp" or (not curve and linear and not row.is_constant)
            kind = Ramp if ramp and not row.is_constant else Constant
            functions[key] = kind(scene.axis_span(row.axis))
    errors = ErrorSet(functions)
    return Terms(tuple(names), errors, np.array([errors.amplitude(key) for key in names], float))


def read_keys(given: Sequence[str]) -> tuple[str, ...] | None:
    """Read ``--fit``: keys with commas between, in any case; None for auto.

    Raises
    ------
    OptionError
        If there is nothing in it.
    """
    parts = [part.strip() for text in given for part in text.split(",") if part.strip()]
    if not given or [part.lower() for part in parts] == [AUTO]:
        return None
    if not parts or any(part.lower() == AUTO for part in parts):
        raise OptionError(f"--fit {','.join(given)!r}; expected auto, or keys such as EX0B,EZ0B")
    known = {key.lower(): key for key in PARAMETERS}
    spelled: list[str] = []
    for part in parts:
        key, colon, curve = part.partition(":")
        spelled.append(known.get(key.strip().lower(), key.strip()) + colon + curve.strip().lower())
    return tuple(spelled)


def automatic(scene: Scene, together: Sequence[Readings]) -> tuple[str, ...]:
    """List the parameters that ``--fit auto`` looks for in several sets of readings.

    Slopes of straightness come last: a straightness is told from a line of its own, and its slope
    belongs to the squareness.
    """
    from warpspace.calibration.kinds.registry import find_kind

    keys: dict[str, None] = {}
    for readings in together:
        for key in find_kind(readings.kind).automatic_keys(readings, scene):
            row = parameter(key)
            rotary = not scene.machine.axes[row.axis].is_linear
            whole = readings.kind in {"points", "lengths"}
            if whole and rotary and not row.is_constant and key not in scene.errors:
                continue  # a constant there is a location error by another name
            keys[key] = None
    return tuple(sorted(keys, key=lambda key: key not in scene.errors and is_straightness(key)))


def is_straightness(key: str) -> bool:
    """Tell whether a parameter is a straightness error; its slope looks like a squareness."""
    row = parameter(key)
    return (
        not row.is_constant
        and not row.is_rotation
        and is_linear(row.axis)
        and row.direction != direction_index(row.axis)
    )
