// The private parts of viser's client; no other script names them. All are absent until viser has started.
(() => {
  const client = () => window.__viserMutable;
  window.warpspaceViser = {
    isReady: () => Boolean(client()),
    canvas: () => client()?.canvas,
    camera: () => client()?.camera,
    cameraControl: () => client()?.cameraControl,
    sendCamera: () => client()?.sendCamera?.(),
    requestRender: () => client()?.requestRender?.(),
    node: name => client()?.nodeRefFromName?.[name],
    nodeNames: () => Object.keys(client()?.nodeRefFromName ?? {}),
    pose: name => client()?.nodePoseData?.[name],
    // the transformation of the drawing in viser's world, column-major
    world: () => client()?.nodeRefFromName?.[""]?.matrixWorld?.elements,
    // a function that viser replaces with each connection
    connection: () => client()?.sendMessage,
    send: message => client().sendMessage(message),
  };
})();
