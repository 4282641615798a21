// The viewer: a model, its two views, and their connection.

const REST = 160; // Milliseconds without motion after which the view counts as settled.
const SPANS = [30, 240]; // Sizes in pixels between which a thing is shown that is visited.
const MAX_UV = 10; // Largest UV for which the view of the layout contains the unit square.
const SLOW = 45; // Milliseconds per frame above which a machine counts as slow.

/** One of the two views. */
class Pane {
  constructor(name, camera, inPlane, viewer) {
    Object.assign(this, {name, camera, inPlane, viewer});
    this.element = document.getElementById(name);
    camera.changed = () => {
      this.markStale();
      viewer.noteMove();
    };
  }

  /** Mark the pane as outdated, so that it is drawn again. */
  markStale() {
    this.stale = true;
    this.viewer.schedule();
  }

  /** Measure the position of the pane on the stage. */
  place(stage) {
    const box = this.element.getBoundingClientRect();
    [this.left, this.top, this.width, this.height] = [box.left - stage.left, box.top - stage.top, box.width, box.height];
    this.camera.resize(Math.max(this.width, 1), Math.max(this.height, 1));
    this.markStale();
  }

  sees([x, y]) {
    return x > 0 && y > 0 && x < this.width && y < this.height;
  }
}

class Viewer {
  /** picture: image for the model, or null. */
  constructor(model, picture) {
    this.model = model;
    this.state = new State({
      show: model.head.show, squares: model.head.squares, seams: true, cones: true, edges: false, report: false, up: model.head.up,
      dark: matchMedia("(prefers-color-scheme: dark)").matches, hovered: null, picked: null, fault: null,
    });
    this.panes = [
      new Pane("model", new Camera(model.arrays.places, firstTurn(model.head, model.head.up), true), false, this),
      new Pane("layout", new Camera(this.flatPlaces(), [1, 0, 0, 0, 1, 0, 0, 0, 1], false), true, this),
    ];
    this.used = this.panes[0];
    this.showsSquare = false; // The view of the layout also contains the unit square.
    this.tool = null; // Alternative handler of clicks and drags: {hover(pane, x, y), pick(pane, x, y, reach), grab(pane, x, y, reach)}.
    this.moving = this.slowFrames = 0;
    this.renderer = new Renderer(document.getElementById("scene"), model);
    if (picture) this.renderer.setPicture(picture, Boolean(model.arrays.own_uv));
    this.marks = new Marks(document.getElementById("marks"), model, this.renderer);
    this.controls = new Controls(this);
    this.panes.forEach((pane) => new Gestures(pane, this));
    this.state.listen((names) => this.note(names));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => this.state.set({dark: event.matches}));
    this.renderer.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.renderer.canvas.addEventListener("webglcontextrestored", () => {
      this.renderer.prepare();
      this.redraw();
    });
    this.readColours();
    const watcher = new ResizeObserver(() => this.resize());
    for (const element of [document.getElementById("stage"), ...this.panes.map((pane) => pane.element)]) watcher.observe(element);
    this.resize();
    this.drawFirst();
  }

  /** Draw roughly for the first time; the time shows whether there is a graphics card. */
  drawFirst() {
    const start = performance.now();
    this.slowFrames = 2;
    this.drawStale();
    this.renderer.finish();
    if (performance.now() - start > SLOW) return; // It is drawn at full resolution a little later.
    this.slowFrames = 0;
    this.redraw();
    this.drawStale();
  }

  /** Show another model, with the same view and, if possible, the same picked thing. */
  takeModel(model) {
    const [space, plane] = this.panes.map((pane) => pane.camera);
    const isSame = model.hasSurfaceOf(this.model);
    // The triangles drawn of a large surface may differ.
    const stays = isSame || (model.head.name === this.model.head.name && model.head.radius === this.model.head.radius);
    this.renderer.takeModel(model);
    this.model = this.marks.model = model;
    const picked = this.state.get("picked");
    this.state.set({hovered: null, picked: isSame && picked?.kind === "triangle" ? picked : null});
    this.marks.seen.clear();
    plane.showOthers(this.flatPlaces());
    if (!stays) {
      this.state.set({up: model.head.up});
      this.setUp();
    }
    this.controls.fill();
    this.controls.show();
    this.redraw();
  }

  /** Draw the unit square in the view of the layout, with the picture behind it. */
  showUnitSquare() {
    this.marks.showsSquare = this.renderer.look.behind = true;
    const {uv_low, uv_high} = this.model.head;
    this.showsSquare = Math.max(...uv_low.map(Math.abs), ...uv_high.map(Math.abs)) <= MAX_UV;
    this.panes[1].camera.showOthers(this.flatPlaces());
  }

  /** Show the model from its first side, with the chosen axis up. */
  setUp() {
    const {camera} = this.panes[0];
    camera.home = firstTurn(this.model.head, this.state.get("up"));
    camera.measure(this.model.arrays.places);
    camera.fit();
  }

  flatPlaces() {
    const points = this.model.arrays.uv.length / 2, square = this.showsSquare ? [[0, 0], [1, 1]] : [];
    const out = new Float32Array(3 * (points + square.length));
    square.forEach(([u, v], i) => out.set(this.model.planePlace(u, v), 3 * (points + i)));
    for (let i = 0; i < points; i++) out.set(this.model.flatPlace(i), 3 * i);
    return out;
  }

  /** Handle a change of the state. */
  note(names) {
    if (names.has("dark")) this.readColours();
    if (names.has("up")) this.setUp();
    if (names.has("hovered") || names.has("picked")) this.remark();
    if (["show", "squares", "seams", "cones", "edges", "dark", "marked"].some((name) => names.has(name))) this.redraw();
  }

  /** Draw the marks over the views again. */
  remark() {
    this.marksStale = true;
    this.schedule();
  }

  redraw() {
    this.panes.forEach((pane) => pane.markStale());
  }

  /** Draw outdated panes with the next frame. */
  schedule() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame((time) => {
      this.scheduled = false;
      if (this.moving && time - this.lastFrame > SLOW && time - this.lastFrame < REST + 1000) this.slowFrames++;
      this.lastFrame = time;
      this.drawStale();
    });
  }

  /** Handle a motion of a camera; when it ends, everything is drawn at full resolution. */
  noteMove() {
    if (!this.moving) this.lastFrame = Infinity;
    clearTimeout(this.moving);
    this.moving = setTimeout(() => {
      this.moving = 0;
      this.panes.filter((pane) => pane.rough).forEach((pane) => pane.markStale());
      this.marksStale = true;
      this.schedule();
    }, REST);
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["ground", "pane", "paint", "undefined", "seam", "halo", "fold"];
    this.renderer.setColours(Object.fromEntries(names.map((name) => [name, rgb(expanded(colour(name)))])));
    this.accent = colour("accent");
  }

  resize() {
    const stage = document.getElementById("stage").getBoundingClientRect();
    const pixel = Math.min(devicePixelRatio || 1, 2);
    this.renderer.resize(stage.width, stage.height, pixel);
    this.marks.resize(stage.width, stage.height, pixel);
    this.panes.forEach((pane) => pane.place(stage));
  }

  drawStale() {
    const stale = this.panes.filter((pane) => pane.stale), rough = Boolean(this.moving) && this.slowFrames > 1;
    if (this.state.get("show") === "picture" && !this.renderer.look.picture) this.renderer.setPicture(numberedBoard());
    if (stale.length === this.panes.length) this.renderer.clear();
    for (const pane of stale) {
      this.renderer.draw(pane, this.state, rough);
      [pane.stale, pane.rough] = [false, rough];
    }
    if (stale.length || this.marksStale) {
      this.marks.draw(this.panes, this.state, this.accent, !this.moving);
      this.marksStale = false;
    }
  }

  // Handlers of gestures.

  use(pane) {
    this.used = pane;
  }

  hover(pane, x, y) {
    this.tool?.hover(pane, x, y);
    const thing = this.renderer.pick(pane, x, y, this.state);
    if (!sameThing(thing, this.state.get("hovered"))) this.state.set({hovered: thing});
  }

  /** Return a handler {move(x, y), drop()} of a drag that begins here, or null for the camera. */
  grab(pane, x, y, reach) {
    return this.tool?.grab(pane, x, y, reach) ?? null;
  }

  leave() {
    this.state.set({hovered: null});
  }

  pick(pane, x, y, reach = 0) {
    if (this.tool?.pick(pane, x, y, reach)) return;
    this.find(this.renderer.pick(pane, x, y, this.state), pane);
  }

  pickMiddle() {
    this.pick(this.used, this.used.width / 2, this.used.height / 2);
  }

  /** Pick a thing, and make it visible in all views except the one in which it was picked. */
  find(thing, except = null) {
    this.state.set({picked: thing, fault: null});
    if (thing) this.panes.filter((pane) => pane !== except).forEach((pane) => this.bringIntoSight(pane, thing));
  }

  /** Show the next place with a fault of the UVs: its largest triangle is picked, and is not small. */
  showNextFault() {
    const {faultCount, arrays} = this.model;
    const fault = faultCount ? ((this.state.get("fault") ?? -1) + 1) % faultCount : null;
    const picked = faultCount ? {kind: "triangle", index: arrays.fault_places[2 * fault]} : null;
    this.state.set({show: "faults", picked, fault});
    if (picked) this.panes.forEach((pane) => this.bringIntoSight(pane, picked, this.zoomTo(pane, picked)));
  }

  /** Pick the next seam, by the edge in its middle. */
  showNextSeam() {
    const {model, state} = this, {seam_numbers} = model.arrays, picked = state.get("picked");
    if (!model.seamCount) return;
    const next = picked?.kind === "seam" ? (seam_numbers[picked.index] + 1) % model.seams.length : 0;
    state.set({seams: true});
    this.find({kind: "seam", index: model.middleOfSeam(model.seams[next][0])});
  }

  /** Return the zoom at which a thing is neither small nor large. */
  zoomTo(pane, thing) {
    const places = this.model.shapeOf(thing, pane.inPlane)[0];
    const size = Math.max(...places.map((place) => Math.hypot(...place.map((x, k) => x - places[0][k]))));
    const span = Math.max(size * pane.camera.scale, 1e-6);
    return Math.min(pane.camera.zoom * (Math.min(Math.max(span, SPANS[0]), SPANS[1]) / span), MAX_ZOOM);
  }

  bringIntoSight(pane, thing, zoom = pane.camera.zoom) {
    const middles = this.model.shapeOf(thing, pane.inPlane).map(middleOf);
    const within = middles.some((middle) => pane.sees(pane.camera.project(middle)));
    if (zoom === pane.camera.zoom && within && this.marks.isSeen(pane, thing, this.state)) return;
    const turn = pane.inPlane ? pane.camera.turn : this.turnTowards(thing, pane.camera.turn);
    const place = rotated(turn, middles[0]), {pan, scale} = pane.camera;
    const off = [0, 1].map((k) => Math.abs(place[k] - pan[k]) * scale);
    const near = off[0] < 0.4 * pane.width && off[1] < 0.4 * pane.height;
    glide(pane.camera, turn, near && zoom === pane.camera.zoom ? pan : place.slice(0, 2), zoom);
  }

  /** Return the rotation nearest to the current one in which the triangle of a thing faces the viewer; tilted if others hide it. */
  turnTowards(thing, turn) {
    const [p, q, r] = this.model.shapeOf({kind: "triangle", index: this.triangleAt(thing)}, false)[0];
    const [a, b] = [q, r].map((end) => end.map((x, k) => x - p[k]));
    const out = this.model.head.outward;
    const normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]].map((x) => out * x);
    const length = Math.hypot(...normal) || 1, facing = normal.map((value) => value / length);
    const middle = middleOf(this.model.shapeOf(thing, false)[0]);
    const free = tilted(facing).find((from) => !this.model.isHidden(middle, from, IN_FRONT)) ?? facing;
    const [x, y, z] = rotated(turn, free);
    const side = Math.hypot(x, y);
    const axis = side > 1e-9 ? [y / side, -x / side, 0] : [0, 1, 0];
    return straightened(product(rotation(axis, Math.atan2(side, z)), turn));
  }

  /** Return a triangle at a thing. */
  triangleAt(thing) {
    if (thing.kind === "triangle") return thing.index;
    const {outline, faces, point_vertex, cones} = this.model.arrays;
    if (thing.kind === "seam") return Math.floor(outline[2 * thing.index] / 3);
    return Math.floor(faces.findIndex((point) => point_vertex[point] === cones[thing.index]) / 3);
  }

  async takePicture(blob) {
    try {
      this.renderer.setPicture(await pictureOf(blob));
      this.state.set({show: "picture"});
      this.redraw();
    } catch (error) {
      trouble(error.message);
    }
  }
}

/** Return a colour #rgb as #rrggbb. */
function expanded(colour) {
  return colour.length === 4 ? colour.replace(/[0-9a-f]/gi, "$&$&") : colour;
}

function trouble(message) {
  const place = document.getElementById("trouble");
  place.hidden = !message;
  place.textContent = message ? message[0].toUpperCase() + message.slice(1) + "." : "";
}
