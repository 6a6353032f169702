"""Links: a parameter of the page's address, handed over by the page.

It is one word of letters and digits, since viser's client writes the address anew when it starts
(which drops what stands behind a #, and would unpack an encoded value).
"""

import base64
import binascii
import json

from warpspace.exceptions import OptionError

STORAGE_KEY = "warpspace-link"
PARAMETER = "view"


def pack(link: str) -> str:
    """Spell a query string as one word that needs no escaping in an address."""
    return base64.urlsafe_b64encode(link.encode()).decode().rstrip("=")


def unpack(word: str) -> str:
    """Read what `pack` has written.

    Raises
    ------
    OptionError
        If it is something else.
    """
    try:
        return base64.urlsafe_b64decode(word + "=" * (-len(word) % 4)).decode()
    except (binascii.Error, ValueError):
        raise OptionError("the link cannot be read; was it cut?") from None


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


def show_script(link: str) -> str:
    """Write the script that puts a link into the address bar and, where allowed, the clipboard.

    Parameters
    ----------
    link : str
        A query string.
    """
    return f"""(() => {{
  const link = {json.dumps(pack(link))}, parameters = new URLSearchParams(location.search);
  window.__warpspaceLink = link;
  try {{ sessionStorage.setItem({json.dumps(STORAGE_KEY)}, link); }} catch {{}}
  parameters.set({json.dumps(PARAMETER)}, link);
  history.replaceState(null, "", location.pathname + "?" + parameters);
  if (navigator.clipboard) navigator.clipboard.writeText(location.href).catch(() => {{}});
}})();"""
