"""Where the panels stand: errors on the left, colour bar and view on the right, heading on top."""

from collections.abc import Callable, Mapping

from viser import GuiApi

from warpspace.app.panels import Desk, Panel
from warpspace.app.panels.chance import ChancePanel
from warpspace.app.panels.commands import CommandsPanel
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.gains import GainsPanel
from warpspace.app.panels.shape import ShapePanel
from warpspace.app.panels.summary import heading_panel, summary_panel
from warpspace.app.panels.view import ViewPanel
from warpspace.app.state import AppState
from warpspace.scene.model import Scene

BRAND = (38, 70, 112)
BRAND_ON_DARK = (122, 162, 214)
LEFT_WIDTH = 330
RIGHT_WIDTH = 310
HEADING_HEIGHT = 130
"""Room kept free for the heading, CSS pixels."""
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
.mantine-Notifications-root[data-position^="top"] { top: auto; bottom: 16px; left: 346px; }
p:has(> label) { color: inherit !important; letter-spacing: 0 !important; }
.mantine-Slider-root:has(.mantine-Slider-markLabel) { margin-bottom: 4px; }
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


def lay_out_panels(
    desk: Desk, state: AppState, scenes: Mapping[str, Scene], fit_view: Callable[[], None]
) -> list[Panel]:
    """Build the page of one tab.

    Parameters
    ----------
    desk : Desk
    state : AppState
    scenes : mapping of str to Scene
    fit_view : callable
        Puts the camera back.

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
    commands = CommandsPanel(desk, fit_view)
    shape_panel = gui.add_panel()
    with shape_panel.add_tab("One error"):
        shape = ShapePanel(desk, state)
    shape_panel.dock_below(gui.main_panel)
    errors = ErrorsPanel(desk, state, shape.choose)

    results = gui.add_panel()
    with results.add_tab("Result"):
        summary = summary_panel(desk)
    results.dock_right()
    results.set_width(RIGHT_WIDTH)

    settings = gui.add_panel()
    with settings.add_tab("View"):
        view = ViewPanel(desk, state, scenes)
        button = gui.add_button("Fit view", color="gray", hint="Camera to the operator's side.")
        button.on_click(lambda _: fit_view())
    with settings.add_tab("Gains"):
        gains = GainsPanel(desk)
    with settings.add_tab("Chance"):
        chance = ChancePanel(desk, state)
    settings.dock_below(results)

    top = gui.add_panel()
    with top.add_tab("warpspace"):
        heading = heading_panel(desk)
    top.float(x=12, y=12, width=520)
    return [errors, shape, view, gains, chance, commands, summary, heading]
