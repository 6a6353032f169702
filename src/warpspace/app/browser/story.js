// The player of a story: its text replaces the columns, keys move from step to step.
(() => {
  const page = window.warpspacePage, root = document.documentElement;
  const isPlaying = () => root.classList.contains("ws-playing");
  let before = null;

  page.story = on => {
    if (on === isPlaying()) return;
    root.classList.toggle("ws-playing", on);
    if (on) before = document.activeElement; else before?.focus?.({ preventScroll: true });
    if (on) root.requestFullscreen?.().catch(() => { /* stays in the window */ });
    else if (document.fullscreenElement) document.exitFullscreen().catch(() => {});
  };
  page.fly = warpspaceFly;
  // a step: duration of the animation of points, colours and camera, ms
  page.step = (duration, camera) => {
    warpspaceMesh.glide = duration;
    if (camera) warpspaceFly(camera, duration);
  };
  addEventListener("keydown", event => {
    if (!isPlaying() || event.ctrlKey || event.metaKey || event.altKey) return;
    const press = [" ", "Enter"].includes(event.key) && event.target.closest?.("button, a, summary, select");
    const action = { ArrowRight: "next_step", " ": "next_step", ArrowLeft: "previous_step",
      Home: "first_step", End: "last_step", Escape: "end_story",
      p: { do: "InputValue", input: "play" } }[event.key];
    event.stopImmediatePropagation();  // hidden parts of the page must not react
    if (press || !action) return;
    event.preventDefault();
    page.send(action);
  }, true);
  document.addEventListener("fullscreenchange", () => {  // for example with Esc
    if (isPlaying() && !document.fullscreenElement) page.send("end_story");
  });
})();
