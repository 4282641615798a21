// The choices, drawn over both views: paths, and cones that are locked, dragged or not yet computed.

const PATH_COLOURS = {cut: "#d6006c", keep: "#0a7d5c"};

class Overlay {
  constructor(studio) {
    this.studio = studio;
  }

  draw(pen, pane) {
    const {tools, choices} = this.studio;
    pen.lineJoin = pen.lineCap = "round";
    if (pane.inPlane && this.studio.hasLayout()) this.studio.viewer.marks.drawSquare(pen, pane);
    for (const path of choices.cuts) this.path(pen, pane, this.studio.verticesOf(path), PATH_COLOURS.cut, [1, 6]);
    for (const path of choices.kept) this.path(pen, pane, this.studio.verticesOf(path), PATH_COLOURS.keep, [1, 6]);
    if (tools.draws) {
      this.path(pen, pane, tools.preview, PATH_COLOURS[tools.mode], []);
      if (tools.from !== null) this.ring(pen, pane, tools.from, PATH_COLOURS[tools.mode], 6);
    }
    this.studio.brush.draw(pen, pane);
    this.studio.panel.charts.draw(pen, pane);
    for (const place of this.studio.viewer.model.head.bad ?? []) this.bad(pen, pane, this.studio.verticesOf(place));
    for (const vertex of this.studio.verticesOf(this.studio.cornersShown())) this.diamond(pen, pane, vertex);
    for (const cone of this.studio.forTexture ? [] : choices.cones) {
      const [vertex] = this.studio.verticesOf([cone.vertex]);
      if (vertex === undefined) continue;
      if (cone.locked) this.box(pen, pane, vertex);
      if (!this.studio.isShown(vertex)) this.ring(pen, pane, vertex, this.studio.viewer.accent, 8);
    }
    if (tools.dragged) this.ring(pen, pane, tools.dragged.at, this.studio.viewer.accent, 10);
    if (this.aims(pane)) this.crosshair(pen, pane);
  }

  /** Return whether keys apply to the middle of a pane: while they are used instead of the mouse. */
  aims(pane) {
    const {keyed, viewer, tools} = this.studio;
    return keyed && pane === viewer.used && (tools.mode !== "look" || document.activeElement === pane.element);
  }

  crosshair(pen, pane) {
    const [x, y] = [pane.width / 2, pane.height / 2];
    const path = new Path2D(`M${x - 14} ${y}H${x - 4}M${x + 4} ${y}H${x + 14}M${x} ${y - 14}V${y - 4}M${x} ${y + 4}V${y + 14}`);
    this.stroke(pen, path, this.studio.viewer.accent, 2);
  }

  /** Return the screen positions of a vertex; in the layout it may have several. */
  places(pane, vertex) {
    const {model} = this.studio.viewer;
    const found = pane.inPlane ? this.studio.pointsOf(vertex).map((point) => model.flatPlace(point)) : [model.place(vertex)];
    return found.map((place) => pane.camera.project(place));
  }

  stroke(pen, path, colour, width) {
    for (const [style, extra] of [["#ffffff", 2.5], [colour, 0]]) {
      pen.strokeStyle = style;
      pen.lineWidth = width + extra;
      pen.stroke(path);
    }
    pen.setLineDash([]);
  }

  /** Mark an edge or a vertex of the model that needed a repair. */
  bad(pen, pane, vertices) {
    if (pane.inPlane || !vertices.length) return;
    if (vertices.length > 1) this.path(pen, pane, vertices, this.studio.viewer.accent, []);
    else this.ring(pen, pane, vertices[0], this.studio.viewer.accent, 6);
  }

  ring(pen, pane, vertex, colour, radius) {
    for (const [x, y] of this.places(pane, vertex)) {
      const path = new Path2D();
      path.arc(x, y, radius, 0, 2 * Math.PI);
      this.stroke(pen, path, colour, 2.5);
    }
  }

  diamond(pen, pane, vertex) {
    for (const [x, y] of this.places(pane, vertex)) {
      const path = new Path2D(`M${x - 9} ${y}L${x} ${y - 9}L${x + 9} ${y}L${x} ${y + 9}Z`);
      pen.fillStyle = "#ffffff";
      pen.fill(path);
      this.stroke(pen, path, "#6a3fb5", 2.5);
    }
  }

  box(pen, pane, vertex) {
    for (const [x, y] of this.places(pane, vertex)) {
      const path = new Path2D();
      path.rect(x - 10, y - 10, 20, 20);
      this.stroke(pen, path, "#20262c", 1.6);
    }
  }

  /** Draw a path on the model; in the layout, where a seam may split it, draw its points. */
  path(pen, pane, vertices, colour, dash) {
    if (vertices.length < 2) return;
    const path = new Path2D();
    if (pane.inPlane) {
      for (const vertex of vertices) {
        for (const [x, y] of this.places(pane, vertex)) path.rect(x - 0.5, y - 0.5, 1, 1);
      }
    } else {
      vertices.forEach((vertex, i) => {
        const [[x, y]] = this.places(pane, vertex);
        if (i) path.lineTo(x, y);
        else path.moveTo(x, y);
      });
      pen.setLineDash(dash);
    }
    this.stroke(pen, path, colour, 2.5);
  }
}
