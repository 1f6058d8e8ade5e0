// Pages that are opened as files may start no worker, so their search would find nothing. There, and only there, Worker is an
// inline frame that runs the same script: messages pass between the two windows as they do between a page and its worker.
if (location.protocol === "file:")
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      // What the script expects of a worker: to send with one argument, and to load others.
      frame.srcdoc = `<script>
        const toPage = window.parent;
        window.postMessage = (data) => toPage.postMessage(data, "*");
        window.importScripts = (...urls) => Promise.all(urls.map((url) => new Promise((loaded, failed) => {
          const script = Object.assign(document.createElement("script"), {src: url, onload: loaded, onerror: failed});
          document.head.append(script);
        })));
      </script><script src="${new URL(url, document.baseURI)}"></script>`;
      this.frame = frame;
      this.ready = new Promise((loaded) => frame.addEventListener("load", loaded, {once: true}));
      window.addEventListener("message", (event) => {
        if (event.source !== frame.contentWindow) return;
        const message = new MessageEvent("message", {data: event.data});
        this.dispatchEvent(message);
        if (this.onmessage) this.onmessage(message);
      });
      document.body.append(frame);
    }
    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", {data, source: window})));
    }
    terminate() {
      this.frame.remove();
    }
  };
