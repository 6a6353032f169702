"""Wireframe of the side of a comparison that is not drawn."""

from viser import SceneApi

from warpspace.app.evaluation.evaluate import Frame
from warpspace.app.viewport.layers import colour_bytes, palette, pieces
from warpspace.app.viewport.layers.adding import add_lines


class OtherLayer:
    """Edges and grid lines of the other bent box, every second piece, so that it reads as dotted.

    Parameters
    ----------
    scene : viser.SceneApi
    frame : Frame
    """

    def __init__(self, scene: SceneApi, frame: Frame) -> None:
        self._edges = add_lines(scene, "/compare/other", palette(frame).edge, 2.0, visible=False)
        self.show(frame)

    def show(self, frame: Frame) -> None:
        """Follow the other side."""
        other = None if frame.compared is None else frame.compared.other_mm
        if other is None or not frame.state.comparison.ghost:
            self._edges.put(visible=False)
            return
        self._edges.put(
            points=pieces(other, frame.topology.edge_segments)[::2],
            colors=colour_bytes(palette(frame).edge),
            visible=True,
        )
