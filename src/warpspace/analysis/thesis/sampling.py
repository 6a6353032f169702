"""Tables 4-6 to 4-8: tolerances, and the volumetric error they lead to."""

from dataclasses import dataclass

from warpspace.analysis.draws import Distribution, build_draws, loop_keys
from warpspace.analysis.montecarlo import MonteCarlo, Plan, montecarlo
from warpspace.analysis.nodes import Over
from warpspace.analysis.thesis.rows import (
    Row,
    ThesisCase,
    number_row,
    printed_tables,
    spell_tolerance,
    text_row,
)
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop
from warpspace.machine.parameters import ErrorKind, parameter
from warpspace.machine.tolerances import ToleranceSet

SAMPLES, SEED = 100_000, 0
"""As many as the thesis has."""

NOTE_PEAK = (
    "Ours is the mean of the uniform distribution; its peak lies at {mode:.1f} µm. The thesis reads"
    " its number off the peak of a histogram and calls it the mean."
)
MORE = {
    "tool_general": " Only the mean of the uniform distribution gives 41.",
    "tool_proposed": (
        " The normal distribution of its section 4.3 gives {normal:.1f} µm: 24 lies between the two"
        " distributions, and no choice that gives 41 gives 24 as well."
    ),
    "workpiece_general": " Within its scatter of 0.2 µm the peak may be printed 15.",
    "workpiece_proposed": " 10 lies between peak and mean.",
}


@dataclass(frozen=True)
class Sampled:
    """The four distributions of table 4-8 under one choice of distribution and parameters."""

    case: ThesisCase
    with_location: bool = False

    def run(self, name: str, distribution: str, *, clip: bool = False) -> MonteCarlo:
        """Sample one of them.

        Parameters
        ----------
        name : str
            "tool_general", "tool_proposed", "workpiece_general" or "workpiece_proposed".
        distribution : str
        clip : bool, optional
        """
        side, _, which = name.partition("_")
        loop = Loop(side)
        tolerances = self.case.general if which == "general" else self.case.proposed
        if self.with_location:
            tolerances = with_location_errors(tolerances)
        model = self.case.model
        keys = loop_keys(model, loop, model.machine.parameter_keys)
        draws = build_draws(tolerances, keys, Distribution(distribution), clip=clip)
        plan = Plan(SAMPLES, SEED, Over.SAMPLED)
        return montecarlo(model, draws, self.case.workspace, View(loop), plan)


def with_location_errors(tolerances: ToleranceSet) -> ToleranceSet:
    """Let the location errors have the tolerance of a translation."""
    kept = {
        key: tolerance
        for key, tolerance in tolerances.own.items()
        if parameter(key).kind is not ErrorKind.LOCATION
    }
    return ToleranceSet(tolerances.default, kept)


def thesis_keys(case: ThesisCase) -> list[str]:
    """Give the 37 parameters of table 4-2."""
    return [
        key
        for key in case.model.machine.parameter_keys
        if parameter(key).kind is not ErrorKind.LOCATION
    ]


def _spelled(tolerances: ToleranceSet, key: str) -> str:
    """Spell the tolerance of a parameter."""
    found = tolerances.get(key)
    return "none" if found is None else spell_tolerance(found.centre, found.half_width)


def table_4_6(case: ThesisCase) -> list[Row]:
    """General tolerance of the 37 parameters."""
    printed = printed_tables()["table_4_6"]
    return [
        text_row(
            "table_4_6",
            key,
            spell_tolerance(0.0, printed[parameter(key).tolerance_class]),
            _spelled(case.general, key),
            parameter(key).unit,
        )
        for key in thesis_keys(case)
    ]


def table_4_7(case: ThesisCase) -> list[Row]:
    """Proposed tolerance of the key errors."""
    return [
        text_row(
            "table_4_7",
            key,
            spell_tolerance(*values),
            _spelled(case.proposed, key),
            parameter(key).unit,
        )
        for key, values in printed_tables()["table_4_7"].items()
        if isinstance(values, list)
    ]


def table_4_8(case: ThesisCase) -> list[Row]:
    """Both tolerances of the groups of key errors, and the predicted volumetric error."""
    printed = printed_tables()["table_4_8"]
    rows: list[Row] = []
    for group in printed["groups"]:
        for name, tolerances in (("general", case.general), ("proposed", case.proposed)):
            spelled = {_spelled(tolerances, key) for key in group["keys"]}
            unit = parameter(group["keys"][0]).unit
            key = f"{' '.join(group['keys'])} {name}"
            ours = " ".join(sorted(spelled))
            rows.append(text_row("table_4_8", key, spell_tolerance(*group[name]), ours, unit))
    return rows + [
        _predicted_row(case, name, value) for name, value in printed["predicted"].items()
    ]


def _predicted_row(case: ThesisCase, name: str, value: float) -> Row:
    """Mean of the uniform distribution beside a predicted volumetric error."""
    found = Sampled(case).run(name, "uniform")
    normal = Sampled(case).run(name, "normal").mean_um
    note = (NOTE_PEAK + MORE[name]).format(mode=found.mode_um, normal=normal)
    key = f"{name.replace('_', ' loop, ')} tolerance: volumetric error"
    return number_row("table_4_8", key, value, found.mean_um, 0, "µm", note)
