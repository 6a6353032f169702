"""What a link holds beside the name of a scene: a line of settings, or a whole file, packed."""

import base64
import binascii
import re
import zlib
from urllib.parse import parse_qsl

from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_PACKED_TEXT

PACKED, CAMERA = "file", "camera"
MARK = "# warpspace-view: "
MAX_LINE = 400_000  # characters of a line of settings in a file
MAX_FIELDS = 400
_HEAD = re.compile(r"(?:[ \t]*+(?:#[^\n]*+)?\n)*+")
# what was compared had a line of its own in files of earlier versions
_LINES = re.compile(r"^# warpspace-(?:view|compare): (\S*)\s*$", re.MULTILINE)


def settings_of(text: str) -> str:
    """Give the line of settings at the head of a scene file; empty where there is none."""
    head = _HEAD.match(text)
    return "&".join(filter(None, _LINES.findall(head[0] if head else "")))


def read_settings(line: str) -> list[tuple[str, str]]:
    """Split a line of settings into names and values, none of which is trusted."""
    if len(line) > MAX_LINE:
        raise OptionError(f"{len(line):,} characters of settings; expected at most {MAX_LINE:,}")
    try:
        return parse_qsl(line, keep_blank_values=True, max_num_fields=MAX_FIELDS)
    except ValueError:
        raise OptionError("there are too many settings; this program did not write them") from None


def pack_scene(text: str) -> str:
    """Spell a scene file as a word of a link."""
    packed = zlib.compress(text.encode(), 9)
    return base64.urlsafe_b64encode(packed).decode().rstrip("=")


def unpack_scene(packed: str) -> str:
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        reader = zlib.decompressobj()
        text = reader.decompress(data, MAX_PACKED_TEXT)
        if reader.unconsumed_tail or not reader.eof:
            raise OptionError("the scene in the link is cut off or too large")
        return text.decode("utf-8")
    except (binascii.Error, zlib.error, ValueError):
        raise OptionError("the scene in the link cannot be read; was the link cut?") from None
