"""Names, units and rules that the two files of a volumetric compensation share (ISG, TwinCAT CNC).

ISG kernel documentation, FCT-C26: parameters in mm and rad, arguments in mm and degrees; position
errors `C0B`, component errors `EXY`; GRID interpolation is linear. A rotation takes place about the
nominal axis and is then subject to location and component errors in fixed directions (page
"Alternative model"); with alternative_model = 1 it takes place about the distorted axis.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.formats.kind import ReadOptions
from warpspace.formats.measured import BOTH, Imported, Run, Series
from warpspace.formats.numbers import MM_TO_UM, RAD_TO_URAD
from warpspace.machine.axes import is_linear
from warpspace.machine.parameters import PARAMETERS, parameter

STANDARD, ALTERNATIVE = "standard", "alternative"
ARGUMENTS = ("X", "Y", "Z", "A", "B", "C")
VARIANTS = (STANDARD, ALTERNATIVE)
CONVENTION = {"linear": "after_motion", "rotary": "before_motion"}
ASSUMED = (
    "a positive angle follows the right-hand rule, also of a squareness",
    "errors of a linear axis ride on it, those of a rotary axis act in fixed directions",
    "values beyond the points are held",
)
OTHER = re.compile(r"P0[XYZ]|N0[XYZ]|P[XYZ][ABC]|V[XYZ][XYZABC]|ID[XYZ]|LN[XYZABC]")
"""Parameters of the kinematics, which are no errors."""
FINE_DEG = 1.0
"""Steps of a table that a wave is added to."""


def error_name(name: str) -> str:
    """Give the key of a parameter of a file; empty where it is no error."""
    upper = name.strip().upper()
    for key in (upper, f"E{upper}"):
        if key in PARAMETERS:
            return key
    return ""


def file_name(key: str) -> str:
    """Give the name that a file has for a key: C0B for EC0B."""
    return key[1:] if parameter(key).is_constant else key


def factor_of(key: str) -> float:
    """Give the factor from mm or rad to µm or µrad."""
    return RAD_TO_URAD if parameter(key).is_rotation else MM_TO_UM


def left_out(names: Sequence[str]) -> tuple[str, ...]:
    """Say which parameters of a file are no errors."""
    return (f"{', '.join(names)}: no errors, left out",) if names else ()


def check_axes(held: Imported, name: str) -> None:
    """Refuse errors of axes that the file has no name for.

    Raises
    ------
    OptionError
    """
    if other := next((axis for axis in held.axes if axis not in ARGUMENTS), ""):
        raise OptionError(f"{name} knows the axes {', '.join(ARGUMENTS)}; the scene has {other}")


def finished(found: Imported, options: ReadOptions) -> Imported:
    """Say what is assumed, and translate the alternative model.

    Parameters
    ----------
    found : Imported
        As the file has it.
    options : ReadOptions

    Returns
    -------
    Imported
    """
    found = replace(
        found,
        units=("mm", "rad", "degrees for rotary positions"),
        assumed=(*found.assumed, *ASSUMED),
        convention=CONVENTION,
    )
    if options.variant != ALTERNATIVE:
        said = "rotation about the nominal axis (alternative_model 0); --variant says otherwise"
        return replace(found, assumed=(*found.assumed, said))
    said = "rotation about the distorted axis (alternative_model 1)"
    found = replace(found, assumed=(*found.assumed, said))
    for axis in {parameter(key).axis for key in found.constants}:
        if not is_linear(axis):
            found = _about_distorted_axis(found, axis, options)
    return found


def _about_distorted_axis(found: Imported, axis: str, options: ReadOptions) -> Imported:
    """Take back, turned with the axis, what the constant errors of a rotary axis move at zero.

    A rotation R about an axis that is displaced by E₀ is E₀·R·E₀⁻¹: to first order the constant
    error minus the same error turned by R, which is one wave a turn of its component errors.
    """
    from warpspace.machine.axes import direction_index

    machine = options.machine
    way = machine.axes[axis].direction if machine is not None and axis in machine.axes else 1
    own = direction_index(axis)
    first, second = (own + 1) % 3, (own + 2) % 3
    for letters in ("XYZ", "ABC"):
        one, other = (
            found.constants.get(f"E{letters[index]}0{axis}", 0.0) for index in (first, second)
        )
        along = found.constants.get(f"E{letters[own]}0{axis}", 0.0)
        waves = {
            letters[first]: (-one, way * other),
            letters[second]: (-other, -way * one),
        }
        for letter, (cosine, sine) in waves.items():
            found = _with_wave(found, f"E{letter}{axis}", cosine, sine)
        if along:
            found = _with_constant(found, f"E{letters[own]}{axis}", -along)
    return found


def _with_wave(found: Imported, key: str, cosine: float, sine: float) -> Imported:
    """Add cosine·cos q + sine·sin q to an error."""
    size = math.hypot(cosine, sine)
    if not size:
        return found
    present = next((one for one in found.series if one.key == key), None)
    if present is None:
        phase = math.degrees(math.atan2(sine, cosine))
        return replace(found, curves={**found.curves, key: {"harmonics": [[1, size, phase]]}})
    low, high = present.positions[0], present.positions[-1]
    fine = np.arange(low, high, FINE_DEG) if high > low else np.array([low])
    at = np.union1d(present.positions, fine)
    angle = np.deg2rad(at)
    values = np.interp(at, present.positions, present.values)
    values = values + cosine * np.cos(angle) + sine * np.sin(angle)
    run = Run(1, BOTH, tuple(values.tolist()))
    added = Series(key, tuple(at.tolist()), (run,))
    return replace(found, series=tuple(added if one is present else one for one in found.series))


def _with_constant(found: Imported, key: str, value: float) -> Imported:
    """Add a constant to a component error."""
    present = next((one for one in found.series if one.key == key), None)
    if present is None:
        curves: Mapping[str, object] = {**found.curves, key: {"poly": [value]}}
        return replace(found, curves=curves)
    runs = tuple(replace(run, values=tuple(v + value for v in run.values)) for run in present.runs)
    added = replace(present, runs=runs)
    return replace(found, series=tuple(added if one is present else one for one in found.series))
