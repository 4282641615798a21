// The paint on the surface, and the brush.

// [layer, name, letter, hint]
const BRUSHES = [
  ["no_cone", "No cones", "p", "Paint where searches must not place cones."],
  ["no_seam", "No seams", "b", "Paint where there must be no seams."],
  ["importance", "Important", "i", "Paint regions that must have less distortion."],
  ["erase", "Erase", "e", "Erase the paint."],
];
const RADII = {least: 4, most: 150}; // pixels
const SAMPLES_A_RADIUS = 2; // Samples of a stroke per radius of the brush.
const MAX_SHADED_WEIGHT = 1000; // Importance at which the colour is saturated.

/** Return numbers as a text of ranges: "3-17 20". */
function regionText(numbers) {
  const sorted = Float64Array.from(numbers).sort(), words = [];
  for (let i = 0, j; i < sorted.length; i = j) {
    for (j = i + 1; j < sorted.length && sorted[j] <= sorted[j - 1] + 1; ) j++;
    words.push(sorted[j - 1] === sorted[i] ? `${sorted[i]}` : `${sorted[i]}-${sorted[j - 1]}`);
  }
  return words.join(" ");
}

/** Return the numbers in such a text. */
function* regionNumbers(text) {
  for (const word of text.split(" ").filter(Boolean)) {
    const [first, last = first] = word.split("-").map(Number);
    for (let number = first; number <= last; number++) yield number;
  }
}

/** The paint, in the form for the graphics card. */
class Paint {
  constructor(studio) {
    this.studio = studio;
    this.shown = this.preview = null; // {layer, weight, numbers} of the current stroke.
  }

  /** Show the chosen paint if it has changed, and a stroke. */
  show() {
    const {viewer} = this.studio;
    if (!viewer) return;
    const key = JSON.stringify(this.chosen);
    if (this.shown?.model === viewer.model && this.shown.key === key && this.shown.preview === this.preview?.numbers.size) return;
    this.shown = {model: viewer.model, key, preview: this.preview?.numbers.size};
    viewer.renderer.setMarks(this.isBare() ? null : this.marks());
    viewer.redraw();
  }

  /** Update after a possible change of the choices. */
  hear() {
    if (this.preview?.sent) this.preview = null;
    this.show();
  }

  /** Show the chosen paint only, without a stroke. */
  forget() {
    this.preview = null;
    this.show();
  }

  /** The chosen paint that has an effect on the map. */
  get chosen() {
    const {choices, forTexture} = this.studio, {no_seam, ...more} = choices.paint ?? {};
    return {...(no_seam ? {no_seam} : {}), ...(forTexture ? {} : more)};
  }

  isBare() {
    return !Object.keys(this.chosen).length && !this.preview;
  }

  marks() {
    const {arrays} = this.studio.viewer.model, paint = this.chosen;
    const looks = new Uint8Array(arrays.places.length);
    const set = (vertices, layer, weight) => {
      const [channel, value] = {no_cone: [0, 255], no_seam: [1, 255], importance: [2, toneOf(weight)]}[layer] ?? [];
      for (const vertex of vertices) {
        if (layer === "erase") looks.fill(0, 3 * vertex, 3 * vertex + 3);
        else looks[3 * vertex + channel] = value;
      }
    };
    const chosen = (text) => this.studio.verticesOf([...regionNumbers(text)]);
    for (const flag of ["no_cone", "no_seam"]) if (paint[flag]) set(chosen(paint[flag]), flag);
    for (const [weight, text] of Object.entries(paint.importance ?? {})) set(chosen(text), "importance", Number(weight));
    if (this.preview) set(this.studio.verticesOf([...this.preview.numbers]), this.preview.layer, this.preview.weight);
    const out = new Uint8Array(4 * arrays.faces.length);
    for (let c = 0; c < arrays.faces.length; c++) {
      const vertex = 3 * arrays.point_vertex[arrays.faces[c]];
      for (let k = 0; k < 3; k++) out[4 * c + k] = looks[vertex + k];
    }
    return out;
  }

  /** Return the number of vertices painted with a layer. */
  count(layer) {
    const paint = this.studio.choices.paint ?? {};
    const texts = layer === "importance" ? Object.values(paint.importance ?? {}) : [paint[layer] ?? ""];
    let sum = 0;
    for (const word of texts.join(" ").split(" ").filter(Boolean)) {
      const [first, last = first] = word.split("-").map(Number);
      sum += last - first + 1;
    }
    return sum;
  }
}

/** Return the tone of an importance, a byte; it is above half, so that the region is visible. */
function toneOf(weight) {
  return weight === 1 ? 0 : Math.round(255 * (0.6 + 0.4 * Math.min(Math.max(Math.log(weight) / Math.log(MAX_SHADED_WEIGHT), 0), 1)));
}

class Brush {
  constructor(studio) {
    this.studio = studio;
    this.radius = 28; // pixels
    this.weight = 10;
    this.at = null; // Position of the brush, {pane, x, y}.
  }

  grow(factor) {
    this.radius = Math.min(Math.max(Math.round(this.radius * factor), RADII.least), RADII.most);
    this.studio.viewer?.remark();
  }

  /** Return the numbers of the vertices under the brush: on the model, those connected to its middle. */
  numbersAt(pane, x, y) {
    const {studio} = this, {tools} = studio;
    const nearest = tools.vertexAt(pane, x, y);
    if (nearest === null) return [];
    const far = this.radius / pane.camera.scale;
    const found = pane.inPlane
      ? studio.standingFor(this.inPlane(pane, x, y, far).add(nearest))
      : this.around(tools.placeAt(pane, x, y), studio.inSurface(tools.cornersAt(pane, x, y)), far);
    return [studio.numberOf(nearest), ...[...found].map((vertex) => studio.surface().numberOf(vertex))].filter((number) => number >= 0);
  }

  inPlane(pane, x, y, far) {
    const {camera} = pane, {model} = this.studio.viewer, {point_vertex} = model.arrays, found = new Set();
    const middle = [camera.pan[0] + (x - pane.width / 2) / camera.scale, camera.pan[1] - (y - pane.height / 2) / camera.scale];
    for (let point = 0; point < point_vertex.length; point++) {
      const [u, v] = model.flatPlace(point);
      if (Math.hypot(u - middle[0], v - middle[1]) <= far) found.add(point_vertex[point]);
    }
    return found;
  }

  around(middle, corners, far) {
    const graph = this.studio.graph(), {places} = this.studio.surface();
    const isNear = (v) => Math.hypot(places[3 * v] - middle[0], places[3 * v + 1] - middle[1], places[3 * v + 2] - middle[2]) <= far;
    const found = new Set(corners.filter(isNear)), waiting = [...found];
    while (waiting.length) {
      const vertex = waiting.pop();
      for (let k = graph.start[vertex]; k < graph.start[vertex + 1]; k++) {
        const other = graph.ends[k];
        if (found.has(other) || !isNear(other)) continue;
        found.add(other);
        waiting.push(other);
      }
    }
    return found;
  }

  /** Paint at a click. */
  dab(pane, x, y) {
    const stroke = new Stroke(this, pane, x, y);
    stroke.drop();
    stroke.stop();
  }

  draw(pen, pane) {
    if (!this.studio.tools.paints || this.at?.pane !== pane) return;
    const path = new Path2D();
    path.arc(this.at.x, this.at.y, this.radius, 0, 2 * Math.PI);
    this.studio.overlay.stroke(pen, path, "#20262c", 1.6);
  }
}

/** A stroke of the brush: shown immediately, and chosen when it ends. */
class Stroke {
  constructor(brush, pane, x, y) {
    Object.assign(this, {brush, pane, studio: brush.studio, layer: brush.studio.tools.mode});
    this.numbers = new Set(); // of vertices
    this.last = [x, y];
    this.add(x, y);
  }

  add(x, y) {
    for (const number of this.brush.numbersAt(this.pane, x, y)) this.numbers.add(number);
    this.brush.at = {pane: this.pane, x, y};
    this.studio.paint.preview = {layer: this.layer, weight: this.brush.weight, numbers: this.numbers};
    this.studio.paint.show();
    this.studio.viewer.remark();
  }

  move(x, y) {
    const [a, b] = this.last, steps = Math.ceil((SAMPLES_A_RADIUS * Math.hypot(x - a, y - b)) / this.brush.radius) || 1;
    for (let k = 1; k <= steps; k++) this.add(a + ((x - a) * k) / steps, b + ((y - b) * k) / steps);
    this.last = [x, y];
  }

  drop() {
    const {studio, brush, layer} = this;
    const where = regionText(this.numbers);
    if (!where) return;
    studio.paint.preview.sent = true;
    studio.act({do: "paint", layer, where, ...(layer === "importance" ? {weight: brush.weight} : {})});
  }

  stop() {
    if (!matchMedia("(hover: hover)").matches) this.brush.at = null; // A lifted finger has no position.
    if (!this.studio.paint.preview?.sent) this.studio.paint.forget();
  }
}
