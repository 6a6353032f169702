"""The panel "Why": the error of the point that was clicked, taken apart."""

import numpy as np

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.budget import answer, with_lever, with_picked
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.budget import ASK, REFUSED, answer_html
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.camera import CameraMemory, fit_camera
from warpspace.app.viewport.layers import SCENE_PER_MM


class BudgetPanel:
    """Numbers of the picked point, one row per contribution, and a button that ends it.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._clicks = Clicks(gui, lambda key: context.post(lambda s: with_lever(s, key)))
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

    def read(self, state: AppState) -> AppState:
        """Nothing to take over: clicks post what they change."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Explain the point in the state that is drawn."""
        state = picture.drawn_state
        picked = picture.state.picked
        self._clear.put(visible=picked is not None)
        self._far.put(visible=picked is not None and bool(picture.state.lever))
        if picked is None:
            self._text.put(content=ASK)
        elif picture.is_difference:
            self._text.put(content=REFUSED)
        else:
            found = answer(state, picked, picture.exaggeration)
            self._text.put(content=answer_html(found, picture.state.lever, self._clicks.attributes))

    def _stand_back(self) -> None:
        """Move the camera back until the frame of the chosen contribution is in view."""
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
