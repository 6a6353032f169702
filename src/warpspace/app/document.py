"""A state as a scene file, and as a link; both read back to the same state.

The file is an ordinary scene; one comment in it holds how it was looked at, which only the app
reads. A link holds the name of a scene the app knows and what differs from it, or the whole file,
packed.
"""

import base64
import binascii
import re
import zlib
from collections.abc import Iterable
from dataclasses import replace
from urllib.parse import parse_qsl, urlencode

from warpspace import __version__
from warpspace.app.edits import curve_of
from warpspace.app.settings import MAX_FIELDS, camera_of, settings_line, with_settings
from warpspace.app.state import AppState, start_state
from warpspace.app.tabs import CameraMemory
from warpspace.exceptions import OptionError
from warpspace.machine.errors import ErrorSet
from warpspace.scene.files import MAX_SCENE_BYTES
from warpspace.scene.library import parse_scene
from warpspace.scene.machines import load_machine, machine_names
from warpspace.scene.model import Scene
from warpspace.scene.save import scene_to_toml

MARK = "# warpspace-view: "
MAX_LINK = 5_500
"""Characters of a link before it is packed: servers take request lines of 8 kB."""
MAX_PACKED_TEXT = 1_000_000
SCENE, PACKED = "scene", "file"
_VIEW = re.compile(rf"^{re.escape(MARK)}(\S*)\s*$", re.MULTILINE)
_UNSAFE = re.compile(r"[^A-Za-z0-9._ -]+")
LONGEST_NAME = 60


def scene_of(state: AppState) -> Scene:
    """Give the scene that a state amounts to: amplitudes, curves, positions, tolerances, factor.

    Parameters
    ----------
    state : AppState

    Returns
    -------
    Scene
        All parameters take part, silenced or not.
    """
    scene = state.scene
    keys = [
        key for key in state.amplitudes if state.amplitudes[key] or key in scene.errors.functions
    ]
    moved = {
        axis: value
        for axis, value in state.positions.items()
        if value != scene.workspace.positions.get(axis)
    }
    return replace(
        scene,
        errors=ErrorSet({key: curve_of(state, key) for key in keys}),
        workspace=scene.workspace.moved(moved) if moved else scene.workspace,
        tolerances=state.tolerances,
        exaggeration=state.exaggeration,
    )


def heard_scene(state: AppState) -> Scene:
    """Give the scene as it is drawn: what is silenced by solo and mute is left out."""
    return scene_of(replace(state, amplitudes=dict(state.heard)))


def state_to_toml(state: AppState, camera: CameraMemory | None = None) -> str:
    """Spell a state as a scene file.

    Parameters
    ----------
    state : AppState
    camera : CameraMemory, optional

    Returns
    -------
    str
        TOML that every reader of scenes takes; `open_text` gives the identical state back.
    """
    scene = scene_of(state)
    saved = replace(state, scene=scene, loaded=None)
    head = (
        f"# Saved by warpspace {__version__}. The line below holds how it was looked at.\n"
        f"{MARK}{settings_line(saved, camera)}\n\n"
    )
    return head + scene_to_toml(scene)


def open_text(text: str, name: str, source: str) -> tuple[AppState, CameraMemory | None]:
    """Build the state of a scene file that somebody has uploaded.

    Parameters
    ----------
    text : str
    name : str
        Name of the scene.
    source : str
        What the file is called in messages.

    Returns
    -------
    tuple of (AppState, CameraMemory or None)

    Raises
    ------
    SceneError
        With every problem of the text.
    """
    state = start_state(_recognised(parse_scene(text, name, source, folder=None)))
    found = _VIEW.search(text)
    if found is None:
        return state, None
    return with_settings(state, found[1]), camera_of(found[1])


def _recognised(scene: Scene) -> Scene:
    """Give a machine written inline its bodies back where only directions make it another one."""
    machine = scene.machine
    for name in machine_names():
        known = load_machine(name)
        if known.axes.keys() != machine.axes.keys():
            continue
        axes = {
            key: replace(axis, direction=known.axes[key].direction)
            for key, axis in machine.axes.items()
        }
        same = replace(known, axes=machine.axes)
        offsets = machine.fixed_mm == known.fixed_mm and machine.chain == known.chain
        if offsets and axes == known.axes:
            return replace(scene, model=replace(scene.model, machine=same))
    return scene


def state_to_link(state: AppState, camera: CameraMemory | None, known: Iterable[Scene]) -> str:
    """Spell a state as a link.

    Parameters
    ----------
    state : AppState
    camera : CameraMemory or None
    known : iterable of Scene
        Scenes that whoever opens the link has as well.

    Returns
    -------
    str
        A query string.

    Raises
    ------
    OptionError
        If the scene is too large for a link.
    """
    plain = state.loaded is None and state.tolerances == state.scene.tolerances
    if plain and any(scene is state.scene for scene in known):
        return urlencode({SCENE: state.scene.name}) + _behind(settings_line(state, camera))
    packed = base64.urlsafe_b64encode(zlib.compress(state_to_toml(state, camera).encode(), 9))
    link = urlencode({PACKED: packed.decode().rstrip("=")})
    if len(link) > MAX_LINK:
        raise OptionError("this scene is too large for a link; save it as a file instead")
    return link


def _behind(line: str) -> str:
    """Put settings behind the name of a scene."""
    return f"&{line}" if line else ""


def open_link(link: str, known: Iterable[Scene]) -> tuple[AppState, CameraMemory | None]:
    """Build the state that a link describes.

    Parameters
    ----------
    link : str
        A query string; anything, since anybody can write one.
    known : iterable of Scene
        Scenes it may name.

    Returns
    -------
    tuple of (AppState, CameraMemory or None)

    Raises
    ------
    OptionError, SceneError
        If it names no scene, or holds none that can be read.
    """
    if len(link) > MAX_LINK:
        raise OptionError(
            f"the link is {len(link):,} characters long; expected at most {MAX_LINK:,}"
        )
    try:
        pairs = dict(parse_qsl(link, max_num_fields=MAX_FIELDS))
    except ValueError:
        raise OptionError("the link has too many parts; it was not made by this program") from None
    if PACKED in pairs:
        return open_text(_unpack(pairs[PACKED]), "link", "the scene in the link")
    for scene in known:
        if scene.name == pairs.get(SCENE):
            rest = [(name, value) for name, value in pairs.items() if name != SCENE]
            line = urlencode(rest)
            return with_settings(start_state(scene), line), camera_of(line)
    name = pairs.get(SCENE, "")[:LONGEST_NAME]
    raise OptionError(f"the link names the scene {name!r}, which is not here")


def _unpack(packed: str) -> str:
    """Unpack the file in a link, up to a size."""
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        reader = zlib.decompressobj()
        text = reader.decompress(data, MAX_PACKED_TEXT)
        if reader.unconsumed_tail or not reader.eof:
            raise OptionError("the scene in the link is cut off or too large")
        return text.decode("utf-8")
    except (binascii.Error, zlib.error, ValueError):
        raise OptionError("the scene in the link cannot be read; was the link cut?") from None


def safe_name(name: str, fallback: str = "scene") -> str:
    """Make a file name of what a user or a browser calls something.

    Parameters
    ----------
    name : str
        Anything: folders, ``../``, control characters and reserved letters are dropped.
    fallback : str, optional
        Where nothing is left.

    Returns
    -------
    str
        Without an ending.
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    stem = last.rsplit(".", 1)[0] if "." in last.strip(".") else last
    clean = _UNSAFE.sub("_", stem).strip(" ._-")[:LONGEST_NAME].strip(" ._-")
    return clean or fallback


def upload_text(content: bytes, source: str) -> str:
    """Read the bytes of an uploaded file.

    Raises
    ------
    OptionError
        If it is too large or no UTF-8 text.
    """
    if len(content) > MAX_SCENE_BYTES:
        raise OptionError(size_message(source, len(content)))
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise OptionError(
            f"{source} is not UTF-8 text (byte {error.start}); expected a scene file"
        ) from None


def size_message(source: str, size: float) -> str:
    """Say that a file is too large."""
    limit = MAX_SCENE_BYTES / 2**20
    return f"{source} is {size / 2**20:.1f} MB large; expected a scene file of at most {limit:g} MB"
