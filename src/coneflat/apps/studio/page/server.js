// Requests to the server, with the token in the address of the page; the server may be behind a proxy.

class Server {
  constructor() {
    this.token = new URLSearchParams(location.search).get("token") ?? "";
    this.queue = Promise.resolve();
  }

  /** Return the response; a rejected request raises an error with the message of the server, a cancelled one with "". */
  async ask(path, options = {}) {
    const answer = await fetch(path, {...options, headers: {"x-coneflat-token": this.token}, cache: "no-store"});
    if (!answer.ok || answer.status === 204) throw new Refusal(await answer.text());
    return answer;
  }

  /** Return the state as soon as it is newer than the known one; unchanged choices are taken from the known state. */
  async state(known) {
    const news = await (await this.ask(`state?after=${known?.version ?? ""}&chosen=${known?.chosen ?? ""}`)).json();
    if (news.choices) return news;
    const {choices, command, python} = known;
    return {...news, choices, command, python};
  }

  /** Return the current layout; unchanged arrays are taken from the known model. */
  async layout(known) {
    const block = await (await this.ask(`layout?known=${known?.head.number ?? ""}`)).arrayBuffer();
    const size = new DataView(block).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(block, 4, size)));
    return modelOf(head, block, 4 + size, known);
  }

  /** Perform an action, after the earlier ones, and return the version of the state with its effect. */
  async act(action) {
    const sent = this.queue.then(() => this.ask("act", {method: "POST", body: JSON.stringify(action)}));
    this.queue = sent.catch(() => {});
    return (await (await sent).json()).version;
  }

  /** Return the curve of distortion by number of cones: {counts, distortions, knee}. */
  async curve() {
    await this.queue;
    return (await this.ask("curve", {method: "POST"})).json();
  }

  /** Compute quads, approximately the given number; the page of these is `quadsPage`. */
  async quads(count) {
    await this.queue;
    return this.ask(`quads?count=${encodeURIComponent(count)}`, {method: "POST"});
  }

  async quadsPage() {
    return (await this.ask("quads")).text();
  }

  /** Cancel what is being computed. */
  cancel() {
    return this.ask("cancel", {method: "POST"});
  }

  /** Download the file at a path: the result or quads. */
  async save(path, name) {
    await this.queue;
    const content = await (await this.ask(path, {method: "POST"})).blob();
    const link = Object.assign(document.createElement("a"), {href: URL.createObjectURL(content), download: name});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }

  /** Upload and open a mesh or a project. */
  open(file) {
    return this.ask(`mesh?name=${encodeURIComponent(file.name)}`, {method: "POST", body: file});
  }
}

/** The error of a request that the server has rejected, with its message. */
class Refusal extends Error {}
