// Search in the book opened from the disk, where browsers start no worker: its script runs in a frame instead. The theme's
// plugin `offline`, which puts the index of the search into a script, looks for a file of this name.

class FrameWorker extends EventTarget {
  constructor(url) {
    super();
    const frame = document.createElement("iframe");
    frame.hidden = true;
    document.body.append(frame);
    this.inside = frame.contentWindow;
    // What the script of a worker has around it.
    const around = `
      postMessage = data => parent.postMessage(data, "*");
      importScripts = (...scripts) => scripts.reduce((before, src) => before.then(() => new Promise(onload => {
        document.body.append(Object.assign(document.createElement("script"), { src, onload }));
      })), Promise.resolve());`;
    this.inside.document.write(`<body><script>${around}</script><script src="${url}"></script></body>`);
    this.inside.document.close();
    // Writing forgets what listened before.
    this.ready = new Promise(loaded => { this.inside.onload = loaded; });
    addEventListener("message", ({ source, data }) => {
      if (source === this.inside) this.dispatchEvent(new MessageEvent("message", { data }));
    });
  }

  postMessage(data) {
    this.ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })));
  }
}

if (location.protocol === "file:") window.Worker = FrameWorker;
