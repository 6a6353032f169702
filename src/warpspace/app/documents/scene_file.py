"""A state as a scene file, and as a link; both read back to the same state.

The file is an ordinary scene; comments at its head hold how it was looked at and what it was
compared with, which only the app reads. A link holds the name of a scene the app knows and what
differs from it, or the whole file, packed.
"""

import base64
import binascii
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from urllib.parse import parse_qsl, urlencode

from warpspace.app.documents.files import LONGEST_NAME, safe_name
from warpspace.app.documents.view_settings import (
    MAX_FIELDS,
    camera_of,
    comparison_line,
    settings_line,
    with_comparison,
    with_settings,
)
from warpspace.app.documents.view_settings import PREFIX as COMPARISON
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.evaluation.scene_edits import same_shape
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import NOBODY, PRESENT
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_PACKED_TEXT
from warpspace.resources import __version__
from warpspace.scene.library import load_scene, parse_scene, scene_names
from warpspace.scene.machines import load_machine, machine_names
from warpspace.scene.model import Scene
from warpspace.scene.save import scene_to_toml

MARK = "# warpspace-view: "
COMPARED = "# warpspace-compare: "
MAX_LINK = 5_500  # characters of a link before it is packed: servers take request lines of 8 kB
MAX_COMPARED = 400_000  # characters of a comparison in a file
SCENE, PACKED, NAME = "scene", "file", "name"
_HEAD = re.compile(r"(?:[ \t]*+(?:#[^\n]*+)?\n)*+")
_VIEW, _COMPARISON = (
    re.compile(rf"^{re.escape(mark)}(\S*)\s*$", re.MULTILINE) for mark in (MARK, COMPARED)
)
Find = Callable[[str], Scene | None]
"""Gives the scene that whoever opens a file or a link also has under a name."""


def state_to_toml(state: AppState, camera: CameraMemory | None = None) -> str:
    """Spell a state as a scene file."""
    line = comparison_line(state.comparison, lambda side: _write(side, None, _bundled))
    if len(line) > MAX_COMPARED:
        raise OptionError("what is compared is too large to be stored with the scene")
    compared = f"{COMPARED}{line}\n" if line else ""
    head = f"# Saved by warpspace {__version__}. Below stands how it was looked at.\n"
    return f"{head}{_with_view(state, camera, compared)}"


def _with_view(state: AppState, camera: CameraMemory | None, remarks: str = "") -> str:
    """Spell a state without its comparison as a scene file."""
    scene = scene_of(state)
    saved = replace(state, scene=scene, loaded=None)
    return f"{MARK}{settings_line(saved, camera)}\n{remarks}\n{scene_to_toml(scene)}"


def open_text(text: str, name: str, source: str) -> tuple[AppState, CameraMemory | None]:
    """Build the state of a scene file that somebody has uploaded."""
    state, camera = _read_text(text, name, source)
    found = _COMPARISON.search(_head(text))
    if found is not None:
        pairs = _pairs(found[1], MAX_COMPARED, "the comparison")
        state = with_comparison(state, pairs, lambda link: _read_link(link, _bundled)[0])
    return state, camera


def _read_text(text: str, name: str, source: str) -> tuple[AppState, CameraMemory | None]:
    """Build a state from a file without looking at a comparison in it."""
    state = start_state(_recognised(parse_scene(text, name, source, folder=None)))
    found = _VIEW.search(_head(text))
    if found is None:
        return state, None
    return with_settings(state, found[1]), camera_of(found[1])


def is_looked_at(text: str) -> bool:
    """Tell whether a scene file says how it was looked at."""
    return _VIEW.search(_head(text)) is not None


def _head(text: str) -> str:
    found = _HEAD.match(text)
    return found[0] if found else ""


def _bundled(name: str) -> Scene | None:
    return load_scene(name) if name in scene_names() else None


def _recognised(scene: Scene) -> Scene:
    """Give a machine written inline its bodies back where only its axes' ends and ways differ."""
    machine = scene.machine
    for name in machine_names():
        known = load_machine(name)
        if same_shape(known, machine):
            same = replace(
                known,
                axes=machine.axes,
                bodies=machine.bodies or known.bodies,
                gantries=machine.gantries or known.gantries,
            )
            return replace(scene, model=replace(scene.model, machine=same))
    return scene


def state_to_link(state: AppState, camera: CameraMemory | None, known: Iterable[Scene]) -> str:
    """Spell a state as a link."""
    link = named_link(state, camera, known) or _packed(
        state.scene.name, state_to_toml(state, camera)
    )
    if len(link) > MAX_LINK:
        raise OptionError("this is too large for a link; save it as a file instead")
    return link


def named_link(state: AppState, camera: CameraMemory | None, known: Iterable[Scene]) -> str:
    """Spell a state of a scene that others have as well as a link of any length, else as nothing.

    See `state_to_link` for the parameters.
    """
    find = _among(known)
    link = _write_named(state, camera, find)
    if not link:
        return ""
    return link + _behind(comparison_line(state.comparison, lambda side: _write(side, None, find)))


def _write(state: AppState, camera: CameraMemory | None, find: Find) -> str:
    """Spell a state without its comparison as a link of any length."""
    return _write_named(state, camera, find) or _packed(state.scene.name, _with_view(state, camera))


def _write_named(state: AppState, camera: CameraMemory | None, find: Find) -> str:
    """Spell a state of a known scene by its name, without its comparison; any other as nothing."""
    plain = state.loaded is None and state.tolerances == state.scene.tolerances
    if not plain or find(state.scene.name) != state.scene:
        return ""
    return urlencode({SCENE: state.scene.name}) + _behind(settings_line(state, camera))


def _among(known: Iterable[Scene]) -> Find:
    named: dict[str, Scene] = {}
    for scene in known:
        named.setdefault(scene.name, scene)
    return named.get


def _behind(line: str) -> str:
    return f"&{line}" if line else ""


def open_link(link: str, known: Iterable[Scene]) -> tuple[AppState, CameraMemory | None]:
    """Build the state that a link describes."""
    pairs = _pairs(link, MAX_LINK, "the link")
    find = _among(known)
    if PACKED in pairs:
        return open_text(_unpack(pairs[PACKED]), *_named(pairs))
    state, camera = _read_link(link, find)
    return with_comparison(state, pairs, lambda part: _read_link(part, find)[0]), camera


def _pairs(line: str, longest: int, what: str) -> dict[str, str]:
    if len(line) > longest:
        raise OptionError(f"{what} is {len(line):,} characters long; expected at most {longest:,}")
    try:
        return dict(parse_qsl(line, max_num_fields=MAX_FIELDS))
    except ValueError:
        raise OptionError(f"{what} has too many parts; it was not made by this program") from None


def _read_link(link: str, find: Find) -> tuple[AppState, CameraMemory | None]:
    """Build the state of a link without looking at a comparison in it."""
    pairs = _pairs(link, MAX_COMPARED, "the link")
    if PACKED in pairs:
        return _read_text(_unpack(pairs[PACKED]), *_named(pairs))
    name = pairs.get(SCENE, "")
    scene = find(name)
    if scene is None:
        raise OptionError(f"the link names the scene {name[:LONGEST_NAME]!r}, which is not here")
    line = urlencode(
        [(k, v) for k, v in pairs.items() if k != SCENE and not k.startswith(COMPARISON)]
    )
    return with_settings(start_state(scene), line), camera_of(line)


def _packed(name: str, text: str) -> str:
    word = base64.urlsafe_b64encode(zlib.compress(text.encode(), 9)).decode().rstrip("=")
    return urlencode({NAME: name, PACKED: word})


def _named(pairs: Mapping[str, str]) -> tuple[str, str]:
    return safe_name(pairs.get(NAME, ""), "link"), "the scene in the link"


def _unpack(packed: str) -> str:
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        reader = zlib.decompressobj()
        text = reader.decompress(data, MAX_PACKED_TEXT)
        if reader.unconsumed_tail or not reader.eof:
            raise OptionError("the scene in the link is cut off or too large")
        return text.decode("utf-8")
    except (binascii.Error, zlib.error, ValueError):
        raise OptionError("the scene in the link cannot be read; was the link cut?") from None


# --- The scenes a tab can choose from -------------------------------------------------------------
# The server's own, and the newest that were opened in it.

MOST_OPENED = 20


class SceneList(Mapping[str, Scene]):
    """Scenes by the title shown, each title once."""

    def __init__(self, scenes: Mapping[str, Scene]) -> None:
        self._fixed = dict(scenes)
        self._opened: dict[str, Scene] = {}

    def __getitem__(self, title: str) -> Scene:
        return self._fixed[title] if title in self._fixed else self._opened[title]

    def __iter__(self) -> Iterator[str]:
        yield from self._fixed
        yield from self._opened

    def __len__(self) -> int:
        return len(self._fixed) + len(self._opened)

    @property
    def fixed(self) -> tuple[Scene, ...]:
        """Scenes that whoever opens a link on this server has as well."""
        return tuple(self._fixed.values())

    def add(self, scene: Scene) -> tuple[str, str]:
        """Take in a scene that was opened from a file or a link."""
        for title, known in self.items():
            if known is scene or known == scene:
                return title, ""
        title = self._free_title(scene)
        self._opened[title] = scene
        dropped = ""
        if len(self._opened) > MOST_OPENED:
            dropped = next(iter(self._opened))
            del self._opened[dropped]
        return title, dropped

    def _free_title(self, scene: Scene) -> str:
        """Give a scene a title that nothing else in a list of scenes has."""
        own = scene.title or scene.name
        title, number = own, 2
        while title in self or title in (PRESENT, NOBODY):
            title = f"{own} ({number})"
            number += 1
        return title


def dropped_words(title: str) -> str:
    """Say that a scene has left the list."""
    return f"The newest {MOST_OPENED} opened scenes are kept; {title} left the list."
