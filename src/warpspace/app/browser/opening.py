"""Scripts of a page that opens: how far it is, and what it has drawn."""

import json


def stage_script(word: str) -> str:
    """Write the script that marks how far a page is, for whoever drives it from outside.

    Parameters
    ----------
    word : str
        "opening", or "open" once everything is there: what `data-warpspace` of the page's root is.
    """
    return f"document.documentElement.dataset.warpspace = {json.dumps(word)};"


def drawn_script(widget: str, number: int) -> str:
    """Write the script that makes a page say when it has drawn all before it.

    Parameters
    ----------
    widget : str
        Identifier of the widget that takes the number.
    number : int

    Returns
    -------
    str
        JavaScript. A page that is not in view draws nothing, and answers at once.
    """
    return f"""(() => {{
  const tell = () => window.__viserMutable?.sendMessage({{
    type: "GuiUpdateMessage", uuid: {json.dumps(widget)}, updates: {{ value: "{number:d}" }}
  }});
  if (document.hidden) setTimeout(tell, 0);
  else requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(tell, 0)));
}})();"""
