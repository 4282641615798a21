// Mouse, pen and touch on a pane: motions of its camera, hovering and picking.

const TURN_SPEED = 0.008; // radians per pixel
const WHEEL_SPEED = 0.0015; // Change of the logarithm of the zoom per pixel of the wheel.
const STILL = 5; // Largest motion of a click in pixels.
const CLICK_TIME = 600; // milliseconds
const FINGER = 16; // Pick radius of a finger in pixels.

class Gestures {
  /** pane: {element, camera}; hears: {hover(pane, x, y), leave(pane), pick(pane, x, y, reach), grab(pane, x, y, reach),
   *  use(pane)}; reach: pick radius in pixels. grab returns null, or a handler of the drag {move(x, y), drop(), stop()}; stop is called last in any case. */
  constructor(pane, hears) {
    this.pane = pane;
    this.hears = hears;
    this.fingers = new Map();
    const listen = (name, does) => pane.element.addEventListener(name, does.bind(this), {passive: false});
    listen("pointerdown", this.down);
    listen("pointermove", this.move);
    listen("pointerup", this.up);
    listen("pointercancel", this.cancel);
    listen("pointerleave", () => this.fingers.size || hears.leave(pane));
    listen("wheel", this.wheel);
    listen("dblclick", () => pane.camera.fit());
    listen("contextmenu", (event) => event.preventDefault());
    listen("focus", () => hears.use(pane));
  }

  at(event) {
    const box = this.pane.element.getBoundingClientRect();
    return {x: event.clientX - box.left, y: event.clientY - box.top};
  }

  down(event) {
    this.hears.use(this.pane);
    this.pane.element.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, this.at(event));
    if (this.fingers.size === 1) {
      this.press = {...this.at(event), time: event.timeStamp, still: true};
      if (!event.button && !event.shiftKey) this.grabbed = this.hears.grab(this.pane, this.press.x, this.press.y, reachOf(event));
    } else {
      this.letGo();
      if (this.press) this.press.still = false;
    }
    this.hears.leave(this.pane);
  }

  move(event) {
    const now = this.at(event), before = this.fingers.get(event.pointerId);
    if (!before) {
      if (event.pointerType !== "touch") this.hears.hover(this.pane, now.x, now.y);
      return;
    }
    if (this.press && Math.hypot(now.x - this.press.x, now.y - this.press.y) > STILL) this.press.still = false;
    if (this.press?.still) return; // Small motions of a finger do not rotate the model.
    if (this.grabbed) this.grabbed.move(now.x, now.y);
    else if (this.fingers.size === 1) this.drag(now.x - before.x, now.y - before.y, event);
    else this.pinch(event.pointerId, before, now);
    this.fingers.set(event.pointerId, now);
  }

  drag(right, down, event) {
    const camera = this.pane.camera;
    if (camera.turns && !(event.shiftKey || event.buttons & 6)) camera.rotate(TURN_SPEED * right, TURN_SPEED * down);
    else camera.move(right, down);
  }

  /** One of two fingers has moved. */
  pinch(moved, before, now) {
    const other = [...this.fingers].find(([id]) => id !== moved)[1];
    const camera = this.pane.camera;
    const was = {x: before.x - other.x, y: before.y - other.y}, is = {x: now.x - other.x, y: now.y - other.y};
    const far = Math.max(Math.hypot(was.x, was.y), 1);
    camera.move((now.x - before.x) / 2, (now.y - before.y) / 2);
    camera.zoomAt(Math.max(Math.hypot(is.x, is.y), 1) / far, (now.x + other.x) / 2, (now.y + other.y) / 2);
    const turn = Math.atan2(is.x * was.y - is.y * was.x, is.x * was.x + is.y * was.y);
    if (camera.turns) camera.rotate(0, 0, turn);
  }

  up(event) {
    const {press, grabbed} = this;
    if (grabbed && !press?.still) grabbed.drop();
    this.cancel(event);
    if (!press?.still || event.timeStamp - press.time > CLICK_TIME || event.button > 0) return;
    const {x, y} = this.at(event);
    this.hears.pick(this.pane, x, y, reachOf(event));
  }

  cancel(event) {
    this.fingers.delete(event.pointerId);
    if (this.fingers.size) return;
    this.press = null;
    this.letGo();
  }

  letGo() {
    this.grabbed?.stop();
    this.grabbed = null;
  }

  wheel(event) {
    event.preventDefault();
    const {x, y} = this.at(event);
    const pixels = event.deltaY * (event.deltaMode === 1 ? 20 : event.deltaMode === 2 ? 400 : 1);
    // A pinch on a touchpad is reported as a wheel with ctrl, in small steps.
    this.pane.camera.zoomAt(Math.exp(-WHEEL_SPEED * pixels * (event.ctrlKey ? 6 : 1)), x, y);
  }
}

function reachOf(event) {
  return event.pointerType === "touch" ? FINGER : 0;
}
