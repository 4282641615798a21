// Draws a model and its layout in two parts of one canvas, and finds the thing at a pixel.

const DARK_CELL = [0.4, 0.53, 0.7]; // Factor of the colour in dark squares: blue, so that red and black dots are visible.
const SEAM_CORE = 1, SEAM_RADIUS = 2.2; // pixels
const DASHES = [[10, 4, 2, 4], [7, 4, 7, 4]]; // Dashes and gaps of folds in pixels: of mountains, and of valleys.
const PICK_RADII = [5, 1.5]; // Things under the pointer have priority over things near it.
const SAMPLES = 4; // Samples per pixel, for smooth outlines.
const ROUGH = 0.5; // Fraction of the pixels along a side while the view moves on a slow machine.
const BEHIND = 0.35; // Opacity of the picture behind the layout.
const UNIT_SQUARE = new Float32Array([0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1]); // Two triangles.
const MAP_CONTRAST = 0.55; // Shading is reduced on colour maps, so that a shadow is not read as a value.

/** Set the size of a canvas only if it changes, because this is slow and clears the canvas. */
function sizeCanvas(canvas, width, height) {
  const size = [width, height].map((side) => Math.max(1, Math.round(side)));
  if (canvas.width !== size[0]) canvas.width = size[0];
  if (canvas.height !== size[1]) canvas.height = size[1];
}

class Renderer {
  constructor(canvas, model) {
    this.canvas = canvas;
    this.model = model;
    this.gl = canvas.getContext("webgl2", {antialias: false, depth: false, preserveDrawingBuffer: true});
    if (!this.gl) throw new Error("this browser does not support WebGL 2, which the page needs");
    this.look = {};
    this.prepare();
  }

  /** Upload all data to the graphics card: at the start, and after a loss of the context. */
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
    this.prepareSurface();
    this.prepareLayout();
    this.square = new Shape(gl, [
      {array: new Float32Array(18), size: 3},
      {array: UNIT_SQUARE, size: 2},
    ]);
    this.square.put(5, {array: UNIT_SQUARE, size: 2});
    const {sequential, diverging, tints} = model.arrays;
    this.tables = {
      sequential: tableTexture(gl, sequential, true),
      diverging: tableTexture(gl, diverging, true),
      charts: tableTexture(gl, tints, false),
      faults: tableTexture(gl, new Uint8Array(FAULT_COLOURS.flatMap((colour) => rgb(colour).map((x) => 255 * x))), false),
    };
    for (const programs of [this.programs, this.pickPrograms]) Object.values(programs).forEach((one) => one.finish());
    this.picture = null;
    if (this.look.picture) this.setPicture(this.look.picture, this.look.asInFile);
    this.shown = null;
    this.targets = new Map();
    this.samples = Math.min(SAMPLES, gl.getParameter(gl.MAX_SAMPLES) ?? 0);
  }

  prepareSurface() {
    const gl = this.gl, model = this.model, places = cornerPlaces(model);
    this.surface = new Shape(gl, [
      {array: places, size: 3},
      {array: cornerUVs(model), size: 2},
      {array: cornerNormals(model, places), size: 4, type: gl.INT_2_10_10_10_REV, normalised: true},
      {array: new Float32Array(3 * model.triangleCount), size: 1},
    ]);
    this.putOwnUVs();
    if (this.look.marks?.length !== 12 * model.triangleCount) this.look.marks = null;
    this.setMarks(this.look.marks);
  }

  /** Set the UVs of the file, if any. */
  putOwnUVs() {
    const array = this.model.arrays.own_uv;
    if (array) this.surface.put(5, {array, size: 2});
  }

  /** Set the paint on the surface: four bytes for each corner, of which three are the strengths of the layers; null for none. */
  setMarks(marks) {
    this.look.marks = marks;
    if (marks) this.surface.put(4, {array: marks, size: 4, type: this.gl.UNSIGNED_BYTE, normalised: true});
  }

  prepareLayout() {
    this.lines = [false, true].map((inPlane) => this.quads(outlineLines(this.model, inPlane)));
    this.folds = [false, true].map((inPlane) => [true, false].map((areMountains) => this.quads(foldLines(this.model, inPlane, areMountains))));
    this.dots = [false, true].map((inPlane) => this.quads(coneDots(this.model, inPlane)));
  }

  /** Replace the model; if the surface is the same, only the layout is uploaded. */
  takeModel(model) {
    const isSame = model.hasSurfaceOf(this.model);
    this.model = model;
    this.shown = null;
    this.targets.forEach((target) => (target.key = null));
    [...this.lines, ...this.folds.flat(), ...this.dots].forEach((shape) => shape.discard());
    if (isSame) {
      this.surface.refill(1, cornerUVs(model));
      this.putOwnUVs();
    } else {
      this.surface.discard();
      this.prepareSurface();
    }
    this.prepareLayout();
  }

  /** Return lines or dots with two attributes of three numbers. */
  quads(attributes) {
    return new Shape(this.gl, attributes.map((rows) => ({array: forQuads(rows, 3), size: 3})));
  }

  /** source: an ImageBitmap or a canvas; asInFile: it is that of the UVs of the file, not of the layout. */
  setPicture(source, asInFile = false) {
    this.look.picture = source;
    this.look.asInFile = asInFile;
    if (this.picture) this.gl.deleteTexture(this.picture);
    this.picture = pictureTexture(this.gl, source, asInFile);
  }

  /** colours: {ground, pane, paint, undefined, seam, halo, fold}, each three numbers. */
  setColours(colours) {
    this.look.colours = colours;
  }

  resize(width, height, pixel) {
    this.pixel = pixel;
    sizeCanvas(this.canvas, width * pixel, height * pixel);
  }

  /** Fill the area between the panes. */
  clear() {
    const gl = this.gl;
    if (gl.isContextLost()) return;
    const ground = [...this.look.colours.ground, 1];
    // Some drivers copy the whole multisampled target, not only the box. The area between the panes must not show old content.
    this.fineTarget().begin(ground, [0, 0, this.canvas.width, this.canvas.height]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clearColor(...ground);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  fineTarget() {
    return this.targetOf("fine", this.canvas.width, this.canvas.height, this.samples);
  }

  /**
   * Draw a pane, {name, left, top, width, height, camera, inPlane}, for a state; sizes in CSS pixels.
   * rough: with a quarter of the pixels, for slow machines during motion.
   */
  draw(pane, state, rough) {
    const gl = this.gl;
    if (gl.isContextLost()) return;
    const [left, right] = [pane.left, pane.left + pane.width].map((x) => Math.round(x * this.pixel));
    const [top, bottom] = [pane.top, pane.top + pane.height].map((y) => Math.round(y * this.pixel));
    const box = [left, this.canvas.height - bottom, Math.max(1, right - left), Math.max(1, bottom - top)];
    const part = rough ? [0, 0, Math.ceil(ROUGH * box[2]), Math.ceil(ROUGH * box[3])] : box;
    const target = rough ? this.targetOf(`${pane.name} rough`, part[2], part[3], 0) : this.fineTarget();
    target.begin([...this.look.colours.pane, 1], part);
    this.drawInto(pane, state, part[2] / pane.width);
    target.show(part, box);
  }

  drawInto(pane, state, pixel) {
    const gl = this.gl, colours = this.look.colours, side = Number(pane.inPlane);
    const show = state.get("show");
    if (this.shown !== show) {
      this.surface.refill(3, cornerValues(this.model, show));
      this.shown = show;
    }
    const view = this.viewOf(pane, pixel);
    const scale = this.model.head.scales[show];
    const table = scale ? scale.table : show === "faults" ? "faults" : "charts";
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.tables[table]);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.picture);
    this.programs.surface.use({
      ...view,
      inPlane: pane.inPlane,
      layered: show === "faults",
      plane: [...this.model.uvCentre, this.model.uvUnit],
      board: show === "checker" || show === "charts",
      pictured: show === "picture" && this.picture !== null,
      asInFile: show === "picture" && Boolean(this.look.asInFile),
      tinted: Boolean(scale) || show === "charts" || show === "faults",
      table: 0,
      picture: 1,
      paint: show === "checker" ? [0.97, 0.97, 0.98] : colours.paint,
      dark: show === "charts" ? [0.76, 0.76, 0.78] : DARK_CELL,
      undefinedPaint: colours.undefined,
      cell: this.model.head.uv_side / state.get("squares"),
      edges: state.get("edges") ? 0.9 : 0,
      outward: this.model.head.outward,
      contrast: scale ? MAP_CONTRAST : 1,
      marked: this.look.marks ? (state.get("marked") ?? 1) : 0,
      hatch: pixel,
    });
    if (pane.inPlane && this.look.behind && show === "picture" && this.picture && (!this.look.asInFile || this.model.head.from_file)) this.drawBehind();
    this.surface.draw();
    gl.enable(gl.BLEND);
    gl.depthMask(false); // Overlays do not hide anything.
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (state.get("seams")) {
      // All halos are drawn before all lines, because a halo would interrupt an earlier line.
      for (const [ink, strength, radius, lift] of [[colours.halo, 0.7, SEAM_RADIUS, 3], [colours.seam, 1, SEAM_CORE, 3.5]]) {
        const widths = {radius: (radius + 0.5) * pixel + 0.5, lift: lift * pixel};
        this.programs.line.use({...view, ...widths, ink, strength, dashes: [0, 0, 0, 0]});
        this.lines[side].draw();
      }
    }
    if (state.get("cones")) {
      this.drawFolds(view, side, pixel);
      this.programs.dot.use({...view, pixel});
      this.dots[side].draw();
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  drawFolds(view, side, pixel) {
    const widths = {radius: (SEAM_CORE + 0.5) * pixel + 0.5, lift: 3.2 * pixel};
    this.folds[side].forEach((lines, kind) => {
      this.programs.line.use({...view, ...widths, ink: this.look.colours.fold, strength: 1, dashes: DASHES[kind].map((length) => length * pixel)});
      lines.draw();
    });
  }

  /** Draw the picture, faded, in the unit square behind the layout. */
  drawBehind() {
    const gl = this.gl;
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, BEHIND);
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    this.square.draw();
    gl.disable(gl.BLEND);
  }

  viewOf(pane, pixel) {
    const {camera, width, height} = pane;
    const zoom = [(2 * camera.scale) / width, (2 * camera.scale) / height];
    return {turn: camera.turn, pan: camera.pan, zoom, size: [width * pixel, height * pixel]};
  }

  /** Return the render target of a name, created again if its size has changed. */
  targetOf(name, width, height, samples) {
    const old = this.targets.get(name);
    if (old?.fits(width, height, samples)) return old;
    old?.discard();
    const target = new Target(this.gl, width, height, samples);
    this.targets.set(name, target);
    return target;
  }

  /** Wait until everything is drawn. */
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** Return the thing at a pixel of a pane, {kind, index}, or null. */
  pick(pane, x, y, state) {
    const gl = this.gl;
    if (gl.isContextLost() || x < 0 || y < 0 || x >= pane.width || y >= pane.height) return null;
    const target = this.pickTargetOf(pane, state), [column, row] = [Math.floor(x), target.height - 1 - Math.floor(y)];
    if (column >= target.width || row < 0) return null;
    target.numbers ??= this.numbersIn(target);
    let index = target.numbers[row * target.width + column] - 1;
    if (index < 0) return null;
    for (const [kind, count] of [["triangle", this.model.triangleCount], ["seam", this.model.seamCount]]) {
      if (index < count) return {kind, index};
      index -= count;
    }
    return {kind: "cone", index};
  }

  /** Return the numbers in an image of them: all at once, because many are asked for to see where a seam is visible. */
  numbersIn({frame, width, height}) {
    const gl = this.gl, bytes = new Uint8Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return new Uint32Array(bytes.buffer); // Machines with a browser are little-endian.
  }

  /** Return the image of thing numbers of a pane; it is drawn again only if the view has changed. */
  pickTargetOf(pane, state) {
    const gl = this.gl, model = this.model;
    const size = [pane.width, pane.height].map((side) => Math.max(1, Math.round(side)));
    const target = this.targetOf(`${pane.name} numbers`, ...size, 0);
    const key = [pane.camera.version, state.get("seams"), state.get("cones"), this.shown === "faults"].join();
    if (target.key === key) return target;
    target.key = key;
    target.numbers = null;
    target.begin([0, 0, 0, 0], [0, 0, ...size]);
    const view = this.viewOf(pane, 1), side = Number(pane.inPlane);
    this.pickPrograms.surface.use({...view, inPlane: pane.inPlane, layered: this.shown === "faults", plane: [...model.uvCentre, model.uvUnit]});
    this.surface.draw();
    if (state.get("seams")) {
      const numbers = {first: model.triangleCount + 1, sides: 1 + side};
      for (const radius of PICK_RADII) {
        this.pickPrograms.line.use({...view, ...numbers, radius, lift: 3});
        this.lines[side].draw(QUAD * model.seamCount * (1 + side));
      }
    }
    if (state.get("cones")) {
      this.pickPrograms.dot.use({...view, pixel: 1, first: model.triangleCount + model.seamCount + 1});
      this.dots[side].draw();
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return target;
  }
}
