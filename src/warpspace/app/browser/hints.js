// Three hints, each beside what it explains: at the first visit, and from the help. They are part of
// the page (`page.js`) and hidden together by their button, Esc, or the first use of what they explain.
(() => {
  const KEY = "warpspace-visited", root = document.documentElement;
  const wasHere = () => {
    if (window.__warpspaceVisited) return true;
    try { return localStorage.getItem(KEY) !== null; } catch { return false; }
  };
  const hide = () => {
    if (!root.classList.contains("ws-hints")) return;
    const focused = document.activeElement?.closest(".ws-hint");
    root.classList.remove("ws-hints");
    if (focused) document.querySelector("#ws-find")?.focus({ preventScroll: true });
  };
  addEventListener("keydown", event => { if (event.key === "Escape") hide(); }, true);
  addEventListener("click", event => { if (event.target.closest?.(".ws-hint button, [role=tab]")) hide(); });
  addEventListener("input", event => { if (event.target.closest?.("#ws-left, .ws-foot")) hide(); });

  // the address of a page opened by a program contains fixedDpr
  window.warpspacePage.hints = requested => {
    const address = new URLSearchParams(location.search), wish = address.get("hints");
    const first = !window.__warpspaceVisited && (wish === "on"
      || wish !== "off" && !address.has("fixedDpr") && !wasHere());
    if (!requested && !first) return;
    window.__warpspaceVisited = true;
    try { localStorage.setItem(KEY, "1"); } catch { /* shown again at the next visit */ }
    root.classList.add("ws-hints");
    if (requested) document.querySelector(".ws-hint button").focus();
  };
})();
