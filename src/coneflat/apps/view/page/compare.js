// Two pages of the viewer in one, side by side or one over the other: the same views and the same display.

const NARROW = 760; // Width of the window in pixels below which one page is over the other.
const LINKED = ["show", "squares", "seams", "cones", "edges", "report", "dark", "up"];

/** Return the zoom with which a camera has as many pixels per unit as another one, if both panes have the size of the other's. */
function zoomLike(camera, leader, unitRatio = 1) {
  const fitted = ({extent}) => Math.min(leader.width / extent[0], leader.height / extent[1]);
  return (leader.zoom * fitted(leader) * unitRatio) / fitted(camera);
}

/** Give a camera the rotation, the middle and the scale of another one. */
function followInSpace(camera, leader) {
  camera.turn = [...leader.turn];
  camera.pan = [...leader.pan];
  camera.zoom = zoomLike(camera, leader);
}

/** Give the camera of a layout the UVs in the middle, and the pixels per UV, of another one. */
function followInPlane(camera, model, leader, leaderModel) {
  const unitRatio = leaderModel.uvUnit / model.uvUnit;
  camera.pan = [0, 1].map((k) => leader.pan[k] / unitRatio + (leaderModel.uvCentre[k] - model.uvCentre[k]) * model.uvUnit);
  camera.zoom = zoomLike(camera, leader, unitRatio);
}

class Comparison {
  constructor(frames) {
    this.frames = frames;
    this.viewers = frames.map((frame) => frame.contentWindow.coneflat);
    this.top = 0;
    this.isLinking = false;
    this.viewers.forEach((viewer, i) => this.link(viewer, this.viewers[1 - i]));
    for (const id of ["over", "swap"]) document.getElementById(id).addEventListener("click", () => this[id]());
    const listeners = [document, ...frames.map((frame) => frame.contentDocument)];
    for (const listener of listeners) listener.addEventListener("keydown", (event) => this.key(event));
    const watcher = new ResizeObserver(() => this.alignHeaders());
    for (const header of this.headers()) for (const part of header.children) watcher.observe(part);
    this.show(innerWidth < NARROW);
    this.follow(this.viewers[0], 0);
    this.follow(this.viewers[0], 1);
  }

  headers() {
    return this.frames.map((frame) => frame.contentDocument.querySelector("header"));
  }

  /** Give both headers the same height, so that the panes have the same size. */
  alignHeaders() {
    for (const header of this.headers()) header.style.minHeight = "";
    const height = Math.max(...this.headers().map((header) => header.offsetHeight));
    for (const header of this.headers()) header.style.minHeight = `${height}px`;
  }

  /** Let the other viewer follow one. */
  link(viewer, other) {
    viewer.panes.forEach((pane, side) => {
      const note = pane.camera.changed;
      pane.camera.changed = () => {
        note();
        this.follow(viewer, side, other);
      };
    });
    viewer.state.listen((names) => {
      const changes = LINKED.filter((name) => names.has(name)).map((name) => [name, viewer.state.get(name)]);
      const possible = changes.filter(([name, value]) => name !== "show" || value !== "own" || other.model.head.own);
      if (possible.length) other.state.set(Object.fromEntries(possible));
      this.linkThings(viewer, other, names);
    });
  }

  /** Show the hovered and the picked triangle in both, if they have the same triangles. */
  linkThings(viewer, other, names) {
    this.isSame ??= viewer.model.hasSurfaceOf(other.model);
    for (const name of ["hovered", "picked"]) {
      const thing = viewer.state.get(name);
      if (this.isSame && names.has(name) && (!thing || thing.kind === "triangle")) other.state.set({[name]: thing});
    }
  }

  follow(viewer, side, other = this.viewers.find((one) => one !== viewer)) {
    if (this.isLinking) return;
    this.isLinking = true;
    const camera = other.panes[side].camera, leader = viewer.panes[side].camera;
    if (side) followInPlane(camera, other.model, leader, viewer.model);
    else followInSpace(camera, leader);
    camera.note();
    this.isLinking = false;
  }

  key(event) {
    if (event.target.closest?.("select, input, dialog") || event.ctrlKey || event.metaKey || event.altKey) return;
    const does = {o: () => this.over(), x: () => this.swap()}[event.key];
    if (!does) return;
    event.preventDefault();
    does();
  }

  over() {
    this.show(!this.isOver);
  }

  swap() {
    this.top = 1 - this.top;
    this.show(true);
    this.frames[this.top].focus();
  }

  show(isOver) {
    this.isOver = isOver;
    document.getElementById("pair").dataset.mode = isOver ? "over" : "beside";
    document.getElementById("over").setAttribute("aria-pressed", String(isOver));
    document.getElementById("swap").hidden = !isOver;
    document.getElementById("seen").textContent = isOver ? this.frames[this.top].title : "";
    this.frames.forEach((frame, i) => frame.classList.toggle("under", isOver && i !== this.top));
  }
}

/** Start when both pages are ready; they say so themselves if they cannot be shown. */
function startWhenReady() {
  const frames = [...document.querySelectorAll("iframe")];
  if (!frames.every((frame) => frame.contentDocument?.documentElement?.dataset.ready)) {
    setTimeout(startWhenReady, 50);
    return;
  }
  window.comparison = new Comparison(frames);
  document.documentElement.dataset.ready = "true";
}

startWhenReady();
