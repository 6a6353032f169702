"""Messages that a page may send: each is validated here before it is handled.

Actions of the page's own scripts (`page.js`, `actions.py`) go to the session, messages on camera,
clicks and rendered pictures to viser.
viser would build an object of any type that a message names and set any attribute; here only these
types pass, with fields of the right type and size. Invalid messages are ignored and the connection
stays open, since a new one would cost the server more than an ignored message.
"""

import logging
import struct
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

from warpspace.app.browser.actions import AnyAction, Number

logger = logging.getLogger(__name__)
LARGEST_SIDE_PX = 16_384  # of the page's picture, and of a picture that it renders
PNG_START = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"
MOST_EVENTS = 16
LONGEST_INDEX = 8  # digits

Side = Annotated[float, Meta(ge=0, le=LARGEST_SIDE_PX)]
Name = Annotated[str, Meta(max_length=1000)]
Vector = tuple[Number, Number, Number]


class _BrowserMessage(Struct, tag_field="type", forbid_unknown_fields=True):
    pass


class Events(_BrowserMessage, tag="WarpspaceEvents"):
    """Actions of the user, in order."""

    events: Annotated[list[AnyAction], Meta(max_length=MOST_EVENTS)]


class CameraMoved(_BrowserMessage, tag="ViewerCameraMessage"):
    """Camera of the page; the first message opens the session."""

    wxyz: tuple[Number, Number, Number, Number]
    position: Vector
    fov: Annotated[float, Meta(gt=0, lt=3.1416)]
    near: Number
    far: Number
    image_height: Side
    image_width: Side
    look_at: Vector
    up_direction: Vector


class DrawingClicked(_BrowserMessage, tag="ScenePointerMessage"):
    event_type: Annotated[str, Meta(pattern="^click$")]
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: tuple[tuple[Number, Number]]
    modifier: Annotated[str, Meta(max_length=40)] | None


class PartHeld(_BrowserMessage, tag="TransformControlsDragStartMessage", kw_only=True):
    """Start of a drag of the gizmo that moves the workpiece."""

    name: Annotated[str, Meta(pattern="^/part/gizmo$")]
    owner: Name = ""


class PartLetGo(PartHeld, tag="TransformControlsDragEndMessage"):
    """End of the drag."""


class PartMoved(PartHeld, tag="TransformControlsUpdateMessage", kw_only=True):
    """Position of the gizmo during the drag."""

    wxyz: tuple[Number, Number, Number, Number]
    position: Vector


class PictureRendered(_BrowserMessage, tag="GetRenderResponseMessage"):
    """Picture that the app requested, a PNG."""

    payload: bytes
    render_uuid: Name


Message = Events | CameraMoved | DrawingClicked | PictureRendered | PartMoved | PartHeld | PartLetGo
_READER = msgspec.msgpack.Decoder(Message)


def read_message(raw: object) -> Message | None:
    """Parse a message of a page; None where it is invalid."""
    try:
        message = _READER.decode(raw) if isinstance(raw, bytes) else None
    except ValueError:  # not msgpack, another kind, other fields, other types, not finite
        message = None
    if message is None or not _is_fine(message):
        logger.warning("ignored an invalid message of a page")
        return None
    return message


def _is_fine(message: Message) -> bool:
    if not isinstance(message, PictureRendered):
        return True
    start, size = message.payload[: len(PNG_START)], message.payload[len(PNG_START) :][:8]
    is_png = start == PNG_START and len(size) == 8
    return is_png and max(struct.unpack(">II", size)) <= LARGEST_SIDE_PX


def index_of(value: str, count: int) -> int | None:
    """Parse an index below `count`; None where the text is none."""
    is_valid = value.isdecimal() and len(value) < LONGEST_INDEX and int(value) < count
    return int(value) if is_valid else None
