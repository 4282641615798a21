// The studio: shows the state of the server, and sends actions to it.

const FAINT = 0.45; // Opacity of paint when no brush is used.
const RETRY = 1500; // Milliseconds before a request is repeated if the server does not respond.
const NO_CHOICES = {options: {}, by_hand: false, cones: [], cuts: [], kept: []}; // Also paint, corners and units, if any.
const STEP = 1.25; // Factor by which a key changes the size of the brush.

class Studio {
  constructor() {
    this.server = new Server();
    this.viewer = this.news = this.refused = null;
    this.layout = 0;
    this.turns = 0; // Quarter turns of the view of the layout.
    this.final = null; // The last layout that was not a preview, {model, turns}.
    this.pending = 0; // Actions without an answer.
    this.answered = 0; // Version of the state with the effect of all answered actions.
    this.took = this.sight = 0; // Milliseconds from the last change to its layout, and to its preview.
    this.selected = null; // The vertex of the picked cone, which does not depend on the index of the cone.
    this.tools = new Tools(this);
    this.paint = new Paint(this);
    this.brush = new Brush(this);
    this.keyed = false; // The keyboard was used last, not the mouse.
    this.shownForTexture = false;
    this.follows = true; // Paths follow sharp edges.
    this.overlay = new Overlay(this);
    this.panel = new Panel(this);
    document.addEventListener("keydown", (event) => this.key(event), {capture: true});
    window.addEventListener("drop", (event) => this.drop(event), {capture: true});
    for (const name of ["keydown", "pointermove"]) window.addEventListener(name, (event) => this.noteKeys(event.type === "keydown"), {capture: true});
    window.addEventListener("dragover", (event) => event.preventDefault());
  }

  // Updates from the server.

  /** Follow the state of the server as long as the page is open. */
  async follow() {
    for (let heard; ; ) {
      try {
        const news = await this.server.state(this.news);
        trouble("");
        if (this.news && news.opened !== this.news.opened && this.layout) {
          location.reload(); // The data of the page, also vertex numbers, belong to another mesh.
          return;
        }
        const isOld = !news.layout || news.layout === this.layout;
        heard = [news, isOld ? null : await this.server.layout(this.viewer?.model).catch(orNone)];
      } catch (error) {
        if (error instanceof Refusal) {
          trouble(error.message);
          return;
        }
        if (!(error instanceof TypeError)) throw error; // fetch throws a TypeError if the server does not respond.
        const again = this.news?.project ? `; start it again with: coneflat studio ${this.news.project}` : "";
        trouble(`the studio does not respond. All choices are saved${again}`);
        await new Promise((done) => setTimeout(done, RETRY));
        continue;
      }
      this.hear(...heard);
    }
  }

  /** Show a new state; model: the layout if it is new. */
  hear(news, model) {
    this.news = news;
    document.body.classList.toggle("empty", !this.news.mesh);
    document.body.classList.toggle("bare", !this.news.layout || this.news.bare);
    document.body.classList.toggle("alone", this.news.bare);
    document.body.classList.toggle("computing", Boolean(this.news.busy));
    document.body.classList.toggle("stale", this.news.stale);
    if (!this.viewer) document.getElementById("name").textContent = this.news.mesh ?? "";
    if (model) this.take(model);
    if (model) this.layout = news.layout;
    this.paint.hear();
    this.showPurpose();
    this.panel.quads.hear(news);
    this.panel.show();
    this.viewer?.remark();
    if (!this.news.busy) document.documentElement.dataset.ready ??= String(Math.round(performance.now()));
    document.documentElement.dataset.settled = String(!this.news.busy);
  }

  /** After a change of the kind of map, show cones on conformal maps only, and end tools without effect. */
  showPurpose() {
    document.body.classList.toggle("texture", this.forTexture);
    if (!this.viewer || this.shownForTexture === this.forTexture) return;
    this.shownForTexture = this.forTexture;
    this.viewer.state.set({cones: !this.forTexture});
    if ((this.forTexture ? CONE_TOOLS : CHART_TOOLS).includes(this.tools.mode)) this.setTool("look");
  }

  /** Show a layout. */
  take(model) {
    const isSame = this.viewer && model.hasSurfaceOf(this.viewer.model);
    const selected = !isSame && model.arrays.whole_faces === this.viewer?.model.arrays.whole_faces ? this.selectedNumber() : null;
    if (!isSame) this.byNumber = this.boundary = null;
    if (!isSame && this.whole?.key !== Surface.keyOf(model)) this.whole = this.edges = null;
    this.points = this.nearest = null;
    // All layouts are drawn in the frame of the unit square, so that they do not move in the view.
    if (model.head.show !== "plain") [model.uvCentre, model.uvUnit] = [[0.5, 0.5], 2];
    this.repicking = true; // The selection is not cleared if it ends because indices have changed.
    if (this.viewer) {
      if (isSame) this.align(model);
      const wasBare = this.viewer.model.head.show === "plain", isBare = model.head.show === "plain";
      this.viewer.takeModel(model);
      if (wasBare !== isBare) this.viewer.state.set({show: model.head.show});
    } else {
      this.viewer = window.coneflat = new Viewer(model, null);
      this.viewer.tool = this.tools;
      this.viewer.showsSquare = this.viewer.renderer.look.behind = true;
      this.viewer.panes[1].camera.showOthers(this.viewer.flatPlaces());
      this.viewer.state.set({marked: FAINT});
      this.viewer.marks.overlay = (pen, pane) => this.overlay.draw(pen, pane);
      this.viewer.state.listen((names) => names.has("picked") && this.notePick());
      this.viewer.state.listen((names) => names.has("up") && this.panel.showUp());
      this.panel.showUp();
    }
    if (!isSame) this.selected = selected === null ? null : (this.verticesOf([selected])[0] ?? null);
    this.repicking = false;
    this.pickSelected();
    this.takeOwnPicture(model);
    this.showMeasures(model.head);
    this.slivers = model.head.show === "plain" ? 0 : sliverCount(model);
    if (!isSame) this.final = null;
    if (!this.news.early && model.head.show !== "plain") this.final = {model, turns: this.turns};
    const {asked, news} = this;
    requestAnimationFrame(() => requestAnimationFrame(() => this.noteTime(asked, news.early)));
  }

  /** Have the texture of the file as the picture, with the UVs of the file, until another is chosen. */
  async takeOwnPicture({arrays, head}) {
    if (!arrays.own_uv || arrays.picture === this.ownPicture) return;
    this.ownPicture = arrays.picture;
    const picture = await pictureOf(new Blob([arrays.picture], {type: head.picture}));
    this.viewer.renderer.setPicture(picture, true);
    this.viewer.redraw();
  }

  /** Add the charts, the packing, the overlap, the energy and the strain to the title; a preview does not have them. */
  showMeasures({rows}) {
    const values = new Map(rows.map(([name, value]) => [name, value])), charts = values.get("charts");
    if (!(Number(charts?.replaceAll(",", "")) > 0)) return;
    const more = [`${charts} ${charts === "1" ? "chart" : "charts"}`, `packing ${values.get("packing")}`, `overlap ${values.get("overlap")}`];
    const place = document.getElementById("title");
    // On maps for textures the energy and the strain are shown instead of the cones.
    const stretch = ["energy", "strain"].map((name) => `${name} ${values.get(name)}`);
    const shown = place.textContent.split("  ·  ").flatMap((text) => (this.forTexture && / cones?$/.test(text) ? stretch : text));
    place.textContent = place.title = [...shown, ...more].join("  ·  ");
  }

  /** Return a sentence on narrow charts beside drawn cuts, or nothing. */
  sliverWarning() {
    if (!this.slivers || !this.choices.cuts.length || this.news.stale || this.news.bare) return [];
    const [charts, are] = this.slivers === 1 ? ["chart", "is"] : ["charts", "are"];
    return [`${this.slivers} ${charts} beside drawn cuts ${are} less than two triangles wide: erase the cut, or draw it along the seam.`];
  }

  /** Choose the axis of the model that points up in its view. */
  setUp(axis) {
    this.viewer.state.set({up: axis});
  }

  /** Turn the view of the layout, and number the charts, like those of the last layout that was not a preview. */
  align(model) {
    const {camera} = this.viewer.panes[1], before = this.final;
    if (!before || model.head.show === "plain") return;
    const pairs = chartPairs(sharedParts(before.model, before.turns, model));
    this.turns = nearestTurns(pairs);
    camera.turn = camera.home = quarterTurns(this.turns);
    keepChartNumbers(pairs, model);
    document.querySelector("#layout h2").textContent = this.turns ? `Layout, rotated by ${90 * this.turns}°` : "Layout";
  }

  /** Record the time until the layout, or its preview, was drawn. */
  noteTime(asked, isEarly) {
    if (!asked || asked !== this.asked) return;
    this.sight ||= performance.now() - asked;
    if (isEarly) return;
    this.took = performance.now() - asked;
    this.asked = 0;
    this.panel.work.show();
  }

  // Actions of the user.

  async act(action) {
    this.asked = performance.now();
    this.sight = 0;
    this.refused = null;
    this.pending++;
    try {
      this.answered = Math.max(this.answered, await this.server.act(action));
      this.pending--;
    } catch (error) {
      this.pending--;
      this.refuse(error);
    }
    this.panel.show();
  }

  /** Whether the state that is shown lacks the effect of an action: controls show what the user has chosen. */
  isBehind() {
    return this.pending > 0 || (this.news?.version ?? 0) < this.answered;
  }

  refuse(error) {
    const text = error instanceof Refusal ? error.message : "the studio does not respond";
    this.refused = text ? {text} : null; // What the user has cancelled needs no text.
    this.paint.forget();
    this.panel.show();
  }

  isBusy() {
    return this.pending > 0 || Boolean(this.news?.busy);
  }

  get stem() {
    return this.news.mesh.replace(/\.[^.]*$/, "");
  }

  async save(ending) {
    const {stem} = RESULT_FILES.find((file) => file.ending === ending);
    await this.server.save(`export/${ending}`, `${this.stem}_${stem}.${ending}`).catch((error) => this.refuse(error));
  }

  setCount(count) {
    this.act({do: "set", name: "cone_count", value: count});
  }

  async open(file) {
    this.refused = null;
    await this.server.open(file).catch((error) => this.refuse(error));
  }

  async openSample() {
    this.refused = null;
    await this.server.ask("sample", {method: "POST"}).catch((error) => this.refuse(error));
  }

  drop(event) {
    const [file] = event.dataTransfer?.files ?? [];
    if (!file || file.type.startsWith("image/")) return; // Images are handled by the viewer.
    event.preventDefault();
    event.stopImmediatePropagation();
    this.open(file);
  }

  setTool(mode) {
    if ((this.forTexture ? CONE_TOOLS : CHART_TOOLS).includes(mode)) return;
    const {head, arrays} = this.viewer?.model ?? {};
    if (!["look", "cone", "chart"].includes(mode) && head?.left_out && !arrays.whole_faces) {
      this.refuse(new Refusal(`a mesh of ${grouped(head.triangles)} triangles is too large to draw or paint on here`));
      return;
    }
    this.tools.set(mode);
    this.viewer?.state.set({marked: this.tools.paints ? 1 : FAINT});
    this.panel.show();
    this.viewer?.remark();
  }

  setAngle(vertex, degrees) {
    this.act({do: "angle", vertex, degrees});
  }

  key(event) {
    if (event.target.closest?.("input, select, dialog")) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const control = event.ctrlKey || event.metaKey;
    if (event.altKey || (control && !["z", "y"].includes(name))) return;
    if (name === "c" && this.forTexture) return this.obey(event, () => {}); // The key that shows cones.
    if (control) return this.obey(event, () => this.act({do: name === "z" && !event.shiftKey ? "undo" : "redo"}));
    const tool = [...TOOLS, ...BRUSHES].find(([, , letter]) => letter === name);
    const vertex = this.selectedNumber(), row = this.coneRows().find((one) => one.vertex === vertex);
    const turn = (step) => () => row && this.setAngle(vertex, Math.min(WIDEST, Math.max(this.panel.step(), this.panel.snapped(row.degrees + step))));
    const keys = {
      u: () => this.act({do: "undo"}), y: () => this.act({do: "redo"}), n: () => this.pickNext(),
      m: () => this.moveToMiddle(), l: () => row && this.act({do: "lock", vertex, locked: !row.locked}),
      g: () => this.panel.angleField(vertex)?.select(), ",": turn(-this.panel.step()), ".": turn(this.panel.step()),
      Delete: () => this.remove(vertex), Backspace: () => this.remove(vertex),
    };
    keys.q = () => this.panel.curve.ask();
    keys.f = () => this.setFollowing(!this.follows);
    if (this.tools.paints) Object.assign(keys, {",": () => this.growBrush(1 / STEP), ".": () => this.growBrush(STEP)});
    if (name === "Escape") this.tools.endLine();
    const does = tool ? () => this.setTool(tool[0]) : keys[name];
    if (does) this.obey(event, does);
  }

  noteKeys(keyed) {
    if (keyed === this.keyed && !keyed) return;
    this.keyed = keyed;
    this.viewer?.remark();
  }

  obey(event, does) {
    event.preventDefault();
    event.stopImmediatePropagation();
    does();
  }

  remove(vertex) {
    const picked = this.viewer?.state.get("picked");
    if (vertex !== null) this.act({do: "remove", vertex});
    else if (picked?.kind === "seam") {
      const corners = this.viewer.model.outlineCorners(2 * picked.index);
      this.act({do: "erase", edge: corners.map((corner) => this.numberOf(this.viewer.model.vertexAt(corner)))});
    }
  }

  pickNext() {
    const rows = this.coneRows();
    if (!rows.length) return;
    const at = rows.findIndex((row) => row.vertex === this.selectedNumber());
    this.find(rows[(at + 1) % rows.length].vertex);
  }

  moveToMiddle() {
    const pane = this.viewer?.used, vertex = this.selectedNumber();
    const to = pane ? this.tools.vertexAt(pane, pane.width / 2, pane.height / 2) : null;
    if (vertex === null || to === null || this.isCone(to)) return;
    this.select(to);
    this.act({do: "move", vertex, to: this.numberOf(to)});
  }

  // The picked cone.

  select(vertex) {
    this.selected = vertex;
  }

  notePick() {
    const picked = this.viewer.state.get("picked");
    if (picked || !this.repicking) this.selected = picked?.kind === "cone" ? this.viewer.model.arrays.cones[picked.index] : null;
    this.panel.showCones();
  }

  pickSelected() {
    const index = this.selected === null ? -1 : this.viewer.model.arrays.cones.indexOf(this.selected);
    if (index >= 0) this.viewer.state.set({picked: {kind: "cone", index}});
  }

  selectedNumber() {
    return this.selected === null || !this.viewer || this.forTexture ? null : this.numberOf(this.selected);
  }

  /** Pick a cone, and make it visible. */
  find(number) {
    const [vertex] = this.verticesOf([number]);
    const index = this.viewer.model.arrays.cones.indexOf(vertex);
    if (index >= 0) this.viewer.find({kind: "cone", index});
  }

  // Queries.

  get choices() {
    return this.news?.choices ?? NO_CHOICES;
  }

  /** Whether the map is one for a texture, without cones to edit. */
  get forTexture() {
    return Boolean(this.choices.for_texture);
  }

  hasLayout() {
    return Boolean(this.viewer) && !this.news.bare;
  }

  hasBoundary() {
    const model = this.viewer?.model;
    return Boolean(model) && model.arrays.outline.length > 2 * model.seamCount;
  }

  /** Return the chosen or found cones, {vertex, degrees, chosen, locked}, with vertices of the user. */
  coneRows() {
    if (this.forTexture) return [];
    const model = this.viewer?.model, shown = new Map();
    if (model) model.arrays.cones.forEach((vertex, i) => shown.set(this.numberOf(vertex), 360 - (model.head.cone_curvatures[i] * 180) / Math.PI));
    const own = new Map(this.choices.cones.map((cone) => [cone.vertex, cone]));
    const vertices = this.choices.by_hand ? [...own.keys()] : [...new Set([...own.keys(), ...shown.keys()])];
    return vertices.sort((a, b) => a - b).map((vertex) => {
      const cone = own.get(vertex), angle = cone?.angle ?? null;
      const degrees = angle === null ? shown.get(vertex) ?? null : (angle * 180) / Math.PI;
      return {vertex, degrees, chosen: angle !== null, locked: Boolean(cone?.locked)};
    });
  }

  isShown(vertex) {
    return this.viewer.model.arrays.cones.includes(vertex);
  }

  /** Return whether there is a cone at a vertex, other than the given one. */
  isCone(vertex, other = null) {
    if (vertex === other) return false;
    const number = this.numberOf(vertex);
    return this.coneRows().some((row) => row.vertex === number);
  }

  /** Return the number of a vertex of the page in the mesh of the user. */
  numberOf(vertex) {
    return this.viewer.model.vertexNumber(vertex);
  }

  /** Return the vertices of the page for numbers of the user; those not shown are left out. */
  verticesOf(numbers) {
    if (!this.byNumber) {
      this.byNumber = new Map();
      const count = this.viewer.model.arrays.places.length / 3;
      for (let v = count - 1; v >= 0; v--) this.byNumber.set(this.numberOf(v), v);
    }
    return numbers.map((number) => this.byNumber.get(number)).filter((vertex) => vertex !== undefined);
  }

  /** Return the points of a vertex in the layout. */
  pointsOf(vertex) {
    if (!this.points) {
      this.points = new Map();
      this.viewer.model.arrays.point_vertex.forEach((one, point) => {
        if (this.points.has(one)) this.points.get(one).push(point);
        else this.points.set(one, [point]);
      });
    }
    return this.points.get(vertex) ?? [];
  }

  /** Return the full mesh; the page may draw fewer triangles. */
  surface() {
    return (this.whole ??= new Surface(this.viewer.model));
  }

  graph() {
    if (!this.edges) {
      this.edges = new EdgeGraph(this.surface());
      this.edges.follow(this.follows);
    }
    this.edges.prefer(this.choices.cuts);
    return this.edges;
  }

  /** Return the vertices of the full mesh for vertices of the page; without added ones if the page is simplified. */
  inSurface(vertices) {
    const surface = this.surface();
    return surface.isThinned ? vertices.map((vertex) => surface.vertexOf(this.numberOf(vertex))).filter((vertex) => vertex >= 0) : vertices;
  }

  /** Return the numbers of the vertices on the shortest path between two vertices of the page. */
  pathBetween(...ends) {
    const [from, to] = this.inSurface(ends);
    return to === undefined ? [] : this.graph().path(from, to).map((vertex) => this.surface().numberOf(vertex));
  }

  /** Return the vertices of the full mesh that are nearest to vertices of the page. */
  standingFor(vertices) {
    const surface = this.surface(), chosen = new Set(this.inSurface([...vertices]));
    if (!surface.isThinned) return chosen;
    const drawn = new Set(this.viewer.model.arrays.point_vertex);
    this.nearest ??= surface.nearest(this.inSurface([...drawn]), this.graph());
    const found = new Set();
    this.nearest.forEach((one, vertex) => chosen.has(one) && found.add(vertex));
    return found;
  }

  setFollowing(follows) {
    this.follows = follows;
    this.edges?.follow(follows);
    this.panel.show();
  }

  growBrush(factor) {
    this.brush.grow(factor);
    this.panel.show();
  }

  /** Return the vertices on the boundary. */
  boundaryVertices() {
    if (!this.boundary) {
      const {model} = this.viewer, ends = new Set();
      for (let i = 2 * model.seamCount; i < model.arrays.outline.length; i++) {
        for (const corner of model.outlineCorners(i)) ends.add(model.vertexAt(corner));
      }
      this.boundary = [...ends].filter((vertex) => this.numberOf(vertex) >= 0);
    }
    return this.boundary;
  }

  /** Return the corners of the rectangle, if the boundary is one. */
  cornersShown() {
    if (this.forTexture) return [];
    return this.tools.mode === "corner" || this.choices.options.boundary === "rectangle" ? this.choices.corners ?? [] : [];
  }
}

/** A rejected layout no longer exists, because another mesh has been opened; an update follows. */
function orNone(error) {
  if (error instanceof Refusal) return null;
  throw error;
}

window.studio = new Studio();
window.studio.panel.show();
window.studio.follow();
