"""What a click in the drawing means: a question why, or the choice of a reference point."""

from typing import Any

import numpy as np

from warpspace.app.browser.arrangement import front_script
from warpspace.app.evaluation.budget import pick, with_picked
from warpspace.app.panels import PanelContext
from warpspace.app.viewport.layers import SCENE_PER_MM


class Pointing:
    """Listens to clicks in the drawing of one tab.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext) -> None:
        self._context = context

        @context.client.scene.on_click()
        def _(event: Any) -> None:
            origin, direction = event.ray_origin, event.ray_direction
            context.act(lambda: self._clicked(origin, direction))

    def _clicked(self, origin: Any, direction: Any) -> None:
        """Find what was clicked and note it in the state; by the session's worker."""
        picture = self._context.shown
        if picture is None:
            return
        try:
            ray = np.array([origin, direction], dtype=float)
        except (TypeError, ValueError):
            return
        if ray.shape != (2, 3):
            return
        picked = pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        if picked is None:
            return
        if self._context.next_click is not None and picked.point_mm is None:
            self._context.next_click(picked)
            return
        self._context.page.run_script(front_script("Error budget"))
        self._context.post(lambda state: with_picked(state, picked))
