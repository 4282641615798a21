// What the page asks of the server, always with the token of its address, and where that is: perhaps behind a proxy.

class Server {
  constructor() {
    this.token = new URLSearchParams(location.search).get("token") ?? "";
    this.queue = Promise.resolve();
  }

  /** Return an answer; a refusal is an error with the server's words. */
  async ask(path, options = {}) {
    const answer = await fetch(path, {...options, headers: {"x-coneflat-token": this.token}, cache: "no-store"});
    if (!answer.ok) throw new Refusal(await answer.text());
    return answer;
  }

  /** Return what there is to know, once it is newer than what was known; choices that are the same are taken from that. */
  async state(known) {
    const news = await (await this.ask(`state?after=${known?.version ?? ""}&chosen=${known?.chosen ?? ""}`)).json();
    if (news.choices) return news;
    const {choices, command, python} = known;
    return {...news, choices, command, python};
  }

  /** Return the layout that is shown now; arrays that a model from here has, too, are taken from that. */
  async layout(known) {
    const block = await (await this.ask(`layout?known=${known?.head.number ?? ""}`)).arrayBuffer();
    const size = new DataView(block).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(block, 4, size)));
    return modelOf(head, block, 4 + size, known);
  }

  /** Do something, after what was asked for before. */
  act(action) {
    const sent = this.queue.then(() => this.ask("act", {method: "POST", body: JSON.stringify(action)}));
    this.queue = sent.catch(() => {});
    return sent;
  }

  /** Return how distortion falls with more cones: {counts, distortions, knee}. */
  async curve() {
    await this.queue;
    return (await this.ask("curve", {method: "POST"})).json();
  }

  /** Hand what is at a path, the result or quads, to the browser as a file. */
  async save(path, name) {
    await this.queue;
    const content = await (await this.ask(path, {method: "POST"})).blob();
    const link = Object.assign(document.createElement("a"), {href: URL.createObjectURL(content), download: name});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }

  /** Send a mesh or a project, to work on it. */
  open(file) {
    return this.ask(`mesh?name=${encodeURIComponent(file.name)}`, {method: "POST", body: file});
  }
}

/** The server does not do what it is asked for, and says why. */
class Refusal extends Error {}
