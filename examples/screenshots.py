"""Take the app's pictures for the README into ``docs/images``, in a headless Chromium.

    python examples/screenshots.py [NAME …] [--to docs/images]

`make screenshots` runs it. Each picture is a visit: a scene, what is clicked, and a file name.
"""

import argparse
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from playwright.sync_api import Page, sync_playwright

from warpspace.app.viewer import Viewer
from warpspace.scene.library import load_scene

SIZE = {"width": 1600, "height": 900}
CHROMIUM = [
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
TO = Path(__file__).resolve().parents[1] / "docs" / "images"
LOADED = "() => window.__viserMutable?.nodeRefFromName['/box/surface']"
SETTLED_MS = 3000


def choose(page: Page, label: str, option: str) -> None:
    """Choose an option of a dropdown."""
    page.get_by_label(label, exact=True).first.click()
    page.get_by_role("option", name=option, exact=True).first.click()
    page.wait_for_timeout(500)


def as_opened(page: Page) -> None:
    """Leave everything as it is."""


def dark(page: Page) -> None:
    """Switch to the dark page."""
    page.get_by_role("checkbox", name="Dark mode").check()


def signed(page: Page) -> None:
    """Colour by one signed component."""
    choose(page, "Colour", "E_z")


VISITS: dict[str, tuple[str, Callable[[Page], None]]] = {
    "app": ("dvf5000_first", as_opened),
    "app_dark": ("dvf5000_first", dark),
    "app_rotary": ("teach_wobbling_table", signed),
}
"""File name to scene and what is done before the picture is taken."""


def take(name: str, folder: Path) -> Path:
    """Take one picture.

    Parameters
    ----------
    name : str
        Key of `VISITS`.
    folder : Path

    Returns
    -------
    Path
        The file written.
    """
    scene_name, act = VISITS[name]
    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        sys.exit("no Chromium found (Debian package chromium)")
    with Viewer(load_scene(scene_name)) as viewer, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM)
        page = browser.new_page(viewport=SIZE)
        page.goto(f"{viewer.url}/?fixedDpr=1")
        page.wait_for_function(LOADED, timeout=60_000)
        page.wait_for_selector("[data-value='max']", timeout=60_000)
        page.wait_for_timeout(SETTLED_MS)
        # the client's remark on software rendering, and any first-use hint
        for button in page.locator(".mantine-Notification-closeButton").all():
            button.click()
        act(page)
        page.mouse.move(SIZE["width"] / 2, SIZE["height"] - 5)
        page.wait_for_timeout(SETTLED_MS)
        target = folder / f"{name}.png"
        page.screenshot(path=target)
        browser.close()
    return target


def main() -> None:
    """Take the pictures asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(VISITS))
    parser.add_argument("--to", type=Path, default=TO)
    options = parser.parse_args()
    if unknown := [name for name in options.names if name not in VISITS]:
        parser.error(f"unknown picture {', '.join(unknown)}; expected {', '.join(VISITS)}")
    options.to.mkdir(parents=True, exist_ok=True)
    for name in options.names or VISITS:
        print(take(name, options.to))


if __name__ == "__main__":
    main()
