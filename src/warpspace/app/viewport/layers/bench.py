"""The path of the standard test that is run: nominal, and actual with the factor of the box."""

import numpy as np
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM, colour_bytes, polyline_pieces
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.picture.marks import spell_micrometres
from warpspace.picture.words import spell_short


class BenchLayer:
    """The path of a test and its name.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        colours = palette(picture)
        self._nominal = add_lines(scene, "/test/nominal", colours.trace_nominal, 1.5, visible=False)
        self._actual = add_lines(scene, "/test/actual", colours.trace_actual, 3.0, visible=False)
        self._name = Handle(
            scene.add_label(
                "/test/name", "", visible=False, font_screen_scale=0.8, anchor="bottom-center"
            )
        )
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Draw the path."""
        found = picture.bench
        shown = isinstance(found, BenchPicture) and picture.state.bench.path
        for part in (self._nominal, self._actual, self._name):
            part.put(visible=shown)
        if not isinstance(found, BenchPicture) or not shown:
            return
        lines = found.lines_mm(picture.exaggeration)
        colours = palette(picture)
        nominal = polyline_pieces([one for one, _ in lines])
        actual = polyline_pieces([other for _, other in lines])
        self._nominal.put(
            points=nominal if len(nominal) else NOTHING, colors=colour_bytes(colours.trace_nominal)
        )
        self._actual.put(
            points=actual if len(actual) else NOTHING, colors=colour_bytes(colours.trace_actual)
        )
        ends = np.concatenate([other for _, other in lines])
        factor = spell_short(picture.exaggeration)
        self._name.put(
            text=f"{found.prepared.test.name}: max {spell_micrometres(found.largest_um)},"
            f" drawn {factor} ×",
            position=ends[np.argmax(ends[:, 2])] * SCENE_PER_MM,
        )
