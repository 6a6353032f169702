// First steps: three cards beside the parts of the page; at the first visit, and from the help.
(() => {
  const KEY = "warpspace-visited", GAP = 10;
  const STEPS = [
    ["#ws-over", "Deformed volume", "The working volume of the machine, deformed by its geometric errors, with"
      + " exaggeration. Colours show the magnitude of the error; the dashed box is nominal."
      + " Drag to rotate; click a point to see the contributions to its error."],
    ["#ws-left", "Errors", "Each row is one geometric error; the largest effect comes first. Drag the slider"
      + " or type a number to change it. Ctrl+Z undoes a change."],
    ["#ws-right", "Five tasks", "Understand, measure and improve the error, design tolerances, or edit the"
      + " machine. ? in the top bar lists all keys."],
  ];
  const wasHere = () => {
    if (window.__warpspaceVisited) return true;
    try { return localStorage.getItem(KEY) !== null; } catch { return false; }
  };
  const place = (card, box) => {
    const { width, height } = card.getBoundingClientRect();
    let x = 12, y = innerHeight - height - 12;  // at the bottom, if there is no space beside the part
    if (box.right + GAP + width <= innerWidth) [x, y] = [box.right + GAP, box.top + GAP];
    else if (box.left - GAP - width >= 0) [x, y] = [box.left - GAP - width, box.top + GAP];
    card.style.left = `${x}px`;
    card.style.top = `${Math.max(12, Math.min(y, innerHeight - height - 12))}px`;
  };

  // the address of a page opened by a program contains fixedDpr
  window.warpspacePage.tour = requested => {
    const address = new URLSearchParams(location.search), wish = address.get("tour");
    const first = !window.__warpspaceVisited && (wish === "on"
      || wish !== "off" && !address.has("fixedDpr") && !wasHere());
    if (!requested && !first || document.getElementById("ws-tour")) return;
    window.__warpspaceVisited = true;
    try { localStorage.setItem(KEY, "1"); } catch { /* shown again at the next visit */ }
    const before = document.activeElement, card = document.createElement("section");
    card.id = "ws-tour";
    card.setAttribute("role", "dialog");
    card.setAttribute("aria-labelledby", "ws-tour-title");
    card.innerHTML = `<h2 id="ws-tour-title"></h2><p></p><div class="ws-actions">
      <button type="button" class="ws-button quiet">Skip</button>
      <button type="button" class="ws-button main">Next</button></div>`;
    const [skip, next] = card.querySelectorAll("button");
    let at = 0, target = null;
    const point = () => {
      target?.classList.remove("ws-pointed");
      const [where, title, text] = STEPS[at], last = at === STEPS.length - 1;
      target = document.querySelector(where);
      target.classList.add("ws-pointed");
      card.querySelector("h2").textContent = `${title} (${at + 1} of ${STEPS.length})`;
      card.querySelector("p").textContent = text;
      skip.hidden = last;
      next.textContent = last ? "Start" : "Next";
      place(card, target.getBoundingClientRect());
      next.focus();
    };
    const end = () => {
      target?.classList.remove("ws-pointed");
      removeEventListener("resize", point);
      card.remove();
      before?.focus?.({ preventScroll: true });
    };
    skip.onclick = end;
    next.onclick = () => { at += 1; if (at < STEPS.length) point(); else end(); };
    card.onkeydown = event => { if (event.key === "Escape") end(); };
    addEventListener("resize", point);
    document.getElementById("ws-page").append(card);
    point();
  };
})();
