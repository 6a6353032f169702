"""Frames of a page that are drawn when a test asks for one, and not sixty times a second."""

from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from warpspace.geometry.colour import colour_table

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page

WHEN_ASKED = """(() => {
  const drawing = WebGL2RenderingContext.prototype;
  for (const name of ["clear", "drawArrays", "drawElements", "drawRangeElements",
      "drawArraysInstanced", "drawElementsInstanced"]) {
    const draw = drawing[name];
    drawing[name] = function (...what) { if (window.testDraws) draw.apply(this, what); };
  }
})()"""
DRAW = """() => new Promise(done => {
  const { canvas, requestRender } = window.__viserMutable;
  window.testDraws = true;
  requestRender();
  // three.js' own callback was there before
  requestAnimationFrame(() => {
    window.testDraws = false;
    done(canvas.getContext("webgl2").getError());
  });
})"""


def new_visitor(
    browser: "Browser", size: tuple[int, int] = (1280, 720), **options: Any
) -> "BrowserContext":
    """Give a visitor whose pages draw when they are asked to; options as of `new_context`."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
    context.add_init_script(WHEN_ASKED)
    return context


def draw(page: "Page") -> None:
    """Draw one frame of a page of `new_visitor`; it stays on the screen until the next."""
    assert page.evaluate(DRAW) == 0, "WebGL reports an error"


def pixels_of_the_map(png: bytes) -> int:
    """Count pixels whose colour is one of the colour map's, within three levels."""
    shown = np.asarray(Image.open(BytesIO(png)).convert("RGB")).reshape(-1, 3).astype(np.int16)
    table = colour_table().astype(np.int16)
    key, counts = np.unique(shown, axis=0, return_counts=True)
    near = np.abs(key[:, None] - table[None]).max(axis=-1).min(axis=-1) <= 3
    return int(counts[near].sum())
