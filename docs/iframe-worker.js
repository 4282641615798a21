// Search in pages that are opened as files: browsers start no workers from files, so the script of the worker runs in a
// hidden frame instead, with the same messages.

class FrameWorker extends EventTarget {
  constructor(address) {
    super();
    this.frame = document.createElement("iframe");
    this.frame.hidden = true;
    this.frame.title = "Search";
    this.frame.receive = (data) => this.dispatchEvent(new MessageEvent("message", {data}));
    const source = new URL(address, document.baseURI).href.replaceAll("&", "&amp;").replaceAll('"', "&quot;");
    this.frame.srcdoc =
      "<script>window.postMessage = (data) => window.frameElement.receive(data);</script>" +
      `<script src="${source}"></script>`;
    this.isReady = new Promise((done) => this.frame.addEventListener("load", done, {once: true}));
    document.body.append(this.frame);
  }

  async postMessage(data) {
    await this.isReady;
    const {contentWindow} = this.frame;
    contentWindow.dispatchEvent(new contentWindow.MessageEvent("message", {data}));
  }

  terminate() {
    this.frame.remove();
  }
}

if (location.protocol === "file:") window.Worker = FrameWorker;
