"""Scripts for the page's address: they hand over the link it was opened with, and show another."""

import json

STORAGE_KEY = "warpspace-link"
PARAMETER = "view"


def listen_script(widget: str) -> str:
    """Write the script that hands over the link a page was opened with.

    A link is taken once per tab: a reload keeps what the tab shows.

    Parameters
    ----------
    widget : str
        Identifier of the (invisible) text widget that takes it.

    Returns
    -------
    str
        JavaScript.
    """
    return f"""(() => {{
  const key = {json.dumps(STORAGE_KEY)};
  const link = new URLSearchParams(location.search).get({json.dumps(PARAMETER)});
  if (!link) return;
  let taken = window.__warpspaceLink;
  try {{ taken = sessionStorage.getItem(key) || taken; }} catch {{}}
  if (taken === link) return;
  window.__warpspaceLink = link;
  try {{ sessionStorage.setItem(key, link); }} catch {{}}
  __viserMutable.sendMessage({{ type: "GuiUpdateMessage", uuid: {json.dumps(widget)},
    updates: {{ value: performance.now() + ":" + link }} }});
}})();"""


def show_script(word: str) -> str:
    """Write the script that puts a link into the address bar and, where allowed, the clipboard.

    Parameters
    ----------
    word : str
        The link, packed.
    """
    return f"""(() => {{
  const link = {json.dumps(word)}, parameters = new URLSearchParams(location.search);
  window.__warpspaceLink = link;
  try {{ sessionStorage.setItem({json.dumps(STORAGE_KEY)}, link); }} catch {{}}
  parameters.set({json.dumps(PARAMETER)}, link);
  history.replaceState(null, "", location.pathname + "?" + parameters);
  if (navigator.clipboard) navigator.clipboard.writeText(location.href).catch(() => {{}});
}})();"""
