"""Take the app's pictures for README and docs into ``docs/images``, in a headless Chromium.

    python examples/screenshots.py [NAME …] [--to docs/images]

`make screenshots` runs it; it starts the app itself. Each picture is a visit: a scene, the size of
the page, and what is done there. Every visit has a tab of its own.
"""

import argparse
import io
import os
import shutil
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from warpspace.app.server.viewer import Viewer
from warpspace.cli.services import build_services
from warpspace.machine.errors import Covariance
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene

SCENES = (
    *("dvf5000_first", "dvf5000_second", "teach_wobbling_table", "fork_head_bc"),
    *("review_dvf5000", "part_on_dvf5000", "ur10"),
)
UNCERTAIN = {
    "EAX": 1.0, "EAY": 3.0, "ECY": 2.0, "EAZ": 3.0, "EC0Y": 4.0, "EA0Z": 5.0, "EB0Z": 5.0,
}  # fmt: skip
"""Standard uncertainties, µrad, of the machine that is drawn with its uncertainty."""
SIZE = (1440, 900)
"""Width and height of the page, CSS pixels."""
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
FILE = "laser_x.csv"
READINGS = """\
run,direction,X [mm],EXX [um],ECX [urad]
1,+,-275,0.0,-4.1
1,+,-125,1.9,-1.2
1,+,0,3.4,0.4
1,+,125,4.0,2.9
1,+,275,5.8,6.3
"""
"""A file that is imported."""
SETTLED_MS, PAUSE_MS, PATIENCE_MS = 3000, 400, 60_000
ZOOM_STEPS = 10  # of the wheel, until the adjusters are in view
COLOURS, WIDE = 256, 2000  # of a picture; pixels from which on steps of colours are not seen


@dataclass(frozen=True)
class Visit:
    """Content of a picture.

    Attributes
    ----------
    act : callable
        What is done once the page stands.
    scene : str
    size : tuple of int
    part : str
        Selector of the part of the page that is kept; empty for all of it.
    """

    act: Callable[[Page], None]
    scene: str = "dvf5000_first"
    size: tuple[int, int] = SIZE
    part: str = ""


def uncertain() -> Scene:
    """Build a measured machine with uncertainties and the measured range."""
    variances = np.diag(np.square(list(UNCERTAIN.values())))
    rows = tuple(map(tuple, variances.tolist()))
    covariance = Covariance(tuple(UNCERTAIN), rows, measured_range={"Z": (-400.0, -80.0)})
    title = "First machine, with its uncertainty"
    return replace(load_scene("dvf5000_first"), title=title, covariance=covariance)


def unsure(page: Page) -> None:
    """Colour only what is significant, with ellipsoids at the corners."""
    page.locator("[data-key=menu-surface] > summary").click()
    for label in ("Significant only", "Uncertainty at the corners"):
        page.locator("label.ws-switch", has_text=label).click()
        page.wait_for_timeout(PAUSE_MS)
    page.keyboard.press("Escape")


def as_opened(page: Page) -> None:
    """Leave everything as it is."""


def press(page: Page, name: str) -> None:
    """Press a button."""
    page.get_by_role("button", name=name, exact=True).first.click()
    page.wait_for_timeout(PAUSE_MS)


def open_task(page: Page, name: str) -> None:
    """Open a task."""
    page.get_by_role("tab", name=name, exact=True).click()
    page.wait_for_timeout(PAUSE_MS)


def unfold(page: Page, title: str) -> None:
    """Unfold a section of the task that is open."""
    page.locator(
        "#ws-right summary, #ws-right [data-do*=fold_section]", has_text=title
    ).first.click()
    page.wait_for_timeout(PAUSE_MS)


def solid(page: Page) -> None:
    """Draw the machine as a solid."""
    page.locator("[data-key='menu-machine'] summary").click()
    page.get_by_role("button", name="solid", exact=True).click()
    page.keyboard.press("Escape")


def dark(page: Page) -> None:
    """Switch to the dark page."""
    page.keyboard.press("m")


def opened_row(page: Page) -> None:
    """Open the row of one error."""
    page.locator("#ws-error-EAY").click()


def compared(page: Page) -> None:
    """Apply the best single adjustment, and draw what it changes."""
    page.locator("#ws-right").get_by_role("button", name="Apply").first.click()
    page.locator("[data-piece=compared] button", has_text="B − A").click()


def ask_question(page: Page) -> None:
    """Show the lever of the largest contribution of the worst point."""
    unfold(page, "Details")
    page.locator("[data-do*=show_lever_of][data-do*=EA0Z]").click()


def tested(page: Page) -> None:
    """Run the R-test on the model."""
    open_task(page, "Measure")
    unfold(page, "Standard tests")
    page.get_by_label("Standard test", exact=True).select_option("r-test")


def improved(page: Page) -> None:
    """Choose a control; the repairs stand below."""
    open_task(page, "Improve")
    page.get_by_label("Controller", exact=True).select_option("sinumerik-cec")
    page.get_by_role("button", name="Save table").wait_for()


def adjusted(page: Page) -> None:
    """Preview the best single act, with its arrows at the adjusters of the machine."""
    open_task(page, "Improve")
    press(page, "Preview")
    box = page.locator("#root canvas").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for _ in range(ZOOM_STEPS):
        page.mouse.wheel(0, 100)
        page.wait_for_timeout(PAUSE_MS)


def designed(page: Page) -> None:
    """Hold the tolerances against 40 µm."""
    open_task(page, "Design")
    box = page.locator("#ws-right").get_by_label("|E| allowed")
    box.fill("40")
    box.press("Enter")
    press(page, "Allocate tolerances")
    page.locator("#ws-right progress").wait_for(state="detached")


def turned(page: Page) -> None:
    """Look at the error motion of a rotary table."""
    open_task(page, "Machine")
    unfold(page, "Rotary axes")
    page.locator(".ws-plots").wait_for()


def rotated(page: Page) -> None:
    """Look at the rotary axes, with the table turned by the playback bar."""
    page.locator(".ws-drawings label", has_text="Rotary axes").click()
    page.get_by_label("Position of C", exact=True).fill("60")
    page.locator(".ws-plots").wait_for()


def imported(page: Page) -> None:
    """Open a table of measured errors."""
    with page.expect_file_chooser() as chooser:
        page.locator("#ws-top [data-upload=files]").click()
    chooser.value.set_files({"name": FILE, "mimeType": "text/csv", "buffer": READINGS.encode()})
    page.locator("[data-key=import]").get_by_role("button", name="Apply").wait_for()


def reported(page: Page) -> None:
    """Open the window of the report, with a result put into it."""
    press(page, "Report")


def noted(page: Page) -> None:
    """Open the list of review notes."""
    page.locator("[data-do=open_notes]").first.click()


def open_story(page: Page) -> None:
    """Play the story up to its second step, which shows the lever arm of an error."""
    noted(page)
    press(page, "Play the story")
    page.locator("[data-do=next_step]").click()


def measured(page: Page) -> None:
    """Measure between two points of the map."""
    unfold(page, "More analyses")
    unfold(page, "Distance and angle")
    press(page, "Pick points")
    box = page.locator("#root canvas").first.bounding_box()
    for part in (0.42, 0.58):
        page.mouse.click(box["x"] + part * box["width"], box["y"] + 0.5 * box["height"])
        page.wait_for_timeout(SETTLED_MS)
    press(page, "Stop")


def clamped(page: Page) -> None:
    """Colour the part along its normals, with the arrows that move it."""
    open_task(page, "Measure")
    unfold(page, "Import")
    unfold(page, "Part")
    page.get_by_label("Coloured along its normal", exact=True).check()
    page.get_by_label("Move in the drawing", exact=True).check()


def programmed(page: Page) -> None:
    """Show the worst line of the program, without the part."""
    open_task(page, "Measure")
    unfold(page, "Import")
    unfold(page, "Part")
    page.get_by_label("Part in the box", exact=True).uncheck()
    unfold(page, "Part")
    unfold(page, "Program")
    page.locator("[data-key=program]").get_by_role("button", name="28", exact=True).first.click()


def played(page: Page) -> None:
    """Move the machine to the worst block of the program."""
    programmed(page)
    page.get_by_role("button", name="Worst", exact=True).click()
    page.locator(".ws-line", has_text="because").wait_for()


VISITS = {
    "app": Visit(as_opened),
    "app_dark": Visit(dark),
    "app_1024": Visit(as_opened, size=(1024, 768)),
    "app_phone": Visit(as_opened, size=(390, 844)),
    "app_wide": Visit(as_opened, size=(2560, 1440)),
    "app_compare": Visit(compared),
    "task_understand": Visit(ask_question, size=(1280, 800)),
    "task_measure": Visit(tested),
    "task_improve": Visit(improved, size=(1280, 800)),
    "task_adjust": Visit(adjusted, size=(1280, 800)),
    "task_design": Visit(designed),
    "task_machine": Visit(turned, "teach_wobbling_table"),
    "rotary_axes": Visit(rotated, "teach_wobbling_table"),
    "robot": Visit(solid, "ur10"),
    "task_import": Visit(imported),
    "window_report": Visit(reported),
    "review_notes": Visit(noted, "review_dvf5000"),
    "review_story": Visit(open_story, "review_dvf5000"),
    "review_distance": Visit(measured),
    "part_box": Visit(clamped, "part_on_dvf5000"),
    "program_playback": Visit(played, "part_on_dvf5000"),
    "uncertainty": Visit(unsure, "uncertain"),
    "errors_row": Visit(opened_row, part="#ws-left"),
}
"""File name to visit."""


def take(browser: Browser, viewer: Viewer, visit: Visit) -> Image.Image:
    """Take one picture."""
    width, height = visit.size
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{viewer.url}/?fixedDpr=1")
    page.wait_for_selector("html[data-warpspace=open]")
    page.wait_for_timeout(SETTLED_MS)
    visit.act(page)
    page.evaluate("document.activeElement?.blur()")
    page.mouse.move(width / 2, height - 5)
    page.wait_for_timeout(SETTLED_MS)
    target = page.locator(visit.part) if visit.part else page
    shot = Image.open(io.BytesIO(target.screenshot())).convert("RGB")
    page.context.close()
    return shot


def with_few_colours(shot: Image.Image) -> Image.Image:
    """Make a picture small; its colours stay smooth."""
    # the median cut would merge the colours of the scale, of which there are few pixels
    palette = shot.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=1)
    dither = Image.Dither.FLOYDSTEINBERG if shot.width < WIDE else Image.Dither.NONE
    return shot.quantize(COLOURS, palette=palette, dither=dither)


def main() -> None:
    """Take the pictures asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(VISITS))
    parser.add_argument("--to", type=Path, default=TO)
    options = parser.parse_args()
    if unknown := [name for name in options.names if name not in VISITS]:
        parser.error(f"unknown picture {', '.join(unknown)}; expected {', '.join(VISITS)}")
    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        sys.exit("no Chromium found (Debian package chromium)")
    options.to.mkdir(parents=True, exist_ok=True)
    scenes = {name: load_scene(name) for name in SCENES} | {"uncertain": uncertain()}
    shelf = {scene.title: scene for scene in scenes.values()}
    with ExitStack() as open_apps, sync_playwright() as playwright:
        viewers: dict[str, Viewer] = {}
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM)
        for name in options.names or VISITS:
            visit = VISITS[name]
            if visit.scene not in viewers:
                viewer = Viewer(scenes[visit.scene], shelf, services=build_services())
                viewers[visit.scene] = open_apps.enter_context(viewer)
            target = options.to / f"{name}.png"
            shot = take(browser, viewers[visit.scene], visit)
            reduced = with_few_colours(shot)
            reduced.save(target, optimize=True)
            print(target)
        browser.close()


if __name__ == "__main__":
    main()
