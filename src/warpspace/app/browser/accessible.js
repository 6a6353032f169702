// Names for screen readers, and keys that act wherever the focus is. What viser leaves out is added
// to the page as it stands, again whenever the page has changed and has been calm for a moment.
(() => {
  if (window.__warpspaceAccess) return window.__warpspaceAccess.name();

  const CALM_MS = 150;
  const ICONS = {
    "list-search": "Command palette", maximize: "Enlarge the chart", "arrow-back": "Back",
  };
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const put = (element, attribute, value) => {
    if (element.getAttribute(attribute) !== value) element.setAttribute(attribute, value);
  };
  const words = selector => document.querySelector(selector)?.innerText.trim() ?? "";

  // --- names ---

  const nameInputs = () => {
    for (const label of all("p > label[for]")) {
      const row = label.parentElement.parentElement?.parentElement;
      const own = row?.lastElementChild, name = label.textContent.trim();
      if (!own || own.contains(label) || !name) continue;
      for (const input of all("[role=slider], input:not([type=hidden]), textarea", own)) {
        if (input.id !== label.htmlFor) put(input, "aria-label", name);
        // a slider with powers of ten says the number they stand for
        if (input.matches("[role=slider]") && name.endsWith(", logarithmic"))
          put(input, "aria-valuetext",
            "×" + Number((10 ** input.getAttribute("aria-valuenow")).toPrecision(3)));
      }
      const buttons = all("button", own);
      if (buttons.length && buttons.every(button => button.parentElement === buttons[0].parentElement)
          && !own.querySelector("input")) {
        put(buttons[0].parentElement, "role", "group");
        put(buttons[0].parentElement, "aria-label", name);
      }
    }
  };

  const nameButtons = () => {
    for (const [icon, name] of Object.entries(ICONS))
      for (const drawn of all(`.tabler-icon-${icon}`)) {
        const button = drawn.closest("button");
        if (button) put(button, "aria-label", name);
      }
    for (const button of all(".mantine-Notification-closeButton"))
      put(button, "aria-label", "Close the message");
    // icons say nothing that their button does not; a drawing that is to be heard has a name
    for (const icon of all("svg:not([role], [aria-label], :has(title))"))
      put(icon, "aria-hidden", "true");
    for (const button of all(".mantine-Modal-close")) put(button, "aria-label", "Close");
  };

  const nameTabs = () => {
    for (const list of all("[role=tablist]")) {
      const names = all("[role=tab]", list).map(tab => tab.textContent.trim()).filter(Boolean);
      if (names.length) put(list, "aria-label", "Tabs " + names.join(", "));
    }
  };

  // folders open by a click alone: they get what a button has
  const nameFolders = () => {
    for (const icon of all(".tabler-icon-chevron-up, .tabler-icon-chevron-down")) {
      const folder = icon.parentElement;
      if (icon.closest("button, [role=tab], .mantine-Input-wrapper") || icon.style.display === "none"
          || getComputedStyle(folder).cursor !== "pointer") continue;
      put(folder, "role", "button");
      put(folder, "tabindex", "0");
      put(folder, "aria-expanded", String(icon.classList.contains("tabler-icon-chevron-up")));
    }
  };

  // the text stands in the page just before its chart
  const nameCharts = () => {
    const texts = all("[data-chart-text]");
    for (const chart of all(".uplot-container")) {
      const before = texts.filter(text =>
        text.compareDocumentPosition(chart) & Node.DOCUMENT_POSITION_FOLLOWING).at(-1);
      const alike = before?.closest("[data-dock-group]") === chart.closest("[data-dock-group]");
      put(chart, "role", "img");
      put(chart, "aria-label", alike && before.textContent.trim() || "Chart");
    }
    for (const text of texts) put(text, "aria-hidden", "true");
  };

  const nameDrawing = () => {
    const canvas = window.__viserMutable?.canvas;
    if (!canvas) return;
    const parts = [words(".ws-title"), words("[data-value=factor]")];
    for (const value of ["mean", "max", "max at"]) {
      const text = words(`[data-value="${value}"]`);
      if (text) parts.push(`${value} ${text}`);
    }
    for (const other of all("canvas")) if (other !== canvas) put(other, "aria-hidden", "true");
    put(canvas, "role", "img");
    put(canvas, "aria-label",
      "Drawing of the deformed working volume. " + parts.filter(Boolean).join(", "));
  };

  const name = () => {
    nameInputs(); nameButtons(); nameTabs(); nameFolders(); nameCharts(); nameDrawing();
  };
  let calm = 0;
  const watch = new MutationObserver(() => { clearTimeout(calm); calm = setTimeout(name, CALM_MS); });
  watch.observe(document.body, {
    childList: true, subtree: true, attributes: true, attributeFilter: ["aria-valuenow", "class"] });
  name();

  // --- keys ---

  const TICKED = ["checkbox", "radio", "button", "submit", "file"];
  const isWritten = element => element instanceof HTMLTextAreaElement
    || (element instanceof HTMLInputElement && !TICKED.includes(element.type))
    || element?.isContentEditable;

  // no key of the app acts while an input has the focus, but in a check box there is nothing to write
  const passOn = event => {
    if (!(event.target instanceof HTMLInputElement) || isWritten(event.target)) return false;
    if ([" ", "Enter", "Tab", "Escape", "Shift", "Control", "Alt", "Meta"].includes(event.key))
      return false;
    event.stopImmediatePropagation();
    const { key, code, ctrlKey, shiftKey, altKey, metaKey } = event;
    const again = new KeyboardEvent("keydown",
      { key, code, ctrlKey, shiftKey, altKey, metaKey, bubbles: true, cancelable: true });
    if (!document.documentElement.dispatchEvent(again)) event.preventDefault();
    return true;
  };

  const search = () => {
    const label = all("p > label").find(label => label.textContent === "Find an error");
    return label?.closest("p").parentElement.parentElement.querySelector("input");
  };
  const find = () => { const box = search(); box?.focus(); box?.select(); };

  // from the search box to the number of the first error that was found, once it is there
  const toFound = tries => {
    const panel = search()?.closest("[data-dock-group]") ?? document.body;
    const boxes = all("input[data-number]", panel)
      .filter(input => input.checkVisibility());
    if (boxes.length && !tries) { boxes[0].focus(); boxes[0].select(); }
    else if (tries) setTimeout(toFound, 100, tries - 1);
  };

  addEventListener("keydown", event => {
    if (!event.isTrusted || document.getElementById("warpspace-tour")) return;
    const at = event.target, plain = !(event.ctrlKey || event.altKey || event.metaKey);
    if (event.key === "Escape") {
      const close = all(".mantine-Modal-content button").find(b => b.innerText.trim() === "Close");
      if (close) close.click();
      else if (isWritten(at) && at.getAttribute("aria-expanded") !== "true"
        && !at.closest("[role=dialog]")) {
        at.dataset.left = "1";
        at.blur();
      }
    } else if (event.key === "/" && plain && !isWritten(at)) {
      event.preventDefault();
      find();
    } else if (event.key === "Enter" && at === search()) toFound(4);
    else if ((event.key === "Enter" || event.key === " ")
        && at.matches?.("div[role=button][aria-expanded]:has(> .tabler-icon)")) {
      event.preventDefault();
      at.click();
    } else passOn(event);
  }, true);

  // chosen with the mouse, an option is done with: keys are keys again
  addEventListener("click", event => {
    if (event.isTrusted && event.detail && event.target.closest?.("[role=option]"))
      setTimeout(() => isWritten(document.activeElement) && document.activeElement.blur(), 50);
  }, true);

  window.__warpspaceAccess = { name, find };
})();
