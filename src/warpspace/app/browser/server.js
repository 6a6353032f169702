// Loss of the server: the page shows a message, stores its state, and sends it back on reconnection.
// A closed connection is detected by `sendMessage`, which viser replaces; viser reconnects every second
// while the page is in the foreground.
(() => {
  const KEPT_KEY = "warpspace-kept";
  const LOST = "The server has stopped or was restarted, or the network is down. The last picture remains"
    + " on screen; changes are possible again after reconnection.";
  const KEPT = "Saved in this tab: scene, errors, view, camera, comparison and selected point, as of {time}."
    + " Leave the tab open; the state is restored automatically.";
  const NOT_KEPT = "The state could not be saved in this tab. It is available after an interruption of less"
    + " than ten minutes, but not after a restart of the server.";
  const OTHER_LINK = "If the server was restarted with another link, open that link in this tab. The state"
    + " is restored only if the address is the same up to the question mark.";
  const BACK = "Connection restored";
  const say = (title, lines, role = "status") => {
    document.getElementById("warpspace-server")?.remove();
    const box = document.createElement("section");
    box.id = "warpspace-server";
    box.setAttribute("role", role);
    const add = (kind, text) => {
      const part = document.createElement(kind);
      part.textContent = text;
      box.append(part);
      return part;
    };
    add("h2", title);
    for (const line of lines) add("p", line);
    if (role === "status") add("button", "Close").onclick = () => box.remove();
    document.body.append(box);
    return (text) => add("p", text);
  };
  const read = () => {
    try { return JSON.parse(sessionStorage.getItem(KEPT_KEY)); } catch { return null; }
  };

  window.warpspacePage.server = {
    say,
    // called with every connection, after viser has set `sendMessage`
    watch() {
      clearInterval(window.__warpspaceWatch);
      const connection = warpspaceViser.connection();
      let count = null, since = 0;
      window.__warpspaceWatch = setInterval(() => {
        if (!connection || warpspaceViser.connection() === connection) return;
        if (!count?.isConnected) {
          since ||= Date.now();
          const kept = read(), time = kept && new Date(kept.at).toLocaleTimeString();
          const lines = [LOST, kept?.text ? KEPT.replace("{time}", time) : NOT_KEPT, OTHER_LINK];
          count = say("Connection to the server lost", lines, "alert")("");
          count.setAttribute("aria-hidden", "true");  // changes every second, not to be read out
          window.__warpspaceLost = true;
          document.documentElement.dataset.warpspace = "lost";
        }
        const text = document.hasFocus()
          ? `Reconnecting, for ${Math.round((Date.now() - since) / 1000)} s so far.`
          : "Reconnects as soon as this page is in the foreground.";
        if (count.textContent !== text) count.textContent = text;
      }, 250);
    },
    // an empty text deletes the saved state
    keep(text) {
      try {
        if (text) sessionStorage.setItem(KEPT_KEY, JSON.stringify({ at: Date.now(), text }));
        else sessionStorage.removeItem(KEPT_KEY);
      } catch { try { sessionStorage.removeItem(KEPT_KEY); } catch { /* no storage */ } }
    },
    // the page is connected, for the first time or again; `known`: the server knows this tab
    back(known) {
      const was = window.__warpspaceLost;
      window.__warpspaceLost = false;
      document.getElementById("warpspace-server")?.remove();
      if (known) {
        if (was) say(BACK, ["Only the connection was interrupted. The state and the undo history are unchanged."]);
        return;
      }
      const kept = read();
      if (kept?.text && !window.warpspacePage.hasLink())
        window.warpspacePage.send({ do: "StoredCopy", text: kept.text });
      else if (was)
        say(BACK, ["The server was restarted or has discarded this tab, and no state was saved here."
          + " The scene was opened again."]);
    },
  };
})();
