"""What files show while two states are compared: what is drawn, under its own name."""

from dataclasses import replace

from warpspace.app.documents.received_files import safe_name
from warpspace.app.documents.services import Beside, Request
from warpspace.app.evaluation.evaluate import Frame
from warpspace.app.evaluation.resulting_scene import heard_scene
from warpspace.app.state.app_state import AppState
from warpspace.scene.model import Scene


def build_request(frame: Frame) -> Request:
    """Say what a figure or an export of a frame is made of.

    Parameters
    ----------
    frame : Frame

    Returns
    -------
    Request
        The side that is drawn, or A with B to be subtracted; with the factor that is drawn, and the
        colours that all maps of the comparison share.
    """
    found, drawn = frame.compared, frame.subject or frame.state
    if found is None:
        return _request(frame, drawn, _scene(drawn, frame))
    a, b = (
        replace(_scene(side, frame), name=f"{name}: {title}", title=title)
        for name, title, side in zip("AB", found.titles, found.sides, strict=True)
    )
    request = _request(frame, drawn, b if found.shown == "b" else a)
    loops = [side.loop for side in found.sides]
    return replace(
        request,
        minus=Beside(b, loops[1].value) if found.shown == "difference" else None,
        pair=(a, b) if not found.refused and loops[0] == loops[1] else None,
    )


def _scene(state: AppState, frame: Frame) -> Scene:
    """Give the scene of a state as it is heard, drawn with the factor of the frame."""
    return replace(heard_scene(state), exaggeration=frame.exaggeration)


def _request(frame: Frame, state: AppState, scene: Scene) -> Request:
    """Ask for one scene, looked at as in a state."""
    return Request(
        scene,
        state.loop.value,
        frame.state.component,
        frame.state.nodes,
        frame.exaggeration,
        frame.state.shown.dark,
        frame.state.look.tilts,
        frame.scale,
    )


def file_stem(frame: Frame) -> str:
    """Name the files of a frame, without an ending."""
    found = frame.compared
    if found is None:
        return safe_name(frame.state.scene.name)
    a, b = (
        "now" if side.state is None else side.state.scene.name if side.is_scene else "snapshot"
        for side in (frame.state.comparison.a, frame.state.comparison.b)
        if side is not None
    )
    words = {"a": f"A_{a}", "b": f"B_{b}", "difference": f"{a}_minus_{b}"}
    return safe_name(words[found.shown])


def exported_words(frame: Frame) -> str:
    """Say what pictures and exports show, where that is not simply what is steered."""
    found = frame.compared
    if found is None:
        tilts = frame.state.look.tilts
        return "The figure shows the tilts of the tool axis as needles on the box." if tilts else ""
    sheet = build_sheet_words(frame)
    return f"Pictures and exports show {found.title}.{sheet} Save and Link keep the comparison."


def build_sheet_words(frame: Frame) -> str:
    """Say what the figure shows beyond what is drawn."""
    found = frame.compared
    if found is None or found.refused or found.sides[0].loop != found.sides[1].loop:
        return ""
    what = "the position errors of " if frame.state.look.tilts else ""
    return f" The figure shows {what}A, B and A − B on one sheet."
