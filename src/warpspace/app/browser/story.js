// A story that is told: the columns give way to its words, keys go from step to step.
(() => {
  const page = window.warpspacePage, root = document.documentElement;
  const isTold = () => root.classList.contains("ws-told");
  let before = null;

  page.story = on => {
    if (on === isTold()) return;
    root.classList.toggle("ws-told", on);
    if (on) before = document.activeElement; else before?.focus?.({ preventScroll: true });
    if (on) root.requestFullscreen?.().catch(() => { /* the page itself is large enough */ });
    else if (document.fullscreenElement) document.exitFullscreen().catch(() => {});
  };
  // a step: how long points, colours and camera take to it, ms
  page.step = (long, camera) => {
    warpspaceMesh.glide = long;
    if (camera) warpspaceFly(camera, long);
  };
  addEventListener("keydown", event => {
    if (!isTold() || event.ctrlKey || event.metaKey || event.altKey) return;
    const press = [" ", "Enter"].includes(event.key) && event.target.closest?.("button, a, summary");
    const name = { ArrowRight: "on", " ": "on", ArrowLeft: "back", Escape: "end" }[event.key];
    event.stopImmediatePropagation();  // no other key acts on what is not to be seen
    if (press || !name) return;
    event.preventDefault();
    page.send(`story:${name}`);
  }, true);
  document.addEventListener("fullscreenchange", () => {  // left with Esc, say
    if (isTold() && !document.fullscreenElement) page.send("story:end");
  });
})();
