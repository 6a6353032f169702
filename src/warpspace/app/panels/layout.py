"""Where the panels stand: errors on the left, colour bar and view on the right, heading on top."""

from viser import GuiApi

from warpspace.app.outside import Outside
from warpspace.app.panels import Desk, Panel
from warpspace.app.panels.chance import ChancePanel
from warpspace.app.panels.clicks import SCRIPT
from warpspace.app.panels.commands import CommandsPanel
from warpspace.app.panels.compare import ComparePanel
from warpspace.app.panels.conventions import ConventionsPanel
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.files import FilesPanel
from warpspace.app.panels.gains import GainsPanel
from warpspace.app.panels.looks import CameraPanel, Choose, LooksPanel
from warpspace.app.panels.machine import MachinePanel
from warpspace.app.panels.rotary import Play, RotaryPanel
from warpspace.app.panels.shape import ShapePanel
from warpspace.app.panels.summary import heading_panel, summary_panel
from warpspace.app.panels.view import ViewPanel
from warpspace.app.panels.why import WhyPanel
from warpspace.app.pointing import Pointing
from warpspace.app.state import AppState

BRAND = (38, 70, 112)
BRAND_ON_DARK = (122, 162, 214)
LEFT_WIDTH = 350
RIGHT_WIDTH = 320
ERRORS_SHARE = 0.68
"""Share of the left column's height that the sliders have, the curve of one error below them."""
STYLE = """<style>
/* labels above their controls, on a line of their own; check boxes stay beside theirs */
div:has(> div > p > label):not(:has(> div input[type="checkbox"])) { flex-wrap: wrap; }
div:has(> p > label) { width: 100% !important; padding-bottom: 2px; }
div:has(> p > label) + div { width: 100%; }
div:has(> div > p > label):has(> div input[type="checkbox"]) { flex-direction: row-reverse;
  justify-content: flex-end; }
div:has(> p > label):has(+ div input[type="checkbox"]) { width: auto !important; padding: 0; }
div:has(> p > label) + div:has(input[type="checkbox"]) { width: auto; flex-grow: 0 !important;
  padding-right: 8px; }
/* messages stand below the heading, not on it */
.mantine-Notifications-root[data-position^="top"] {
  top: auto !important; bottom: 1em !important; }
p:has(> label) { color: inherit !important; letter-spacing: 0 !important; }
.mantine-Slider-root:has(.mantine-Slider-markLabel) { margin-bottom: 4px; }
/* what is not the main thing to do is outlined */
.mantine-Button-root[style*="color-gray-filled"] { background: none;
  color: var(--mantine-color-text); border: 1px solid var(--mantine-color-default-border); }
/* all tabs of a panel on one line */
[data-dock-tab] { padding: 0 .52em !important; }
.mantine-ScrollArea-scrollbar[data-orientation="horizontal"] { display: none; }
</style>"""


def side_widths() -> tuple[int, int]:
    """Give the widths of the docked panels, CSS pixels."""
    return LEFT_WIDTH, RIGHT_WIDTH


def apply_theme(gui: GuiApi, *, dark: bool) -> None:
    """Set the colours of the page."""
    gui.configure_theme(
        dark_mode=dark,
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND_ON_DARK if dark else BRAND,
    )


def split_script(share: float = ERRORS_SHARE) -> str:
    """Write the script that divides the left column between sliders and curve.

    The server can only halve a column. The script moves the divider as a hand would, so that it
    stays a divider which can be moved; one that has been moved already is left alone.

    Parameters
    ----------
    share : float, optional
        Of the height that is to go to the upper panel.

    Returns
    -------
    str
        JavaScript that waits for a column in halves and gives up after ten seconds.
    """
    return f"""(() => {{
  const divide = tries => {{
    const divider = document.querySelector(
      "[data-dock-region=left] [data-dock-divider=column]");
    if (divider?.previousElementSibling?.style.flexGrow !== "0.5")
      return tries && setTimeout(divide, 50, tries - 1);
    const column = divider.parentElement.getBoundingClientRect();
    const send = (target, type, clientY) => target.dispatchEvent(new PointerEvent(type, {{
      bubbles: true, button: 0, pointerId: 7007, clientX: column.left + 1, clientY }}));
    const from = divider.getBoundingClientRect().top;
    send(divider, "pointerdown", from);
    send(window, "pointermove", from + ({share} - 0.5) * column.height);
    send(window, "pointerup", from + ({share} - 0.5) * column.height);
  }};
  divide(200);
}})();"""


def lay_out_panels(
    desk: Desk, state: AppState, outside: Outside, fit_view: Choose, play: Play
) -> list[Panel]:
    """Build the page of one tab.

    Parameters
    ----------
    desk : Desk
    state : AppState
    outside : Outside
        Camera, page and files of the tab.
    fit_view : callable
        Puts the camera to a named view, or changes its lens.
    play : callable
        Turns the table.

    Returns
    -------
    list of Panel
        In the order they are read.
    """
    gui = desk.gui
    apply_theme(gui, dark=state.shown.dark)
    gui.set_panel_label("Errors")
    gui.main_panel.dock_left()
    gui.main_panel.set_width(LEFT_WIDTH)
    gui.add_html(STYLE)
    outside.run_script(SCRIPT)
    commands = CommandsPanel(desk, lambda: fit_view(None, None))
    shape_panel = gui.add_panel()
    with shape_panel.add_tab("One error"):
        shape = ShapePanel(desk, state)
    shape_panel.dock_below(gui.main_panel)
    outside.run_script(split_script())

    def open_curve(key: str) -> None:
        shape.choose(key)
        shape_panel.expand()

    errors = ErrorsPanel(desk, state, shape.choose, open_curve)

    results = gui.add_panel()
    with results.add_tab("Result"):
        summary = summary_panel(desk)
    with results.add_tab("Why"):
        why = WhyPanel(desk, outside)
    with results.add_tab("Gains"):
        gains = GainsPanel(desk)
    with results.add_tab("Compare"):
        compare = ComparePanel(desk, outside.scenes)
    with results.add_tab("Files"):
        files = FilesPanel(desk, outside)
    results.dock_right()
    results.set_width(RIGHT_WIDTH)

    settings = gui.add_panel()
    with settings.add_tab("View"):
        view = ViewPanel(desk, state, outside.scenes)
        looks = LooksPanel(desk, state)
        camera = CameraPanel(desk, fit_view)
    with settings.add_tab("Machine"):
        machine = MachinePanel(desk, state)
    with settings.add_tab("Table"):
        rotary = RotaryPanel(desk, state, play)
    with settings.add_tab("Chance"):
        chance = ChancePanel(desk, state)
    with settings.add_tab("Conventions"):
        conventions = ConventionsPanel(desk, state)
    Pointing(outside, desk, conventions)
    settings.dock_below(results)

    top = gui.add_panel()
    with top.add_tab("warpspace"):
        heading = heading_panel(desk)
    top.float(x=12, y=12, width=520)
    return [
        errors,
        shape,
        view,
        looks,
        camera,
        machine,
        rotary,
        gains,
        chance,
        commands,
        why,
        compare,
        files,
        conventions,
        summary,
        heading,
    ]
