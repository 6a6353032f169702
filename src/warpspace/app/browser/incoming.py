"""What a page may say: each message of a connection is read here before anybody acts on it.

What the page's own scripts say (`page.js`) goes to the session as events, ``part:word`` with a
value; a file is the value of ``part:file``: its size, its name, and what is in it in base64. viser
is given what its part of the page says of camera, clicks and rendered pictures.
viser would build an object of whatever kind a message names and set whatever attribute it names;
here only these kinds pass, with fields of the right type and size. What is refused is left out and
the connection stays open, since a new one would cost the server more than a message that is
dropped.
"""

import logging
import struct
from dataclasses import dataclass
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

logger = logging.getLogger(__name__)
LARGEST_NUMBER = 1e9
LARGEST_SIDE_PX = 16_384  # of the page's picture, and of a picture that it renders
PNG_START = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"
MOST_EVENTS = 16
LONGEST_VALUE = 20_000  # of an event, but for those that may be as long as a file in base64
LONG = (":file", ":kept")
LONGEST_INDEX = 8  # digits

Number = Annotated[float, Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]  # NaN is neither
Side = Annotated[float, Meta(ge=0, le=LARGEST_SIDE_PX)]
Name = Annotated[str, Meta(max_length=1000)]
EventName = Annotated[str, Meta(max_length=160, pattern=":")]
EventValue = Annotated[str, Meta(max_length=15_500_000)]
Vector = tuple[Number, Number, Number]


class _BrowserMessage(Struct, tag_field="type", forbid_unknown_fields=True):
    pass


class Events(_BrowserMessage, tag="WarpspaceEvents"):
    """What a user has done, in order."""

    events: Annotated[list[tuple[EventName, EventValue]], Meta(max_length=MOST_EVENTS)]


class CameraMoved(_BrowserMessage, tag="ViewerCameraMessage"):
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


class DrawingClicked(_BrowserMessage, tag="ScenePointerMessage"):
    event_type: Annotated[str, Meta(pattern="^click$")]
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: tuple[tuple[Number, Number]]
    modifier: Annotated[str, Meta(max_length=40)] | None


class PartHeld(_BrowserMessage, tag="TransformControlsDragStartMessage", kw_only=True):
    """What moves the part, as it is seized."""

    name: Annotated[str, Meta(pattern="^/part/gizmo$")]
    owner: Name = ""


class PartLetGo(PartHeld, tag="TransformControlsDragEndMessage"):
    """The same, as it is let go."""


class PartMoved(PartHeld, tag="TransformControlsUpdateMessage", kw_only=True):
    """The same, while it is dragged."""

    wxyz: tuple[Number, Number, Number, Number]
    position: Vector


class PictureRendered(_BrowserMessage, tag="GetRenderResponseMessage"):
    """The picture that the app has asked for, a PNG."""

    payload: bytes
    render_uuid: Name


Message = Events | CameraMoved | DrawingClicked | PictureRendered | PartMoved | PartHeld | PartLetGo
_READER = msgspec.msgpack.Decoder(Message)


def read_message(raw: object) -> Message | None:
    """Read a message of a page; None where the app has no use for it."""
    try:
        message = _READER.decode(raw) if isinstance(raw, bytes) else None
    except ValueError:  # not msgpack, another kind, other fields, other types, not finite
        message = None
    if message is None or not _is_fine(message):
        logger.warning("a page has sent a message that the app has no use for; it is left out")
        return None
    return message


def _is_fine(message: Message) -> bool:
    if isinstance(message, Events):
        return all(len(v) <= LONGEST_VALUE or name.endswith(LONG) for name, v in message.events)
    return not isinstance(message, PictureRendered) or _is_picture(message.payload)


def _is_picture(payload: bytes) -> bool:
    if not payload.startswith(PNG_START) or len(payload) < len(PNG_START) + 8:
        return False
    return max(struct.unpack_from(">II", payload, len(PNG_START))) <= LARGEST_SIDE_PX


@dataclass(frozen=True, slots=True)
class Event:
    """Something a user did; all of it comes from a browser and may be anything."""

    part: str  # name of the part of the page
    word: str  # what is to be done, or the path of what is set behind ``set.``
    value: str


def event_of(name: str, value: str) -> Event:
    part, _, word = name.partition(":")
    return Event(part, word, value)


def index_of(value: str, count: int) -> int | None:
    """Read which of so many things an event means; None where it is none of them."""
    is_valid = value.isdecimal() and len(value) < LONGEST_INDEX and int(value) < count
    return int(value) if is_valid else None
