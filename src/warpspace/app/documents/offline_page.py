"""A single file with the interactive scene that works offline: for e-mail, file servers, archives.

It shows one picture, or the steps of a story. A temporary server exports the drawing of the first
step; the page around it (heading, colour bar, statistics, exaggeration, parameters) is built here,
since the export has no widgets. The page contains points, colour levels and cameras of all steps,
and deforms the drawing by them (`browser/mesh.js`).
"""

import contextlib
import json
import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
import rich
import viser
from markupsafe import Markup, escape

from warpspace.analysis.note_tables import note_numbers, spell_numbers, spell_place, stale_remark
from warpspace.app.browser.html import EMPTY
from warpspace.app.browser.page import script_source
from warpspace.app.browser.templates import Templates
from warpspace.app.browser.viser_private import BARE_STYLE
from warpspace.app.documents import legend
from warpspace.app.documents.scene_file import KnownScenes, reopened
from warpspace.app.drawing.around import ACCENT, POINT_MARKER, draw_labels, draw_surroundings
from warpspace.app.drawing.box import box, limit_shapes, line_facts, packed
from warpspace.app.drawing.camera import CameraMemory, fit_camera
from warpspace.app.drawing.colours import colour_levels, level_colours
from warpspace.app.drawing.labels import axes_room_mm, note_labels, point_labels
from warpspace.app.drawing.moving import draw_machine
from warpspace.app.drawing.shapes import SCENE_PER_MM, Nodes, Shapes, ball, light_scene
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, start_state
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.field.grid import MIN_NODES
from warpspace.machine.axes import parameter
from warpspace.picture.formatting import spell_factor
from warpspace.picture.map_mesh import map_mesh
from warpspace.picture.model import choose_scale
from warpspace.resources import __version__
from warpspace.scene.model import Scene
from warpspace.scene.notes import Note, story
from warpspace.units import Array

HTML = Templates("offline")
About = Mapping[str, Any] | None
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""The browser may load the contents of the file only."""
MAX_UNFOLDED = 12  # errors in a list that is initially open
ASPECT = 1.5
PARTS = 50_000  # resolution of points of a step, per longest edge
AWAY_MM = (0.0, 0.0, 1e6)  # of the marker of a step without a point: out of sight
LEFT_OUT = "the steps do not show machine, slices, isolines, traces and paths"


@dataclass(frozen=True)
class PageStep:
    """One step of a page; a page of one picture has a single step."""

    picture: LivePicture
    camera: CameraMemory
    note: Markup = EMPTY

    @property
    def point_mm(self) -> Array:
        return next((label.at_mm for label in note_labels(self.picture)), np.array(AWAY_MM))


def offline_picture(
    scene: Scene, *, nodes: int, largest: float | None = None, **changes: Any
) -> LivePicture:
    """Evaluate a scene for a page; `largest` is the common end of colours of several scenes."""
    # callers may pass 1 for a point
    state = replace(start_state(scene), nodes=max(nodes, MIN_NODES), **changes)
    picture = LiveModel().evaluate(state)
    colours = None if largest is None else choose_scale([np.array(largest)], state.component)
    return replace(picture, colours=colours or picture.colours)


def build_offline_html(
    picture: LivePicture, provenance: About = None, camera: CameraMemory | None = None
) -> str:
    """Build the page: the interactive scene with colour bar, statistics and exaggeration."""
    conditions = list(legend.picture_conditions(picture))
    about = {**(provenance or {}), **({"conditions": conditions} if conditions else {})}
    drawn = (box(picture), limit_shapes(picture), draw_surroundings(picture), draw_machine(picture),
             draw_labels(picture))  # fmt: skip
    shapes = {name: shape for shapes in drawn for name, shape in shapes.items()}
    steps = [PageStep(picture, camera or _usual_camera(picture))]
    return _build_page(picture.title, steps, shapes, about)


def build_story_html(state: AppState, provenance: About = None, scenes: KnownScenes = None) -> str:
    steps = _story_steps(state, scenes)
    first, grid = steps[0].picture, steps[0].picture.grid.nominal_mm
    alike = all(np.array_equal(step.picture.grid.nominal_mm, grid) for step in steps)
    # shapes that do not follow the steps are omitted
    prefixes = ("/box", "/ghost", "/axes", "/words/axis", "/words/tick") if alike else ("/box",)
    nodes = {**box(first), **draw_surroundings(first), **draw_labels(first)}
    shapes = {name: shape for name, shape in nodes.items() if name.startswith(prefixes)}
    shapes["/story/point"] = ball(steps[0].point_mm, POINT_MARKER * first.size_mm, ACCENT)
    return _build_page(state.scene.title, steps, shapes, provenance or {})


def step_words(scene: Scene, notes: Sequence[Note], index: int, problem: str) -> Markup:
    """Render number, text and numbers of a step of a story, and a problem with its drawing."""
    note = notes[index]
    heads = (note.kind.capitalize(), note.author, f"{note.date:%Y-%m-%d}", note.status)
    stays = problem and f"The drawing of the previous step is shown: {problem}"
    stale = stale_remark(note, note_numbers(scene, [note])[0])
    facts = " · ".join(filter(None, (spell_place(note), spell_numbers(note))))
    heading = " · ".join(filter(None, heads))
    return HTML.step(index + 1, len(notes), heading, note, facts, (stale, stays))


# --- The drawing ----------------------------------------------------------------------------------


def _usual_camera(picture: LivePicture) -> CameraMemory:
    drawn = np.concatenate([axes_room_mm(picture), picture.drawn_mm.reshape(-1, 3)])
    return fit_camera(drawn, ASPECT)


def _export(step: PageStep, shapes: Shapes) -> str:
    console = rich.get_console()  # shows a banner of the server, in a terminal and in a notebook
    with contextlib.ExitStack() as stack:
        stack.callback(setattr, console, "quiet", console.quiet)
        console.quiet = True
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        stack.callback(server.stop)
        light_scene(server.scene)
        Nodes(server.scene).draw(shapes)
        first, camera = server.initial_camera, step.camera
        first.up, first.fov = camera.up, camera.fov_rad
        first.position, first.look_at = camera.position, camera.look_at
        return server.scene.as_html(dark_mode=step.picture.state.shown.dark)


def _story_steps(state: AppState, scenes: KnownScenes) -> list[PageStep]:
    notes, scene, live = story(state.review), state.resulting_scene(), LiveModel()
    if not notes:
        raise OptionError("no note of this scene is a step of a story")
    picture, camera, steps = live.evaluate(_story_view(state, state)), None, list[PageStep]()
    for index, note in enumerate(notes):
        problem = ""
        try:
            step_state, step_camera = reopened(state, note, scenes) if note.view else (state, None)
            evaluated = live.evaluate(_story_view(step_state, state, note))
            if steps and evaluated.shape != picture.shape:
                raise OptionError("its machine has a different volume")
            picture, camera = evaluated, step_camera
        except WarpspaceError as error:
            problem = str(error)
        text = step_words(scene, notes, index, problem)
        steps.append(PageStep(picture, camera or _usual_camera(picture), text))
    return steps


def _story_view(step_state: AppState, like: AppState, *notes: Note) -> AppState:
    """Return a state with the common settings of all steps: full surface, same background."""
    return replace(
        step_state,
        look=replace(step_state.look, surface="surface", isolines=False),
        machine=replace(step_state.machine, shown=False),
        shown=replace(step_state.shown, dark=like.shown.dark),
        nodes=like.nodes,
        review=notes,
    )


def _packed_steps(steps: Sequence[PageStep]) -> str:
    """Pack the drawings of the steps; points as integer shifts from those of the first."""
    first, step_views = steps[0].picture, [_view_facts(step) for step in steps]
    content: dict[str, object] = {"steps": step_views}
    if len(steps) > 1:
        start, unit = map_mesh(first).vertices_mm, first.size_mm / PARTS
        content |= {"start": packed(start.astype("<f4")), "unit": unit, **line_facts(first, start)}
        for step, entries in zip(steps, step_views, strict=True):
            mesh, scale = map_mesh(step.picture), step.picture.scale
            entries |= {
                "point": (step.point_mm * SCENE_PER_MM).round(4).tolist(),
                "shifts": np.rint((mesh.vertices_mm - start) / unit).astype(int).ravel().tolist(),
                "levels": packed(colour_levels(scale, mesh.values)),
                "palette": packed(level_colours(diverging=scale.diverging)),
            }
    text = json.dumps(content, allow_nan=False).encode()
    return b64encode(zlib.compress(text, 9)).decode("ascii")


def _view_facts(step: PageStep) -> dict[str, object]:
    picture = step.picture
    centre = (picture.grid.bounds_mm.mean(axis=0) * SCENE_PER_MM).round(4).tolist()
    bars = {"centre": centre, "perMm": SCENE_PER_MM, "factor": picture.exaggeration,
            "spelt": spell_factor(picture.exaggeration)}  # fmt: skip
    return {"camera": asdict(step.camera), "bars": bars if picture.state.look.bars else None}


# --- The page around the drawing ------------------------------------------------------------------


def _build_page(title: str, steps: Sequence[PageStep], shapes: Shapes, about: About) -> str:
    texts = files("warpspace.app.documents")
    names = "viser_private.js", "mesh.js", "fly.js", "bars.js"
    added = BARE_STYLE + "".join(f"<script>{script_source(name)}</script>" for name in names)
    scene = _export(steps[0], shapes).replace("</body>", f"{added}</body>")
    remarks = ("drag to turn, wheel to zoom", f"warpspace {__version__}")
    if steps[0].note:
        remarks = (LEFT_OUT, "→ next step, ← previous step", *remarks)
    heading, column, below = (
        HTML.steps(pieces)
        for pieces in zip(*(_step_pieces(step, title) for step in steps), strict=True)
    )
    return Template(texts.joinpath("offline.html").read_text("utf-8")).substitute(
        title=escape(title),
        program=f"warpspace {__version__}",
        policy=POLICY,
        theme="dark" if steps[0].picture.state.shown.dark else "light",
        heading=heading,
        # in an attribute only these two characters need escaping
        scene=scene.replace("&", "&amp;").replace('"', "&quot;"),
        buttons="" if len(steps) > 1 else "hidden",
        beside=column,
        remarks=below + HTML.texts("span", remarks),
        # no text in a script may end it
        provenance=json.dumps(about, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c"),
        steps=_packed_steps(steps),
        script=texts.joinpath("offline.js").read_text("utf-8"),
    )


def _step_pieces(step: PageStep, title: str) -> tuple[Markup, Markup, Markup]:
    picture = step.picture
    within = "" if picture.is_difference else f" · {legend.within_limit_words(picture)[0]}"
    factor, *looks = legend.look_words(picture)
    largest = f"{legend.numbers_words(picture)} {legend.place_words(picture)}{within}"
    headline = " · ".join(filter(None, (largest, legend.loop_words(picture), factor)))
    subjects = [text for text in (picture.title, *legend.subject_words(picture)) if text != title]
    point_texts = [label.text for label in point_labels(picture) if label.kind == "asked"]
    counted = "different in A and B" if picture.is_difference else "not zero"
    column = HTML.column(step, picture, legend.legend_html(picture), " · ".join(point_texts),
                         _error_rows(picture), counted, MAX_UNFOLDED)  # fmt: skip
    return HTML.texts("p", (headline, *subjects)), column, HTML.texts("span", looks)


def _error_rows(picture: LivePicture) -> list[tuple[str, str, str]]:
    compared = picture.compared.sides if picture.compared and picture.is_difference else ()
    sides = [side.active_scene().errors.functions for side in compared or (picture.drawn_state,)]
    error_rows: list[tuple[str, str, str]] = []
    for row in map(parameter, dict.fromkeys(key for side in sides for key in side)):
        functions = [side.get(row.key) for side in sides]
        spelt = [f"{of.amplitude:+g}" if of and of.amplitude else "0" for of in functions]
        value = f"A {spelt[0]}, B {spelt[1]}" if compared else spelt[0]
        if (functions[0] != functions[1]) if compared else value != "0":
            error_rows.append((row.key, row.name, f"{value} {row.unit}".replace("-", "−")))
    return error_rows
