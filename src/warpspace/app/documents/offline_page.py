"""One file with the interactive scene that needs no network: for a mail, a share, an archive.

The scene is exported by a throwaway server that nobody connects to; the page around it (heading,
colour bar, statistics, factor, parameters) is ours, since the export has no widgets.
"""

import contextlib
import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
import viser
from markupsafe import Markup, escape

from warpspace.app.browser.html import attributes, fill, join, lowered, number, rows, tag
from warpspace.app.documents import legend
from warpspace.app.drawing.around import around, words
from warpspace.app.drawing.box import box
from warpspace.app.drawing.camera import CameraMemory, fit_camera
from warpspace.app.drawing.labels import axes_room_mm, point_labels
from warpspace.app.drawing.shapes import Nodes, Shapes, light_scene
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import start_state
from warpspace.field.grid import MIN_NODES
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.picture.model import choose_scale
from warpspace.resources import __version__
from warpspace.scene.model import Scene

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""What the browser may load: what is in the file, and nothing else."""
FEW = 12  # errors that are listed at once
ASPECT = 1.5


def offline_picture(
    scene: Scene,
    *,
    exaggeration: float,
    nodes: int,
    loop: Loop = Loop.TOOL,
    component: str = "norm",
    largest: float | None = None,
) -> LivePicture:
    """Evaluate a scene for a page; `largest` is where its colours end, for several alike."""
    state = replace(
        start_state(scene),
        exaggeration=exaggeration,
        nodes=max(nodes, MIN_NODES),  # callers count those of a grid, and a point has one
        loop=loop,
        component=component,
    )
    picture = LiveModel().evaluate(state)
    colours = None if largest is None else choose_scale([np.array(largest)], component)
    return replace(picture, colours=colours or picture.colours)


def usual_camera(picture: LivePicture) -> CameraMemory:
    drawn = np.concatenate([axes_room_mm(picture), picture.drawn_mm.reshape(-1, 3)])
    return fit_camera(drawn, ASPECT)


def build_scene_html(
    picture: LivePicture, camera: CameraMemory | None = None, shapes: Shapes | None = None
) -> str:
    """Export the 3-D scene of a picture as a page of its own, without a word around it."""
    kept = camera or usual_camera(picture)
    drawn = {**box(picture), **around(picture), **words(picture)} if shapes is None else shapes
    with contextlib.redirect_stdout(io.StringIO()):  # the server says hello and goodbye
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            light_scene(server.scene)
            Nodes(server.scene).draw(drawn)
            first = server.initial_camera
            first.up, first.fov = kept.up, kept.fov_rad
            first.position, first.look_at = kept.position, kept.look_at
            return server.scene.as_html(dark_mode=picture.state.shown.dark)
        finally:
            server.stop()


def build_offline_html(
    picture: LivePicture,
    provenance: Mapping[str, Any] | None = None,
    camera: CameraMemory | None = None,
) -> str:
    """Build the page: the interactive scene with its colour bar, numbers and factor."""
    conditions = list(legend.picture_conditions(picture))
    about = {**(provenance or {}), **({"conditions": conditions} if conditions else {})}
    errors = _error_rows(picture)
    counted = "unlike in A and B" if picture.is_difference else "not zero"
    kept = "" if picture.is_difference else f" · {legend.kept_words(picture)[0]}"
    factor, *looks = legend.look_words(picture)
    heading = (
        f"{legend.numbers_words(picture)} {legend.place_words(picture)}{kept} · {factor}",
        *(one for one in legend.subject_words(picture) if one != picture.title),
    )
    asked = [label for label in point_labels(picture) if label.kind == "asked"]
    remarks = (*looks, "drag to turn, wheel to zoom", f"warpspace {__version__}")
    return fill_page(
        picture.title,
        heading,
        build_scene_html(picture, camera=camera),
        about,
        remarks,
        legend=legend.legend_html(picture),
        numbers=numbers_html(picture),
        point=tag("p", " · ".join(one.text for one in asked)),
        errors=fill(
            "<details{open}><summary>{count} {counted}</summary><table>{rows}</table></details>",
            open=attributes(open=len(errors) <= FEW),
            count=f"{len(errors)} error{'' if len(errors) == 1 else 's'}", counted=counted,
            rows=join(tag("tr", join(tag("td", cell) for cell in row)) for row in errors),
        ),
    )  # fmt: skip


def numbers_html(picture: LivePicture) -> Markup:
    found = picture.statistics
    numbers = {"mean": found.mean_um, "RMS": found.rms_um, "P95": found.p95_um, "max": found.max_um}
    return tag("b", lowered(f"{picture.length_words} over the volume")) + rows(
        (name, f"{number(value, 2)} µm") for name, value in numbers.items()
    )


def fill_page(
    title: str,
    heading: Iterable[str],
    scene: str,
    about: Mapping[str, Any],
    remarks: Iterable[str],
    **pieces: str,
) -> str:
    """Put an exported scene into a page; `pieces` are those of its template, empty by default."""
    template = files("warpspace.app.documents").joinpath("offline.html").read_text("utf-8")
    empty = dict.fromkeys(("legend", "numbers", "point", "errors", "kind", "scripts"), "")
    return Template(template).substitute(
        **(empty | pieces),
        title=escape(title),
        program=f"warpspace {__version__}",
        policy=POLICY,
        heading=join(tag("p", words) for words in heading),
        # a page in an attribute: only these two characters would end or change it
        scene=scene.replace("&", "&amp;").replace('"', "&quot;"),
        remarks=join(tag("span", words) for words in remarks),
        provenance=as_json(about),
    )


def as_json(value: object) -> str:
    """Spell a value for a script block of a page, which no text in it can end."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


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
