"""Scripts of a page that opens: how far it is, what it has drawn, the first hint."""

import json

HINT_SECONDS = 12
HINT = "Drag a slider on the left: the box bends at once.   Ctrl+Z undoes   ·   H shows all keys"


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


def hint_script(text: str = HINT, seconds: float = HINT_SECONDS) -> str:
    """Write the script of the hint a browser shows on its first visit, and only then.

    Returns
    -------
    str
        JavaScript: a line at the bottom of the page that takes no clicks and leaves by itself,
        at the latest with the first thing done.
    """
    style = (
        "position:fixed;left:50%;bottom:28px;transform:translateX(-50%);z-index:50;"
        "padding:9px 18px;border-radius:8px;background:rgba(24,32,46,.9);color:#fff;"
        "font:14px/1.4 system-ui,sans-serif;pointer-events:none;transition:opacity .8s;"
        "white-space:pre;max-width:90vw"
    )
    return f"""(() => {{
  const key = "warpspace-visited";
  try {{ if (localStorage.getItem(key)) return; localStorage.setItem(key, "1"); }} catch {{}}
  const hint = document.createElement("div");
  hint.id = "warpspace-hint";
  hint.setAttribute("role", "status");
  hint.style.cssText = {json.dumps(style)};
  hint.textContent = {json.dumps(text)};
  document.body.append(hint);
  const leave = () => {{ hint.style.opacity = 0; setTimeout(() => hint.remove(), 900); }};
  setTimeout(leave, {1000 * seconds:g});
  for (const what of ["pointerdown", "keydown"])
    // what scripts of our own do is not the user's first deed
    addEventListener(what, event => event.isTrusted && leave(), {{ capture: true }});
}})();"""
