"""What a page may say: every message of a client is checked here before viser acts on it.

viser builds an object of whatever kind a message names and sets whatever attribute of a widget it
names. Here only the kinds the app has a use for pass, with fields of the right type and size; of
a widget a page sets nothing but `value`, which is a text.
What is refused is left out and the connection stays open, since a new one would cost the server
more than a message that is dropped.
"""

import logging
import struct
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct
from viser import ClientHandle, ViserServer

from warpspace.app.browser.viser_private import check_messages, check_updates, log_failures

logger = logging.getLogger(__name__)
LARGEST_NUMBER = 1e9
LONGEST_NAME = 1_000
LONGEST_TEXT = 6_000_000  # of the value of a text field, characters: a file of 4 MiB in base64
LARGEST_SIDE_PX = 16_384  # of the page's picture, and of a picture that it renders
PNG_START = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"

Number = Annotated[float, Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]  # NaN is neither
Side = Annotated[float, Meta(ge=0, le=LARGEST_SIDE_PX)]
Name = Annotated[str, Meta(max_length=LONGEST_NAME)]
Text = Annotated[str, Meta(max_length=LONGEST_TEXT)]
Vector = tuple[Number, Number, Number]


class Update(Struct, forbid_unknown_fields=True):
    """What is set: the value and, where a page says who it is, its width."""

    value: Text
    width: Number | None = None


class WidgetChanged(Struct, tag_field="type", tag="GuiUpdateMessage", forbid_unknown_fields=True):
    """A script of ours says something: events, an answer, what it has kept."""

    uuid: Name
    updates: Update


class CameraMoved(Struct, tag_field="type", tag="ViewerCameraMessage", forbid_unknown_fields=True):
    """The page's camera; the first one opens the session."""

    wxyz: tuple[Number, Number, Number, Number]
    position: Vector
    fov: Annotated[float, Meta(gt=0, lt=3.1416)]
    near: Number
    far: Number
    image_height: Side
    image_width: Side
    look_at: Vector
    up_direction: Vector


class DrawingClicked(
    Struct, tag_field="type", tag="ScenePointerMessage", forbid_unknown_fields=True
):
    """A click in the drawing."""

    event_type: Annotated[str, Meta(pattern="^click$")]
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: tuple[tuple[Number, Number]]
    modifier: Annotated[str, Meta(max_length=40)] | None


class PictureRendered(
    Struct, tag_field="type", tag="GetRenderResponseMessage", forbid_unknown_fields=True
):
    """The picture that the app has asked for, a PNG."""

    payload: bytes
    render_uuid: Name


_READER = msgspec.msgpack.Decoder(WidgetChanged | CameraMoved | DrawingClicked | PictureRendered)


def guard_server() -> None:
    """Have all that servers are sent from now on checked, and what fails logged, not printed."""
    check_messages(may_pass)
    log_failures(lambda error: logger.error("a callback failed", exc_info=error))


def guard_widgets(owner: ViserServer | ClientHandle) -> None:
    """Have what a page sets of widgets checked; before there are any."""
    check_updates(owner, may_set)


def may_pass(raw: bytes) -> bool:
    """Tell whether a message of a page may reach viser."""
    try:
        message = _READER.decode(raw)
    except ValueError:  # not msgpack, another kind, other fields, other types, not finite
        fine = False
    else:
        fine = not isinstance(message, PictureRendered) or _is_picture(message.payload)
    if not fine:
        logger.warning("a page has sent a message that the app has no use for; it is left out")
    return fine


def moved(raw: object) -> str | None:
    """Name what a message moves where the last move says all: the camera; None for all others."""
    try:
        message = _READER.decode(raw) if isinstance(raw, bytes) else None
    except ValueError:
        return None
    return "camera" if isinstance(message, CameraMoved) else None


def may_set(present: object, updates: dict[str, Any]) -> bool:
    """Tell whether a page may update a widget: one that holds a text."""
    fine = updates.keys() == {"value"} and isinstance(present, str)
    fine = fine and isinstance(updates["value"], str)
    if not fine:
        logger.warning("a page has sent a value that its widget cannot have; it is left out")
    return fine


def _is_picture(payload: bytes) -> bool:
    if not payload.startswith(PNG_START) or len(payload) < len(PNG_START) + 8:
        return False
    return max(struct.unpack_from(">II", payload, len(PNG_START))) <= LARGEST_SIDE_PX
