"""Links: what stands behind the # of the page's address, handed over by the page."""

import json

STORAGE_KEY = "warpspace-link"


def listen_script(widget: str) -> str:
    """Write the script that hands over the link a page was opened with, and every later one.

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
  const hand = () => {{
    const link = location.hash.slice(1);
    if (!/^(scene|file)=/.test(link)) return;
    let taken = window.__warpspaceLink;
    try {{ taken = sessionStorage.getItem(key) || taken; }} catch {{}}
    if (taken === link) return;
    window.__warpspaceLink = link;
    try {{ sessionStorage.setItem(key, link); }} catch {{}}
    __viserMutable.sendMessage({{ type: "GuiUpdateMessage", uuid: {json.dumps(widget)},
      updates: {{ value: performance.now() + ":" + link }} }});
  }};
  if (window.__warpspaceHand) removeEventListener("hashchange", window.__warpspaceHand);
  window.__warpspaceHand = hand;
  addEventListener("hashchange", hand);
  hand();
}})();"""


def show_script(link: str) -> str:
    """Write the script that puts a link into the address bar and, where allowed, the clipboard.

    Parameters
    ----------
    link : str
        A query string.
    """
    key, spelt = json.dumps(STORAGE_KEY), json.dumps(link).replace("<", "\\u003c")
    return f"""(() => {{
  const link = {spelt};
  window.__warpspaceLink = link;
  try {{ sessionStorage.setItem({key}, link); }} catch {{}}
  history.replaceState(null, "", location.pathname + location.search + "#" + link);
  if (navigator.clipboard) navigator.clipboard.writeText(location.href).catch(() => {{}});
}})();"""
