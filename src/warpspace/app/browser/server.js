// A page whose server is gone says so, keeps its state, and hands it back when it answers again.
// A page notices that its connection is closed by `sendMessage`, which viser replaces then; viser
// itself connects anew every second while the page is in front.
(() => {
  const KEPT_KEY = "warpspace-kept";
  const LOST = "The connection to its server is lost: it was ended or restarted, or the network is down."
    + " What you see is the last picture; nothing can be changed until it answers again.";
  const KEPT = "Kept in this tab: scene, errors, view, camera, comparison and the point asked about, as of"
    + " {time}. Leave the tab open; they come back by themselves.";
  const NOT_KEPT = "Nothing could be kept in this tab. After a restart of the server it begins anew;"
    + " after an interruption of less than ten minutes everything is still there.";
  const OTHER_LINK = "If the server was started again under another link, open that in this tab: what is"
    + " kept comes back there only if its address is the same up to the question mark.";
  const BACK = "The app answers again";
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
    // to be called with every connection: what it knows is what viser sends with now
    watch() {
      clearInterval(window.__warpspaceWatch);
      const send = window.__viserMutable?.sendMessage;
      let count = null, since = 0;
      window.__warpspaceWatch = setInterval(() => {
        if (!send || window.__viserMutable.sendMessage === send) return;
        if (!count?.isConnected) {
          since ||= Date.now();
          const kept = read(), time = kept && new Date(kept.at).toLocaleTimeString();
          const lines = [LOST, kept?.text ? KEPT.replace("{time}", time) : NOT_KEPT, OTHER_LINK];
          count = say("The app does not answer", lines, "alert")("");
          count.setAttribute("aria-hidden", "true");  // it changes: not to be read out each time
          window.__warpspaceLost = true;
          document.documentElement.dataset.warpspace = "lost";
        }
        const text = document.hasFocus()
          ? `Trying again every second, for ${Math.round((Date.now() - since) / 1000)} s so far.`
          : "It tries again as soon as this page is in front.";
        if (count.textContent !== text) count.textContent = text;
      }, 250);
    },
    // an empty text takes away what was kept
    keep(text) {
      try {
        if (text) sessionStorage.setItem(KEPT_KEY, JSON.stringify({ at: Date.now(), text }));
        else sessionStorage.removeItem(KEPT_KEY);
      } catch { try { sessionStorage.removeItem(KEPT_KEY); } catch { /* nothing is kept there */ } }
    },
    // the page is connected, for the first time or again; to a server that knows its tab or not
    back(known) {
      const was = window.__warpspaceLost;
      window.__warpspaceLost = false;
      document.getElementById("warpspace-server")?.remove();
      if (known) {
        if (was) say(BACK, ["Only the connection was interrupted; everything is as it was, Undo too."]);
        return;
      }
      const kept = read();
      if (kept?.text && !window.warpspacePage.hasLink())
        window.warpspacePage.send("keeper:kept", kept.text);
      else if (was)
        say(BACK, ["Its server was restarted, or has forgotten this tab, and nothing was kept here:"
          + " it begins anew."]);
    },
  };
})();
