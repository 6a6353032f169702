"""A picture of the 3-D view as PNG that says what it shows: title, factor, numbers, colour bar."""

from functools import cache
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from warpspace.app.documents.conditions import picture_conditions
from warpspace.app.documents.legend import marks
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.viewport.camera import CameraMemory
from warpspace.app.viewport.labels import axis_labels, point_labels
from warpspace.app.viewport.shapes import SCENE_PER_MM
from warpspace.geometry.surfaces import round_down
from warpspace.picture.words import reference_words, spell_factor
from warpspace.resources import __version__
from warpspace.units import MM_PER_UM, Array

LIGHT, DARK = ((255, 255, 255), (27, 38, 59)), ((26, 27, 30), (222, 226, 232))
"""Ground and ink."""
BAND_PX = 150
HEAD_PX = 64
BAR_PX, BAR_LEFT_PX, BAR_STEP_PX = 150, 16, 24
"""Longest scale bar, where bars begin, and how far they are apart."""


def view_png(
    pixels: NDArray[np.uint8],
    picture: LivePicture,
    px_per_mm: float | None = None,
    camera: CameraMemory | None = None,
) -> bytes:
    """Put a rendered view under a heading and beside its colour bar.

    Words beside points, which the page lays over its drawing, are put where the camera saw them.
    """
    ground, ink = DARK if picture.state.shown.dark else LIGHT
    view = Image.fromarray(pixels).convert("RGBA")
    page = Image.new("RGBA", (view.width + BAND_PX, view.height + HEAD_PX), (*ground, 255))
    page.alpha_composite(view, (0, HEAD_PX))
    draw = ImageDraw.Draw(page)
    _heading(draw, picture, ink)
    _colour_bar(page, draw, picture, ink)
    if camera is not None:
        _words(draw, picture, camera, (view.width, view.height), ink)
    if px_per_mm is not None:
        _scale_bars(draw, picture, px_per_mm, ink)
    facts = PngImagePlugin.PngInfo()
    facts.add_text("Software", f"warpspace {__version__}")
    facts.add_itxt("Title", picture.title)
    facts.add_itxt(
        "Description",
        "; ".join((f"exaggeration {spell_factor(picture.exaggeration)}", *_said(picture))),
    )
    written = BytesIO()
    page.convert("RGB").save(written, "PNG", pnginfo=facts)
    return written.getvalue()


@cache
def _font(size: int) -> "ImageFont.ImageFont | ImageFont.FreeTypeFont":
    """Give a font that has µ, × and −: the one that comes with the figures' library, unloaded."""
    library = find_spec("matplotlib")
    if library is not None and library.origin is not None:
        path = Path(library.origin).parent / "mpl-data/fonts/ttf/DejaVuSans.ttf"
        if path.is_file():
            return ImageFont.truetype(str(path), size)
    return ImageFont.load_default(size)


def _heading(draw: ImageDraw.ImageDraw, picture: LivePicture, ink: tuple[int, int, int]) -> None:
    found = picture.statistics
    title = picture.title
    factor = spell_factor(picture.exaggeration).replace("\u202f", " ")
    draw.text((16, 10), title[:110], ink, _font(22))
    draw.text(
        (16, 38),
        f"exaggeration {factor} · {picture.length_words} mean {found.mean_um:.2f} µm,"
        f" max {found.max_um:.2f} µm"
        f" · {' · '.join(_said(picture))}",
        ink,
        _font(15),
    )


def _said(picture: LivePicture) -> list[str]:
    reference = picture.both_words(lambda state: reference_words(state.scene))
    held = any(
        side.scene.reference is not None
        for side in (picture.compared.sides if picture.compared else (picture.state,))
    )
    return [
        f"{picture.both_words(lambda state: state.loop.value)} loop",
        *([reference] if held else []),
        *picture_conditions(picture),
    ]


def _colour_bar(
    page: Image.Image, draw: ImageDraw.ImageDraw, picture: LivePicture, ink: tuple[int, int, int]
) -> None:
    scale = picture.scale
    left, top = page.width - BAND_PX + 20, HEAD_PX + 60
    height = max(page.height - top - 40, 40)
    values = np.linspace(scale.high, scale.low, height)
    strip = np.repeat(scale.colours(values)[:, None, :], 24, axis=1)
    page.paste(Image.fromarray(strip.astype(np.uint8)), (left, top))
    font = _font(15)
    draw.text((left, top - 34), f"{scale.label} [{scale.unit}]", ink, font)
    for mark in marks(picture, apart=18.0 / height):
        at, name_at = (top + (1.0 - part) * (height - 1) for part in (mark.at, mark.name_at))
        draw.line([(left + 24, at), (left + 27, at), (left + 32, name_at)], ink, 1)
        draw.text((left + 35, name_at - 9), mark.words, ink, font)


def _words(
    draw: ImageDraw.ImageDraw,
    picture: LivePicture,
    camera: CameraMemory,
    size: tuple[int, int],
    ink: tuple[int, int, int],
) -> None:
    labels, middle = [*axis_labels(picture), *point_labels(picture)], picture.grid.bounds_mm.mean(0)
    starts = [middle if label.from_mm is None else label.from_mm for label in labels]
    points = np.array([*(label.at_mm for label in labels), *starts, middle])
    place = _seen(camera, points * SCENE_PER_MM, size)
    font, written = _font(14), list[Array]()
    for label, at, start in zip(labels, place, place[len(labels) :], strict=False):
        way = at - start
        way = way / max(float(np.linalg.norm(way)), 1e-9)
        half = np.array([draw.textlength(label.text, font), 16.0]) / 2.0
        for far in {"tick": (4.0,), "axis": (46.0,)}.get(label.kind, (22.0, 38.0, 54.0)):
            middle = at + way * (far + half)
            box = np.array([middle - half, middle + half])
            if not (box.min() > 0.0 and (box[1] < size).all()) or any(
                (box[0] < other[1]).all() and (other[0] < box[1]).all() for other in written
            ):
                continue
            written.append(box)
            if label.kind not in ("tick", "axis"):
                end = at + way * far
                draw.line([(at[0], at[1] + HEAD_PX), (end[0], end[1] + HEAD_PX)], ink, 1)
            draw.text((middle[0], middle[1] + HEAD_PX), label.text, ink, font, anchor="mm")
            break


def _seen(camera: CameraMemory, points: Array, size: tuple[int, int]) -> Array:
    """Give where points, [n, 3], are in a picture, [n, 2], pixels from its left top."""
    position = np.array(camera.position)
    forth = np.array(camera.look_at) - position
    forth = forth / np.linalg.norm(forth)
    right = np.cross(forth, camera.up)
    right = right / np.linalg.norm(right)
    seen = (points - position) @ np.stack([right, np.cross(right, forth), forth], axis=1)
    px = size[1] / 2.0 / np.tan(camera.fov_rad / 2.0) / seen[:, 2:]
    found: Array = np.array(size) / 2.0 + seen[:, :2] * (1.0, -1.0) * px
    return found


def _scale_bars(
    draw: ImageDraw.ImageDraw, picture: LivePicture, px_per_mm: float, ink: tuple[int, int, int]
) -> None:
    room, um_mm = BAR_PX / px_per_mm, MM_PER_UM * picture.exaggeration
    mm, um = round_down(room), round_down(room / um_mm)
    error = f"{um:g} µm" if um < 1e4 else f"{um * MM_PER_UM:g} mm"
    factor = spell_factor(picture.exaggeration).replace("\u202f", " ")
    rows = ((um * um_mm, f"{error} error, drawn {factor}"), (mm, f"{mm:g} mm geometry"))
    for number, (length, words) in enumerate(rows):
        y = draw.im.size[1] - 18 - number * BAR_STEP_PX
        end = BAR_LEFT_PX + length * px_per_mm
        draw.line([(BAR_LEFT_PX, y), (end, y)], ink, 2)
        for x in (BAR_LEFT_PX, end):
            draw.line([(x, y - 6), (x, y)], ink, 2)
        draw.text((end + 8, y - 13), words, ink, _font(14))
