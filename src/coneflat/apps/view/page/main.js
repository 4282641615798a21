// The page at work: a model, two views of it, and what links them.

const REST = 160; // milliseconds without a move after which nothing moves
const SLOW = 45; // milliseconds for a frame from which on a machine is slow

/** A side of the page. */
class Pane {
  constructor(name, camera, inPlane, viewer) {
    Object.assign(this, {name, camera, inPlane, viewer});
    this.element = document.getElementById(name);
    camera.changed = () => {
      this.spoil();
      viewer.noteMove();
    };
  }

  /** It must be drawn again. */
  spoil() {
    this.stale = true;
    this.viewer.schedule();
  }

  /** Note where it lies on the stage. */
  place(stage) {
    const box = this.element.getBoundingClientRect();
    [this.left, this.top, this.width, this.height] = [box.left - stage.left, box.top - stage.top, box.width, box.height];
    this.camera.resize(Math.max(this.width, 1), Math.max(this.height, 1));
    this.spoil();
  }

  sees([x, y]) {
    return x > 0 && y > 0 && x < this.width && y < this.height;
  }
}

class Viewer {
  /** picture: to lay on the model, or null. */
  constructor(model, picture) {
    this.model = model;
    this.state = new State({
      show: model.head.show, squares: model.head.squares, seams: true, cones: true, edges: false, report: false,
      dark: matchMedia("(prefers-color-scheme: dark)").matches, hovered: null, picked: null,
    });
    this.panes = [
      new Pane("model", new Camera(model.arrays.places, model.head.turn.flat(), true), false, this),
      new Pane("layout", new Camera(this.flatPlaces(), [1, 0, 0, 0, 1, 0, 0, 0, 1], false), true, this),
    ];
    this.used = this.panes[0];
    this.tool = null; // What clicks and drags do instead: {hover(pane, x, y), pick(pane, x, y, reach), grab(pane, x, y, reach)}.
    this.moving = this.slowFrames = 0;
    this.renderer = new Renderer(document.getElementById("scene"), model);
    if (picture) this.renderer.setPicture(picture);
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

  /** Draw for the first time, roughly; how long that takes tells whether there is a graphics card. */
  drawFirst() {
    const start = performance.now();
    this.slowFrames = 2;
    this.drawStale();
    this.renderer.finish();
    if (performance.now() - start > SLOW) return; // It will be drawn finely a little later.
    this.slowFrames = 0;
    this.redraw();
    this.drawStale();
  }

  /** Show another model; what is seen of it stays in sight, and what is picked, if there still is such a thing. */
  takeModel(model) {
    const [space, plane] = this.panes.map((pane) => pane.camera);
    const isSame = model.hasSurfaceOf(this.model);
    // Of a large surface other triangles may be drawn now.
    const stays = isSame || (model.head.name === this.model.head.name && model.head.radius === this.model.head.radius);
    this.renderer.takeModel(model);
    this.model = this.marks.model = model;
    const picked = this.state.get("picked");
    this.state.set({hovered: null, picked: isSame && picked?.kind === "triangle" ? picked : null});
    this.marks.seen.clear();
    plane.showOthers(this.flatPlaces());
    if (!stays) {
      space.home = model.head.turn.flat();
      space.measure(model.arrays.places);
      space.fit();
    }
    this.controls.fill();
    this.controls.show();
    this.redraw();
  }

  flatPlaces() {
    const points = this.model.arrays.uv.length / 2;
    const out = new Float32Array(3 * points);
    for (let i = 0; i < points; i++) out.set(this.model.flatPlace(i), 3 * i);
    return out;
  }

  /** Some of the state has changed. */
  note(names) {
    if (names.has("dark")) this.readColours();
    if (names.has("hovered") || names.has("picked")) this.remark();
    if (["show", "squares", "seams", "cones", "edges", "dark", "marked"].some((name) => names.has(name))) this.redraw();
  }

  /** What is drawn over the views has changed. */
  remark() {
    this.marksStale = true;
    this.schedule();
  }

  redraw() {
    this.panes.forEach((pane) => pane.spoil());
  }

  /** Draw what is stale with the next frame. */
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

  /** A camera moves; when it rests, everything is drawn finely. */
  noteMove() {
    if (!this.moving) this.lastFrame = Infinity;
    clearTimeout(this.moving);
    this.moving = setTimeout(() => {
      this.moving = 0;
      this.panes.filter((pane) => pane.rough).forEach((pane) => pane.spoil());
      this.marksStale = true;
      this.schedule();
    }, REST);
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["ground", "pane", "paint", "undefined", "seam", "halo"];
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

  // What the gestures tell.

  use(pane) {
    this.used = pane;
  }

  hover(pane, x, y) {
    this.tool?.hover(pane, x, y);
    const thing = this.renderer.pick(pane, x, y, this.state);
    if (!sameThing(thing, this.state.get("hovered"))) this.state.set({hovered: thing});
  }

  /** Return who hears of a drag that begins here instead of the camera, {move(x, y), drop()}, or null. */
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

  /** Pick a thing, and bring it into sight in every view but the one where the user just saw it. */
  find(thing, except = null) {
    this.state.set({picked: thing});
    if (thing) this.panes.filter((pane) => pane !== except).forEach((pane) => this.bringIntoSight(pane, thing));
  }

  bringIntoSight(pane, thing) {
    const middles = this.model.shapeOf(thing, pane.inPlane).map(middleOf);
    const within = middles.some((middle) => pane.sees(pane.camera.project(middle)));
    if (within && this.marks.isSeen(pane, thing, this.state)) return;
    const turn = pane.inPlane ? pane.camera.turn : this.turnTowards(thing, pane.camera.turn);
    const place = turned(turn, middles[0]), {pan, scale} = pane.camera;
    const off = [0, 1].map((k) => Math.abs(place[k] - pan[k]) * scale);
    const near = off[0] < 0.4 * pane.width && off[1] < 0.4 * pane.height;
    glide(pane.camera, turn, near ? pan : place.slice(0, 2));
  }

  /** Return the least turned view in which a thing's triangle faces the user; tilted where that lies behind others. */
  turnTowards(thing, turn) {
    const [p, q, r] = this.model.shapeOf({kind: "triangle", index: this.triangleAt(thing)}, false)[0];
    const [a, b] = [q, r].map((end) => end.map((x, k) => x - p[k]));
    const out = this.model.head.outward;
    const normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]].map((x) => out * x);
    const length = Math.hypot(...normal) || 1, facing = normal.map((value) => value / length);
    const middle = middleOf(this.model.shapeOf(thing, false)[0]);
    const free = tilted(facing).find((from) => !this.model.isHidden(middle, from, IN_FRONT)) ?? facing;
    const [x, y, z] = turned(turn, free);
    const side = Math.hypot(x, y);
    const axis = side > 1e-9 ? [y / side, -x / side, 0] : [0, 1, 0];
    return straightened(product(rotation(axis, Math.atan2(side, z)), turn));
  }

  /** A triangle that a thing lies on. */
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
