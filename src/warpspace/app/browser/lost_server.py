"""Scripts of a page whose server is gone: it says so, keeps its state, and hands it back.

A page notices that its connection is closed by `sendMessage`, which viser replaces then. viser
itself keeps the panels dimmed and connects anew every second while the page is in front.
"""

import json
from collections.abc import Sequence

from warpspace.app.browser.page import PARAMETER as LINK_PARAMETER
from warpspace.app.browser.page import STORAGE_KEY as LINK_KEY

STORAGE_KEY = "warpspace-kept"
STYLE = (
    "position:fixed;left:50%;top:34%;transform:translateX(-50%);z-index:1000;max-width:480px;"
    "width:calc(100vw - 48px);box-sizing:border-box;padding:16px 20px;border-radius:10px;"
    "background:#18202e;color:#fff;border:1px solid #ffb454;font:14px/1.5 system-ui,sans-serif;"
    "box-shadow:0 8px 32px rgba(0,0,0,.35)"
)
LOST_TITLE = "The app does not answer"
LOST = (
    "The connection to its server is lost: it was ended or restarted, or the network is down."
    " What you see is the last picture; sliders and buttons do nothing until it answers again."
)
KEPT = (
    "Kept in this tab: scene, errors, view, camera, comparison and the point asked about, as of"
    " {time}. Leave the tab open; they come back by themselves."
)
NOT_KEPT = (
    "Nothing could be kept in this tab. After a restart of the server it begins anew; after a mere"
    " interruption of less than ten minutes everything is still there."
)
TRYING = "It is tried again every second; so far for {seconds} s."
WAITING = "It is tried again as soon as this page is in front."
OTHER_LINK = (
    "If the server was started again under another link, open that in this tab: what is kept comes"
    " back there only if its address is the same up to the question mark."
)
BACK_TITLE = "The app answers again"
BACK = "Only the connection had been interrupted; everything is as it was, Undo too."
BEGUN_ANEW = (
    "Its server was restarted, or has forgotten this tab, and nothing was kept here: it begins"
    " anew."
)


def _show(title: str, lines: Sequence[str], role: str) -> str:
    return f"""(({{ title, lines, role, style }}) => {{
  document.getElementById("warpspace-server")?.remove();
  const box = document.createElement("section");
  box.id = "warpspace-server";
  box.setAttribute("role", role);
  box.style.cssText = style;
  const add = (kind, text, parent = box) => {{
    const part = document.createElement(kind);
    part.textContent = text;
    part.style.margin = "0 0 6px";
    parent.append(part);
    return part;
  }};
  add("strong", title).style.fontSize = "16px";
  for (const line of lines) add("p", line);
  if (role === "status") {{
    const close = add("button", "Close");
    close.style.cssText = "padding:3px 14px;border-radius:6px;border:1px solid #fff;" +
      "background:none;color:inherit;cursor:pointer;font:inherit";
    close.onclick = () => box.remove();
  }}
  document.body.append(box);
  return box;
}})({json.dumps({"title": title, "lines": list(lines), "role": role, "style": STYLE})})"""


def watch_script() -> str:
    """Write the script that says when the connection of a page is lost.

    It is to run anew with every connection: what it knows is what viser sends with now.
    """
    return f"""(() => {{
  clearInterval(window.__warpspaceWatch);
  const send = window.__viserMutable?.sendMessage;
  let count = null, since = 0;
  window.__warpspaceWatch = setInterval(() => {{
    if (!send || __viserMutable.sendMessage === send) return;
    if (count === null || !count.isConnected) {{
      since ||= Date.now();
      let kept = null;
      try {{ kept = JSON.parse(sessionStorage.getItem({json.dumps(STORAGE_KEY)})); }} catch {{}}
      const box = {_show(LOST_TITLE, [LOST], "alert")};
      const line = kept?.text
        ? {json.dumps(KEPT)}.replace("{{time}}", new Date(kept.at).toLocaleTimeString())
        : {json.dumps(NOT_KEPT)};
      for (const text of [line, {json.dumps(OTHER_LINK)}, ""]) {{
        count = document.createElement("p");
        count.textContent = text;
        count.style.margin = "0 0 6px";
        box.append(count);
      }}
      count.setAttribute("aria-hidden", "true");  // it changes: not to be read out each time
      window.__warpspaceLost = true;
      document.documentElement.dataset.warpspace = "lost";
    }}
    const text = document.hasFocus()
      ? {json.dumps(TRYING)}.replace("{{seconds}}", Math.round((Date.now() - since) / 1000))
      : {json.dumps(WAITING)};
    if (count.textContent !== text) count.textContent = text;
  }}, 250);
}})();"""


def keep_script(text: str) -> str:
    """Write the script that keeps a text in the tab; an empty one takes away what was kept."""
    key = json.dumps(STORAGE_KEY)
    if not text:
        return f"try {{ sessionStorage.removeItem({key}); }} catch {{}}"
    return f"""(() => {{
  const kept = JSON.stringify({{ at: Date.now(), text: {_spelt(text)} }});
  try {{ sessionStorage.setItem({key}, kept); }}
  catch {{ try {{ sessionStorage.removeItem({key}); }} catch {{}} }}
}})();"""


def back_script(widget: str, *, known: bool) -> str:
    """Write the script of a page that is connected, for the first time or again."""
    return f"""(() => {{
  const was = window.__warpspaceLost;
  window.__warpspaceLost = false;
  document.getElementById("warpspace-server")?.remove();
  if ({json.dumps(known)}) {{
    if (was) {_show(BACK_TITLE, [BACK], "status")};
    return;
  }}
  let kept = null, taken = window.__warpspaceLink;
  try {{
    kept = JSON.parse(sessionStorage.getItem({json.dumps(STORAGE_KEY)}));
    taken = sessionStorage.getItem({json.dumps(LINK_KEY)}) || taken;
  }} catch {{}}
  const link = new URLSearchParams(location.search).get({json.dumps(LINK_PARAMETER)});
  if (kept?.text && (!link || link === taken))
    __viserMutable.sendMessage({{ type: "GuiUpdateMessage", uuid: {json.dumps(widget)},
      updates: {{ value: String(kept.text) }} }});
  else if (was) {_show(BACK_TITLE, [BEGUN_ANEW], "status")};
}})();"""


def say_script(title: str, lines: Sequence[str]) -> str:
    """Write the script that shows a message that stays until it is closed."""
    return f"{_show(title, lines, 'status')};".replace("<", "\\u003c")


def _spelt(text: str) -> str:
    return json.dumps(text).replace("<", "\\u003c")
