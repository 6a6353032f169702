// Pictograms of the kinds of errors: symbols, named after the first word of the name of the error.
(() => {
  const PATHS = {
    positioning: "M1 13H15M3 10.5V13M8 10.5V13M13 10.5V13M3 5H12M9 2L12 5L9 8",
    straightness: "M1 13h2.5M6.8 13h2.5M12.5 13H15M1 9C4 1 7 3 8.5 6.5S12.5 12 15 4",
    roll: "M8 7.2v1.6M2.5 6A5.8 5.8 0 1 1 3 11.5M1.2 8.2L2.8 11.8L6.4 10.6",
    pitch: "M1 14H15M2 8L12 3.5L13.8 7.5L3.8 12Z",
    yaw: "M1 1.5H15M1 14.5H15M3 7.5L10.5 3.5L13 8.5L5.5 12.5Z",
    squareness: "M2.5 13.5H15M2.5 13.5L7 1.5M2.5 1.5v2M2.5 5.5v2M2.5 9.5v2",
    location: "M15 8A5.5 5.5 0 1 1 4 8A5.5 5.5 0 1 1 15 8M1 8H8M4.5 4.5V11.5M9.5 7.2v1.6",
    orientation: "M1.5 14H12.5M7 14L11.5 1.5M7 11.5v-2M7 7.5v-2M7 3.5v-2",
    radial: "M14 8A6 6 0 1 1 2 8A6 6 0 1 1 14 8M4.5 8H11M8.5 5.5L11 8L8.5 10.5",
    axial: "M14 11.5A6 2.5 0 1 1 2 11.5A6 2.5 0 1 1 14 11.5M8 11.5V1.5M5.5 4L8 1.5L10.5 4",
    tilt: "M13.6 9.6A6 2.5 -22 1 1 2.4 14A6 2.5 -22 1 1 13.6 9.6M8 11.8L4.5 2.5M8 8.5v-2M8 4.5v-2",
    angular: "M14 8A6 6 0 1 1 2 8A6 6 0 1 1 14 8M8 2V8L12.2 3.8",
  };
  const symbols = Object.entries(PATHS).map(([kind, path]) =>
    `<symbol id="ws-kind-${kind}" viewBox="0 0 16 16"><path d="${path}"/></symbol>`);
  document.getElementById("ws-page").insertAdjacentHTML("beforeend",
    `<svg class="ws-heard" aria-hidden="true">${symbols.join("")}</svg>`);
})();
