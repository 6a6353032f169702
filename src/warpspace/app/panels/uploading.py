"""A button that takes files up to a size: larger ones are refused before they are sent."""

from collections.abc import Callable
from functools import partial
from typing import Any

from warpspace.app.browser.uploads import read_refusal, size_message, size_script
from warpspace.app.panels.context import PanelContext


def add_upload(
    context: PanelContext,
    label: str,
    received: Callable[[str, bytes], None],
    refused: Callable[[str], None],
    spell: Callable[[str], str],
    *,
    endings: str,
    hint: str,
    most_bytes: int,
    what: str = "scene file",
) -> Any:
    """Add a button for uploads.

    Parameters
    ----------
    context : PanelContext
    label : str
    received : callable
        Gets name and content of a file, on the session.
    refused : callable
        Gets the message about one that does not come, on the session.
    spell : callable
        Makes a name that can be shown of what a page calls a file.
    endings : str
        Of files that are offered, with commas between.
    hint : str
    most_bytes : int
        Size of the largest file.
    what : str, optional
        What the button takes, for messages.

    Returns
    -------
    viser.GuiUploadButtonHandle
    """
    gui = context.gui
    button = gui.add_upload_button(label, mime_type=endings, hint=hint)
    context.uploads.watch(
        button,
        most_bytes,
        lambda name, content: context.act(partial(received, name, content)),
        lambda text: context.act(partial(refused, text)),
        what,
    )
    carrier = gui.add_text("", "", visible=False)

    def refuse() -> None:
        name, size = read_refusal(str(carrier.value))
        refused(size_message(spell(name), size, most_bytes, what))

    carrier.on_update(lambda _: context.act(refuse))
    context.page.run_script(size_script(button, carrier, most_bytes))
    return button
