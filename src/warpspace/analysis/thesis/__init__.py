"""Every number printed in the thesis beside ours.

The numbers come from the model and the bundled scenes alone; nothing is tuned to agree. Where the
print cannot be reproduced, the row says so and why, and `hypotheses` lists what was tried.
"""

from warpspace.analysis.thesis.hypotheses import Hypothesis, thesis_hypotheses
from warpspace.analysis.thesis.rows import Row, ThesisCase
from warpspace.analysis.thesis.table import thesis_rows

__all__ = ["Hypothesis", "Row", "ThesisCase", "thesis_hypotheses", "thesis_rows"]
