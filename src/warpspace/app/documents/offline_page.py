"""One file with the interactive scene that needs no network: for a mail, a share, an archive.

The scene is exported by a throwaway server that nobody connects to; the page around it (heading,
colour bar, statistics, factor, parameters) is ours, since the export has no widgets.
"""

import contextlib
import io
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import viser
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpspace.app.documents.conditions import picture_conditions
from warpspace.app.evaluation.budget import active_errors, answer
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.readouts import summary as legend
from warpspace.app.readouts.html import style_sheet
from warpspace.app.state.app_state import start_state
from warpspace.app.viewport.camera import CameraMemory, fit_camera
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.app.viewport.layers.adding import light_scene
from warpspace.app.viewport.layers.asked_point import AskedPointLayer
from warpspace.app.viewport.layers.axes import AxesLayer, axes_room_mm
from warpspace.app.viewport.layers.box import BoxLayer, OtherSideLayer
from warpspace.app.viewport.layers.traces import TracesLayer
from warpspace.field.grid import MIN_NODES
from warpspace.geometry.surfaces import is_thin
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorFunction
from warpspace.picture.model import choose_scale
from warpspace.picture.words import convention_words, own_axes, reference_words, spell_point
from warpspace.resources import __version__
from warpspace.scene.model import Scene

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""What the browser may load: what is in the file, and nothing else."""
ASPECT = 1.5
MARGIN = 1.3  # room around the box, for the axes beside it


def offline_picture(
    scene: Scene,
    *,
    exaggeration: float,
    nodes: int,
    loop: Loop = Loop.TOOL,
    component: str = "norm",
    largest: float | None = None,
) -> LivePicture:
    """Evaluate a scene for a page."""
    state = replace(
        start_state(scene),
        exaggeration=exaggeration,
        nodes=max(nodes, MIN_NODES),  # callers count those of a grid, and a point has one
        loop=loop,
        component=component,
    )
    picture = LiveModel().evaluate(state)
    return (
        picture
        if largest is None
        else replace(picture, colours=choose_scale([np.array(largest)], component))
    )


def build_scene_html(
    picture: LivePicture, aspect: float = ASPECT, camera: CameraMemory | None = None
) -> str:
    """Export the 3-D scene of a picture as a page of its own, without a word around it."""
    with contextlib.redirect_stdout(io.StringIO()):  # the server says hello and goodbye
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            light_scene(server.scene)
            for layer in (BoxLayer, TracesLayer, AxesLayer, OtherSideLayer, AskedPointLayer):
                layer(server.scene, picture)
            if camera is None:
                _place_camera(server, picture, aspect)
            else:
                _keep_camera(server, camera)
            return server.scene.as_html(dark_mode=picture.state.shown.dark)
        finally:
            server.stop()


def _place_camera(server: viser.ViserServer, picture: LivePicture, aspect: float) -> None:
    drawn = np.concatenate([picture.grid.nominal_mm, picture.drawn_mm]).reshape(-1, 3)
    if is_thin(picture.shape):
        drawn = np.concatenate([drawn, axes_room_mm(picture)])
    pose = fit_camera(drawn, aspect, margin=MARGIN)
    camera = server.initial_camera
    camera.up = (0.0, 0.0, 1.0)
    camera.fov = pose.fov_rad
    camera.position = pose.position * SCENE_PER_MM
    camera.look_at = pose.look_at * SCENE_PER_MM


def _keep_camera(server: viser.ViserServer, kept: CameraMemory) -> None:
    camera = server.initial_camera
    camera.up = kept.up
    camera.fov = kept.fov_rad
    camera.position = kept.position
    camera.look_at = kept.look_at


def build_offline_html(
    picture: LivePicture,
    provenance: Mapping[str, Any] | None = None,
    camera: CameraMemory | None = None,
) -> str:
    """Build the page: the interactive scene with its colour bar, numbers and factor."""
    # a page in an attribute: only these two characters would end or change it
    inner = build_scene_html(picture, camera=camera).replace("&", "&amp;").replace('"', "&quot;")
    conditions = list(picture_conditions(picture))
    about = {**(provenance or {}), **({"conditions": conditions} if conditions else {})}
    stored = json.dumps(about, ensure_ascii=False, allow_nan=False)
    templates = Environment(
        loader=PackageLoader("warpspace.app"), autoescape=True, undefined=StrictUndefined
    )
    return templates.get_template("offline.html.j2").render(
        title=picture.title,
        program=f"warpspace {__version__}",
        policy=POLICY,
        style=Markup(style_sheet()),  # noqa: S704 - ours
        heading=Markup(legend.heading(picture)),  # noqa: S704 - escaped where it is built
        summary=Markup(legend.summary(picture)),  # noqa: S704
        scene=Markup(inner),  # noqa: S704
        parameters=parameter_rows(picture),
        counted="unlike in A and B" if picture.is_difference else "not zero",
        point=point_words(picture),
        remarks=remarks(picture),
        provenance=Markup(stored.replace("<", "\\u003c")),  # noqa: S704
    )


def parameter_rows(picture: LivePicture) -> list[dict[str, str]]:
    """Spell the errors that are drawn: key, plain name, value with unit.

    Those that are not zero; of a difference those that are unlike on both sides.
    """
    drawn = picture.drawn_state
    if picture.compared is None or not picture.is_difference:
        return [_row(key, f"{value:+g}") for key, value in drawn.active.items() if value != 0.0]
    a, b = (active_errors(side).functions for side in picture.compared.sides)
    return [
        _row(key, f"A {_amplitude(a.get(key))}, B {_amplitude(b.get(key))}")
        for key in {**a, **b}
        if a.get(key) != b.get(key)
    ]


def point_words(picture: LivePicture) -> str:
    """Say where the point is that was asked about, and its error; empty where there is none."""
    picked = picture.state.picked
    if picked is None or picture.is_difference:
        return ""
    found = answer(picture.drawn_state, picked, picture.exaggeration)
    length = float(np.linalg.norm(found.drawn_um))
    axes = own_axes(picture.drawn_state.scene, found.at)
    place = spell_point(axes, found.explanation.nominal_mm)
    return f"marked point: {place} mm, |E| {length:.1f} µm"


def _row(key: str, value: str) -> dict[str, str]:
    row = parameter(key)
    return {"key": key, "name": row.name, "value": f"{value} {row.unit}".replace("-", "−")}


def _amplitude(function: ErrorFunction | None) -> str:
    return "0" if function is None else f"{function.amplitude:+g}"


def remarks(picture: LivePicture) -> list[str]:
    """Spell how the scene is looked at; of a difference for both sides."""
    return [
        f"{picture.both_words(lambda state: state.loop.value)} loop",
        picture.both_words(lambda state: reference_words(state.scene)),
        *picture_conditions(picture),
        picture.both_words(lambda state: convention_words(state.scene)),
        picture.both_words(
            lambda state: "exact chain" if state.controller else "first-order model"
        ),
        "error = actual − nominal",
        "drag to turn, wheel to zoom",
        f"warpspace {__version__}",
    ]
