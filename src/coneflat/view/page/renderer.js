// Draws a model and its layout into two parts of one canvas, and tells what is at a pixel.

const DARK_CELL = [0.4, 0.53, 0.7]; // What dark squares let through: blue, so that red and black dots stand out.
const SEAM_CORE = 1, SEAM_RADIUS = 2.2; // pixels
const PICK_RADII = [5, 1.5]; // What lies right under the pointer comes before what lies beside it.
const MAP_CONTRAST = 0.55; // On colour maps light is evened out, or a shadow would read as a value.

/** Set the size of a canvas, which costs much and clears it, where it has another. */
function sizeCanvas(canvas, width, height) {
  const size = [width, height].map((side) => Math.max(1, Math.round(side)));
  if (canvas.width !== size[0]) canvas.width = size[0];
  if (canvas.height !== size[1]) canvas.height = size[1];
}

class Renderer {
  constructor(canvas, model) {
    this.canvas = canvas;
    this.model = model;
    this.gl = canvas.getContext("webgl2", {antialias: true, alpha: false, preserveDrawingBuffer: true});
    if (!this.gl) throw new Error("this browser shows no WebGL 2, which the drawing needs");
    this.look = {};
    this.prepare();
  }

  /** Send everything to the graphics card: at the start, and when it has lost it. */
  prepare() {
    const gl = this.gl, model = this.model;
    const pairs = {
      surface: [SURFACE_VERTEX, SURFACE_FRAGMENT],
      line: [LINE_VERTEX, LINE_FRAGMENT],
      dot: [DOT_VERTEX, DOT_FRAGMENT],
    };
    this.programs = {};
    this.pickPrograms = {};
    for (const [name, [vertex, fragment]] of Object.entries(pairs)) {
      this.programs[name] = new Program(gl, vertex, fragment, false);
      this.pickPrograms[name] = new Program(gl, vertex, fragment, true);
    }
    const places = cornerPlaces(model);
    this.surface = new Shape(gl, [
      {array: places, size: 3},
      {array: cornerUVs(model), size: 2},
      {array: cornerNormals(model, places), size: 4, type: gl.INT_2_10_10_10_REV, normalised: true},
      {array: new Float32Array(3 * model.triangleCount), size: 1},
    ]);
    this.lines = [false, true].map((inPlane) => this.instances(outlineSegments(model, inPlane)));
    this.dots = [false, true].map((inPlane) => this.instances(coneDots(model, inPlane)));
    const {sequential, diverging, tints} = model.arrays;
    this.tables = {
      sequential: tableTexture(gl, sequential, true),
      diverging: tableTexture(gl, diverging, true),
      charts: tableTexture(gl, tints, false),
    };
    for (const programs of [this.programs, this.pickPrograms]) Object.values(programs).forEach((one) => one.finish());
    this.picture = null;
    if (this.look.picture) this.setPicture(this.look.picture);
    this.shown = null;
    this.pickBuffers = new Map();
  }

  /** Return lines or dots, of six numbers each. */
  instances(array) {
    const buffer = this.gl.createBuffer();
    const halves = [{array, offset: 0}, {offset: 12}].map((half) => ({...half, buffer, size: 3, stride: 24, each: 1}));
    return {shape: new Shape(this.gl, halves), count: array.length / 6};
  }

  /** source: an ImageBitmap or a canvas. */
  setPicture(source) {
    this.look.picture = source;
    if (this.picture) this.gl.deleteTexture(this.picture);
    this.picture = pictureTexture(this.gl, source);
  }

  /** colours: {ground, pane, paint, undefined, seam, halo}, each three numbers. */
  setColours(colours) {
    this.look.colours = colours;
  }

  resize(width, height, pixel) {
    this.pixel = pixel;
    sizeCanvas(this.canvas, width * pixel, height * pixel);
  }

  /** Fill what lies between the panes. */
  clear() {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(...this.look.colours.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** Draw a pane, {left, top, width, height, camera, inPlane}, as the state says; sizes in CSS pixels. */
  draw(pane, state) {
    const gl = this.gl, colours = this.look.colours, side = Number(pane.inPlane);
    if (gl.isContextLost()) return;
    const show = state.get("show");
    if (this.shown !== show) {
      this.surface.refill(3, cornerValues(this.model, show));
      this.shown = show;
    }
    this.begin(pane, this.pixel, null, [...colours.pane, 1]);
    const view = this.viewOf(pane, this.pixel);
    const scale = this.model.head.scales[show];
    const table = scale ? scale.table : "charts";
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.tables[table]);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.picture);
    this.programs.surface.use({
      ...view,
      inPlane: pane.inPlane,
      plane: [...this.model.uvCentre, this.model.uvUnit],
      board: show === "checker" || show === "charts",
      pictured: show === "picture" && this.picture !== null,
      tinted: Boolean(scale) || show === "charts",
      table: 0,
      picture: 1,
      paint: show === "checker" ? [0.97, 0.97, 0.98] : colours.paint,
      dark: show === "charts" ? [0.72, 0.72, 0.74] : DARK_CELL,
      undefinedPaint: colours.undefined,
      cell: this.model.head.uv_side / state.get("squares"),
      edges: state.get("edges") ? 0.9 : 0,
      outward: this.model.head.outward,
      contrast: scale ? MAP_CONTRAST : 1,
    });
    this.surface.drawTriangles(this.model.triangleCount);
    gl.enable(gl.BLEND);
    gl.depthMask(false); // What is only laid over the surface hides nothing.
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (state.get("seams")) {
      // All halos before all lines: a halo would break the line before it.
      for (const [ink, strength, radius, lift] of [[colours.halo, 0.7, SEAM_RADIUS, 3], [colours.seam, 1, SEAM_CORE, 3.5]]) {
        const widths = {radius: (radius + 0.5) * this.pixel + 0.5, lift: lift * this.pixel};
        this.programs.line.use({...view, ...widths, ink, strength});
        this.lines[side].shape.drawEach(this.lines[side].count);
      }
    }
    if (state.get("cones")) {
      this.programs.dot.use({...view, pixel: this.pixel});
      this.dots[side].shape.drawEach(this.dots[side].count);
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  viewOf(pane, pixel) {
    const {camera, width, height} = pane;
    const zoom = [(2 * camera.scale) / width, (2 * camera.scale) / height];
    return {turn: camera.turn, pan: camera.pan, zoom, size: [width * pixel, height * pixel]};
  }

  /** Aim at a pane of the canvas, or of a buffer of its own, and clear it. */
  begin(pane, pixel, buffer, colour) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    const left = buffer ? 0 : Math.round(pane.left * pixel);
    const bottom = buffer ? 0 : this.canvas.height - Math.round((pane.top + pane.height) * pixel);
    const box = [left, bottom, Math.round(pane.width * pixel), Math.round(pane.height * pixel)];
    gl.viewport(...box);
    gl.scissor(...box);
    gl.enable(gl.SCISSOR_TEST);
    gl.clearColor(...colour);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.disable(gl.BLEND);
  }

  /** Return the thing at a pixel of a pane, {kind, index}, or null. */
  pick(pane, x, y, state) {
    const gl = this.gl;
    if (gl.isContextLost() || x < 0 || y < 0 || x >= pane.width || y >= pane.height) return null;
    const buffer = this.pickBufferOf(pane, state);
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer.frame);
    const bytes = new Uint8Array(4);
    gl.readPixels(Math.floor(x), buffer.height - 1 - Math.floor(y), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    let index = new DataView(bytes.buffer).getUint32(0, true) - 1;
    if (index < 0) return null;
    for (const [kind, count] of [["triangle", this.model.triangleCount], ["seam", this.model.seamCount]]) {
      if (index < count) return {kind, index};
      index -= count;
    }
    return {kind: "cone", index};
  }

  /** Return the buffer with the numbers of what a pane shows; drawn again only when the view has changed. */
  pickBufferOf(pane, state) {
    const gl = this.gl, model = this.model;
    const width = Math.max(1, Math.round(pane.width)), height = Math.max(1, Math.round(pane.height));
    const key = [pane.camera.version, width, height, state.get("seams"), state.get("cones")].join();
    let buffer = this.pickBuffers.get(pane.name);
    if (buffer && buffer.key === key) return buffer;
    if (!buffer || buffer.width !== width || buffer.height !== height) {
      if (buffer) this.discard(buffer);
      buffer = this.newPickBuffer(width, height);
      this.pickBuffers.set(pane.name, buffer);
    }
    buffer.key = key;
    this.begin(pane, 1, buffer.frame, [0, 0, 0, 0]);
    const view = this.viewOf(pane, 1);
    this.pickPrograms.surface.use({...view, inPlane: pane.inPlane, plane: [...model.uvCentre, model.uvUnit]});
    this.surface.drawTriangles(model.triangleCount);
    const side = Number(pane.inPlane);
    if (state.get("seams")) {
      const numbers = {first: model.triangleCount + 1, sides: 1 + side};
      for (const radius of PICK_RADII) {
        this.pickPrograms.line.use({...view, ...numbers, radius, lift: 3});
        this.lines[side].shape.drawEach(model.seamCount * (1 + side));
      }
    }
    if (state.get("cones")) {
      this.pickPrograms.dot.use({...view, pixel: 1, first: model.triangleCount + model.seamCount + 1});
      this.dots[side].shape.drawEach(this.dots[side].count);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return buffer;
  }

  newPickBuffer(width, height) {
    const gl = this.gl;
    const frame = gl.createFramebuffer(), colour = gl.createRenderbuffer(), depth = gl.createRenderbuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    for (const [target, format, place] of [
      [colour, gl.RGBA8, gl.COLOR_ATTACHMENT0],
      [depth, gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT],
    ]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, target);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, target);
    }
    return {frame, colour, depth, width, height, key: ""};
  }

  discard({frame, colour, depth}) {
    this.gl.deleteFramebuffer(frame);
    this.gl.deleteRenderbuffer(colour);
    this.gl.deleteRenderbuffer(depth);
  }
}
