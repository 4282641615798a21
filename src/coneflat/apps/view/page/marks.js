// The hovered and the picked thing, drawn over both views; dashed if hidden.

const RING = 11, CONE_RING = 15; // Radii in pixels; that of cones leaves the corners of their squares free.
const RING_SIZE = 14; // Pixels; smaller things are marked by a ring.
const IN_FRONT = 0.03; // Model radii; a triangle hides a thing if it is nearer by at least this distance.
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
    if (!picked && !hovered) this.seen.clear();
    for (const pane of panes) {
      pen.save();
      pen.beginPath();
      pen.rect(pane.left, pane.top, pane.width, pane.height);
      pen.clip();
      pen.translate(pane.left, pane.top);
      if (pane.inPlane && this.showsSquare) this.drawSquare(pen, pane);
      if (picked) this.drawThing(pen, pane, state, picked, ink, true, settled);
      if (hovered && !sameThing(hovered, picked)) this.drawThing(pen, pane, state, hovered, ink, false, settled);
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

  drawThing(pen, pane, state, thing, ink, strong, settled) {
    const key = [pane.name, thing.kind, thing.index].join();
    if (settled || !this.seen.has(key)) this.seen.set(key, this.isSeen(pane, thing, state));
    const seen = this.seen.get(key);
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
