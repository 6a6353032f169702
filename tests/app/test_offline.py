"""The offline page: opened in Chromium without a network, it draws and asks for nothing."""

import html
import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.documents.offline_page import build_offline_html, offline_picture

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

EVIL = "</script><script>window.hacked=1</script><img src=x onerror='window.hacked=2'>&\"'"


def page_of(scene, **changes) -> str:
    choices = {"exaggeration": 1000.0, "nodes": 21, **changes}
    return build_offline_html(offline_picture(scene, **choices), {"title": scene.title, "n": 1})


def test_the_page_is_small_and_says_what_it_shows() -> None:
    text = page_of(load_scene("dvf5000_first"))
    assert len(text.encode()) <= 3_000_000
    for words in ("DVF5000, first machine measured", "×1000", "30.89 µm", "pitch of Y"):
        assert words in text


def test_largest_grid_still_fits_a_mail() -> None:
    assert len(page_of(load_scene("dvf5000_first"), nodes=31).encode()) <= 3_000_000


def test_nothing_in_the_outer_page_points_anywhere() -> None:
    text = page_of(load_scene("dvf5000_first"))
    outer = re.sub(r'srcdoc="[^"]*"', "", text)
    assert not re.search(r"https?://|//\w+\.|\bsrc=|\bhref=", outer)
    assert "default-src 'none'" in html.unescape(outer)


def test_stored_provenance_can_be_read_back() -> None:
    scene = replace(load_scene("dvf5000_first"), title=EVIL)
    text = page_of(scene, nodes=3)
    stored = re.search(r'id="warpspace">(.*?)</script>', text, re.DOTALL)
    assert stored is not None
    assert json.loads(stored.group(1)) == {"title": EVIL, "n": 1}


@pytest.mark.browser
@pytest.mark.parametrize("title", ["plain", EVIL])
def test_opens_without_network_and_draws(browser: "Browser", tmp_path: "Path", title: str) -> None:
    scene = replace(load_scene("dvf5000_first"), title=title)
    path = tmp_path / "scene.html"
    path.write_text(page_of(scene), encoding="utf-8")
    context = browser.new_context(viewport={"width": 1200, "height": 800}, offline=True)
    page = context.new_page()
    requests: list[str] = []
    problems: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda entry: problems.append(entry.text) if entry.type == "error" else None)
    page.goto(path.as_uri())
    assert page.locator("b[data-value=factor]").inner_text() == "displacement drawn ×1000"
    canvas = page.frame_locator("iframe").locator("canvas").first
    canvas.wait_for(state="visible", timeout=30_000)
    colours = 0
    for _ in range(40):
        page.wait_for_timeout(500)
        colours = viridis_pixels(canvas.screenshot())
        if colours > 20_000:
            break
    assert colours > 20_000, "the map is not drawn"
    assert page.title() == f"{title} · warpspace"
    assert page.evaluate("window.hacked") is None
    assert problems == []
    tab = [url for url in requests if not url.startswith(("blob:", "data:", "about:"))]
    assert tab == [path.as_uri()]
    context.close()


def viridis_pixels(png: bytes) -> int:
    """Count pixels whose colour is one of the colour map's, within three levels."""
    from io import BytesIO

    from PIL import Image

    from warpspace.geometry.colour import colour_table

    shown = np.asarray(Image.open(BytesIO(png)).convert("RGB")).reshape(-1, 3).astype(np.int16)
    table = colour_table().astype(np.int16)
    key, counts = np.unique(shown, axis=0, return_counts=True)
    near = np.abs(key[:, None] - table[None]).max(axis=-1).min(axis=-1) <= 3
    return int(counts[near].sum())
