"""A state as a scene file and as a link; both are read back to the same state.

Both contain one line of settings, a query string (``loop=relative&B=30&look.surface=cut``): the
differences of the state from its scene as opened, the camera, and the comparison. In a file it is a
comment at the head of an ordinary scene, in a link it follows the name of a scene that the app
knows; any other link is the packed file. Scenes and pinned states of a comparison are links within
that line.

Every value passes the pure updates of the state; invalid settings are ignored and listed in notes.
"""

import base64
import binascii
import math
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from urllib.parse import parse_qsl, urlencode

from warpspace.app.documents.transfers import LONGEST_NAME, safe_name
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.evaluation.compare import BEFORE, pinned_side, plain_state, scene_side
from warpspace.app.evaluation.machine_edits import known_alike
from warpspace.app.state.app_state import NOBODY, PRESENT, AppState, Side, start_state
from warpspace.app.state.form_values import linked_forms, with_form
from warpspace.app.state.leaf import Unreadable
from warpspace.app.state.tree import leaves, set_leaf, spell_value, stored
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_NOTE_VIEW, MAX_PACKED_TEXT
from warpspace.resources import __version__
from warpspace.scene.library import load_scene, parse_scene, scene_names
from warpspace.scene.model import Scene
from warpspace.scene.notes import Note
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import parse_number

MARK = "# warpspace-view: "
MAX_LINK = 5_500  # characters of a link before it is packed: servers take request lines of 8 kB
MAX_LINE = 400_000  # characters of a line of settings in a file
MAX_FIELDS = 400
SCENE, PACKED, NAME, CAMERA = "scene", "file", "name", "camera"
_HEAD = re.compile(r"(?:[ \t]*+(?:#[^\n]*+)?\n)*+")
_LINES = re.compile(r"^# warpspace-view: (\S*)\s*$", re.MULTILINE)
KnownScenes = Sequence[Scene] | None
"""Scenes that are available where a file or a link is opened; None for the bundled ones."""
Opened = tuple[AppState, CameraMemory | None]


def state_to_toml(state: AppState, camera: CameraMemory | None = None) -> str:
    scene = replace(state.resulting_scene(), review=file_notes(state))
    line = settings_line(replace(state, scene=scene, loaded=None), camera)
    if len(line) > MAX_LINE:
        raise OptionError("the comparison is too large to be stored with the scene")
    head = f"# Saved by warpspace {__version__}. The next line holds the view."
    return f"{head}\n{MARK}{line}\n\n{scene_to_toml(scene)}"


def open_text(text: str, name: str, source: str, *, single: bool = False) -> Opened:
    scene = _recognised(parse_scene(text, name, source, folder=None))
    line = settings_of(text)
    return with_settings(start_state(scene), line, single=single), camera_of(line)


def settings_of(text: str) -> str:
    """Return the line of settings at the head of a scene file; empty where there is none."""
    head = _HEAD.match(text)
    return "&".join(filter(None, _LINES.findall(head[0] if head else "")))


def _find(name: str, scenes: KnownScenes) -> Scene | None:
    if scenes is None:
        return load_scene(name) if name in scene_names() else None
    return next((scene for scene in scenes if scene.name == name), None)


def _recognised(scene: Scene) -> Scene:
    machine = scene.machine
    twin = known_alike(machine)
    if twin is None:
        return scene
    bodies, gantries = machine.bodies or twin.bodies, machine.gantries or twin.gantries
    same = replace(twin, axes=machine.axes, bodies=bodies, gantries=gantries)
    return replace(scene, model=replace(scene.model, machine=same))


def state_to_link(state: AppState, camera: CameraMemory | None, scenes: KnownScenes) -> str:
    link = _spell(state, camera, scenes)
    if len(link) > MAX_LINK:
        raise OptionError("the state is too large for a link; save it as a file")
    return link


def _spell(state: AppState, camera: CameraMemory | None, scenes: KnownScenes) -> str:
    return named_link(state, camera, scenes) or _packed(state, camera)


def _packed(state: AppState, camera: CameraMemory | None) -> str:
    text = zlib.compress(state_to_toml(state, camera).encode(), 9)
    word = base64.urlsafe_b64encode(text).decode().rstrip("=")
    return urlencode({NAME: state.scene.name, PACKED: word})


def named_link(state: AppState, camera: CameraMemory | None, scenes: KnownScenes) -> str:
    """Write a link to a known scene, of any length; empty for other scenes."""
    scene = state.scene
    plain = _is_plain(state) and state.review == scene.review
    if not plain or _find(scene.name, scenes) != scene:
        return ""
    line = settings_line(state, camera, scenes)
    return "&".join(filter(None, (urlencode({SCENE: scene.name}), line)))


def _is_plain(state: AppState) -> bool:
    """Return whether settings alone describe the differences of a state from its scene."""
    return state.loaded is None and state.tolerances == state.scene.tolerances


def open_link(link: str, scenes: KnownScenes) -> Opened:
    if len(link) > MAX_LINK:
        raise OptionError(
            f"the link is {len(link):,} characters long; expected at most {MAX_LINK:,}"
        )
    return _read_link(link, scenes)


def _read_link(link: str, scenes: KnownScenes, *, single: bool = False) -> Opened:
    pairs = dict(_pairs(link))
    if PACKED in pairs:
        name = safe_name(pairs.get(NAME, ""), "link")
        return open_text(_unpack(pairs[PACKED]), name, "the scene in the link", single=single)
    name = pairs.pop(SCENE, "")
    scene = _find(name, scenes)
    if scene is None:
        raise OptionError(f"the link names an unknown scene {name[:LONGEST_NAME]!r}")
    line = urlencode(pairs)
    return with_settings(start_state(scene), line, scenes, single=single), camera_of(line)


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


# --- The line of settings -------------------------------------------------------------------------


def settings_line(
    state: AppState, camera: CameraMemory | None = None, scenes: KnownScenes = None,
    *, at_rest: bool = False,
) -> str:  # fmt: skip
    """Write the differences from the scene as opened; `at_rest` from `AppState.at_rest`."""
    opened = start_state(state.scene).at_rest() if at_rest else start_state(state.scene)
    pairs = [
        (leaf.linked, spell_value(leaf, stored(state, leaf.path)))
        for leaf in leaves(state).values()
        if leaf.linked and stored(state, leaf.path) != stored(opened, leaf.path)
    ]
    if camera is not None:
        numbers = (*camera.position, *camera.look_at, *camera.up, camera.fov_rad)
        pairs.append((CAMERA, ",".join(f"{number:.9g}" for number in numbers)))
    return urlencode([*pairs, *linked_forms(state), *_sides(state, scenes)])


def with_settings(
    state: AppState, line: str, scenes: KnownScenes = None, *, single: bool = False
) -> AppState:
    pairs = [pair for pair in _pairs(line) if not (single and pair[0].startswith(PREFIX))]
    state, unread = _with_sides(state, dict(pairs), scenes), list[str]()
    for name, text in pairs:
        if name == CAMERA or name in SIDES:
            continue
        # leaves depend on earlier settings, such as the components of a quantity
        leaf = {entry.linked: entry for entry in leaves(state).values() if entry.linked}.get(name)
        try:
            state = set_leaf(state, leaf, text) if leaf else with_form(state, name, text)
        except Unreadable:
            unread.append(f"{name}={text}"[:60])
    if unread:
        suffix = f" and {len(unread) - 4} more" if len(unread) > 4 else ""
        named = ", ".join(unread[:4])
        return state.noted(f"ignored settings (unknown or invalid): {named}{suffix}")
    return state


def _pairs(line: str) -> list[tuple[str, str]]:
    if len(line) > MAX_LINE:
        raise OptionError(f"{len(line):,} characters of settings; expected at most {MAX_LINE:,}")
    try:
        return parse_qsl(line, keep_blank_values=True, max_num_fields=MAX_FIELDS)
    except ValueError:
        raise OptionError(f"too many settings; expected at most {MAX_FIELDS}") from None


CAMERA_NUMBERS = 10
FARTHEST = 1000.0  # farthest place of a camera, in units of the drawing
FOV_RAD = (0.01, 2.5)


def camera_of(line: str) -> CameraMemory | None:
    """Parse the camera of a line of settings; None where it is missing or invalid."""
    try:
        numbers = [parse_number(word) for word in dict(_pairs(line)).get(CAMERA, "").split(",")]
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


# --- Views of notes -------------------------------------------------------------------------------


def view_of(state: AppState, camera: CameraMemory | None) -> str:
    """Write the present view for a note: relative to the scene as opened where possible."""
    viewed = replace(state, review=())
    link = "" if _is_plain(state) else _packed(viewed, camera)
    # curves of thousands of points are stored in the scene only
    fits = 0 < len(link) <= MAX_NOTE_VIEW
    return link if fits else settings_line(viewed, camera, at_rest=True)


def file_notes(state: AppState) -> tuple[Note, ...]:
    """Return the notes for a file, whose scene may differ from the one as opened."""
    opened = start_state(replace(state.origin, review=()))

    def with_packed_view(note: Note) -> Note:
        if not note.view or PACKED in dict(_pairs(note.view)):
            return note
        link = _packed(*reopened(opened, note))
        return replace(note, view=link) if len(link) <= MAX_NOTE_VIEW else note

    return state.review if _is_plain(state) else tuple(map(with_packed_view, state.review))


def reopened(state: AppState, note: Note, scenes: KnownScenes = None) -> Opened:
    """Restore the view of a note; its state lists settings that cannot be restored."""
    if not note.view:
        return state, None
    origin = state.origin
    if PACKED in dict(_pairs(note.view)):
        viewed, camera = _read_link(note.view, scenes)
        same = viewed.scene.machine.axes == origin.machine.axes
        viewed = replace(viewed, loaded=None if viewed.scene == origin else origin,
                        start=state.start if same else viewed.start)  # fmt: skip
    else:
        viewed = with_settings(start_state(origin).at_rest(), note.view, scenes)
        camera = camera_of(note.view)
    return replace(viewed, review=state.review, page=state.page, forms=state.forms), camera


# --- The sides of a comparison in it --------------------------------------------------------------

PREFIX = "compare."
PINNED = "pinned"
NOW = "now"  # the present state, in files and links
LONGEST_TITLE = 200
SIDES = [PREFIX + name for name in ("pinned", "a", "b", "pinned.title", "a.title", "b.title")]


def _sides(state: AppState, scenes: KnownScenes) -> Iterator[tuple[str, str]]:
    chosen = state.comparison
    for name, side in (("pinned", chosen.pinned), ("a", chosen.a), ("b", chosen.b)):
        if side is None or (name == "a" and side.state is None):
            continue
        if side.state is None:
            text, usual = NOW, side.title
        elif name != PINNED and not side.is_scene:
            text, usual = PINNED, side.title
        else:
            text = _spell(side.state, None, scenes)
            usual = scene_side(side.state.scene).title if side.is_scene else ""
        yield PREFIX + name, text
        if side.title != usual:
            yield f"{PREFIX}{name}.title", side.title


def _with_sides(state: AppState, settings: Mapping[str, str], scenes: KnownScenes) -> AppState:
    sides: dict[str, Side | None] = {PINNED: None}
    for name in (PINNED, "a", "b"):
        text = settings.get(PREFIX + name)
        if text is None or text == NOW:
            sides[name] = None if text is None else Side()
        elif text == PINNED:
            sides[name] = sides[PINNED]
            if sides[PINNED] is None:
                raise OptionError("the comparison lacks its pinned state")
        else:
            opened, _ = _read_link(text, scenes, single=True)
            if name == PINNED:
                state = state.noted(*(f"{BEFORE}: {note}" for note in opened.notes))
                side = pinned_side(plain_state(opened.without_notes()))
            else:
                side = scene_side(opened.scene)
            title = settings.get(f"{PREFIX}{name}.title", "")[:LONGEST_TITLE]
            usual = title in (NOW, PRESENT, NOBODY, "")
            sides[name] = side if usual else replace(side, title=title)
    compared = replace(state.comparison, a=sides["a"] or Side(), b=sides["b"], pinned=sides[PINNED])
    return replace(state, comparison=compared)


# --- Scenes of a tab: those of the server, and the latest opened ones -----------------------------

MOST_OPENED = 20


class SceneList(dict[str, Scene]):
    """Scenes by unique title."""

    def __init__(self, scenes: Mapping[str, Scene]) -> None:
        super().__init__(scenes)
        self.fixed = tuple(scenes.values())  # available to all tabs

    def add(self, scene: Scene) -> tuple[str, str]:
        """Add an opened scene; return its title, and that of a scene dropped for it."""
        for title, listed in self.items():
            if listed is scene or listed == scene:
                return title, ""
        base = title = scene.title or scene.name
        number = 2
        while title in self or title in (PRESENT, NOBODY):
            title, number = f"{base} ({number})", number + 1
        self[title] = scene
        if len(self) <= len(self.fixed) + MOST_OPENED:
            return title, ""
        dropped = list(self)[len(self.fixed)]
        del self[dropped]
        return title, dropped
