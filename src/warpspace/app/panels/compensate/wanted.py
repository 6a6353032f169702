"""The widgets that say which table is wanted; those that a format has no use for are hidden."""

from collections.abc import Callable
from typing import Any

from warpspace.app.browser.handles import Input
from warpspace.app.panels.context import PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.app.state.compensation_choice import (
    LONGEST_POINTS,
    LOOP_WORDS,
    RESOLUTIONS,
    SIGN_WORDS,
    CompensationChoice,
    format_titles,
    has_place_for_tilt,
    is_table,
)


class WantedPart:
    """Format, points, resolution, sign, loop and orientation.

    Parameters
    ----------
    context : PanelContext
    changed : callable
        Called on the session when something else is wanted.
    """

    def __init__(self, context: PanelContext, changed: Callable[[], None]) -> None:
        gui = context.gui
        self._titles = format_titles()

        def note() -> None:
            context.act(changed)

        self._format: Input[str] = Input(
            gui.add_dropdown(
                "Table",
                tuple(self._titles),
                hint="What your control reads. `warpspace formats` says what each one holds.",
            ),
            note,
        )
        self._points: Input[str] = Input(
            gui.add_text(
                "Points per axis",
                "",
                hint="A number, or X=9,Y=5; empty for what suits the table.",
            ),
            note,
        )
        self._resolution: Input[float] = Input(
            gui.add_number(
                "Resolution [mm]",
                0.0,
                min=RESOLUTIONS.low,
                max=RESOLUTIONS.high,
                step=RESOLUTIONS.step,
                hint="Smallest step of a value (degrees for rotary axes); of fanuc-3d the detection"
                " unit. 0: that of the table.",
            ),
            note,
        )
        self._sign: Input[str] = Input(
            gui.add_dropdown(
                "Sign of the numbers",
                tuple(SIGN_WORDS),
                hint="Error: the control takes the numbers back. Correction: it adds them.",
            ),
            note,
        )
        self._loop: Input[str] = Input(
            gui.add_dropdown(
                "Loop corrected",
                tuple(LOOP_WORDS),
                hint="Suits: relative where a linear axis carries the workpiece, or where all"
                " rotary axes that correct the orientation do; else tool.",
            ),
            note,
        )
        self._orientation: Input[bool] = Input(
            gui.add_checkbox(
                "Correct the tool orientation",
                False,
                hint="Rotary axes take back the tilt of the tool axis, as far as they can.",
            ),
            note,
        )

    def choice(self, state: AppState) -> CompensationChoice:
        """Give what is wanted, clamped; what is hidden counts as not given."""
        title = str(self._format.handle.value)
        name = self._titles.get(title, next(iter(self._titles.values())))
        table, tilts = is_table(name), has_place_for_tilt(name, state.scene.machine)
        sign = SIGN_WORDS.get(str(self._sign.handle.value), "")
        return CompensationChoice(
            name,
            str(self._points.handle.value)[: LONGEST_POINTS + 1],
            RESOLUTIONS.clamp(_number(self._resolution.handle.value), 0.0) if table else 0.0,
            sign if table else "",
            LOOP_WORDS.get(str(self._loop.handle.value), ""),
            bool(self._orientation.handle.value) and tilts,
        )

    def follow(self, state: AppState) -> None:
        """Show what the format and the machine have a use for."""
        name = self._titles.get(str(self._format.handle.value), "")
        table = not name or is_table(name)
        tilts = bool(name) and has_place_for_tilt(name, state.scene.machine)
        for one, visible in (
            (self._resolution, table),
            (self._sign, table),
            (self._orientation, tilts),
        ):
            if one.handle.visible != visible:
                one.handle.visible = visible


def _number(value: Any) -> float:
    """Take a number from a browser; what is none is 0."""
    return float(value) if isinstance(value, int | float) else 0.0
