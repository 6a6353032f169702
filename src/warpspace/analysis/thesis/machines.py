"""Tables 5-3 to 5-5: the two machines measured."""

from warpspace.analysis.measured import Check, Measured, check_errors, measured
from warpspace.analysis.thesis.rows import (
    Row,
    ThesisCase,
    number_row,
    printed_tables,
    spell_tolerance,
    text_row,
)
from warpspace.machine.parameters import parameter

MACHINES = ("first", "second")
NOTE_SWAPPED = (
    "Table 5-5 has the values of EA0Z and EB0Z the other way round than table {table}, which"
    " measured them; figure 5-10 shows a rhombic YZ plane and the text blames EA0Z for it, so that"
    " table {table} is followed."
)
NOTE_DIGIT = " Besides, 13.8 there is 13.9 here."
NOTE_RAMP = (
    "Mean |E| of the tool loop over 11³ nodes, with each angular error as a ramp from zero to the"
    " printed value, since the measured curves are lost. Seven numbers show consistency, not proof;"
    " see the hypotheses for other readings."
)


def judged(case: ThesisCase) -> tuple[Measured, Measured]:
    """Judge both machines by the proposed tolerance."""
    first, second = (
        measured(case.model, errors, case.proposed, case.workspace)
        for errors in (case.first, case.second)
    )
    return first, second


def squareness_tables(case: ThesisCase) -> list[Row]:
    """Tables 5-3 and 5-4."""
    rows: list[Row] = []
    for table, errors in (("table_5_3", case.first), ("table_5_4", case.second)):
        checks = {check.key: check for check in check_errors(errors, case.proposed)}
        for key, value in printed_tables()[table].items():
            if key in checks:
                rows.append(number_row(table, key, value, checks[key].value, 1, "µrad"))
                rows.append(_tolerance_row(table, checks[key]))
    return rows


def table_5_5(case: ThesisCase) -> list[Row]:
    """Key errors, their marks, and the volumetric error."""
    printed = printed_tables()["table_5_5"]
    rows: list[Row] = []
    both = judged(case)
    for which, (name, machine) in enumerate(zip(MACHINES, both, strict=True)):
        for check in machine.checks:
            if which == 0:
                rows.append(_tolerance_row("table_5_5", check))
            value, mark = printed[check.key][2 * which : 2 * which + 2]
            note = ""
            if check.key in {"EA0Z", "EB0Z"}:
                note = NOTE_SWAPPED.format(table="5-3" if which == 0 else "5-4")
                note += NOTE_DIGIT if value == 13.9 else ""
            unit = parameter(check.key).unit
            key = f"{name} machine {check.key}"
            rows.append(number_row("table_5_5", key, value, check.value, 1, unit, note))
            rows.append(text_row("table_5_5", f"{key} mark", mark, check.mark, note=note))
        mean = machine.predicted_nodes.mean_um
        value = printed["volumetric_um"][which]
        key = f"{name} machine volumetric error"
        rows.append(number_row("table_5_5", key, value, mean, 0, "µm", NOTE_RAMP))
    return rows


def _tolerance_row(table: str, check: Check) -> Row:
    """Tolerance of a key error as tables 5-3 to 5-5 repeat it from table 4-7."""
    printed = spell_tolerance(*printed_tables()["table_4_7"][check.key])
    centre, half_width = check.centre, check.half_width
    ours = "none" if centre is None or half_width is None else spell_tolerance(centre, half_width)
    return text_row(table, f"{check.key} tolerance", printed, ours, check.unit)
