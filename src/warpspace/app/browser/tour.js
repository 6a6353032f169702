// The tour: one card after the other beside what it tells of; all else waits until it has ended.
(({ stops, asked, key }) => {
  const address = new URLSearchParams(location.search), wish = address.get("tour");
  const visited = () => {
    if (window.__warpspaceVisited) return true;
    try { return localStorage.getItem(key) !== null; } catch { return false; }
  };
  // a page opened by a program has fixedDpr in its address
  const shown = asked || (!window.__warpspaceVisited && wish === "on")
    || (wish !== "off" && !address.has("fixedDpr") && !visited());
  if (!shown || document.getElementById("warpspace-tour")) return;
  window.__warpspaceVisited = true;
  try { localStorage.setItem(key, "1"); } catch {}

  const make = (kind, parent, text = "", name = "") => {
    const element = parent.appendChild(document.createElement(kind));
    element.textContent = text;
    if (name) element.className = name;
    return element;
  };
  const before = document.activeElement;
  const overlay = document.createElement("div");
  overlay.id = "warpspace-tour";
  const ring = make("i", overlay), card = make("section", overlay);
  ring.setAttribute("aria-hidden", "true");
  for (const [attribute, value] of Object.entries({ role: "dialog", "aria-modal": "true",
    "aria-labelledby": "warpspace-tour-title", "aria-describedby": "warpspace-tour-text" }))
    card.setAttribute(attribute, value);
  const count = make("span", card, "", "ws-quiet"), title = make("h2", card);
  const text = make("p", card), more = make("p", card, "", "ws-quiet"), row = make("div", card);
  title.id = "warpspace-tour-title";
  text.id = "warpspace-tour-text";
  const skip = make("button", row, "Skip"), back = make("button", row, "Back");
  const next = make("button", row, "Next");
  for (const button of [skip, back, next]) button.type = "button";

  const waiting = [...document.body.children].filter(child => !child.inert
    && !["SCRIPT", "STYLE"].includes(child.tagName));
  let at = 0;

  const target = stop => stop.tab
    ? [...document.querySelectorAll('[role="tab"]')].find(t => t.textContent.trim() === stop.tab)
    : stop.at && document.querySelector(stop.at);

  const place = () => {
    const found = target(stops[at]);
    found?.scrollIntoView({ block: "nearest", inline: "nearest" });
    const box = found?.getBoundingClientRect(), own = card.getBoundingClientRect(), gap = 14;
    const free = box && box.width > 0 && box.height > 0;
    ring.className = free ? "" : "ws-nowhere";
    const middle = [(innerWidth - own.width) / 2, (innerHeight - own.height) / 2];
    let [x, y] = middle;
    if (free) {
      Object.assign(ring.style, { left: `${box.left - 4}px`, top: `${box.top - 4}px`,
        width: `${box.width + 4}px`, height: `${box.height + 4}px` });
      if (box.right + gap + own.width < innerWidth) [x, y] = [box.right + gap, box.top];
      else if (box.left - gap - own.width > 0) [x, y] = [box.left - gap - own.width, box.top];
      else if (box.bottom + gap + own.height < innerHeight) [x, y] = [box.left, box.bottom + gap];
      else if (box.top - gap - own.height > 0) [x, y] = [box.left, box.top - gap - own.height];
      else [x, y] = [middle[0], innerHeight - own.height - 3 * gap];
    } else ring.removeAttribute("style");
    card.style.left = `${Math.max(12, Math.min(x, innerWidth - own.width - 12))}px`;
    card.style.top = `${Math.max(12, Math.min(y, innerHeight - own.height - 12))}px`;
  };

  const show = number => {
    at = number;
    const stop = stops[at], last = at === stops.length - 1;
    count.textContent = `${at + 1} of ${stops.length}`;
    title.textContent = stop.title;
    text.textContent = stop.text;
    more.textContent = stop.more;
    more.hidden = !stop.more;
    back.hidden = at === 0;
    skip.hidden = last;
    next.textContent = last ? "Start" : "Next";
    place();
    next.focus();
  };

  const end = () => {
    removeEventListener("keydown", hear, true);
    removeEventListener("resize", place);
    overlay.remove();
    for (const child of waiting) child.inert = false;
    if (before?.isConnected) before.focus?.({ preventScroll: true });
  };
  const onward = step => {
    if (at + step >= stops.length) end();
    else if (at + step >= 0) show(at + step);
  };
  // keys are the tour's as long as it is there
  const hear = event => {
    if (!event.isTrusted) return;
    event.stopImmediatePropagation();
    if (event.key === "Escape") end();
    else if (event.key === "ArrowRight") onward(1);
    else if (event.key === "ArrowLeft") onward(-1);
    else if (event.key === "Tab") {
      const buttons = [skip, back, next].filter(button => !button.hidden);
      const now = buttons.indexOf(document.activeElement), step = event.shiftKey ? -1 : 1;
      buttons.at((now + step) % buttons.length).focus();
      event.preventDefault();
    } else if (!overlay.contains(document.activeElement)) next.focus();
  };

  skip.onclick = end;
  back.onclick = () => onward(-1);
  next.onclick = () => onward(1);
  overlay.onpointerdown = event => { if (event.target.tagName !== "BUTTON") event.preventDefault(); };
  addEventListener("keydown", hear, true);
  addEventListener("resize", place);
  for (const child of waiting) child.inert = true;
  document.body.append(overlay);
  show(0);
})
