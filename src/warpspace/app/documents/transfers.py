"""Links, uploaded files, and names of exported files."""

import base64
import binascii
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from warpspace.app.browser.actions import Upload
from warpspace.app.evaluation.compare import AFTER, BEFORE, drawn_tables, without_words
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, Side
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.scene.urdf import imported_text, omitted_notes, place_robot, read_robot

# --- Links: a state as one word in the page's address ---------------------------------------------
# Letters and digits only, since viser's client rewrites the address when it starts (it drops a
# fragment and would decode an encoded value).


def pack(link: str) -> str:
    """Encode a query string as one word that needs no escaping in an address."""
    return base64.urlsafe_b64encode(link.encode()).decode().rstrip("=")


def unpack(word: str) -> str:
    try:
        return base64.urlsafe_b64decode(word + "=" * (-len(word) % 4)).decode()
    except (binascii.Error, ValueError):
        raise OptionError("the link cannot be read; it may be truncated") from None


# --- Uploaded files -------------------------------------------------------------------------------

_UNSAFE = re.compile(r"[^A-Za-z0-9._ -]+")
LONGEST_NAME = 60


def safe_name(name: str, fallback: str = "scene") -> str:
    """Build a safe file name, without ending, from any name."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    stem = last.rsplit(".", 1)[0] if "." in last.strip(".") else last
    clean = _UNSAFE.sub("_", stem).strip(" ._-")[:LONGEST_NAME].strip(" ._-")
    return clean or fallback


def safe_file_name(name: str) -> str:
    """Build a safe file name with the ending of the name, or ``.txt``."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    ending = last.rsplit(".", 1)[-1] if "." in last else "txt"
    return f"{safe_name(last, 'file')}.{safe_name(ending, 'txt')}"


IN_BOX = {"part": (".stl", ".obj", ".ply", ".glb"), "program": (".ngc", ".nc", ".tap")}
"""Endings of part and program files, by panel."""


def read_upload(
    upload: Upload, most_bytes: int = MAX_SCENE_BYTES, what: str = "scene file"
) -> tuple[str, bytes]:
    """Parse name and bytes of an uploaded file; a page omits the bytes of one too large."""
    name = safe_file_name(upload.name)
    try:
        content = base64.b64decode(upload.content)
    except ValueError:
        raise OptionError(f"{name} was not received completely; try again") from None
    size = max(upload.size, len(content))
    if size > most_bytes:
        raise OptionError(
            f"{name} is {size / 2**20:.1f} MB large; expected a {what} of at most"
            f" {most_bytes / 2**20:g} MB"
        )
    return name, content


def upload_text(content: bytes, source: str, what: str = "scene file") -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise OptionError(
            f"{source} is not UTF-8 text (byte {error.start}); expected a {what}"
        ) from None


MOST_NOTES = 12  # remarks on a robot description


def robot_text(name: str, content: bytes) -> tuple[str, list[str]]:
    """Convert a robot description (URDF) to a scene file, without meshes; return remarks , too."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / safe_file_name(name)
        path.write_bytes(content)
        robot, unplaced = read_robot(path)
    placed = place_robot(robot, name)
    notes = [*placed.notes, *omitted_notes(robot, unplaced, placed.frame_of)]
    return imported_text(placed.machine, safe_file_name(name), notes, {}), notes[:MOST_NOTES]


# --- Files of a comparison ------------------------------------------------------------------------

AS_DRAWN = "View and HTML show the drawing."


def shown_sides(picture: LivePicture, *, sheet: bool = False) -> list[AppState]:
    """List the drawn states: one, or A and B of a difference or of a sheet."""
    compared = picture.compared
    if compared is None:
        return [picture.drawn_state]
    sides = [
        replace(side, scene=replace(side.scene, name=f"{letter}: {title}", title=title))
        for letter, title, side in zip("AB", compared.titles, compared.sides, strict=True)
    ]
    if compared.view == "difference" or (sheet and has_sheet(picture)):
        return sides
    return [sides["ab".index(compared.view)]]


def has_sheet(picture: LivePicture) -> bool:
    """Return whether both sides of a comparison and their difference fit on one sheet."""
    compared = picture.compared
    if compared is None or compared.refused:
        return False
    return compared.sides[0].loop == compared.sides[1].loop


def file_stem(picture: LivePicture) -> str:
    compared, chosen = picture.compared, picture.state.comparison
    if compared is None or drawn_tables(picture.state):
        tail = "_with_table" if drawn_tables(picture.state) else ""
        return safe_name(picture.state.scene.name) + tail
    before = chosen.a.state is not None and not chosen.a.is_scene
    a, b = (
        side.state.scene.name if side.state and side.is_scene
        else word if side.state or (before and word == AFTER)
        else "present"
        for side, word in ((chosen.a, BEFORE), (chosen.b or Side(), AFTER))
    )  # fmt: skip
    return safe_name({"a": f"A_{a}", "b": f"B_{b}"}.get(compared.view, f"{b}_minus_{a}"))


def exported_words(picture: LivePicture) -> str:
    """Describe the contents of exports where they differ from the present state."""
    compared, tilts = picture.compared, picture.state.look.tilts
    without = without_words(picture.state)
    if without:
        return f"Figure, exports, Save and Link: {without[0].lower()}{without[1:]} {AS_DRAWN}"
    if compared is None:
        return "The figure shows the tilts of the tool axis as needles on the box." if tilts else ""
    what = "the position errors of " if tilts else ""
    sheet = f" The figure shows {what}A, B and B − A on one sheet." if has_sheet(picture) else ""
    pictures = f"Pictures and exports show {compared.title}."
    return f"{pictures}{sheet} Save and Link include the comparison."
