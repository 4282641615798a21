// Tools for clicks and drags on the panes: look, place cones, draw seams.

// [key, name, letter, hint]
const TOOLS = [
  ["look", "Look", "v", "Drag to rotate the model. Drag a cone to move it."],
  ["cone", "Cone", "a", "Click to add a cone; drag a cone to move it."],
  ["cut", "Cut", "x", "Click points: the shortest paths between them are cut. Esc, or Cut again, ends the path."],
  ["keep", "Keep whole", "k", "Click points: the shortest paths between them are not cut. Esc, or Keep whole again, ends the path."],
  ["chart", "Chart", "j", "Drag a chart in the layout to move it; click one to rotate or pin it."],
  ["corner", "Corner", "o", "Click four points of the boundary: the corners of a rectangle. Click a corner to remove it."],
];
const CHART_TOOLS = ["chart"]; // Without effect on conformal maps.
const CONE_TOOLS = ["cone", "corner", "no_cone", "importance"]; // Without effect on maps for textures.
const PICK_RADIUS = 12; // Pick radius of a click in pixels.
const CONE_RADIUS = 5; // That of a cone, which a seam in front may cover.

const BARE = {get: () => false}; // A state in which only triangles are drawn and picked.

class Tools {
  /** studio: {viewer, pathBetween(vertex, other), act(action), isBusy(), select(vertex)}. */
  constructor(studio) {
    this.studio = studio;
    this.mode = "look";
    this.from = null; // Start of the path that is being drawn.
    this.preview = [];
    this.dragged = null; // {from, at}: a cone, and the vertex that it is dragged to.
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

  get paints() {
    return BRUSHES.some(([layer]) => layer === this.mode);
  }

  get draws() {
    return this.mode === "cut" || this.mode === "keep";
  }

  /** Return the vertex nearest to a pixel, of the triangle there; null outside the surface. */
  vertexAt(pane, x, y) {
    const {model, renderer} = this.studio.viewer;
    const thing = renderer.pick(pane, x, y, BARE);
    if (thing?.kind !== "triangle") return null;
    const places = model.shapeOf(thing, pane.inPlane)[0].map((place) => pane.camera.project(place));
    const far = places.map(([px, py]) => Math.hypot(px - x, py - y));
    return model.vertexAt(3 * thing.index + far.indexOf(Math.min(...far)));
  }

  cornersAt(pane, x, y) {
    const {model, renderer} = this.studio.viewer;
    const thing = renderer.pick(pane, x, y, BARE);
    return thing?.kind === "triangle" ? [0, 1, 2].map((k) => model.vertexAt(3 * thing.index + k)) : [];
  }

  /** Return the point of the model at a pixel, in parallel projection. */
  placeAt(pane, x, y) {
    const {model} = this.studio.viewer, places = this.cornersAt(pane, x, y).map((vertex) => model.place(vertex));
    const [a, b, c] = places.map((place) => pane.camera.project(place));
    const area = (p, q, r) => (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    const whole = area(a, b, c), at = [x, y];
    const shares = Math.abs(whole) > 1e-9 ? [area(at, b, c), area(a, at, c), area(a, b, at)].map((part) => part / whole) : [1 / 3, 1 / 3, 1 / 3];
    return [0, 1, 2].map((k) => shares.reduce((sum, share, i) => sum + share * places[i][k], 0));
  }

  /** Return the boundary vertex at a click; null if there is none. */
  boundaryVertexAt(pane, x, y) {
    const {studio} = this, {model} = studio.viewer, boundary = studio.boundaryVertices();
    const off = (vertex) => Math.min(...studio.overlay.places(pane, vertex).map(([px, py]) => Math.hypot(px - x, py - y)));
    const picked = studio.verticesOf(studio.choices.corners ?? []).find((vertex) => off(vertex) <= PICK_RADIUS);
    if (picked !== undefined) return picked;
    const nearest = this.vertexAt(pane, x, y);
    if (nearest === null || pane.inPlane) return leastOf(boundary, off);
    // Hidden vertices may be at the same pixel.
    const [px, py, pz] = model.place(nearest);
    return leastOf(boundary, (vertex) => Math.hypot(...model.place(vertex).map((value, k) => value - [px, py, pz][k])));
  }

  // Handlers of the viewer.

  hover(pane, x, y) {
    if (this.paints) {
      this.studio.brush.at = {pane, x, y};
      this.studio.viewer.remark();
    }
    if (this.from === null) return;
    const vertex = this.vertexAt(pane, x, y);
    this.preview = vertex === null ? [] : this.studio.verticesOf(this.studio.pathBetween(this.from, vertex));
    this.studio.viewer.remark();
  }

  /** Return the cone at a pixel, or the nearest visible one within a number of pixels; null if there is none. */
  coneAt(pane, x, y, reach) {
    const {viewer} = this.studio, {model} = viewer;
    if (this.studio.forTexture) return null;
    const thing = viewer.renderer.pick(pane, x, y, viewer.state);
    if (thing?.kind === "cone") return thing;
    if (!viewer.state.get("cones")) return null;
    const off = (index) => Math.min(...this.studio.overlay.places(pane, model.arrays.cones[index]).map(([px, py]) => Math.hypot(px - x, py - y)));
    const isNear = (index) => off(index) <= Math.max(reach ?? 0, CONE_RADIUS) && viewer.marks.isSeen(pane, {kind: "cone", index}, viewer.state);
    const index = leastOf(Array.from({length: model.coneCount}, (_, one) => one).filter(isNear), off);
    return index === null ? null : {kind: "cone", index};
  }

  pick(pane, x, y, reach) {
    const cone = ["look", "cone"].includes(this.mode) ? this.coneAt(pane, x, y, reach) : null;
    if (cone) this.studio.viewer.find(cone, pane);
    if (cone || this.mode === "look") return Boolean(cone);
    if (this.mode === "chart") return this.studio.panel.charts.select(pane, x, y) >= 0;
    const vertex = this.vertexAt(pane, x, y);
    if (vertex !== null && this.draws) this.drawTo(vertex);
    if (vertex !== null && this.paints) this.studio.brush.dab(pane, x, y);
    if (this.mode === "corner") this.corner(pane, x, y);
    if (vertex !== null && this.mode === "cone") {
      this.studio.select(vertex);
      this.studio.act({do: "add", vertex: this.studio.numberOf(vertex)});
    }
    return true;
  }

  drawTo(vertex) {
    const path = this.from === null ? [] : this.studio.pathBetween(this.from, vertex);
    if (path.length > 1) this.studio.act({do: this.mode, path});
    this.from = vertex;
    this.preview = [];
    this.studio.viewer.remark();
  }

  corner(pane, x, y) {
    const vertex = this.boundaryVertexAt(pane, x, y);
    if (vertex === null) this.studio.refuse(new Refusal("this model has no boundary for corners"));
    else this.studio.act({do: "corner", vertex: this.studio.numberOf(vertex)});
  }

  grab(pane, x, y, reach) {
    if (this.paints) return this.vertexAt(pane, x, y) === null ? null : new Stroke(this.studio.brush, pane, x, y);
    if (this.draws || this.mode === "corner") return null;
    if (this.mode === "chart") {
      const {charts} = this.studio.panel, triangle = pane.inPlane ? charts.select(pane, x, y) : -1;
      return triangle < 0 ? null : new ChartDrag(charts, pane, triangle, x, y);
    }
    const cone = this.coneAt(pane, x, y, reach);
    return cone && new Drag(this, pane, this.studio.viewer.model.arrays.cones[cone.index]);
  }
}

/** Return the value that minimises a function; null if there are no values. */
function leastOf(values, function_) {
  let best = null, least = Infinity;
  for (const value of values) {
    const now = function_(value);
    if (now < least) [best, least] = [value, now];
  }
  return best;
}

/** A cone that is dragged along the surface. Each layout is shown as soon as it is computed. */
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
