"""One file with the interactive scene that needs no network: for a mail, a share, an archive.

It shows one picture, or the steps of a story. A throwaway server that nobody connects to exports
the drawing of the first step; the page around it (heading, colour bar, statistics, factor,
parameters) is ours, since the export has no widgets. Of all steps the page holds points, levels of
their colours and cameras, and bends the drawing by them (`browser/mesh.js`).
"""

import contextlib
import io
import json
import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
import viser
from markupsafe import Markup, escape

from warpspace.analysis.note_tables import note_numbers, spell_numbers, spell_place, stale_remark
from warpspace.app.browser.html import EMPTY, join, linked, lowered, number, rows, tag
from warpspace.app.browser.page import script_source
from warpspace.app.documents import legend
from warpspace.app.documents.scene_file import Known, reopened
from warpspace.app.drawing.around import ACCENT, ASKED, around, words
from warpspace.app.drawing.box import box, line_facts, packed
from warpspace.app.drawing.camera import CameraMemory, fit_camera
from warpspace.app.drawing.colours import colour_levels, level_colours
from warpspace.app.drawing.labels import axes_room_mm, note_labels, point_labels
from warpspace.app.drawing.shapes import SCENE_PER_MM, Nodes, Shapes, ball, light_scene
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, start_state
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.field.grid import MIN_NODES
from warpspace.machine.axes import parameter
from warpspace.picture.map_mesh import map_mesh
from warpspace.picture.model import choose_scale
from warpspace.resources import __version__
from warpspace.scene.model import Scene
from warpspace.scene.notes import Note, story
from warpspace.units import Array

About = Mapping[str, Any] | None
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""What the browser may load: what is in the file, and nothing else."""
FEW = 12  # errors that are listed at once
ASPECT = 1.5
PARTS = 50_000  # of the longest edge, that points of a step are rounded to
AWAY_MM = (0.0, 0.0, 1e6)  # where the marker of a step without a point stands: out of sight
LEFT_OUT = "machine, slices, isolines, traces and paths are left out of the steps"


@dataclass(frozen=True)
class PageStep:
    """What a page shows at a time; one picture is the only step."""

    picture: LivePicture
    camera: CameraMemory
    note: Markup = EMPTY  # what the note says that it shows

    @property
    def point_mm(self) -> Array:
        """Where the point of the note is drawn."""
        return next((one.at_mm for one in note_labels(self.picture)), np.array(AWAY_MM))


def offline_picture(
    scene: Scene, *, nodes: int, largest: float | None = None, **shown: Any
) -> LivePicture:
    """Evaluate a scene for a page; `largest` is where its colours end, for several alike."""
    # callers count the nodes of a grid, and a point has one
    state = replace(start_state(scene), nodes=max(nodes, MIN_NODES), **shown)
    picture = LiveModel().evaluate(state)
    colours = None if largest is None else choose_scale([np.array(largest)], state.component)
    return replace(picture, colours=colours or picture.colours)


def build_offline_html(
    picture: LivePicture, provenance: About = None, camera: CameraMemory | None = None
) -> str:
    """Build the page: the interactive scene with its colour bar, numbers and factor."""
    conditions = list(legend.picture_conditions(picture))
    about = {**(provenance or {}), **({"conditions": conditions} if conditions else {})}
    shapes = {**box(picture), **around(picture), **words(picture)}
    steps = [PageStep(picture, camera or _usual_camera(picture))]
    return _build_page(picture.title, steps, shapes, about)


def build_story_html(state: AppState, provenance: About = None, known: Known = None) -> str:
    """Build the page of the story that the notes of a state tell."""
    steps = _story_steps(state, known)
    first, grid = steps[0].picture, steps[0].picture.grid.nominal_mm
    alike = all(np.array_equal(step.picture.grid.nominal_mm, grid) for step in steps)
    # what follows no step stays away
    kept = ("/box", "/ghost", "/axes", "/words/axis", "/words/tick") if alike else ("/box",)
    found = {**box(first), **around(first), **words(first)}
    shapes = {name: shape for name, shape in found.items() if name.startswith(kept)}
    shapes["/story/point"] = ball(steps[0].point_mm, ASKED * first.size_mm, ACCENT)
    return _build_page(state.scene.title, steps, shapes, provenance or {})


def step_words(scene: Scene, notes: Sequence[Note], index: int, problem: str) -> Markup:
    """Say what a step of a story says, from its number to why its drawing is another's."""
    note = notes[index]
    heads = (note.kind.capitalize(), note.author, f"{note.date:%Y-%m-%d}", note.status)
    stays = problem and f"The drawing of the step before stays: {problem}"
    stale = stale_remark(note, note_numbers(scene, [note])[0])
    return join((
        tag("h2", f"{index + 1} of {len(notes)}"),
        tag("p", " · ".join(filter(None, heads)), class_="ws-quiet"),
        tag("p", linked(note.text), class_="ws-said"),
        *(tag("p", linked(f"{one.author}: {one.text}")) for one in note.replies),
        tag("p", " · ".join(filter(None, (spell_place(note), spell_numbers(note)))),
            class_="ws-quiet"),
        *(tag("p", one, class_="ws-warn") for one in (stale, stays) if one),
    ))  # fmt: skip


# --- The drawing ----------------------------------------------------------------------------------


def _usual_camera(picture: LivePicture) -> CameraMemory:
    drawn = np.concatenate([axes_room_mm(picture), picture.drawn_mm.reshape(-1, 3)])
    return fit_camera(drawn, ASPECT)


def _export(step: PageStep, shapes: Shapes) -> str:
    with contextlib.redirect_stdout(io.StringIO()):  # the server says hello and goodbye
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            light_scene(server.scene)
            Nodes(server.scene).draw(shapes)
            first, kept = server.initial_camera, step.camera
            first.up, first.fov = kept.up, kept.fov_rad
            first.position, first.look_at = kept.position, kept.look_at
            return server.scene.as_html(dark_mode=step.picture.state.shown.dark)
        finally:
            server.stop()


def _story_steps(state: AppState, known: Known) -> list[PageStep]:
    notes, scene, live = story(state.review), state.resulting_scene(), LiveModel()
    if not notes:
        raise OptionError("no note of this scene has a step of a story")
    picture, camera, steps = live.evaluate(_whole(state, state)), None, list[PageStep]()
    for index, note in enumerate(notes):
        problem = ""
        try:
            shown, seen = reopened(state, note, known) if note.view else (state, None)
            found = live.evaluate(_whole(shown, state, note))
            if steps and found.shape != picture.shape:
                raise OptionError("its machine has another volume")
            picture, camera = found, seen
        except WarpspaceError as error:
            problem = str(error)
        said = step_words(scene, notes, index, problem)
        steps.append(PageStep(picture, camera or _usual_camera(picture), said))
    return steps


def _whole(shown: AppState, like: AppState, *notes: Note) -> AppState:
    """Give what the steps have in common: the whole surface of the box, on the same ground."""
    look, machine = replace(shown.look, surface="surface", isolines=False), shown.machine
    ground, machine = replace(shown.shown, dark=like.shown.dark), replace(machine, shown=False)
    return replace(shown, look=look, shown=ground, machine=machine, nodes=like.nodes, review=notes)


def _packed_steps(steps: Sequence[PageStep]) -> str:
    """Pack what the page draws steps by; points as whole shifts from those of the first."""
    first, told = steps[0].picture, [{"camera": asdict(step.camera)} for step in steps]
    found: dict[str, object] = {"steps": told}
    if len(steps) > 1:
        start, unit = map_mesh(first).vertices_mm, first.size_mm / PARTS
        found |= {"start": packed(start.astype("<f4")), "unit": unit, **line_facts(first, start)}
        for step, entries in zip(steps, told, strict=True):
            mesh, scale = map_mesh(step.picture), step.picture.scale
            entries |= {
                "point": (step.point_mm * SCENE_PER_MM).round(4).tolist(),
                "shifts": np.rint((mesh.vertices_mm - start) / unit).astype(int).ravel().tolist(),
                "levels": packed(colour_levels(scale, mesh.values)),
                "palette": packed(level_colours(diverging=scale.diverging)),
            }
    text = json.dumps(found, allow_nan=False).encode()
    return b64encode(zlib.compress(text, 9)).decode("ascii")


# --- The page around it ---------------------------------------------------------------------------


def _build_page(title: str, steps: Sequence[PageStep], shapes: Shapes, about: About) -> str:
    texts = files("warpspace.app.documents")
    scripts = "".join(f"<script>{script_source(name)}</script>" for name in ("mesh.js", "fly.js"))
    scene = _export(steps[0], shapes).replace("</body>", f"{scripts}</body>")
    remarks = ("drag to turn, wheel to zoom", f"warpspace {__version__}")
    if steps[0].note:
        remarks = (LEFT_OUT, "→ goes on, ← goes back", *remarks)
    heading, beside, below = (
        join(tag("div", one, data_step=i, hidden=i > 0) for i, one in enumerate(said))
        for said in zip(*(_step_pieces(step, title) for step in steps), strict=True)
    )
    return Template(texts.joinpath("offline.html").read_text("utf-8")).substitute(
        title=escape(title),
        program=f"warpspace {__version__}",
        policy=POLICY,
        theme="dark" if steps[0].picture.state.shown.dark else "light",
        heading=heading,
        # a page in an attribute: only these two characters would end or change it
        scene=scene.replace("&", "&amp;").replace('"', "&quot;"),
        buttons="" if len(steps) > 1 else "hidden",
        beside=beside,
        remarks=below + join(tag("span", one) for one in remarks),
        # no text in a script may end it
        provenance=json.dumps(about, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c"),
        steps=_packed_steps(steps),
        script=texts.joinpath("offline.js").read_text("utf-8"),
    )


def _step_pieces(step: PageStep, title: str) -> tuple[Markup, Markup, Markup]:
    picture, errors = step.picture, _error_rows(step.picture)
    kept = "" if picture.is_difference else f" · {legend.kept_words(picture)[0]}"
    factor, *looks = legend.look_words(picture)
    seen = f"{legend.numbers_words(picture)} {legend.place_words(picture)}{kept} · {factor}"
    subjects = [one for one in (picture.title, *legend.subject_words(picture)) if one != title]
    found = picture.statistics
    numbers = {"mean": found.mean_um, "RMS": found.rms_um, "P95": found.p95_um, "max": found.max_um}
    asked = [label.text for label in point_labels(picture) if label.kind == "asked"]
    counted = "unlike in A and B" if picture.is_difference else "not zero"
    summary = f"{len(errors)} error{'' if len(errors) == 1 else 's'} {counted}"
    listed = join(tag("tr", join(tag("td", cell) for cell in row)) for row in errors)
    beside = (
        step.note,
        *(tag("p", one, class_="ws-warn") for one in picture.state.notes),
        legend.legend_html(picture),
        tag("b", lowered(f"{picture.length_words} over the volume")),
        rows((name, f"{number(value, 2)} µm") for name, value in numbers.items()),
        tag("p", " · ".join(asked)),
        tag("details", tag("summary", summary) + tag("table", listed),
            open=len(errors) <= FEW and not step.note),
    )  # fmt: skip
    return (
        join(tag("p", one) for one in (seen, *subjects)),
        join(beside),
        join(tag("span", one) for one in looks),
    )


def _error_rows(picture: LivePicture) -> list[tuple[str, str, str]]:
    """Spell the errors that are not zero, or unlike in A and B: key, plain name, value and unit."""
    both = picture.compared.sides if picture.compared and picture.is_difference else ()
    sides = [one.active_scene().errors.functions for one in both or (picture.drawn_state,)]
    found: list[tuple[str, str, str]] = []
    for row in map(parameter, dict.fromkeys(key for side in sides for key in side)):
        given = [side.get(row.key) for side in sides]
        spelt = [f"{one.amplitude:+g}" if one and one.amplitude else "0" for one in given]
        value = f"A {spelt[0]}, B {spelt[1]}" if both else spelt[0]
        if (given[0] != given[1]) if both else value != "0":
            found.append((row.key, row.name, f"{value} {row.unit}".replace("-", "−")))
    return found
