"""A picture of the 3-D view as PNG that says what it shows: title, factor, numbers, colour bar."""

from functools import cache
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont, PngImagePlugin

from warpspace.app.documents.conditions import picture_conditions
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.viewport.marks import scale_bars
from warpspace.picture.words import reference_words, spell_factor
from warpspace.resources import __version__

LIGHT, DARK = ((255, 255, 255), (27, 38, 59)), ((26, 27, 30), (222, 226, 232))
"""Ground and ink."""
BAND_PX = 150
HEAD_PX = 64
BAR_PX, BAR_LEFT_PX, BAR_STEP_PX = 150, 16, 24
"""Longest scale bar, where bars begin, and how far they are apart."""


def view_png(
    pixels: NDArray[np.uint8], picture: LivePicture, px_per_mm: float | None = None
) -> bytes:
    """Put a rendered view under a heading and beside its colour bar."""
    ground, ink = DARK if picture.state.shown.dark else LIGHT
    view = Image.fromarray(pixels).convert("RGBA")
    page = Image.new("RGBA", (view.width + BAND_PX, view.height + HEAD_PX), (*ground, 255))
    page.alpha_composite(view, (0, HEAD_PX))
    draw = ImageDraw.Draw(page)
    _heading(draw, picture, ink)
    _colour_bar(page, draw, picture, ink)
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
    for tick in scale.ticks:
        at = top + (scale.high - tick) / (scale.high - scale.low) * (height - 1)
        draw.line([(left + 24, at), (left + 30, at)], ink, 1)
        draw.text((left + 35, at - 9), f"{tick:g}".replace("-", "−"), ink, font)


def _scale_bars(
    draw: ImageDraw.ImageDraw, picture: LivePicture, px_per_mm: float, ink: tuple[int, int, int]
) -> None:
    # the longest bar is a quarter of the length that is handed over
    bars = scale_bars(4.0 * BAR_PX / px_per_mm, picture.exaggeration)
    factor = spell_factor(picture.exaggeration).replace("\u202f", " ")
    words = ("geometry", f"error, drawn {factor}")
    height = draw.im.size[1]
    for number, (bar, word) in enumerate(zip(bars, words, strict=True)):
        y = height - 18 - (1 - number) * BAR_STEP_PX
        end = BAR_LEFT_PX + bar.drawn_mm * px_per_mm
        draw.line([(BAR_LEFT_PX, y), (end, y)], ink, 2)
        for x in (BAR_LEFT_PX, end):
            draw.line([(x, y - 6), (x, y)], ink, 2)
        draw.text((end + 8, y - 13), f"{bar.text} {word}", ink, _font(14))
