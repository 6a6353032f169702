"""What files show while two states are compared: what is drawn, under its own name."""

from dataclasses import replace

from warpspace.app.documents.conditions import state_conditions
from warpspace.app.documents.received_files import safe_name
from warpspace.app.documents.services import Beside, Request
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import AFTER, BEFORE, Side
from warpspace.app.state.table import drawn_tables, without_words
from warpspace.picture.comparison import conditions_of_both
from warpspace.scene.model import Scene

AS_DRAWN = "View and HTML show what is drawn."


def build_request(picture: LivePicture) -> Request:
    """Say what a figure or an export of a picture is made of.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    Request
        The side that is drawn, or A with B beside it for the change; with the factor that is
        drawn, and the colours that all maps of the comparison share.
    """
    found, drawn = picture.compared, picture.drawn_state
    if found is None:
        return _request(picture, drawn, _scene(drawn, picture))
    a, b = (
        replace(_scene(side, picture), name=f"{name}: {title}", title=title)
        for name, title, side in zip("AB", found.titles, found.sides, strict=True)
    )
    side, scene = (found.sides[1], b) if found.shown == "b" else (found.sides[0], a)
    request = _request(picture, side, scene)
    loops = [side.loop for side in found.sides]
    return replace(
        request,
        beside=Beside(b, loops[1].value, state_conditions(found.sides[1]))
        if found.shown == "difference"
        else None,
        pair_conditions=conditions_of_both(*map(state_conditions, found.sides)),
        pair=(a, b) if not found.refused and loops[0] == loops[1] else None,
    )


def _scene(state: AppState, picture: LivePicture) -> Scene:
    """Give the scene of a state, its active errors only, with the factor of the picture."""
    return replace(active_scene(state), exaggeration=picture.exaggeration)


def _request(picture: LivePicture, state: AppState, scene: Scene) -> Request:
    """Ask for one scene, looked at as in a state."""
    return Request(
        scene,
        state.loop.value,
        picture.state.component,
        picture.state.nodes,
        picture.exaggeration,
        picture.state.shown.dark,
        picture.state.look.tilts,
        picture.scale,
        conditions=state_conditions(state),
        range_fixed=picture.state.look.range_mode == "fixed",
    )


def file_stem(picture: LivePicture) -> str:
    """Name the files of a picture, without an ending; of one with a table say so."""
    found, plain = picture.compared, safe_name(picture.state.scene.name)
    if drawn_tables(picture.state):
        return f"{plain}_with_table"
    if found is None:
        return plain
    a, b = (
        _side_stem(side, picture.state.comparison.pinned)
        for side in (picture.state.comparison.a, picture.state.comparison.b)
        if side is not None
    )
    words = {"a": f"A_{a}", "b": f"B_{b}", "difference": f"{b}_minus_{a}"}
    return safe_name(words[found.shown])


def _side_stem(side: Side[AppState], pinned: Side[AppState] | None) -> str:
    """Name one side of a comparison in the name of a file."""
    if side.state is None:
        return AFTER if pinned is not None else "present"
    return side.state.scene.name if side.is_scene else BEFORE


def exported_words(picture: LivePicture) -> str:
    """Say what pictures and exports show, where that is not simply what is steered."""
    found = picture.compared
    if without := without_words(picture.state):
        return f"Figure, exports, Save and Link: {without[0].lower()}{without[1:]} {AS_DRAWN}"
    if found is None:
        tilts = picture.state.look.tilts
        return "The figure shows the tilts of the tool axis as needles on the box." if tilts else ""
    sheet = build_sheet_words(picture)
    return f"Pictures and exports show {found.title}.{sheet} Save and Link keep the comparison."


def build_sheet_words(picture: LivePicture) -> str:
    """Say what the figure shows beyond what is drawn."""
    found = picture.compared
    if found is None or found.refused or found.sides[0].loop != found.sides[1].loop:
        return ""
    what = "the position errors of " if picture.state.look.tilts else ""
    return f" The figure shows {what}A, B and B − A on one sheet."
