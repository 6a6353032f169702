"""A tab of a plug-in appears on the page and follows the picture."""

from app.wire import OPEN, Wire, dial
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.context import PanelContext
from warpspace.app.server.tabs import Tab, register_tab, tabs, unregister_tab
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState
from warpspace.scene.library import load_scene

SHOWN: list[float] = []


class NotesPanel:
    def __init__(self, context: PanelContext, state: AppState) -> None:
        context.gui.add_button(f"Notes on {state.scene.title}")

    def read(self, state: AppState) -> AppState:
        return state

    def show(self, picture: LivePicture) -> None:
        SHOWN.append(picture.statistics.mean_um)


def test_an_added_tab_appears_and_follows_the_picture() -> None:
    register_tab(Tab("Notes", "settings", [NotesPanel]))
    try:
        assert [tab.name for tab in tabs() if tab.place == "settings"][-1] == "Notes"
        with Viewer(load_scene("dvf5000_first")) as viewer, dial(viewer) as socket:
            wire = Wire(socket)
            assert wire.read_until(lambda: OPEN in wire.scripts, seconds=30.0)
            assert "Notes on DVF5000, first machine measured" in wire.labels
            before = len(SHOWN)
            wire.update(wire.widgets["EAX"], 33.0)
            assert wire.read_until(lambda: len(SHOWN) > before)
            assert SHOWN[-1] != SHOWN[0]
    finally:
        unregister_tab("Notes")
