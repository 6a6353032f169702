"""Mixed-integer linear programs, solved by HiGHS without output of its own."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpspace.units import Array


def solve_integer_program(
    costs: Array,
    rows: Array,
    limits: tuple[ArrayLike, ArrayLike],
    bounds: tuple[ArrayLike, ArrayLike],
    is_integer: NDArray[np.bool_],
    max_seconds: float = np.inf,
) -> tuple[Array | None, float]:
    """Find the least costs · x, x [n] within bounds and rows @ x, rows [m, n], within limits.

    Not by ``scipy.optimize.milp``: its HiGHS prints on stdout in rare cases.

    Returns
    -------
    ndarray or None
        x, [n]; None where there is none, or none was found in time.
    float
        Proved lower bound of the costs.
    """
    import highspy

    program, count = highspy.HighsLp(), len(costs)
    program.num_col_, program.num_row_ = count, len(rows)
    program.col_cost_ = costs.tolist()
    lower, upper = (np.broadcast_to(end, count).tolist() for end in bounds)
    program.col_lower_, program.col_upper_ = lower, upper
    lower, upper = (np.broadcast_to(end, len(rows)).tolist() for end in limits)
    program.row_lower_, program.row_upper_ = lower, upper
    row, column = np.nonzero(rows)
    program.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    program.a_matrix_.start_ = np.searchsorted(row, np.arange(len(rows) + 1)).tolist()
    program.a_matrix_.index_ = column.tolist()
    program.a_matrix_.value_ = rows[row, column].tolist()
    kinds = highspy.HighsVarType.kContinuous, highspy.HighsVarType.kInteger
    program.integrality_ = [kinds[int(flag)] for flag in is_integer]
    solver = highspy.Highs()
    solver.silent()
    solver.setOptionValue("threads", 1)
    solver.setOptionValue("mip_rel_gap", 0.0)
    solver.setOptionValue("time_limit", float(max_seconds))
    solver.passModel(program)
    solver.run()
    info = solver.getInfo()
    if info.primal_solution_status != highspy.SolutionStatus.kSolutionStatusFeasible:
        return None, -np.inf
    return np.array(solver.getSolution().col_value), float(info.mip_dual_bound)
