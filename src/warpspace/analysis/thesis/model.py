"""Tables 4-1 to 4-5: dimensions, parameters, gains."""

from collections.abc import Callable

from scipy import stats

from warpspace.analysis.gains import Gain, gains_at, gains_max
from warpspace.analysis.thesis.rows import (
    Row,
    ThesisCase,
    agrees,
    number_row,
    printed_tables,
    text_row,
)
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.parameters import ErrorKind, parameter

COLUMNS: tuple[tuple[str, Callable[[Gain], float]], ...] = (
    ("|E|", lambda gain: gain.norm),
    ("x", lambda gain: abs(gain.x)),
    ("y", lambda gain: abs(gain.y)),
    ("z", lambda gain: abs(gain.z)),
)
NOTE_C_OFFSET = (
    "The row prints nine values for eight symbols, and 0 where C has to lie 50 mm below B: only"
    " with -50 do the gains of B in table 4-4 come out (see the hypotheses)."
)
NOTE_SURPLUS = "The row prints one zero more than it has symbols; left out here."
NOTE_HALF = "Exactly half way (275 mm); the thesis prints it rounded down."
NOTE_STEP = (
    "Over steps of 10°, as the thesis has it. The exact maximum is 0.4854, which would be printed"
    " 0.49 as it is for |E|."
)
NOTE_TOTAL = (
    "Four location errors of B and C (EX0B, EZ0B, EX0C, EY0C) stand in the equations but not in the"
    " table; with them the model has 41."
)


def table_4_1(case: ThesisCase) -> list[Row]:
    """Frame origins."""
    printed = printed_tables()["table_4_1"]
    machine = case.model.machine
    rows: list[Row] = []
    for index, name in enumerate("xyz"):
        for frame, value in zip(printed["frames"], printed[name], strict=True):
            offset = (
                machine.axes[frame].offset_mm if frame in machine.axes else machine.fixed_mm[frame]
            )
            ours = offset[index]
            note = NOTE_C_OFFSET if (frame, name) == ("C", "z") else ""
            if not note and name == "x" and frame == "t":
                note = NOTE_SURPLUS
            rows.append(number_row("table_4_1", f"O_{name}{frame}", value, ours, 1, "mm", note))
    return rows


def table_4_2(case: ThesisCase) -> list[Row]:
    """Count the parameters per axis."""
    printed = printed_tables()["table_4_2"]
    keys = [
        key
        for key in case.model.machine.parameter_keys
        if parameter(key).kind is not ErrorKind.LOCATION
    ]
    rows: list[Row] = []
    for axis in "XYZBC":
        own = [parameter(key) for key in keys if parameter(key).axis == axis]
        constants = sum(row.is_constant for row in own)
        for what, count, ours in zip(
            ("component", "constant"), printed[axis], (len(own) - constants, constants), strict=True
        ):
            rows.append(number_row("table_4_2", f"{axis} {what} errors", count, ours))
    rows.append(
        number_row("table_4_2", "all parameters", printed["total"], len(keys), note=NOTE_TOTAL)
    )
    return rows


def tool_gains(model: Model) -> dict[str, Gain]:
    """Gains at the point of table 4-3, by key."""
    at = printed_tables()["table_4_3"]["at"]
    return {gain.key: gain for gain in gains_at(model, Loop.TOOL, model.machine.parameter_keys, at)}


def workpiece_gains(model: Model, step_deg: float | None = None) -> dict[str, Gain]:
    """Gains of table 4-4, by key; the step of the thesis by default."""
    printed = printed_tables()["table_4_4"]
    ranges = {axis: (float(printed[axis][0]), float(printed[axis][1])) for axis in "BC"}
    step = step_deg or printed["step_deg"]
    found = gains_max(model, Loop.WORKPIECE, model.machine.parameter_keys, ranges, step)
    return {gain.key: gain for gain in found}


def gain_rows(table: str, gains: dict[str, Gain]) -> list[Row]:
    """Rows of a gain table."""
    rows: list[Row] = []
    for key, values in printed_tables()[table].items():
        if key not in gains:
            continue
        for (column, pick), value in zip(COLUMNS, values, strict=True):
            ours = pick(gains[key])
            note = ""
            if abs(abs(ours - value) - 0.005) < 1e-9:
                note = NOTE_HALF
            elif (key, column) in {("EBB", "x"), ("EBB", "z"), ("EA0B", "y"), ("EC0B", "y")}:
                note = NOTE_STEP
            unit = f"µm/{parameter(key).unit}"
            rows.append(number_row(table, f"{key} {column}", value, ours, 2, unit, note))
    return rows


def count_agreeing(table: str, gains: dict[str, Gain]) -> tuple[int, int]:
    """Count the gains of a table that agree, and all of them."""
    pairs = [
        (value, pick(gains[key]))
        for key, values in printed_tables()[table].items()
        if key in gains
        for (_, pick), value in zip(COLUMNS, values, strict=True)
    ]
    return sum(agrees(value, ours, 2) for value, ours in pairs), len(pairs)


def figure_4_3(gains: dict[str, Gain]) -> list[Row]:
    """Order of the key errors, among the parameters whose gain is amplified by a lever."""
    printed = printed_tables()["figure_4_3"]
    turning = [gain for gain in gains.values() if gain.parameter.is_rotation]
    rows: list[Row] = []
    for (column, pick), name in zip(COLUMNS, ("norm", "x", "y", "z"), strict=True):
        ranked = sorted(turning, key=pick, reverse=True)
        ours = " ".join(gain.key for gain in ranked[: len(printed[name])])
        row = text_row("figure_4_3", f"largest {column}", " ".join(printed[name]), ours)
        rows.append(row)
    return rows


def table_4_5() -> list[Row]:
    """Probability of a value within k standard deviations."""
    return [
        number_row(
            "table_4_5",
            f"within {k} sigma",
            value,
            100.0 * float(stats.norm.cdf(k) - stats.norm.cdf(-k)),
            4,
            "%",
        )
        for k, value in enumerate(printed_tables()["table_4_5"]["percent"], start=1)
    ]
