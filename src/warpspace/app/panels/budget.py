"""The panel "Error budget": the error of the point that was asked about, taken apart."""

import numpy as np

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle
from warpspace.app.browser.page import front_script
from warpspace.app.evaluation.budget import answer, pick_worst, with_lever, with_picked
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.budget import (
    ASK,
    AT,
    EDIT,
    EXCLUDE,
    INCLUDE,
    LEVER,
    REFUSED,
    answer_html,
    field_html,
)
from warpspace.app.state.app_state import AppState
from warpspace.app.state.edits import with_excluded
from warpspace.app.state.typed_numbers import with_typed_point
from warpspace.app.viewport.camera import CameraMemory, fit_camera
from warpspace.app.viewport.layers import SCENE_PER_MM

TAB = "Error budget"
WORST = "Worst point"
HINT = "Ask what the largest error of the volume is made of (W does the same)."


def add_worst_button(context: PanelContext, label: str = WORST) -> None:
    """Add the button that asks about the worst point."""
    button = context.gui.add_button(label, color="gray", hint=HINT)
    button.on_click(lambda _: context.act(lambda: ask_worst(context)))


def ask_worst(context: PanelContext) -> None:
    """Ask about the worst point of what is drawn, and bring its budget to the front."""
    if context.shown is None:
        return
    picked = pick_worst(context.shown)
    context.page.run_script(front_script(TAB))
    context.post(lambda state: with_picked(state, picked))


class BudgetPanel:
    """Numbers of the picked point, one row per contribution, and a button that ends it."""

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._clicks = Clicks(gui, self._clicked)
        add_worst_button(context)
        self._field = Handle(gui.add_html(""))
        self._text = Handle(gui.add_html(ASK))
        far = gui.add_button(
            "Show the whole lever",
            color="gray",
            visible=False,
            hint="Move the camera back until axis, lever and box are all in view (F goes back).",
        )
        far.on_click(lambda _: context.act(self._stand_back))
        clear = gui.add_button(
            "Clear",
            color="gray",
            visible=False,
            hint="Forget the point (N does the same).",
        )
        clear.on_click(lambda _: context.post(forget))
        self._far, self._clear = Handle(far), Handle(clear)
        command = gui.add_command("Forget the point", description="End the question", hotkey="N")
        command.on_trigger(lambda _: context.post(forget))
        worst = gui.add_command(WORST, description=HINT, hotkey="W")
        worst.on_trigger(lambda _: context.act(lambda: ask_worst(context)))

    def _clicked(self, word: str) -> None:
        what, _, rest = word.partition(" ")
        context = self._context
        if what == AT:
            context.post(lambda state: with_typed_point(state, rest))
        elif what == LEVER:
            context.post(lambda state: with_lever(state, rest))
        elif what in (EXCLUDE, INCLUDE):
            context.post(lambda state: with_excluded(state, rest, what == EXCLUDE))
        elif what == EDIT:
            context.act(lambda: self._edit(rest))

    def _edit(self, key: str) -> None:
        if key in self._context.store.state.amplitudes and self._context.reveal_error is not None:
            self._context.post(lambda state: state.with_chosen_error(key))
            self._context.reveal_error(key)

    def read(self, state: AppState) -> AppState:
        """Nothing to take over: clicks post what they change."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Explain the point in the state that is drawn."""
        state = picture.drawn_state
        picked = picture.state.picked
        self._clear.put(visible=picked is not None)
        self._far.put(visible=picked is not None and bool(picture.state.lever))
        at = None
        if picked is None:
            text = ASK
        elif picture.is_difference:
            text = REFUSED
        else:
            found = answer(state, picked, picture.exaggeration)
            at = found.at
            # only what is steered can be changed, not what it is compared with
            button = self._clicks.button if picture.is_steered else None
            left_out, clicks = state.exclusions.excluded, self._clicks.attributes
            text = answer_html(found, picture.state.lever, clicks, button, left_out)
        self._text.put(content=text)
        self._field.put(content=field_html(at, self._clicks.text_box(AT)))

    def _stand_back(self) -> None:
        picture, camera = self._context.shown, self._context.camera.remember()
        if picture is None or picture.state.picked is None:
            return
        found = answer(picture.drawn_state, picture.state.picked, picture.exaggeration)
        parts = found.explanation.contributions
        origins = [p.origin_mm + found.shift_mm for p in parts if p.key == picture.state.lever]
        if not origins:
            return
        points = np.concatenate([picture.drawn_mm.reshape(-1, 3), np.stack(origins)])
        room = self._context.camera.room
        pose = fit_camera(
            points,
            room.aspect,
            fov_deg=float(np.rad2deg(camera.fov_rad)),
            margin=1.2,
            top=room.top_share,
            bottom=room.bottom_share,
        )
        x, y, z = (float(value) * SCENE_PER_MM for value in pose.position)
        at = tuple(float(value) * SCENE_PER_MM for value in pose.look_at)
        self._context.look_from(
            CameraMemory((x, y, z), (at[0], at[1], at[2]), (0.0, 0.0, 1.0), camera.fov_rad)
        )


def forget(state: AppState) -> AppState:
    """Ask about no point any more."""
    return with_picked(state, None)
