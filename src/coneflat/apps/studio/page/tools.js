// What clicks and drags on the panes do: look, place cones, draw seams.

// [key, name, letter, hint]
const TOOLS = [
  ["look", "Look", "v", "Drag turns the model. Drag a cone to move it."],
  ["cone", "Cone", "a", "Click puts a cone there; drag one to move it."],
  ["cut", "Cut", "x", "Click from point to point: the shortest path between them is cut. Esc ends the line."],
  ["keep", "Keep whole", "k", "Click from point to point: no seam runs along the path between them. Esc ends the line."],
];

const BARE = {get: () => false}; // A state in which nothing but triangles is drawn, or picked.

class Tools {
  /** studio: {viewer, graph, act(action), isBusy(), select(vertex)}. */
  constructor(studio) {
    this.studio = studio;
    this.mode = "look";
    this.from = null; // where the line that is being drawn begins
    this.preview = [];
    this.dragged = null; // {from, at}: a cone, and where it is dragged to
    this.strokes = 0;
  }

  set(mode) {
    this.mode = mode;
    this.endLine();
  }

  endLine() {
    this.from = null;
    this.preview = [];
  }

  get draws() {
    return this.mode === "cut" || this.mode === "keep";
  }

  /** The vertex nearest to a pixel, of the triangle there; null beside the surface. */
  vertexAt(pane, x, y) {
    const {model, renderer} = this.studio.viewer;
    const thing = renderer.pick(pane, x, y, BARE);
    if (thing?.kind !== "triangle") return null;
    const places = model.shapeOf(thing, pane.inPlane)[0].map((place) => pane.camera.project(place));
    const far = places.map(([px, py]) => Math.hypot(px - x, py - y));
    return model.vertexAt(3 * thing.index + far.indexOf(Math.min(...far)));
  }

  // What the viewer tells.

  hover(pane, x, y) {
    if (this.from === null) return;
    const vertex = this.vertexAt(pane, x, y);
    this.preview = vertex === null ? [] : this.studio.graph().path(this.from, vertex);
    this.studio.viewer.remark();
  }

  pick(pane, x, y) {
    const {viewer} = this.studio, thing = viewer.renderer.pick(pane, x, y, viewer.state);
    if (this.mode === "look" || (this.mode === "cone" && thing?.kind === "cone")) return false;
    const vertex = this.vertexAt(pane, x, y);
    if (vertex !== null && this.draws) this.drawTo(vertex);
    if (vertex !== null && this.mode === "cone") {
      this.studio.select(vertex);
      this.studio.act({do: "add", vertex: this.studio.numberOf(vertex)});
    }
    return true;
  }

  drawTo(vertex) {
    const path = this.from === null ? [] : this.studio.graph().path(this.from, vertex);
    if (path.length > 1) this.studio.act({do: this.mode, path: path.map((v) => this.studio.numberOf(v))});
    this.from = vertex;
    this.preview = [];
    this.studio.viewer.remark();
  }

  grab(pane, x, y) {
    const {viewer} = this.studio;
    if (this.draws) return null;
    const thing = viewer.renderer.pick(pane, x, y, viewer.state);
    if (thing?.kind !== "cone") return null;
    return new Drag(this, pane, viewer.model.arrays.cones[thing.index]);
  }
}

/** A cone on its way along the surface. What follows from it is shown as often as it is there. */
class Drag {
  constructor(tools, pane, vertex) {
    Object.assign(this, {tools, pane, studio: tools.studio});
    this.stroke = `drag ${++tools.strokes} ${performance.now()}`;
    this.sent = vertex;
    tools.dragged = {from: vertex, at: vertex};
  }

  move(x, y) {
    const vertex = this.tools.vertexAt(this.pane, x, y), {dragged} = this.tools;
    if (vertex === null || vertex === dragged.at || this.studio.isCone(vertex, this.sent)) return;
    dragged.at = vertex;
    this.studio.viewer.remark();
    if (!this.studio.isBusy()) this.send();
  }

  drop() {
    this.send();
  }

  stop() {
    this.tools.dragged = null;
    this.studio.viewer.remark();
  }

  send() {
    const {at} = this.tools.dragged;
    if (at === this.sent) return;
    const [from, to] = [this.sent, at].map((vertex) => this.studio.numberOf(vertex));
    this.studio.select(at);
    this.studio.act({do: "move", vertex: from, to, stroke: this.stroke});
    this.sent = at;
  }
}
