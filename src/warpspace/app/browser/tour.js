// First steps: three cards, each beside what it explains; at the first visit, and from the help.
(() => {
  const KEY = "warpspace-visited", GAP = 10;
  const STEPS = [
    ["#ws-over", "The bent volume", "This is the working volume of the machine, bent by its geometric errors and"
      + " drawn much larger than true. Colours show how large the error is; the dashed box is nominal."
      + " Drag to turn it; click a point to see why it is off."],
    ["#ws-left", "Its errors", "Each row is one geometric error; the largest effect stands first. Drag its slider"
      + " or type a number, and the drawing follows. Ctrl+Z takes it back."],
    ["#ws-right", "Five tasks", "Understand the error, measure it, find what improves it, design tolerances, or"
      + " change the machine. ? at the top lists all keys."],
  ];
  const wasHere = () => {
    if (window.__warpspaceVisited) return true;
    try { return localStorage.getItem(KEY) !== null; } catch { return false; }
  };
  const place = (card, box) => {
    const own = card.getBoundingClientRect();
    let x = 12, y = innerHeight - own.height - 12;  // where there is room beside nothing: at the bottom
    if (box.right + GAP + own.width <= innerWidth) [x, y] = [box.right + GAP, box.top + GAP];
    else if (box.left - GAP - own.width >= 0) [x, y] = [box.left - GAP - own.width, box.top + GAP];
    card.style.left = `${x}px`;
    card.style.top = `${Math.max(12, Math.min(y, innerHeight - own.height - 12))}px`;
  };

  // a page that a program opens has fixedDpr in its address
  window.warpspacePage.tour = asked => {
    const address = new URLSearchParams(location.search), wish = address.get("tour");
    const first = !window.__warpspaceVisited && (wish === "on"
      || wish !== "off" && !address.has("fixedDpr") && !wasHere());
    if (!asked && !first || document.getElementById("ws-tour")) return;
    window.__warpspaceVisited = true;
    try { localStorage.setItem(KEY, "1"); } catch { /* it is shown again next time */ }
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
