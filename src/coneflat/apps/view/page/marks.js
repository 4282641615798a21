// The hovered and the picked thing, drawn over both views; dashed if hidden.

const RING = 11, CONE_RING = 15; // Radii in pixels; that of cones leaves the corners of their squares free.
const RING_SIZE = 14; // Pixels; smaller things are marked by a ring.
const IN_FRONT = 0.03; // Model radii; a triangle hides a thing if it is nearer by at least this distance.
const NAME_OFFSET = 20; // Distance in pixels of the name of a seam from it, more than a ring.
const NAME_SPACE = [28, 16]; // Smallest distances in pixels of names side by side, and of names above each other.
const NUMBER_INK = "#15181c", FONT = "600 14px system-ui, sans-serif";
const UNSEEN = "rgba(0, 0, 0, 0.01)";

class Marks {
  constructor(canvas, model, renderer) {
    this.canvas = canvas;
    this.model = model;
    this.renderer = renderer;
    this.seen = new Map();
    this.showsSquare = false; // Whether the unit square is drawn in the layout.
    this.overlay = null; // A function (pen, pane) that draws further things over a pane.
  }

  resize(width, height, pixel) {
    this.pixel = pixel;
    sizeCanvas(this.canvas, width * pixel, height * pixel);
  }

  /** settled: whether nothing moves; otherwise the visibility is not computed again. */
  draw(panes, state, ink, settled) {
    const pen = this.canvas.getContext("2d");
    pen.setTransform(this.pixel, 0, 0, this.pixel, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.fillStyle = UNSEEN; // Chromium may show the old content where nothing is drawn after clearing.
    pen.fillRect(0, 0, 1, 1);
    const [picked, hovered] = [state.get("picked"), state.get("hovered")];
    if (settled) this.seen.clear();
    const seams = [picked, hovered].filter((thing) => thing?.kind === "seam");
    for (const pane of panes) {
      pen.save();
      pen.beginPath();
      pen.rect(pane.left, pane.top, pane.width, pane.height);
      pen.clip();
      pen.translate(pane.left, pane.top);
      if (pane.inPlane && this.showsSquare) this.drawSquare(pen, pane);
      for (const {index} of seams) this.drawSeam(pen, pane, state, index, ink);
      if (picked) this.drawThing(pen, pane, state, picked, ink, true);
      if (hovered && !sameThing(hovered, picked)) this.drawThing(pen, pane, state, hovered, ink, hovered.kind === "seam");
      this.drawNumbers(pen, pane, state);
      for (const {index} of seams) this.drawSeamNames(pen, pane, state, index, ink);
      this.overlay?.(pen, pane);
      pen.restore();
    }
  }

  /** Draw the outline of the unit square of the texture. */
  drawSquare(pen, pane) {
    const path = new Path2D();
    [[0, 0], [1, 0], [1, 1], [0, 1]].forEach(([u, v], i) => {
      const [x, y] = pane.camera.project(this.model.planePlace(u, v));
      if (i) path.lineTo(x, y);
      else path.moveTo(x, y);
    });
    path.closePath();
    pen.strokeStyle = "#808890";
    pen.lineWidth = 1;
    pen.setLineDash([5, 4]);
    pen.stroke(path);
    pen.setLineDash([]);
  }

  /** Return whether a thing was visible when the view came to rest, or when it was first drawn after that. */
  wasSeen(pane, thing, state) {
    const key = [pane.name, thing.kind, thing.index].join();
    if (!this.seen.has(key)) this.seen.set(key, this.isSeen(pane, thing, state));
    return this.seen.get(key);
  }

  /** Draw the whole seam of an edge, both of its sides in the layout; dashed where it is hidden. */
  drawSeam(pen, pane, state, edge, ink) {
    const [seen, hidden] = [new Path2D(), new Path2D()];
    for (const index of this.model.edgesOfSeam(edge)) {
      const thing = {kind: "seam", index}, path = this.wasSeen(pane, thing, state) ? seen : hidden;
      for (const [begin, end] of this.model.shapeOf(thing, pane.inPlane)) {
        path.moveTo(...pane.camera.project(begin).slice(0, 2));
        path.lineTo(...pane.camera.project(end).slice(0, 2));
      }
    }
    pen.lineCap = "round";
    for (const [path, dashes] of [[hidden, [2, 5]], [seen, []]]) {
      pen.setLineDash(dashes);
      for (const [style, width] of [["#ffffff", 5], [ink, 2.4]]) {
        pen.strokeStyle = style;
        pen.lineWidth = width;
        pen.stroke(path);
      }
    }
    pen.setLineDash([]);
  }

  /** Write the names of the seam of an edge, if it has any, beside the middle of each of its sides; where they would cover each other, that of the edge comes first. */
  drawSeamNames(pen, pane, state, edge, ink) {
    const written = [];
    for (const index of this.model.namedEdges(edge)) {
      const middle = {kind: "seam", index};
      if (!this.wasSeen(pane, middle, state)) continue;
      this.model.shapeOf(middle, pane.inPlane).forEach((ends, side) => {
        const [x, y] = middleOf(ends.map((end) => pane.camera.project(end)));
        const [inner, down] = pane.camera.project(this.model.oppositePlace(2 * index + side, pane.inPlane));
        const far = NAME_OFFSET / (Math.hypot(inner - x, down - y) || 1);
        const place = [x + far * (inner - x), y + far * (down - y)];
        if (written.some((other) => Math.abs(other[0] - place[0]) < NAME_SPACE[0] && Math.abs(other[1] - place[1]) < NAME_SPACE[1])) return;
        written.push(place);
        this.write(pen, this.model.nameAt(index), place, ink);
      });
    }
  }

  /** Write the numbers of pieces, if there are pieces. */
  drawNumbers(pen, pane, state) {
    this.model.arrays.anchors.forEach((index, piece) => {
      const triangle = {kind: "triangle", index};
      if (!this.wasSeen(pane, triangle, state)) return;
      const corners = this.model.shapeOf(triangle, pane.inPlane)[0].map((corner) => pane.camera.project(corner));
      this.write(pen, String(piece + 1), middleOf(corners), NUMBER_INK);
    });
  }

  /** Write a text with a halo around a place in pixels. */
  write(pen, text, [x, y], ink) {
    Object.assign(pen, {font: FONT, textAlign: "center", textBaseline: "middle", lineJoin: "round"});
    Object.assign(pen, {strokeStyle: "#ffffff", lineWidth: 5, fillStyle: ink});
    pen.strokeText(text, x, y);
    pen.fillText(text, x, y);
  }

  drawThing(pen, pane, state, thing, ink, strong) {
    const seen = this.wasSeen(pane, thing, state);
    for (const ends of this.model.shapeOf(thing, pane.inPlane)) {
      const places = ends.map((end) => pane.camera.project(end));
      const span = Math.max(...places.map(([x, y]) => Math.hypot(x - places[0][0], y - places[0][1])));
      const path = new Path2D();
      places.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
      if (thing.kind === "triangle") path.closePath();
      if (span < RING_SIZE) {
        const [x, y] = middleOf(places);
        const radius = thing.kind === "cone" ? CONE_RING : RING;
        path.moveTo(x + radius, y);
        path.arc(x, y, radius, 0, 2 * Math.PI);
      }
      pen.lineJoin = pen.lineCap = "round";
      pen.setLineDash(seen ? [] : [4, 5]);
      if (thing.kind === "triangle" && seen && span >= RING_SIZE) {
        pen.fillStyle = ink + (strong ? "55" : "33");
        pen.fill(path);
      }
      for (const [style, width] of [["#ffffff", strong ? 6 : 4.5], [ink, strong ? 3.2 : 2]]) {
        pen.strokeStyle = style;
        pen.lineWidth = width;
        pen.stroke(path);
      }
      pen.setLineDash([]);
    }
  }

  /** Return whether a thing is visible; in the layout everything is. */
  isSeen(pane, thing, state) {
    if (pane.inPlane) return true;
    const places = this.model.shapeOf(thing, false)[0].map((end) => pane.camera.project(end));
    const [x, y, near] = middleOf(places);
    const front = this.renderer.pick(pane, x, y, state);
    if (!front) return false;
    if (sameThing(front, thing)) return true;
    const other = middleOf(this.model.shapeOf(front, false)[0].map((end) => pane.camera.project(end)));
    return other[2] < near + IN_FRONT;
  }
}

function middleOf(places) {
  return [0, 1, 2].map((k) => places.reduce((sum, place) => sum + place[k], 0) / places.length);
}
