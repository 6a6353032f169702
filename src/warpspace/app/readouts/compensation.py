"""A compensation in words: what it leaves, what the control holds, what was assumed."""

from warpspace.app.evaluation.compensation import BOTH, box_of
from warpspace.app.readouts.html import message, render
from warpspace.app.state.app_state import AppState
from warpspace.formats.compensation.compensate import Compensation

WHAT = (
    "A table of corrections for the control, and what it would leave of the errors that the sliders"
    " say. Choose what your control reads and press Compute: it takes some seconds and changes"
    " nothing yet."
)
ROWS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}
"""Word on a row to field of `Statistics`."""
MOST_WORDS = 12  # assumptions and notes that are listed


def note_html(problem: str, *, known: bool) -> str:
    """Say what went wrong, else what is to be done as long as nothing was computed."""
    if problem:
        return message(problem, "compensation trouble")
    return "" if known else message(WHAT, "compensation note")


def box_words(state: AppState, found: Compensation) -> str:
    """Say how the box is drawn: with which table, and in which loop."""
    controller = state.controller
    if controller is None:
        return "The box shows the machine without a table."
    table = "this table" if controller is found.controller else "an earlier table"
    what = "A without, B with" if box_of(state) == BOTH else "with"
    words = f"The box shows the machine as the sliders say, {what} {table}, {controller.label}."
    if state.loop != controller.loop:
        words += f" It is seen in the {state.loop} loop, the table corrects the {controller.loop}."
    return words


def compensation_html(found: Compensation, picture: str, box: str, *, current: bool) -> str:
    """Spell a compensation."""
    return render(
        "compensation",
        found=found,
        rows=ROWS,
        before=found.before_statistics,
        after=found.after_statistics,
        tilts=list(zip(("mean", "max"), found.tilt_urad(found.before), strict=True)),
        tilts_after=dict(zip(("mean", "max"), found.tilt_urad(found.after), strict=True)),
        assumed=found.assumed[:MOST_WORDS],
        notes=found.notes[:MOST_WORDS],
        picture=picture,
        box=box,
        current=current,
    )
