"""All rows, in the order of the thesis."""

from warpspace.analysis.thesis import machines, model, sampling
from warpspace.analysis.thesis.rows import Row, ThesisCase


def thesis_rows(case: ThesisCase) -> tuple[Row, ...]:
    """Set every number printed in tables 4-1 to 4-8 and 5-3 to 5-5 beside ours.

    Parameters
    ----------
    case : ThesisCase

    Returns
    -------
    tuple of Row
    """
    gains = model.tool_gains(case.model)
    return (
        *model.table_4_1(case),
        *model.table_4_2(case),
        *model.gain_rows("table_4_3", gains),
        *model.figure_4_3(gains),
        *model.gain_rows("table_4_4", model.workpiece_gains(case.model)),
        *model.table_4_5(),
        *sampling.table_4_6(case),
        *sampling.table_4_7(case),
        *sampling.table_4_8(case),
        *machines.squareness_tables(case),
        *machines.table_5_5(case),
    )
