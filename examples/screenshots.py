"""Take the app's pictures for README and docs into ``docs/images``, in a headless Chromium.

    python examples/screenshots.py [NAME …] [--to docs/images]

`make screenshots` runs it; it starts the app itself. Each picture is a visit: a scene, the tab that
is opened, and what is done there. Pictures of a tab show its column beside the box.
"""

import argparse
import io
import os
import shutil
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from warpspace.app.browser.room import column_widths
from warpspace.app.server.viewer import Viewer
from warpspace.cli.services import build_services
from warpspace.scene.library import load_scene

SCENES = ("dvf5000_first", "dvf5000_second", "teach_wobbling_table", "fork_head_bc")
WHOLE, ONE_TAB = (1600, 900), (1280, 900)
"""Width and height of the page, CSS pixels."""
LEFT_WIDTH, RIGHT_WIDTH = column_widths(ONE_TAB[0])
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
SETTLED_MS, PAUSE_MS, PATIENCE_MS = 2500, 400, 30_000
COLOURS = 256


@dataclass(frozen=True)
class Visit:
    """What is in a picture.

    Attributes
    ----------
    act : callable
        What is done once the page stands.
    tab : str
        Tab that the picture is about; empty for the whole page.
    scene : str
    share : float
        Of its column's height that the panel of the tab is given.
    """

    act: Callable[[Page], None]
    tab: str = ""
    scene: str = "dvf5000_first"
    share: float = 0.72


def as_opened(page: Page) -> None:
    """Leave everything as it is."""


def choose(page: Page, label: str, option: str) -> None:
    """Choose an option of a dropdown."""
    page.get_by_label(label, exact=True).first.click()
    page.get_by_role("option", name=option, exact=True).first.click()
    page.wait_for_timeout(PAUSE_MS)


def press(page: Page, name: str) -> None:
    """Press a button."""
    page.get_by_role("button", name=name, exact=True).first.click()
    page.wait_for_timeout(PAUSE_MS)


def tick(page: Page, name: str) -> None:
    """Tick a check box."""
    page.get_by_role("checkbox", name=name, exact=True).check()
    page.wait_for_timeout(PAUSE_MS)


def write(page: Page, label: str, value: str) -> None:
    """Write into the number box of an error."""
    box = page.locator(f"input[data-number='{label}']")
    box.fill(value)
    box.press("Enter")
    page.wait_for_timeout(PAUSE_MS)


def dark(page: Page) -> None:
    """Switch to the dark page."""
    page.keyboard.press("m")


def tested(page: Page) -> None:
    """Run the R-test on the model."""
    choose(page, "Test", "sphere")


def signed(page: Page) -> None:
    """Colour by one signed component."""
    choose(page, "Component", "E_z")


def switched(page: Page) -> None:
    """Include only two errors, one of which is excluded."""
    for word in ("only EAX", "only EAY", "exclude EAY"):
        page.locator(f"button[data-word='{word}']").click()
        page.wait_for_timeout(PAUSE_MS)


def curved(page: Page) -> None:
    """Make the curve of one error a table."""
    choose(page, "Curve", "table")
    page.locator("textarea").first.fill("-225 0\n-75 -31\n75 -24\n225 -43.7")
    page.wait_for_timeout(PAUSE_MS)


def asked(page: Page) -> None:
    """Ask a point why it is off, and one contribution where it comes from."""
    page.mouse.click(LEFT_WIDTH + 250, 430)
    page.locator("[data-contribution='EA0Z']").click()
    press(page, "Show the whole lever")


def repaired(page: Page) -> None:
    """Compare with the best set of two adjustments."""
    page.locator("[data-set='2'] button", has_text="Compare").click()
    page.wait_for_timeout(PAUSE_MS)


def by_effect(page: Page) -> None:
    """Rank by what the errors do."""
    choose(page, "Ranked by", "effect of the present errors")


def compared(page: Page) -> None:
    """Pin, mend one squareness, draw the difference."""
    press(page, "Pin as before")
    write(page, "EA0Z", "0")
    press(page, "B − A")


def sliced(page: Page) -> None:
    """Look at slices with isolines."""
    choose(page, "Show as", "slices")
    tick(page, "Isolines")


def bent(page: Page) -> None:
    """Draw the machine as its errors bend it."""
    tick(page, "Machine bodies")
    tick(page, "Bodies deformed by the errors")
    page.keyboard.press("f")


def allocated(page: Page) -> None:
    """Allocate tolerances for 40 µm."""
    page.wait_for_selector("[data-value='histogram']")
    box = page.get_by_label("|E| allowed [µm]", exact=True).last
    box.fill("40")
    box.press("Enter")
    page.wait_for_timeout(PAUSE_MS)
    press(page, "Allocate")
    page.wait_for_selector("[data-value='allocated']")


def side_by_side(page: Page) -> None:
    """Compare three machines of the library."""
    press(page, "Choose machines …")
    for title in ("Trunnion A-C machining centre", "Rotary table C with a swivel head B"):
        page.locator(".ws-choice button", has_text=title).first.click()
        page.wait_for_timeout(PAUSE_MS)
    press(page, "Done")
    press(page, "Compare")
    page.wait_for_selector(".ws-concepts img", timeout=180_000)


def calibrated(page: Page) -> None:
    """Fit the bundled readings of a fork head, and draw the machine that they give."""
    choose(page, "Bundled readings", "tcp_on.csv")
    press(page, "Fit")
    outcome = page.locator("[data-value='calibration']")
    outcome.wait_for(timeout=60_000)
    outcome.locator("[data-word='compare']").click()
    page.wait_for_timeout(PAUSE_MS)
    choose(page, "Residual arrows in the box", "before")
    outcome.evaluate("part => part.scrollIntoView({ block: 'start' })")


def compensated(page: Page) -> None:
    """Compute a table for a control, and draw what it leaves."""
    choose(page, "Table", "HEIDENHAIN .COM and .CMA, nonlinear axis error compensation")
    points = page.get_by_label("Points per axis", exact=True).first
    points.fill("11")
    points.press("Enter")
    page.wait_for_timeout(PAUSE_MS)
    press(page, "Compute")
    maps = page.locator("[data-value='compensation maps']")
    maps.wait_for(timeout=60_000)
    choose(page, "The box shows", "what is left")
    page.wait_for_timeout(SETTLED_MS)
    maps.evaluate("part => part.scrollIntoView({ block: 'end' })")


VISITS = {
    "app": Visit(as_opened),
    "app_dark": Visit(dark),
    "app_rotary": Visit(signed, scene="teach_wobbling_table"),
    "tab_errors": Visit(switched, "Errors"),
    "tab_error_curve": Visit(curved, "Error curve", share=0.45),
    "tab_volumetric_error": Visit(as_opened, "Volumetric error", share=0.52),
    "tab_error_budget": Visit(asked, "Error budget"),
    "tab_repair": Visit(repaired, "Repair"),
    "tab_sensitivities": Visit(by_effect, "Sensitivities"),
    "tab_tests": Visit(tested, "Tests", share=0.62),
    "tab_compare": Visit(compared, "Compare"),
    "tab_concepts": Visit(side_by_side, "Concepts", share=0.9),
    "tab_calibrate": Visit(calibrated, "Calibrate", "fork_head_bc", share=0.93),
    "tab_files": Visit(as_opened, "Files", share=0.4),
    "tab_view": Visit(sliced, "View"),
    "tab_machine": Visit(bent, "Machine", share=0.6),
    "tab_machine_editor": Visit(as_opened, "Machine editor"),
    "tab_rotary_axes": Visit(as_opened, "Rotary axes", "teach_wobbling_table"),
    "tab_tolerances": Visit(allocated, "Tolerances"),
    "tab_compensate": Visit(compensated, "Compensate", share=0.9),
    "tab_conventions": Visit(as_opened, "Conventions"),
}
"""File name to visit."""
LEFT_TABS, LOWER_TABS = (
    ("Errors", "Error curve"),
    (
        "Error curve",
        "View",
        "Concepts",
        "Machine",
        "Machine editor",
        "Rotary axes",
        "Tolerances",
        "Compensate",
        "Conventions",
    ),
)


def open_tab(page: Page, visit: Visit) -> None:
    """Open the tab of a visit and give it room."""
    if visit.tab != "Errors":
        page.get_by_role("tab", name=visit.tab, exact=True).first.click()
    side = "left" if visit.tab in LEFT_TABS else "right"
    divider = page.locator(f"[data-dock-region={side}] [data-dock-divider=column]").bounding_box()
    assert divider is not None, side
    x, y = divider["x"] + 4, divider["y"] + divider["height"] / 2
    share = 1 - visit.share if visit.tab in LOWER_TABS else visit.share
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, share * ONE_TAB[1], steps=5)
    page.mouse.up()
    page.wait_for_timeout(PAUSE_MS)


def take(browser: Browser, viewer: Viewer, visit: Visit) -> Image.Image:
    """Take one picture."""
    width, height = ONE_TAB if visit.tab else WHOLE
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{viewer.url}/?fixedDpr=1")
    page.wait_for_function(LOADED, timeout=60_000)
    page.wait_for_selector("html[data-warpspace=open]", timeout=60_000)
    page.wait_for_timeout(SETTLED_MS)
    # the client's remark on software rendering
    for button in page.locator(".mantine-Notification-closeButton").all():
        button.click()
    if visit.tab:
        open_tab(page, visit)
    visit.act(page)
    page.evaluate("document.activeElement?.blur()")
    page.mouse.move(width / 2, height - 5)
    page.wait_for_timeout(SETTLED_MS)
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    page.context.close()
    if not visit.tab:
        return shot
    if visit.tab in LEFT_TABS:
        return shot.crop((0, 0, width - RIGHT_WIDTH, height))
    return shot.crop((LEFT_WIDTH, 0, width, height))


def with_few_colours(shot: Image.Image) -> Image.Image:
    """Make a picture small; its colours stay smooth."""
    # the median cut would merge the colours of the scale, of which there are few pixels
    palette = shot.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=1)
    return shot.quantize(COLOURS, palette=palette, dither=Image.Dither.FLOYDSTEINBERG)


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
    scenes = {name: load_scene(name) for name in SCENES}
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
            few = with_few_colours(shot)
            few.save(target, optimize=True)
            print(target)
        browser.close()


if __name__ == "__main__":
    main()
