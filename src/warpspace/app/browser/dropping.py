"""Files that are dropped anywhere on the page go the way of those chosen with the upload button."""

from typing import Any

from warpspace.app.browser.viser_private import dom_id


def drop_script(button: Any) -> str:
    """Write the script that gives dropped files, one after the other, to an upload button.

    Parameters
    ----------
    button : viser upload button
        The checks of its uploads hold for these files, too.

    Returns
    -------
    str
        JavaScript.
    """
    return f"""(() => {{
  const hasFiles = event => [...(event.dataTransfer?.types ?? [])].includes("Files");
  addEventListener("dragover", event => {{
    if (hasFiles(event)) event.preventDefault();
  }});
  addEventListener("drop", event => {{
    if (!hasFiles(event)) return;
    event.preventDefault();
    const input = document.getElementById("file_upload_{dom_id(button)}");
    if (!input) return;
    [...event.dataTransfer.files].slice(0, 16).forEach((file, index) => setTimeout(() => {{
      const one = new DataTransfer();
      one.items.add(file);
      input.files = one.files;
      input.dispatchEvent(new Event("change", {{ bubbles: true }}));
    }}, 150 * index));
  }});
}})();"""
