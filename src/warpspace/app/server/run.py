"""Serves the app until it is interrupted, and tells the user how to reach it."""

import time
import warnings
import webbrowser
from collections.abc import Callable, Mapping

from warpspace.app.documents.services import Services
from warpspace.app.server.doors import Access
from warpspace.app.server.network import draw_code, has_other_users, limit_log
from warpspace.app.server.viewer import Viewer
from warpspace.app.state.app_state import AppState
from warpspace.scene.model import Scene

Say = Callable[[str], None]
NO_AUTHENTICATION = (
    "WARNING: {host} can be reached from other machines, and with --no-token the app asks nobody"
    " for a token or a password: whoever reaches it sees its scenes, and can use it"
)

OTHER_USERS = (
    "Others who use this machine can open it too, without a token; --token TEXT asks for one"
)


def open_browser(url: str) -> bool:
    """Open a page in a graphical browser."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if type(browser) is webbrowser.GenericBrowser:  # one that takes over the terminal
        return False
    return browser.open(url)


def run_viewer(
    scene: Scene,
    scenes: Mapping[str, Scene],
    *,
    start: AppState | None = None,
    host: str,
    port: int | None,
    shared: bool = False,
    services: Services | None = None,
    access: Access | None = None,
    code: bool = False,
    browser: bool,
    say: Say,
    warn: Say,
) -> None:
    """Serve the app until it is interrupted."""
    # a tab may close while something is on its way to it
    warnings.filterwarnings("ignore", message="Queued an? .* on a closed connection")
    limit_log()
    with Viewer(
        scene,
        scenes,
        start=start,
        host=host,
        port=port,
        shared=shared,
        services=services,
        access=access,
    ) as viewer:
        try:
            say(f"{scene.title} is shown at {viewer.link} (Ctrl-C ends it)")
            if not viewer.is_local:
                say(f"from other machines: {viewer.network_link}")
                if code:
                    say(draw_code(viewer.network_link))
                if viewer.token is None:
                    warn(NO_AUTHENTICATION.format(host=host))
            elif viewer.token is None and has_other_users():
                warn(OTHER_USERS)
            if browser and not open_browser(viewer.link):
                say(f"no browser could be opened; open {viewer.link} yourself")
            while True:  # a signal that the system gives to another thread is seen within a second
                time.sleep(1.0)
        except KeyboardInterrupt:
            say("\nended")
