// The page around the drawing: top bar, error list, tasks, overlay of the drawing. The server writes
// HTML into named places; actions of the user (actions.py) go back. This file is independent of the contents.
(() => {
  if (window.warpspacePage) return;
  const MOST_EVENTS = 16, SEND_MS = 30, TOAST_MS = 8000, MOST_FILES = 16;
  const pending = [];  // actions, each with its JSON but for the value of the user
  const texts = new Map();  // of all places, including those that do not exist yet
  const known = { keys: {} };
  let timer = 0, last = 0;

  const shell = document.createElement("div");
  shell.id = "ws-page";
  shell.innerHTML = `
    <header id="ws-top" data-piece="top"></header>
    <nav id="ws-left" aria-label="Errors">
      <p class="ws-hint" role="note">Drag a slider: the box deforms. <button type="button" class="ws-button">Got it</button></p>
      <div data-piece="errors"></div></nav>
    <div id="ws-over" role="region" aria-label="Overlay of the drawing"><section class="ws-head" data-piece="head" aria-label="Summary"></section>
      <section class="ws-legend" data-piece="legend" aria-label="Colour legend"></section>
      <div class="ws-compared" data-piece="compared"></div>
      <svg class="ws-leaders" aria-hidden="true"></svg>
      <div class="ws-labels" aria-hidden="true"></div><div class="ws-words" aria-hidden="true"></div>
      <div class="ws-foot"><div class="ws-controls" role="group" aria-label="Display settings"><div data-piece="controls"></div>
        <div data-piece="compare"></div></div>
      <div class="ws-lengths"><div class="ws-triad" data-piece="triad"></div><div class="ws-bars"></div>
        <p class="ws-hint" role="note">Colours are true, the shape is exaggerated.</p></div>
      <div class="ws-playback" role="group" aria-label="Playback" data-piece="playback"></div></div></div>
    <section id="ws-story" aria-label="Story" aria-live="polite" data-piece="story"></section>
    <aside id="ws-right" aria-label="Tasks"><p class="ws-hint" role="note">Pick one of five tasks.</p>
      <div data-piece="tasks"></div></aside>
    <aside id="ws-notes" aria-label="Notes" data-piece="notes"></aside>
    <dialog id="ws-window" aria-labelledby="ws-window-title" data-piece="window"></dialog>
    <div id="ws-toasts" role="status" aria-live="polite" popover="manual"></div>
    <div id="ws-drop" hidden></div>`;

  // --- HTML: only differences are applied, so that focus and typed text are preserved --------------
  const keyOf = node => node.nodeType === 1 ? node.id || node.dataset.key || node.dataset.piece || "" : "";
  const typing = node => node === document.activeElement && node.dataset.dirty;
  const ruled = node => node.firstElementChild?.dataset.do;  // true if the server opens and closes it
  const copyAttributes = (old, fresh) => {
    for (const { name } of [...old.attributes])
      if (!fresh.hasAttribute(name) && (name !== "open" || ruled(old))
          && !["data-dirty", "data-touched", "style"].includes(name))
        old.removeAttribute(name);
    for (const { name, value } of fresh.attributes)
      if (old.getAttribute(name) !== value) old.setAttribute(name, value);
    if (fresh.style.cssText !== old.style.cssText) old.style.cssText = fresh.style.cssText;
    if (old.tagName === "INPUT" && !typing(old)) {
      if (old.type === "checkbox" || old.type === "radio") old.checked = fresh.hasAttribute("checked");
      else if (old.value !== fresh.getAttribute("value") && !old.dataset.held)
        old.value = fresh.getAttribute("value") ?? "";
    }
    if (old.tagName === "TEXTAREA" && !typing(old) && old.value !== fresh.textContent)
      old.value = fresh.textContent;
  };
  const patch = (old, fresh) => {
    const keyed = new Map([...old.children].filter(keyOf).map(node => [keyOf(node), node]));
    let at = old.firstChild;
    for (const next of [...fresh.childNodes]) {
      const key = keyOf(next);
      const match = key ? keyed.get(key) : at && !keyOf(at) && at.nodeName === next.nodeName ? at : null;
      if (!match || match.nodeName !== next.nodeName) { old.insertBefore(next, at); continue; }
      if (match === at) at = at.nextSibling; else old.insertBefore(match, at);
      if (next.nodeType !== 1) {
        if (match.nodeValue !== next.nodeValue) match.nodeValue = next.nodeValue;
        continue;
      }
      copyAttributes(match, next);
      if (!next.hasAttribute("data-piece") && !match.querySelector(":scope > .ws-typed")) patch(match, next);
      if (match.tagName === "SELECT" && match !== document.activeElement)
        match.value = match.querySelector("option[selected]")?.value ?? match.options[0]?.value;  // `next` has lost new options
    }
    while (at) { const gone = at; at = at.nextSibling; gone.remove(); }
  };
  const write = (name, html) => {
    const place = shell.querySelector(`[data-piece="${CSS.escape(name)}"]`);
    texts.set(name, html);
    if (!place) return;
    const fresh = document.createElement("div");
    fresh.innerHTML = html;
    patch(place, fresh);
    for (const { dataset, childNodes } of place.querySelectorAll("[data-piece]"))
      if (!childNodes.length && texts.get(dataset.piece)) write(dataset.piece, texts.get(dataset.piece));
    if (name === "window") showWindow(place);
    if (name === "notes") prepareNotes(place);
    place.querySelectorAll(`[data-set='${AUTHOR}']`).forEach(fillAuthor);
  };

  // --- review notes: an opening form takes the focus; the author is stored in this browser ---------
  const AUTHOR = JSON.stringify({ do: "SetLeaf", path: "page.author" }), AUTHOR_KEY = "warpspace-author";
  const prepareNotes = place => {
    const first = place.querySelector("textarea"), form = first?.closest("[data-key]").dataset.key;
    if (first && known.form !== form) first.focus();
    known.form = form;
  };
  const fillAuthor = box => {
    let author = "";
    try { author = localStorage.getItem(AUTHOR_KEY) ?? ""; } catch { /* no storage */ }
    if (author && !box.value && !typing(box)) { box.value = author; send(AUTHOR, author); }
  };

  // --- the dialog: modal, closed by its button, Esc, or a click outside ----------------------------
  let before = null;
  const showWindow = dialog => {
    const filled = dialog.childElementCount > 0;
    if (filled && !dialog.open) { before = document.activeElement; dialog.showModal(); raiseToasts(); }
    if (!filled && dialog.open) { dialog.close(); (document.querySelector(".ws-hints .ws-hint button") ?? before)?.focus?.(); }
  };

  const closeWindow = () => {  // without waiting for the server
    const dialog = document.getElementById("ws-window");
    dialog.replaceChildren();
    showWindow(dialog);
    send("close_dialog");
  };

  // --- actions, in order: the first is sent immediately, those that follow quickly are sent together -
  const post = events => warpspaceViser.send({ type: "WarpspaceEvents", events });
  const flush = () => {
    clearTimeout(timer);
    timer = warpspaceViser.isReady() ? 0 : setTimeout(flush, SEND_MS);
    if (timer || !pending.length) return;
    last = performance.now();
    post(pending.splice(0, MOST_EVENTS).map(([, action]) => action));
  };
  // an action, or its JSON; of one with a value only the latest is sent
  const send = (action, value) => {
    const text = typeof action === "string" ? action : JSON.stringify(action);
    const read = text.startsWith("{") ? JSON.parse(text) : text;
    if (value === undefined) { pending.push(["", read]); }
    else {
      const same = pending.findIndex(([other]) => other === text);
      if (same >= 0) pending.splice(same, 1);
      pending.push([text, { ...read, value: String(value) }]);
    }
    if (pending.length >= MOST_EVENTS || !timer && performance.now() - last >= SEND_MS) flush();
    else timer ||= setTimeout(flush, Math.max(0, SEND_MS - (performance.now() - last)));
  };
  const valueOf = node => node.type === "checkbox" ? (node.checked ? "1" : "0") : node.value;

  shell.addEventListener("click", event => {
    const part = event.target.closest("[data-do]");
    if (part?.tagName === "SUMMARY") event.preventDefault();
    if (part?.dataset.do === "close_dialog") closeWindow();
    else if (part && !part.disabled) send(part.dataset.do);
    event.target.closest(".ws-menu button")?.closest("details").removeAttribute("open");
    const number = event.target.closest("[data-box]");
    if (number && event.target.tagName !== "INPUT") typeInto(number).select();
    const upload = event.target.closest("[data-upload]");
    if (upload) chooseFiles(upload);
    const copy = event.target.closest("[data-copy]");
    if (copy) copyText(copy.dataset.copy);
    const go = event.target.closest("[data-go]");
    if (go) document.querySelector(go.dataset.go)?.focus();
    if (event.target.id === "ws-window") closeWindow();  // outside the dialog
  });
  shell.addEventListener("input", event => {
    const node = event.target, name = node.dataset?.live ?? (node.type === "range" ? node.dataset?.set : null);
    if (node.type === "range") {
      const twin = document.getElementById(node.dataset.twin ?? "");
      if (twin?.tagName === "INPUT") twin.value = node.value;
      else if (twin) twin.firstChild.data = node.value.replace("-", "−");
    } else if (node.dataset?.set) node.dataset.dirty = "1";
    if (name && node.type === "range" && !known.drags && !name.includes('"Scrub"')) {
      known.drags = true;
      pending.push(["", "hold"]);  // with the first value of the drag
    }
    if (name) send(name, valueOf(node));
  });
  // the end of a drag, by pointer or key: the drawing chooses its scales again
  const release = () => {
    if (known.drags) send("release");
    known.drags = false;
  };
  for (const type of ["keydown", "keyup", "blur"])
    addEventListener(type, () => {
      known.pressed = type === "keydown";
      if (!known.pressed) release();
    }, true);
  shell.addEventListener("change", event => {
    const node = event.target;
    delete node.dataset?.dirty;
    if (node.dataset?.set && !node.dataset.enter) send(node.dataset.set, valueOf(node));
    if (!known.pressed) release();
    if (node.dataset?.set === AUTHOR) try { localStorage.setItem(AUTHOR_KEY, node.value); } catch { /* no storage */ }
  });
  for (const [type, pressed] of [["pointerdown", true], ["pointerup", false], ["pointercancel", false]])
    addEventListener(type, event => {
      for (const node of pressed ? [event.target] : shell.querySelectorAll("[data-held]"))
        if (node.type === "range") { if (pressed) node.dataset.held = "1"; else delete node.dataset.held; }
      if (!pressed) release();
    }, true);
  shell.addEventListener("focusout", event => { delete event.target.dataset?.held; });

  // --- a number that becomes a text box while it is edited: [data-box] is its action ----------------
  const typeInto = text => {
    const box = Object.assign(document.createElement("input"),
      { className: "ws-box ws-typed", value: text.dataset.text, defaultValue: text.dataset.text });
    box.dataset.set = text.dataset.box;
    box.setAttribute("inputmode", "decimal");
    box.setAttribute("aria-label", text.dataset.label);
    const leave = () => { if (box.isConnected) box.remove(); };
    box.addEventListener("blur", () => setTimeout(leave));  // after the typed text has been sent
    box.addEventListener("keydown", event => {
      if (event.key !== "Enter" && event.key !== "Escape") return;
      if (event.key === "Escape") box.value = box.defaultValue;
      event.stopPropagation();
      text.parentElement.querySelector("input[type=range]")?.focus();
    });
    text.append(box);
    return box;
  };

  // --- a list that is sorted again when pointer and focus leave it: [data-leave] is the action -------
  const leaveList = event => {
    const list = event.target.closest?.("[data-leave]");
    if (!list?.dataset.touched || list.contains(event.relatedTarget)) return;
    setTimeout(() => {
      const active = document.activeElement, inside = list.contains(active) && active.matches(":focus-visible");
      if (inside || list.matches(":hover") || list.querySelector("[data-held]")) return;
      delete list.dataset.touched;
      send(list.dataset.leave);
    });
  };
  for (const name of ["pointerout", "focusout", "pointerup"]) addEventListener(name, leaveList);
  shell.addEventListener("change", event => {
    const list = event.target.closest("[data-leave]");
    if (list) list.dataset.touched = "1";
  });

  // --- menus: one at a time, closed by a click outside or Esc --------------------------------------
  const closeMenus = but => shell.querySelectorAll("details:is(.ws-menu, .ws-pop)[open]").forEach(menu => {
    if (menu !== but) menu.open = false;
  });
  const shift = document.head.appendChild(document.createElement("style"));
  shell.addEventListener("toggle", event => {  // an open menu stays within the drawing
    const sheet = event.target.open && event.target.querySelector(":scope > .ws-sheet");
    if (!sheet) return;
    shift.textContent = "";
    const at = sheet.getBoundingClientRect(), room = shell.querySelector("#ws-over").getBoundingClientRect();
    const beyond = Math.min(at.right - room.right + 8, at.left - room.left) / (shell.currentCSSZoom ?? 1);
    if (beyond > 0) shift.textContent = `.ws-pop[open] > .ws-sheet { translate: ${-beyond}px 0; }`;
  }, true);
  addEventListener("pointerdown", event => closeMenus(event.target.closest?.("details:is(.ws-menu, .ws-pop)")), true);
  shell.addEventListener("keydown", event => {
    const menu = event.key === "Escape" && event.target.closest?.("details:is(.ws-menu, .ws-pop)[open]");
    if (menu) { menu.open = false; menu.querySelector("summary").focus(); }
  });

  // --- keys: digits typed on a slider set its number; others act unless text is entered ------------
  const spelt = event => [event.ctrlKey || event.metaKey ? "ctrl" : "", event.shiftKey ? "shift" : "",
    event.altKey ? "alt" : "", event.key.toLowerCase()].filter(Boolean).join("+");
  addEventListener("keydown", event => {
    if (document.documentElement.classList.contains("ws-playing")) return;  // keys of the story
    const node = event.target, tagName = node.tagName;
    if (tagName === "INPUT" && node.type === "range" && /^[-−0-9.,]$/.test(event.key)) {
      const box = document.getElementById(node.dataset.twin ?? "");
      if (box) {
        event.preventDefault();
        const typed = box.dataset.box ? typeInto(box) : box;
        typed.focus(); typed.value = event.key; typed.dataset.dirty = "1";
      }
      return;
    }
    if (node.getAttribute?.("role") === "tab") {  // arrows move along the tabs, Enter opens one
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      const tabs = [...node.parentElement.children];
      const to = step ? tabs[(tabs.indexOf(node) + step + tabs.length) % tabs.length]
        : event.key === "Enter" || event.key === " " ? node : null;
      if (to) { event.preventDefault(); to.focus(); to.click(); return; }
    }
    if (node.getAttribute?.("role") === "treeitem") {  // likewise along a tree
      const step = { ArrowDown: 1, ArrowUp: -1 }[event.key], open = ["Enter", " "].includes(event.key);
      const items = [...node.closest("[role=tree]").querySelectorAll("[role=treeitem]")];
      if (step) items[items.indexOf(node) + step]?.focus();
      if (open) node.querySelector("[data-do]").click();
      if (step || open) { event.preventDefault(); return; }
    }
    if (event.key === "Escape" && node.dataset?.dirty) {
      delete node.dataset.dirty; node.value = node.defaultValue; return;
    }
    const writes = tagName === "TEXTAREA" || tagName === "SELECT"
      || tagName === "INPUT" && !["range", "checkbox", "radio"].includes(node.type);
    if (writes && !(event.ctrlKey || event.metaKey)) return;
    const action = known.keys[spelt(event)];
    if (!action || document.getElementById("ws-window").open && action !== "close_dialog") return;
    if (writes && ["undo", "redo"].includes(action)) return;  // undo of the text box
    event.preventDefault();
    event.stopImmediatePropagation();
    if (action === "find_error") document.querySelector("#ws-find")?.focus();
    else if (action === "choose_files") chooseFiles(buttonOf("files"));
    else send(action);
  }, true);
  // a box with data-enter sends it on Enter; arrows move from it into the list below it
  shell.addEventListener("keydown", event => {
    const node = event.target;
    if (event.key === "Escape" && !node.dataset?.dirty && node.closest("#ws-notes"))
      shell.querySelector("[data-do=close_notes]").click();
    if (node.dataset?.enter && event.key === "Enter") send(node.dataset.enter, node.value);
    const list = node.closest("[data-list]"), step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!list || !step) return;
    const items = [...list.querySelectorAll("input, button")];
    items[items.indexOf(node) + step]?.focus();
    event.preventDefault();
  });
  // the camera, which listens on the document, moves only while no control has the focus
  shell.addEventListener("keydown", event => event.stopPropagation());
  document.addEventListener("cancel", event => {
    if (event.target.id === "ws-window") { event.preventDefault(); closeWindow(); }
  }, true);

  // --- files: one action each, without content if the file is too large -----------------------------
  const sendFile = async ({ upload, most }, file) => {
    const reader = new FileReader();
    if (file.size <= Number(most))
      await new Promise(done => { reader.onload = done; reader.readAsDataURL(file); });
    const content = reader.result?.split(",")[1] ?? "";
    post([{ do: "Upload", panel: upload, name: file.name, size: file.size, content }]);
  };
  const sendFiles = (button, files) =>
    [...files].slice(0, MOST_FILES).forEach(file => sendFile(button.dataset, file));
  const buttonOf = part => document.querySelector(`[data-upload="${part}"][data-most]`);
  const chooseFiles = button => {
    const input = document.createElement("input");
    input.type = "file"; input.multiple = true; input.accept = button.dataset.accept;
    input.onchange = () => sendFiles(button, input.files);
    input.click();
  };
  const hasFiles = event => [...(event.dataTransfer?.types ?? [])].includes("Files");
  const rowsAt = event => event.target.closest?.("textarea.ws-rows-box");
  // outline of the place where the files go: the numbers of a curve, otherwise the whole drawing
  let dropTimer = 0;
  const showDrop = target => {
    const mark = shell.querySelector("#ws-drop"), zoom = shell.currentCSSZoom ?? 1;
    clearTimeout(dropTimer);
    mark.hidden = !target;
    if (!target) return;
    mark.textContent = target.tagName === "TEXTAREA" ? "Drop: numbers of this curve" : "Drop to open";
    const { x, y, width, height } = target.getBoundingClientRect();
    Object.assign(mark.style, { left: `${x / zoom}px`, top: `${y / zoom}px`, width: `${width / zoom}px`,
      height: `${height / zoom}px` });
    dropTimer = setTimeout(showDrop, 1000);  // the browser repeats dragover; without it the files have left
  };
  addEventListener("dragover", event => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    showDrop(rowsAt(event) ?? shell.querySelector("#ws-over"));
  });
  addEventListener("dragleave", event => { if (!event.relatedTarget) showDrop(); });
  addEventListener("drop", event => {
    showDrop();
    if (!hasFiles(event)) return;
    event.preventDefault();
    const numbers = rowsAt(event);
    if (numbers) {
      event.dataTransfer.files[0].text().then(text => {
        numbers.value = text;
        send(numbers.dataset.set, text);
      });
      return;
    }
    sendFiles(buttonOf("files"), event.dataTransfer.files);
  });

  // above an open dialog, too
  const raiseToasts = () => {
    const shelf = shell.querySelector("#ws-toasts");
    if (!shelf.isConnected || !shelf.showPopover) return;
    if (shelf.matches(":popover-open")) shelf.hidePopover();
    if (shelf.childElementCount) shelf.showPopover();
    shelf.scrollTop = shelf.scrollHeight;
  };
  // --- messages that disappear by themselves; the columns end above them ---------------------------
  new ResizeObserver(([{ target }]) => shell.style.setProperty("--ws-said", `${target.offsetHeight}px`))
    .observe(shell.querySelector("#ws-toasts"));
  const toast = (kind, title, text = "", action = null) => {
    const box = document.createElement("section");
    box.className = `ws-toast ws-${kind}`;
    box.append(Object.assign(document.createElement("strong"), { textContent: title }));
    if (text) box.append(Object.assign(document.createElement("p"), { textContent: text }));
    const close = Object.assign(document.createElement("button"), { textContent: "✕" });
    close.setAttribute("aria-label", "Close this message");
    const leave = () => { box.remove(); raiseToasts(); };
    close.onclick = leave;
    box.append(close);
    const shelf = shell.querySelector("#ws-toasts");
    if (action) {  // label and event of a button; one such message at a time
      const button = Object.assign(document.createElement("button"),
        { textContent: action[0], className: "ws-action", onclick: leave });
      [button.dataset.do, box.dataset.action] = [action[1], action[1]];
      shelf.querySelector(`[data-action="${action[1]}"]`)?.remove();
      box.append(button);
    }
    shelf.append(box);
    raiseToasts();
    if (kind !== "stays") setTimeout(leave, TOAST_MS);
  };
  const copyText = async (text, title = "Copied", words = "") => {
    try { await navigator.clipboard.writeText(text); toast("done", title, words); }
    catch { toast("stays", "Copy this text", `${text}\n${words}`); }
  };

  // --- the address of the page: the link it was opened with, opened once per tab, and shared links --
  const LINK_KEY = "warpspace-link", LINK = "view";
  const stored = () => { try { return sessionStorage.getItem(LINK_KEY); } catch { return null; } };
  const store = link => {
    window.__warpspaceLink = link;
    try { sessionStorage.setItem(LINK_KEY, link); } catch { /* no storage */ }
  };
  const linkOf = () => new URLSearchParams(location.search).get(LINK);
  const showAddress = parameters =>
    history.replaceState(null, "", location.pathname + (String(parameters) && `?${parameters}`));
  const tidyAddress = () => {  // the token has set the cookie and is no longer needed
    const parameters = new URLSearchParams(location.search);
    if (!parameters.has("token")) return;
    parameters.delete("token");
    showAddress(parameters);
  };

  // --- identity of the tab --------------------------------------------------------------------------
  const TAB_KEY = "warpspace-tab";
  const rename = name => {
    window.__warpspaceTab = name;
    try { sessionStorage.setItem(TAB_KEY, name); } catch { /* valid until the page is closed */ }
  };
  const tabName = () => {
    try { return sessionStorage.getItem(TAB_KEY) || window.__warpspaceTab; }
    catch { return window.__warpspaceTab; }
  };

  document.body.append(shell);
  document.getElementById("root").setAttribute("role", "main");
  document.getElementById("root").setAttribute("aria-label", "3-D view of the deformed working volume");
  window.warpspacePage = {
    send, rename, toast, copyText, over: shell.querySelector("#ws-over"),
    // true if the page was opened with a link
    hasLink: () => known.hasLink,
    style(css) {
      document.head.append(Object.assign(document.createElement("style"), { textContent: css }));
    },
    // connected, for the first time or again: send identity of the tab and link
    arrive() {
      rename(tabName() || [...crypto.getRandomValues(new Uint8Array(16))]
        .map(byte => byte.toString(16).padStart(2, "0")).join(""));
      pending.splice(0);
      send({ do: "TabHere", token: window.__warpspaceTab });
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) send("reduce_motion");
      tidyAddress();
      const link = linkOf();
      known.hasLink = Boolean(link) && link !== (stored() || window.__warpspaceLink);
      if (known.hasLink) { store(link); send({ do: "InputValue", input: "follow_link" }, link); }
    },
    // progress of the page, for tests
    stage(word) {
      document.documentElement.dataset.warpspace = word;
      if (word === "open") { warpspaceMesh.greet(); this.hints(); }
    },
    // report when everything before it is drawn
    drawn() {
      const report = () => send("drawn");
      if (document.hidden) setTimeout(report, 0);
      else requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(report, 0)));
    },
    share(word, token, words) {
      const parameters = new URLSearchParams(location.search);
      store(word);
      parameters.set(LINK, word);
      showAddress(parameters);
      const address = new URL(location.href);
      if (token) address.searchParams.set("token", token);
      const isLocal = ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);
      const reach = "The link works on this computer only: it names this computer, not a server.";
      copyText(address.href, "Link copied", isLocal ? `${words}\n${reach}` : words);
    },
    keys(actions) { known.keys = actions; },
    // scroll to a note, after the list is opened
    reveal(id) { setTimeout(() => document.getElementById(id)?.focus(), 300); },
    // rejected: these controls show their present values again
    settle(actions) {
      const control = text => text.startsWith("{") ? JSON.stringify({ ...JSON.parse(text), value: 0 }) : text;
      const names = actions.map(control);
      for (const node of shell.querySelectorAll("[data-set]")) {
        if (!names.includes(control(node.dataset.set)) || typing(node) || node.dataset.held) continue;
        const options = [...node.options ?? []];
        node.checked = node.defaultChecked;
        node.value = options.length ? (options.find(one => one.defaultSelected) ?? options[0]).value
          : node.type === "radio" || node.type === "checkbox" ? node.value : node.defaultValue;
      }
    },
    show(pieces) { for (const [name, html] of Object.entries(pieces)) write(name, html); },
    menu(name) {
      const menu = document.querySelector(`[data-key="menu-${name}"]`);
      if (menu) menu.open = true;
      menu?.querySelector("summary").focus();
    },
    title(words) { document.title = `${words} · warpspace`; },
    dark(on) { document.documentElement.classList.toggle("ws-dark", on); },
  };
})();
