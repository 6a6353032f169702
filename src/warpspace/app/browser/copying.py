"""Buttons that copy a text, and the way from an error to its slider."""

import json

COPY_SCRIPT = """(() => {
  window.warpspaceCopy = button => {
    const text = button.dataset.copy, word = button.textContent;
    const done = () => {
      button.textContent = "copied";
      setTimeout(() => { button.textContent = word; }, 1500);
    };
    const byHand = () => {
      const area = document.createElement("textarea");
      area.value = text;
      area.style.position = "fixed";
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
      button.focus();
      done();
    };
    if (navigator.clipboard) navigator.clipboard.writeText(text).then(done, byHand);
    else byHand();
  };
  // viser flies through the scene with W: what gets through is the key without its place
  window.addEventListener("keydown", event => {
    const { target } = event;
    if (event.code !== "KeyW" || event.ctrlKey || event.metaKey || event.altKey) return;
    if (target instanceof Element && target.closest("input, textarea, select")) return;
    event.stopImmediatePropagation();
    if (!event.repeat)
      (target ?? document.body).dispatchEvent(new KeyboardEvent("keydown", {
        key: event.key, bubbles: true, cancelable: true }));
  }, true);
})();"""
"""Has to run in the page once; copies also where a page without TLS has no clipboard of its own."""


def reveal_script(label: str) -> str:
    """Write the script that opens the folder of a slider, brings it into view and focuses it.

    Parameters
    ----------
    label : str
        What the label of the slider begins with; a name of ours, no word of a user's.

    Returns
    -------
    str
        JavaScript that waits two seconds for the slider at most.
    """
    return f"""(() => {{
  const reveal = tries => {{
    const labels = [...document.querySelectorAll("[data-dock-region=left] label[for]"),
      ...document.querySelectorAll("label[for]")];
    const label = labels.find(label => label.textContent.startsWith({json.dumps(label)}));
    if (!label) return tries && setTimeout(reveal, 50, tries - 1);
    for (let part = label; part; part = part.parentElement)
      if (part.previousElementSibling && getComputedStyle(part).display === "none")
        part.previousElementSibling.click();
    setTimeout(() => {{
      const slider = document.getElementById(label.htmlFor);
      label.scrollIntoView({{ block: "center" }});
      slider?.querySelector("[role=slider]")?.focus({{ preventScroll: true }});
    }}, 300);
  }};
  reveal(40);
}})();"""
