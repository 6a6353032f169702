// A page hands over the token of its tab, and its width in CSS pixels, as soon as it is connected.
(carrier => {
  const KEY = "warpspace-tab";
  let token = window.__warpspaceTab, tries = 0;
  try { token = sessionStorage.getItem(KEY) || token; } catch { /* it lives as long as the page */ }
  token ||= [...crypto.getRandomValues(new Uint8Array(16))]
    .map(byte => byte.toString(16).padStart(2, "0")).join("");
  window.warpspaceRename = name => {
    window.__warpspaceTab = name;
    try { sessionStorage.setItem(KEY, name); } catch { /* as above */ }
  };
  window.warpspaceRename(token);
  const hand = () => {
    const viewer = window.__viserMutable;
    if (viewer) viewer.sendMessage({ type: "GuiUpdateMessage", uuid: carrier,
      updates: { value: token, width: innerWidth } });
    else if (tries++ < 200) setTimeout(hand, 25);
  };
  hand();
})
