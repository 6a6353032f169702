"""What a page says of itself on arrival: which tab it is, and how wide."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from viser import _messages as messages

from warpspace.app.browser.arrivals import CARRIER, MOST_KNOWN, Arrivals
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.camera import CameraMemory
from warpspace.app.viewport.tab_camera import TabCamera
from warpspace.scene.library import load_scene


class Connections:
    """Stands for viser's connections."""

    def __init__(self) -> None:
        self.handler: Any = None
        self.sent: list[Any] = []

    def register_handler(self, _: type, handler: Any) -> None:
        self.handler = handler

    def queue_message(self, message: Any) -> None:
        self.sent.append(message)

    def say(self, client: int, uuid: str, value: object) -> None:
        self.handler(client, messages.GuiUpdateMessage(uuid, {"value": value}))


@pytest.fixture
def connections() -> Connections:
    return Connections()


@pytest.fixture
def arrivals(connections: Connections) -> Arrivals:
    return Arrivals(SimpleNamespace(_websock_server=connections))  # pyright: ignore[reportArgumentType]


def test_a_token_is_known_before_and_after_a_page_is_expected(
    arrivals: Arrivals, connections: Connections
) -> None:
    assert CARRIER in connections.sent[0].source
    connections.say(3, CARRIER, "early")
    woken: list[int] = []
    early, late = arrivals.expect(3), arrivals.expect(4)
    assert early.wait(0.0, lambda: woken.append(3))
    assert early.token == "early"
    assert not late.wait(0.0, lambda: woken.append(4))
    connections.say(4, CARRIER, "late")
    connections.say(4, CARRIER, "later")  # only the first counts
    assert late.is_there
    assert late.token == "late"
    assert woken == [4]


@pytest.mark.parametrize("value", [None, 1, ["a"], {"a": 1}])
def test_what_is_no_text_is_not_taken(
    arrivals: Arrivals, connections: Connections, value: object
) -> None:
    connections.say(1, CARRIER, value)
    connections.say(1, "some-widget", "text")
    connections.handler(1, messages.GuiUpdateMessage(CARRIER, [1]))  # pyright: ignore[reportArgumentType]
    assert not arrivals.expect(1).is_there


@pytest.mark.parametrize(
    ("width", "believed"),
    [(1280, 1280.0), (911.5, 911.5), (None, None), ("wide", None), (-1, None), (1e9, None)],
)
def test_a_page_says_how_wide_it_is(
    arrivals: Arrivals, connections: Connections, width: object, believed: float | None
) -> None:
    said = {"value": "token", "width": width}
    connections.handler(1, messages.GuiUpdateMessage(CARRIER, said))
    assert arrivals.expect(1).width == believed


def test_pages_that_never_show_anything_are_forgotten(
    arrivals: Arrivals, connections: Connections
) -> None:
    first = arrivals.expect(0)
    for client in range(1, MOST_KNOWN + 1):
        connections.say(client, CARRIER, "x")
    assert arrivals.expect(0) is not first
    arrivals.forget(5)
    assert not arrivals.expect(5).is_there


def fitted(image_width: int, page_width: float | None) -> np.ndarray:
    """Position of a camera whose picture was this wide when it was put in place."""
    camera = SimpleNamespace(image_width=image_width, image_height=720)
    picture = LiveModel().evaluate(start_state(load_scene("dvf5000_first")))
    tab = TabCamera(SimpleNamespace(camera=camera))  # pyright: ignore[reportArgumentType]
    tab.page_width = page_width
    # viser's camera has arrays, this one what it was given
    tab.remember = lambda: CameraMemory((0.0,) * 3, (0.0,) * 3, (0.0,) * 3, 0.8)
    tab.fit(picture)
    return camera.position


def test_the_first_view_does_not_depend_on_whether_panels_stood_already() -> None:
    expected = fitted(1280, page_width=1280.0)
    np.testing.assert_array_equal(fitted(610, page_width=1280.0), expected)
    # what a page does not say is taken from its picture
    np.testing.assert_array_equal(fitted(1280, page_width=None), expected)
