"""What lies over the drawing: heading, scale bars, values on isolines, the switch of the machine.

All of it is placed by the page (`browser/room.js`); here is what it says.
"""

from dataclasses import replace
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Input
from warpspace.app.browser.room import Room, open_script, read_room, show_script
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.documents.conditions import order_conditions
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.summary import buttons, heading, strip
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.picture.mesh import isoline_labels
from warpspace.picture.words import spell_factor
from warpspace.units import Array, spell_short

MACHINE = "machine"  # word of the button that hides the ghost of the machine, or shows it


class RoomPanel:
    """The room between the panels."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        said = context.gui.add_text("", "", visible=False)
        self._said: Input[str] = Input(said, context.changed)
        self._clicks = Clicks(context.gui, self._clicked)
        self._order = ""
        self._sent: dict[str, Any] = {}
        self._sent_html: dict[str, str] = {}
        context.page.run_script(open_script(dom_id(said)))

    def _clicked(self, word: str) -> None:
        if word == MACHINE:
            self._context.post(_switched)

    def read(self, state: AppState) -> AppState:
        """Have the camera fill a room whose size has changed."""
        room = read_room(self._said.poll() or "")
        if room is not None:
            self._context.act(lambda: self._fill(room))
        return state

    def _fill(self, room: Room) -> None:
        picture = self._context.shown
        if picture is not None and self._context.camera.take_room(room, picture):
            self._context.client.flush()

    def show(self, picture: LivePicture) -> None:
        """Send what has changed."""
        html = {
            "head": heading(picture, self._order, picture.state.left_behind),
            "strip": strip(picture),
            "buttons": buttons(
                ghost=picture.state.machine.ghost,
                there=not picture.state.machine.shown,
                attributes=self._clicks.button(MACHINE),
            ),
        }
        facts = room_facts(picture)
        changes = {key: value for key, value in facts.items() if self._sent.get(key) != value}
        pieces = {key: text for key, text in html.items() if self._sent_html.get(key) != text}
        if changes or pieces:
            self._context.page.run_script(show_script({**changes, "html": pieces}))
        self._sent, self._sent_html = facts, html

    def settle(self, picture: LivePicture) -> None:
        """Say what the first order leaves out; evaluating that is too slow for every move."""
        self._order = " ".join(order_conditions(picture))
        self.show(picture)


def _switched(state: AppState) -> AppState:
    return replace(state, machine=state.machine.switched(ghost=not state.machine.ghost))


def room_facts(picture: LivePicture) -> dict[str, Any]:
    """Give what the page places by itself as the camera moves."""
    state = picture.state
    bounds = picture.grid.bounds_mm
    return {
        "bars": state.look.bars,
        "factor": picture.exaggeration,
        "spelt": spell_factor(picture.exaggeration),
        "perMm": SCENE_PER_MM,
        "centre": _scene(bounds.mean(axis=0)),
        "dark": state.shown.dark,
        "labels": _labels(picture),
        "slices": _slices(picture),
    }


def _scene(point_mm: Array) -> list[float]:
    return [round(float(value) * SCENE_PER_MM, 5) for value in point_mm]


def _labels(picture: LivePicture) -> list[dict[str, Any]]:
    """Spell the values of the isolines that are drawn."""
    look = picture.state.look
    if not look.isolines or look.surface == "grid":
        return []
    return [
        {
            "at": _scene(label.at_mm),
            "out": [float(v) for v in label.outward],
            "text": f"{spell_short(label.value)} {picture.scale.unit}",
        }
        for label in isoline_labels(picture)
    ]


def _slices(picture: LivePicture) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for one in picture.slices:
        low, high = one.grid.bounds_mm
        axis = int((high - low).argmin())
        found.append(
            {"axis": axis, "at": _scene(low)[axis], "low": _scene(low), "high": _scene(high)}
        )
    return found
