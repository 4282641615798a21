// Charts of a map for a texture: moved in the layout, rotated, pinned, and packed around pinned ones.

const PIN_COLOUR = "#6a3fb5";

/** Complex numbers as pairs. */
const times = ([a, b], [c, d]) => [a * c - b * d, a * d + b * c];
const plus = ([a, b], [c, d]) => [a + c, b + d];

class Charts {
  constructor(studio) {
    this.studio = studio;
    this.part = (id) => document.getElementById(id);
    this.face = null; // A triangle of the selected chart, in the mesh of the user.
    this.offset = null; // [u, v] by which the selected chart is being dragged.
    for (const [id, does] of [["chart-rotate", () => this.rotate()], ["chart-pin", () => this.togglePin()], ["chart-free", () => studio.act({do: "unpin all"})]]) this.part(id).addEventListener("click", does);
    this.part("chart-pack").addEventListener("change", (event) => studio.act({do: "pack", value: event.target.checked}));
  }

  get model() {
    return this.studio.viewer?.model;
  }

  get pins() {
    return this.studio.forTexture ? (this.studio.choices.charts ?? {pins: [], packed: false}) : {pins: [], packed: false};
  }

  /** Return the charts of the layout by their number: {face, factor, shift, isPinned}, relative to the layout without pins. */
  placed() {
    const {model} = this;
    if (this.placedOf !== model) {
      this.placedOf = model;
      this.byChart = new Map((model.head.places ?? []).map(([index, face, a, b, u, v, isPinned]) => [model.arrays.chart[index], {face, factor: [a, b], shift: [u, v], isPinned: isPinned > 0}]));
    }
    return this.byChart;
  }

  /** Return the place of the chart of a triangle of the page. */
  placeAt(triangle) {
    const face = this.model.triangleNumber(triangle);
    return this.placed().get(this.model.arrays.chart[triangle]) ?? {face, factor: [1, 0], shift: [0, 0], isPinned: false};
  }

  /** Return a triangle of the page in the selected chart; -1 if none is selected. */
  selectedTriangle() {
    if (this.face === null || !this.model || !this.studio.forTexture) return -1;
    const numbers = this.model.arrays.face_numbers;
    return numbers ? numbers.indexOf(this.face) : this.face;
  }

  /** Return the chart of a triangle of the page as polylines of the layout, each two points [u, v]. */
  border(triangle) {
    const {model} = this, {outline, chart, uv, faces} = model.arrays, sides = [];
    const point = (corner) => [uv[2 * faces[corner]], uv[2 * faces[corner] + 1]];
    for (let i = 0; i < outline.length; i++) {
      if (chart[Math.floor(outline[i] / 3)] === chart[triangle]) sides.push(model.outlineCorners(i).map(point));
    }
    return sides;
  }

  /** Return the box [low, high] of points of a border. */
  boxOf(sides) {
    const points = sides.flat();
    return [Math.min, Math.max].map((pick) => [0, 1].map((k) => points.reduce((best, point) => pick(best, point[k]), points[0][k])));
  }

  // Actions.

  /** Select the chart at a pixel of the model or the layout; return a triangle of the page in it, -1 for none. */
  select(pane, x, y) {
    const thing = this.studio.viewer.renderer.pick(pane, x, y, BARE);
    const triangle = thing?.kind === "triangle" ? thing.index : -1;
    this.face = triangle < 0 ? null : this.model.triangleNumber(triangle);
    this.studio.panel.show();
    this.studio.viewer.remark();
    return triangle;
  }

  /** Pin the chart of a triangle of the page at the place after a further similarity. */
  pin(triangle, factor, shift) {
    const place = this.placeAt(triangle);
    const numbers = [...times(factor, place.factor), ...plus(times(factor, place.shift), shift)];
    this.studio.act({do: "pin", place: [place.face, ...numbers]});
  }

  /** Rotate the selected chart by a quarter turn about the middle of its box. */
  rotate() {
    const triangle = this.selectedTriangle();
    if (triangle < 0) return;
    const [low, high] = this.boxOf(this.border(triangle)), middle = low.map((value, k) => (value + high[k]) / 2);
    const [u, v] = times([0, 1], middle);
    this.pin(triangle, [0, 1], [middle[0] - u, middle[1] - v]);
  }

  togglePin() {
    const triangle = this.selectedTriangle();
    if (triangle < 0) return;
    const place = this.placeAt(triangle);
    if (place.isPinned) this.studio.act({do: "unpin", face: place.face});
    else this.pin(triangle, [1, 0], [0, 0]);
  }

  // Display.

  show() {
    const triangle = this.selectedTriangle(), {pins, packed} = this.pins, isChosen = this.studio.tools.mode === "chart";
    this.part("charts-tools").hidden = !this.studio.forTexture || !(isChosen || pins.length);
    for (const id of ["chart-rotate", "chart-pin"]) this.part(id).disabled = triangle < 0;
    this.part("chart-pin").setAttribute("aria-pressed", String(triangle >= 0 && this.placeAt(triangle).isPinned));
    this.part("chart-free").disabled = !pins.length;
    this.studio.panel.check("chart-pack", packed);
  }

  /** Draw pins in pinned charts, and the border of the selected one where it is dragged. */
  draw(pen, pane) {
    if (!pane.inPlane || !this.studio.forTexture || !this.studio.hasLayout()) return;
    const {model} = this, {overlay} = this.studio, selected = this.studio.tools.mode === "chart" ? this.selectedTriangle() : -1;
    const at = (point, [u, v] = [0, 0]) => pane.camera.project(model.planePlace(point[0] + u, point[1] + v));
    const path = (triangle, offset) => new Path2D(this.border(triangle).map(([p, q]) => `M${at(p, offset).slice(0, 2)}L${at(q, offset).slice(0, 2)}`).join(""));
    for (const [index, , , , , , isPinned] of model.head.places ?? []) {
      if (isPinned) this.nail(pen, pane, index);
    }
    if (selected >= 0) overlay.stroke(pen, path(selected, this.offset ?? [0, 0]), this.studio.viewer.accent, 2.5);
  }

  /** Draw a pin in the middle of a pinned chart. */
  nail(pen, pane, triangle) {
    const [low, high] = this.boxOf(this.border(triangle)), middle = low.map((value, k) => (value + high[k]) / 2);
    const [x, y] = pane.camera.project(this.model.planePlace(...middle)), path = new Path2D(`M${x} ${y}V${y - 12}`);
    path.arc(x, y - 15, 4, 0, 2 * Math.PI);
    this.studio.overlay.stroke(pen, path, PIN_COLOUR, 2.5);
  }
}

/** A chart that is dragged in the layout; it is pinned where it is dropped, within the texture. */
class ChartDrag {
  constructor(charts, pane, triangle, x, y) {
    Object.assign(this, {charts, pane, triangle, from: [x, y]});
    this.box = charts.boxOf(charts.border(triangle));
    // The projection of the plane is affine.
    const {model} = charts, [o, p, q] = [[0, 0], [1, 0], [0, 1]].map((uv) => pane.camera.project(model.planePlace(...uv)));
    this.axes = [[p[0] - o[0], p[1] - o[1]], [q[0] - o[0], q[1] - o[1]]];
  }

  move(x, y) {
    const [dx, dy] = [x - this.from[0], y - this.from[1]], [[a, b], [c, d]] = this.axes, whole = a * d - b * c;
    const offset = [(dx * d - dy * c) / whole, (dy * a - dx * b) / whole];
    this.charts.offset = offset.map((value, k) => Math.max(-this.box[0][k], Math.min(1 - this.box[1][k], value)));
    this.charts.studio.viewer.remark();
  }

  drop() {
    const {offset} = this.charts;
    if (offset && (offset[0] || offset[1])) this.charts.pin(this.triangle, [1, 0], offset);
  }

  stop() {
    this.charts.offset = null;
    this.charts.studio.viewer.remark();
  }
}
