"""A story in one file that needs no network: its notes in order, each beside what it was made of.

The drawing is exported once, as the first step shows it. Of each other step the page holds points,
levels of its colours and the camera, and morphs the drawing (`browser/mesh.js`).
"""

import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.analysis.reviewing import note_numbers, said_stale, spell_numbers, spell_place
from warpspace.app.browser.html import join, linked, tag
from warpspace.app.browser.page import script_source
from warpspace.app.documents import legend
from warpspace.app.documents.offline_page import (
    as_json,
    build_scene_html,
    fill_page,
    numbers_html,
    usual_camera,
)
from warpspace.app.documents.scene_file import Known, reopened
from warpspace.app.drawing.around import ACCENT, ASKED, around, words
from warpspace.app.drawing.box import box, line_facts, packed
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.drawing.colours import colour_levels, level_colours
from warpspace.app.drawing.shapes import SCENE_PER_MM, Shape, ball
from warpspace.app.evaluation.budget import answer
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState, Picked
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.geometry.surfaces import is_thin
from warpspace.kinematics.model import Loop
from warpspace.picture.mesh import map_mesh
from warpspace.resources import __version__
from warpspace.scene.notes import Note, story
from warpspace.units import Array

LEFT_OUT = "machine, slices, isolines, traces and paths are left out of the steps"
AWAY_MM = (0.0, 0.0, 1e6)  # where the marker of a step without a point stands: out of sight
LEVELS = 65_535  # that a coordinate is rounded to: a hundredth of a millimetre or finer
STILL = "The drawing of the step before stays: "


@dataclass(frozen=True)
class Step:
    note: Note
    picture: LivePicture
    camera: CameraMemory
    problem: str = ""  # why its picture is that of the step before

    @property
    def point_mm(self) -> Array:
        """Where what the note is pinned to is drawn."""
        note, on = self.note, self.note.on
        if self.problem or not note.at or (on and on.body) or self.picture.is_difference:
            return np.array(AWAY_MM)
        picked = Picked(note.at)
        if on and on.loop:
            picked = Picked(note.at, Loop(on.loop), on.point_mm)
        try:
            return answer(self.picture.drawn_state, picked, self.picture.exaggeration).drawn_mm
        except WarpspaceError:  # of a machine with other axes
            return np.array(AWAY_MM)


def build_story_html(
    state: AppState, provenance: Mapping[str, Any] | None = None, known: Known = None
) -> str:
    """Build the page of the story that the notes of a state tell."""
    steps = _steps(state, known)
    first, scene = steps[0].picture, state.resulting_scene()
    meshes = [map_mesh(step.picture) for step in steps]
    places = np.array([step.point_mm for step in steps]) * SCENE_PER_MM
    grid = first.grid.nominal_mm
    alike = all(np.array_equal(step.picture.grid.nominal_mm, grid) for step in steps)
    found = {**box(first), **around(first), **words(first, points=False)}
    kept = ("/box", "/ghost", "/axes", "/words") if alike else ("/box",)  # these do not follow
    shapes = {name: shape for name, shape in found.items() if name.startswith(kept)}
    marker: Shape = ball(places[0] / SCENE_PER_MM, ASKED * first.size_mm, ACCENT)
    inner = build_scene_html(first, steps[0].camera, {**shapes, "/story/point": marker})
    scripts = "".join(f"<script>{script_source(name)}</script>" for name in ("mesh.js", "fly.js"))
    told: list[dict[str, object]] = []
    for step, mesh, at in zip(steps, meshes, places.tolist(), strict=True):
        camera = step.camera
        spelt: dict[str, object] = {
            "camera": [*camera.position, *camera.look_at, *camera.up, camera.fov_rad],
            "point": [round(x, 4) for x in at],
        }
        if not is_thin(first.shape):
            low = mesh.vertices_mm.min(axis=0)
            unit = max(float(np.ptp(mesh.vertices_mm, axis=0).max()) / LEVELS, 1e-9)
            spelt |= {
                "low": low.tolist(), "unit": unit,
                "points": _deflated(np.rint((mesh.vertices_mm - low) / unit)),
                "levels": packed(colour_levels(step.picture.scale, mesh.values)),
                "palette": int(step.picture.scale.diverging),
            }  # fmt: skip
        told.append(spelt)
    palettes = [packed(level_colours(diverging=one).astype("<f4")) for one in (False, True)]
    facts = {} if is_thin(first.shape) else line_facts(first, meshes[0].vertices_mm)
    data = as_json({"steps": told, "palettes": palettes, **facts})
    page_script = files("warpspace.app.documents").joinpath("offline_story.js").read_text("utf-8")
    notes = [step.note for step in steps]
    stale = [said_stale(*one) for one in zip(notes, note_numbers(scene, notes), strict=True)]
    return fill_page(
        state.scene.title,
        (f"A story in {len(steps)} step{'s' if len(steps) > 1 else ''} · → goes on, ← goes back",),
        inner.replace("</body>", f"{scripts}</body>"),
        provenance or {},
        (LEFT_OUT, "error = actual − nominal", "drag to turn, wheel to zoom",
         f"warpspace {__version__}"),
        kind="told",
        legend=tag("nav", join((
            tag("button", "← Back", id="back", disabled=True),
            tag("button", "On →", id="on", disabled=len(steps) == 1),
        ))),
        numbers=join(_section(i, steps, one) for i, one in enumerate(stale)),
        scripts=f'<script type="application/json" id="story">{data}</script>'
        f"<script>{page_script}</script>",
    )  # fmt: skip


def _deflated(whole: Array) -> str:
    """Pack whole numbers, [M, 3]: of each coordinate the changes from point to point."""
    changes = np.diff(whole.astype("<i4"), axis=0, prepend=0).astype("<i2")  # modulo 2¹⁶
    return b64encode(zlib.compress(changes.T.tobytes(), 9)).decode("ascii")


def step_words(note: Note, number: int, count: int, stale: str, problem: str) -> Markup:
    """Say what a step of a story says, from its number to why its drawing is another's."""
    heads = (note.kind.capitalize(), note.author, f"{note.date:%Y-%m-%d}", note.status)
    return join((
        tag("h2", f"{number + 1} of {count}"),
        tag("p", " · ".join(filter(None, heads)), class_="ws-quiet"),
        tag("p", linked(note.text), class_="ws-said"),
        *(tag("p", linked(f"{one.author}: {one.text}")) for one in note.replies),
        tag("p", " · ".join(filter(None, (spell_place(note), spell_numbers(note)))),
            class_="ws-quiet"),
        *(tag("p", words, class_="ws-warn") for words in (stale, problem and STILL + problem)
          if words),
    ))  # fmt: skip


def _section(number: int, steps: Sequence[Step], stale: str) -> Markup:
    step = steps[number]
    said = (
        step_words(step.note, number, len(steps), stale, step.problem),
        tag("p", f"{step.picture.title} · {legend.look_words(step.picture)[0]}"),
        legend.legend_html(step.picture), numbers_html(step.picture),
        *(tag("p", one, class_="ws-warn") for one in step.picture.state.notes),
    )  # fmt: skip
    return tag("section", join(said), class_="story", data_step=number, hidden=number > 0)


def _steps(state: AppState, known: Known) -> list[Step]:
    live, steps = LiveModel(), list[Step]()
    for note in story(state.review):
        try:
            shown, camera = reopened(state, note, known) if note.view else (state, None)
            picture = live.evaluate(_drawn(shown, state.nodes))
            if steps and picture.shape != steps[0].picture.shape:
                raise OptionError("its machine has another volume")
            steps.append(Step(note, picture, camera or usual_camera(picture)))
        except WarpspaceError as error:
            before = steps[-1] if steps else None
            picture = before.picture if before else live.evaluate(_drawn(state, state.nodes))
            camera = before.camera if before else usual_camera(picture)
            steps.append(Step(note, picture, camera, str(error)))
    if not steps:
        raise OptionError("no note of this scene has a step of a story")
    return steps


def _drawn(state: AppState, nodes: int) -> AppState:
    """Give what the steps have in common: the whole surface of the box."""
    look = replace(state.look, surface="surface", isolines=False)
    machine = replace(state.machine, shown=False, ghost=False)
    return replace(state, look=look, machine=machine, nodes=nodes)
