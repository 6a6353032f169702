"""A state as a scene file, and as a link; both read back to the same state.

The file is an ordinary scene; comments at its head hold how it was looked at and what it was
compared with, which only the app reads. A link holds the name of a scene the app knows and what
differs from it, or the whole file, packed.
"""

import base64
import binascii
import math
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from urllib.parse import parse_qsl, urlencode

from warpspace.app.documents.files import LONGEST_NAME, safe_name
from warpspace.app.evaluation.compare import plain_state, scene_side
from warpspace.app.evaluation.machine_edits import known_alike
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import BEFORE, NOBODY, PRESENT, SHOWN, Comparison, Side
from warpspace.app.state.forms import linked_forms, with_form
from warpspace.app.state.leaf import Leaf, Unreadable
from warpspace.app.state.tree import leaves, set_leaf, spell_value, stored
from warpspace.app.viewport.camera import CameraMemory
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_PACKED_TEXT
from warpspace.resources import __version__
from warpspace.scene.files import parse_number
from warpspace.scene.library import load_scene, parse_scene, scene_names
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
    known = known_alike(machine)
    if known is None:
        return scene
    same = replace(
        known,
        axes=machine.axes,
        bodies=machine.bodies or known.bodies,
        gantries=machine.gantries or known.gantries,
    )
    return replace(scene, model=replace(scene.model, machine=same))


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
    line = urlencode([(k, v) for k, v in pairs.items() if k != SCENE and not k.startswith(PREFIX)])
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


# --- How a scene is looked at as one line of text -------------------------------------------------
# A query string (``loop=relative&B=30&look.surface=cut``) with only what differs from the scene as
# opened. Reading it trusts nothing: every value passes the pure updates of the state, what cannot
# be read is left out and named.

MAX_LENGTH = 16_000
MAX_FIELDS = 400
CAMERA = "camera"
CAMERA_NUMBERS = 10
FARTHEST = 1000.0  # farthest place of a camera, in units of the drawing
FOV_RAD = (0.01, 2.5)


def settings_line(state: AppState, camera: CameraMemory | None = None) -> str:
    """Spell how a state is looked at, and its amplitudes, as a query string."""
    opened = start_state(state.scene)
    pairs = [
        (leaf.linked, spell_value(leaf, now))
        for leaf in leaves(state).values()
        if leaf.linked and (now := stored(state, leaf.path)) != stored(opened, leaf.path)
    ]
    pairs += linked_forms(state)
    if camera is not None:
        numbers = (*camera.position, *camera.look_at, *camera.up, camera.fov_rad)
        pairs.append((CAMERA, ",".join(f"{number:.6g}" for number in numbers)))
    return urlencode(pairs)


def with_settings(state: AppState, line: str) -> AppState:
    """Apply a line of settings to a state."""
    unread: list[str] = []
    known, named = leaves(state), _linked(state)
    for name, value in _settings(line):
        if name == CAMERA:
            continue
        try:
            leaf = named.get(name)
            state = with_form(state, name, value) if leaf is None else set_leaf(state, leaf, value)
        except Unreadable:
            unread.append(f"{name}={value}"[:60])
        if leaves(state) is not known:  # for instance the components of a quantity
            known, named = leaves(state), _linked(state)
    if unread:
        more = f" and {len(unread) - 4} more" if len(unread) > 4 else ""
        note = f"settings left out, since they mean nothing here: {', '.join(unread[:4])}{more}"
        state = replace(state, notes=(*state.notes, note))
    return state


def _linked(state: AppState) -> dict[str, Leaf]:
    return {leaf.linked: leaf for leaf in leaves(state).values() if leaf.linked}


def camera_of(line: str) -> CameraMemory | None:
    """Read the camera of a line of settings; None where there is none that can be used."""
    text = dict(_settings(line)).get(CAMERA)
    if text is None:
        return None
    try:
        numbers = [parse_number(word) for word in text.split(",")]
    except ValueError:
        return None
    if len(numbers) != CAMERA_NUMBERS:
        return None
    position, look_at, up = ((n[0], n[1], n[2]) for n in (numbers[:3], numbers[3:6], numbers[6:9]))
    distance = math.dist(position, look_at)
    usable = max(map(abs, numbers)) <= FARTHEST and distance > 1e-3 and math.hypot(*up) > 1e-3
    if not usable or not FOV_RAD[0] <= numbers[9] <= FOV_RAD[1]:
        return None
    return CameraMemory(position, look_at, up, numbers[9])


def _settings(line: str) -> list[tuple[str, str]]:
    if len(line) > MAX_LENGTH:
        return []
    try:
        return parse_qsl(line, keep_blank_values=True, max_num_fields=MAX_FIELDS)
    except ValueError:
        return []


# --- A comparison as one line of text -------------------------------------------------------------
# What is compared, what is drawn, and what was pinned.
#
# A side that is a scene, and what was pinned, are spelt as links of their own, so that they come
# back as they are seen: by the name of a scene that is known, or with all that is in them.

PREFIX = "compare."
PINNED = "pinned"
NOW = "now"  # what is steered, in files and links
TITLE = f"{BEFORE}: "  # what the title of a pinned state begins with
LONGEST_TITLE = 200
NAMES = frozenset({"a", "b", "shown", "ghost", PINNED, "a.title", "b.title", "pinned.title"})
Write = Callable[[AppState], str]
Read = Callable[[str], AppState]


def comparison_line(comparison: Comparison[AppState], write: Write) -> str:
    """Spell a comparison as a query string."""
    pairs: list[tuple[str, str]] = []
    for name, side in (("a", comparison.a), ("b", comparison.b)):
        if side is None or (name == "a" and side.state is None):
            continue
        pairs.append((name, _side_text(side, write)))
        if side.is_scene and side.state and side.title != scene_side(side.state.scene).title:
            pairs.append((f"{name}.title", side.title))
    if comparison.shown != Comparison().shown:
        pairs.append(("shown", comparison.shown))
    if not comparison.ghost:
        pairs.append(("ghost", "0"))
    pinned = comparison.pinned
    if pinned is not None and pinned.state is not None:
        pairs += [(PINNED, write(pinned.state)), ("pinned.title", pinned.title)]
    return urlencode([(PREFIX + name, value) for name, value in pairs])


def _side_text(side: Side[AppState], write: Write) -> str:
    if side.state is None:
        return NOW
    return write(side.state) if side.is_scene else PINNED


def with_comparison(state: AppState, pairs: Mapping[str, str], read: Read) -> AppState:
    """Give a state the comparison that somebody has written down."""
    given = {k.removeprefix(PREFIX): v for k, v in pairs.items() if k.startswith(PREFIX)}
    if not given:
        return state
    for name in given:
        if name not in NAMES:
            raise OptionError(f"the comparison says {name[:30]!r}, which means nothing")
    pinned = None
    notes = state.notes
    if PINNED in given:
        before = read(given[PINNED])
        notes = (*notes, *(f"{BEFORE}: {note}" for note in before.notes))
        plain = replace(plain_state(before), notes=())
        title = TITLE + given.get("pinned.title", "").removeprefix(TITLE)
        pinned = Side(title[:LONGEST_TITLE], plain)
    a, b = (_side(given, name, pinned, read) for name in "ab")
    shown, ghost = given.get("shown", Comparison().shown), given.get("ghost", "1")
    if shown not in SHOWN or ghost not in ("0", "1"):
        raise OptionError("the comparison does not say what is drawn: expected a, b or difference")
    found = Comparison(a or Side(), b, shown, ghost == "1", pinned)
    return replace(state, comparison=found, notes=notes)


def _side(
    given: Mapping[str, str], name: str, pinned: Side[AppState] | None, read: Read
) -> Side[AppState] | None:
    """Read one side; None where there is none."""
    text = given.get(name)
    if text is None or text == NOW:
        return None if text is None else Side()
    if text == PINNED:
        if pinned is None:
            raise OptionError("the comparison is with a pinned state, but holds none")
        return pinned
    side = scene_side(read(text).scene)
    title = given.get(f"{name}.title", side.title)[:LONGEST_TITLE]
    return side if title in (NOW, PRESENT, NOBODY, "") else replace(side, title=title)
