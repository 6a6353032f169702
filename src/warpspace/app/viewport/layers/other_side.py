"""Wireframe of the side of a comparison that is not drawn."""

from viser import SceneApi

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import colour_bytes
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.picture.mesh import outline_pieces


class OtherSideLayer:
    """Edges and grid lines of the other bent box, every second piece, so that it reads as dotted.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._edges = add_lines(scene, "/compare/other", palette(picture).edge, 2.0, visible=False)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the other side."""
        other = None if picture.compared is None else picture.compared.other_mm
        if other is None or not picture.state.comparison.ghost:
            self._edges.put(visible=False)
            return
        self._edges.put(
            points=outline_pieces(picture, other)[::2],
            colors=colour_bytes(palette(picture).edge),
            visible=True,
        )
