// An orthographic camera; its rotation has rows to the right, up, and towards the eye.

const MARGIN = 0.94; // Fraction of the pane that the model fills after fitting.
const MAX_ZOOM = 5000;
const MIN_ZOOM = 0.05;

/** Return the matrix product turn * point. */
function rotated(turn, p) {
  return [0, 3, 6].map((row) => turn[row] * p[0] + turn[row + 1] * p[1] + turn[row + 2] * p[2]);
}

function product(one, two) {
  const out = new Array(9).fill(0);
  for (let i = 0; i < 9; i++) for (let k = 0; k < 3; k++) out[i] += one[i - (i % 3) + k] * two[3 * k + (i % 3)];
  return out;
}

/** Return the rotation matrix for an angle about a unit axis. */
function rotation(axis, angle) {
  const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), t = 1 - c;
  return [
    t * x * x + c, t * x * y - s * z, t * x * z + s * y,
    t * x * y + s * z, t * y * y + c, t * y * z - s * x,
    t * x * z - s * y, t * y * z + s * x, t * z * z + c,
  ];
}

/** Return the rows of a rotation matrix, orthonormalised to remove rounding errors. */
function straightened(turn) {
  const unit = (v) => v.map((x) => x / Math.hypot(...v));
  const a = unit(turn.slice(0, 3));
  const b0 = turn.slice(3, 6), along = a[0] * b0[0] + a[1] * b0[1] + a[2] * b0[2];
  const b = unit(b0.map((x, i) => x - along * a[i]));
  return [...a, ...b, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

const TILTS = [0, 0.4, 0.8, 1.15], AROUND = 8; // Radians; number of directions for each tilt.

/** Return unit vectors around a direction, sorted by increasing angle from it. */
function tilted(direction) {
  const least = direction.map(Math.abs).indexOf(Math.min(...direction.map(Math.abs)));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const across = cross(direction, [0, 1, 2].map((k) => Number(k === least)));
  const side = across.map((value) => value / Math.hypot(...across)), other = cross(direction, side);
  return TILTS.flatMap((tilt) =>
    Array.from({length: tilt ? AROUND : 1}, (_, i) => {
      const [c, s] = [Math.cos((2 * Math.PI * i) / AROUND), Math.sin((2 * Math.PI * i) / AROUND)];
      return direction.map((value, k) => Math.cos(tilt) * value + Math.sin(tilt) * (c * side[k] + s * other[k]));
    }),
  );
}

const AXES = ["x", "y", "z"];
// Rotations that turn the upward axis of a model to y and its front to z, as in figures.
const TO_Y = {x: [0, 1, 0, 1, 0, 0, 0, 0, -1], y: [1, 0, 0, 0, 1, 0, 0, 0, 1], z: [1, 0, 0, 0, 0, 1, 0, -1, 0]};

/** Return the rotation of the first view of a model, {turn}, if an axis points up. */
function firstTurn({turn}, axis) {
  return product(turn.flat(), TO_Y[axis]);
}

class Camera {
  /** points: coordinates, three per point, to be shown; turns: whether the camera can rotate. */
  constructor(points, turn, turns) {
    this.turns = turns;
    this.home = turn;
    this.changed = () => {};
    this.version = 0;
    this.width = this.height = 1;
    this.measure(points);
    this.fit();
  }

  /** Measure the extents of the points in the home view. */
  measure(points) {
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (let i = 0; i < points.length; i += 3) {
      for (let k = 0; k < 2; k++) {
        const row = 3 * k;
        const x = this.home[row] * points[i] + this.home[row + 1] * points[i + 1] + this.home[row + 2] * points[i + 2];
        if (x < low[k]) low[k] = x;
        if (x > high[k]) high[k] = x;
      }
    }
    this.extent = [Math.max(high[0] - low[0], 1e-6), Math.max(high[1] - low[1], 1e-6)];
    this.middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  }

  /** Show other points: all of them if all were visible before, else with the same view. */
  showOthers(points) {
    const fitted = this.zoom === 1 && this.pan.every((x, k) => x === this.middle[k]);
    this.measure(points);
    if (fitted) this.fit();
    else this.note();
  }

  fit() {
    this.turn = [...this.home];
    this.pan = [...this.middle];
    this.zoom = 1;
    this.note();
  }

  note() {
    this.version++;
    this.changed();
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return;
    [this.width, this.height] = [width, height];
    this.note();
  }

  /** Return the pixels per unit. */
  get scale() {
    return Math.min((MARGIN * this.width) / this.extent[0], (MARGIN * this.height) / this.extent[1]) * this.zoom;
  }

  /** Return the pixel (from the upper left corner of the pane) and the nearness of a point. */
  project(p) {
    const [x, y, z] = rotated(this.turn, p);
    return [this.width / 2 + (x - this.pan[0]) * this.scale, this.height / 2 - (y - this.pan[1]) * this.scale, z];
  }

  /** Rotate about the axes of the screen: to the right, down, and in the plane, in radians. */
  rotate(right, down, round = 0) {
    if (!this.turns) return;
    let turn = product(rotation([1, 0, 0], down), product(rotation([0, 1, 0], right), this.turn));
    if (round) turn = product(rotation([0, 0, 1], round), turn);
    this.turn = straightened(turn);
    this.note();
  }

  /** Move the view by pixels to the right and down. */
  move(right, down) {
    this.pan = [this.pan[0] - right / this.scale, this.pan[1] + down / this.scale];
    this.note();
  }

  /** Zoom about a pixel, which remains fixed. */
  zoomAt(factor, x, y) {
    const zoom = Math.min(Math.max(this.zoom * factor, MIN_ZOOM), MAX_ZOOM);
    const gain = 1 / this.scale - this.zoom / (this.scale * zoom);
    this.pan = [this.pan[0] + (x - this.width / 2) * gain, this.pan[1] - (y - this.height / 2) * gain];
    this.zoom = zoom;
    this.note();
  }
}

/** Animate a camera to another rotation, pan and zoom. */
function glide(camera, turn, pan, zoom = camera.zoom) {
  const from = {turn: camera.turn, pan: camera.pan, zoom: camera.zoom};
  const relative = product(turn, [0, 3, 6, 1, 4, 7, 2, 5, 8].map((i) => from.turn[i]));
  const cosine = Math.min(Math.max((relative[0] + relative[4] + relative[8] - 1) / 2, -1), 1);
  const angle = Math.acos(cosine);
  const raw = [relative[7] - relative[5], relative[2] - relative[6], relative[3] - relative[1]];
  const length = Math.hypot(...raw);
  const axis = length > 1e-9 ? raw.map((x) => x / length) : [0, 1, 0];
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const start = performance.now(), last = still ? 1 : 350;
  const version = {now: camera.version};
  const step = () => {
    if (camera.version !== version.now) return; // The user has moved the camera during the animation.
    const part = Math.min((performance.now() - start) / last, 1), eased = part * part * (3 - 2 * part);
    camera.turn = part < 1 ? straightened(product(rotation(axis, angle * eased), from.turn)) : turn;
    camera.pan = [0, 1].map((k) => from.pan[k] + eased * (pan[k] - from.pan[k]));
    camera.zoom = part < 1 ? from.zoom * (zoom / from.zoom) ** eased : zoom;
    camera.note();
    version.now = camera.version;
    if (part < 1) requestAnimationFrame(step);
  };
  step();
}
