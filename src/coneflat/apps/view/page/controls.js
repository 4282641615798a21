// Buttons, keys, the scale and the report, which show and change the state.

const HAS_MOUSE = matchMedia("(hover: hover)");
const MIN_LOG2_SQUARES = 3, MAX_LOG2_SQUARES = 9; // Logarithm to base 2 of the number of squares along the square root of the area.

class Controls {
  /** viewer: {state, model, find(thing), takePicture(blob), panes, used}. */
  constructor(viewer) {
    this.viewer = viewer;
    this.part = (id) => document.getElementById(id);
    this.fill();
    this.connect();
    viewer.state.listen(() => this.show());
    this.show();
  }

  fill() {
    const {head} = this.viewer.model;
    document.title = `${head.name} – coneflat`;
    this.part("name").textContent = head.name;
    const shown = this.viewer.model.triangleCount;
    const thinned = head.left_out ? `  ·  drawn with ${grouped(shown)} of ${grouped(head.triangles)} triangles` : "";
    this.part("title").textContent = this.part("title").title = head.title + thinned;
    this.part("show").replaceChildren(...showsOf(this.viewer.model).map(([key, name]) => new Option(name, key)));
    this.part("key-shows").textContent = `show: ${showsOf(this.viewer.model).slice(0, 9).map(([key, name], i) => `${i + 1} ${key === "own" ? name : name.toLowerCase()}`).join(", ")}`;
    this.part("cones").textContent = head.parts?.folds ? "Folds" : head.parts ? "Darts" : "Cones";
    this.part("table").replaceChildren(...this.reportParts(head, shown));
    this.part("legend").replaceChildren(...this.legendParts(head));
  }

  reportParts(head, shown) {
    const table = document.createElement("table");
    for (const [measure, value, meaning] of head.rows) {
      const row = table.insertRow();
      row.append(Object.assign(document.createElement("th"), {textContent: measure, scope: "row"}));
      for (const text of [value, meaning]) row.insertCell().textContent = text;
    }
    const notes = head.notes.map((note) => `Note: ${note}`);
    if (head.left_out) {
      notes.unshift(
        `Drawn with ${grouped(shown)} of ${grouped(head.triangles)} triangles, to reduce the size of the page; ` +
          "the measures are those of all triangles. Faults of UVs are coloured only on triangles that are drawn.",
      );
    }
    const heading = Object.assign(document.createElement("h2"), {textContent: "Report"});
    return [heading, table, ...notes.map((note) => Object.assign(document.createElement("p"), {className: "note", textContent: note}))];
  }

  connect() {
    const {state} = this.viewer;
    this.part("show").addEventListener("change", (event) => state.set({show: event.target.value}));
    this.part("squares").addEventListener("input", (event) => state.set({squares: 2 ** Number(event.target.value)}));
    this.part("file").addEventListener("change", (event) => {
      if (event.target.files.length) this.viewer.takePicture(event.target.files[0]);
      event.target.value = "";
    });
    for (const name of ["seams", "cones", "edges", "report"]) {
      this.part(name).addEventListener("click", () => state.toggle(name));
    }
    this.part("theme").addEventListener("click", () => state.toggle("dark"));
    this.part("next-fault").addEventListener("click", () => this.viewer.showNextFault());
    this.part("turn-up").addEventListener("click", () => this.turnUp());
    this.part("help").addEventListener("click", () => this.showHelp());
    document.addEventListener("keydown", (event) => this.key(event));
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      if (event.dataTransfer.files.length) this.viewer.takePicture(event.dataTransfer.files[0]);
    });
  }

  show() {
    const {state, model} = this.viewer;
    document.documentElement.dataset.theme = state.get("dark") ? "dark" : "light";
    this.part("show").value = state.get("show");
    this.part("squares").value = Math.log2(state.get("squares"));
    this.part("squares-label").hidden = !["checker", "charts"].includes(state.get("show"));
    this.part("file-label").hidden = state.get("show") !== "picture";
    for (const name of ["seams", "cones", "edges", "report"]) {
      this.part(name).setAttribute("aria-pressed", String(state.get(name)));
    }
    this.part("next-fault").hidden = this.part("legend").hidden = state.get("show") !== "faults";
    this.part("next-fault").disabled = !model.faultCount;
    this.part("turn-up").textContent = `${state.get("up")} up`;
    this.part("table").hidden = !state.get("report");
    const thing = state.get("hovered") ?? state.get("picked");
    this.showFacts(thing ? this.factsOf(thing) : null);
    this.showScale(model.head.scales[state.get("show")], placeOfThing(model, thing, state.get("show")));
  }

  showHelp() {
    this.part("keys").showModal();
    this.part("keys").scrollTop = 0;
  }

  /** Choose the next axis to point up. */
  turnUp() {
    const {state} = this.viewer;
    state.set({up: AXES[(AXES.indexOf(state.get("up")) + 1) % AXES.length]});
  }

  factsOf(thing) {
    const {state, model} = this.viewer, fault = state.get("fault");
    const facts = factsOf(model, thing, state.get("show"));
    if (fault !== null && sameThing(thing, state.get("picked"))) facts.unshift(`Fault ${fault + 1} of ${model.faultCount}`);
    return facts;
  }

  /** Return the names of the faults of UVs, with their colours and numbers of triangles. */
  legendParts({fault_counts}) {
    return Object.entries(FAULT_NAMES).map(([fault, name], i) => {
      const item = Object.assign(document.createElement("li"), {textContent: `${name}: ${grouped(fault_counts[fault])}`});
      const colour = document.createElement("i");
      colour.style.background = FAULT_COLOURS[i + 1];
      item.prepend(colour);
      return item;
    });
  }

  showFacts(facts) {
    const hint = HAS_MOUSE.matches
      ? "Point at a triangle, a seam or a cone to show it in both views; ? shows the keys."
      : "Tap a triangle, a seam or a cone to show it in both views; ? shows the gestures.";
    const spans = (facts ?? [hint]).map(
      (text) => Object.assign(document.createElement("span"), {textContent: text, className: facts ? "" : "faint"}),
    );
    this.part("facts").replaceChildren(...spans);
  }

  showScale(scale, mark) {
    this.part("scale").hidden = !scale;
    if (!scale) return;
    this.part("scale-mark").hidden = mark === null;
    if (mark !== null) this.part("scale-mark").style.left = `${100 * mark}%`;
    if (this.scaleShown === scale) return;
    this.scaleShown = scale;
    this.part("scale-title").textContent = scale.title;
    const colours = this.viewer.model.arrays[scale.table];
    const image = new ImageData(256, 1);
    for (let i = 0; i < 256; i++) image.data.set([...colours.subarray(3 * i, 3 * i + 3), 255], 4 * i);
    this.part("scale-colours").getContext("2d").putImageData(image, 0, 0);
    this.part("scale-ticks").replaceChildren(
      ...scale.ticks.map(([place, label]) => {
        const tick = Object.assign(document.createElement("span"), {textContent: label});
        tick.style.left = `${100 * place}%`;
        return tick;
      }),
    );
  }

  key(event) {
    const typing = event.target.closest?.("select, input, dialog");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const {state, used} = this.viewer;
    const camera = used.camera, far = 40;
    const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    const zoom = (factor) => camera.zoomAt(factor, camera.width / 2, camera.height / 2);
    const squares = (step) => {
      const exponent = Math.min(Math.max(Math.log2(state.get("squares")) + step, MIN_LOG2_SQUARES), MAX_LOG2_SQUARES);
      state.set({squares: 2 ** exponent});
    };
    const keys = {
      "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), "0": () => camera.fit(),
      "[": () => squares(-0.5), "]": () => squares(0.5),
      s: () => state.toggle("seams"), c: () => state.toggle("cones"), t: () => state.toggle("edges"),
      r: () => state.toggle("report"), d: () => state.toggle("dark"), "?": () => this.showHelp(),
      z: () => this.turnUp(),
      j: () => this.viewer.showNextFault(),
      h: () => this.viewer.showNextSeam(),
      w: () => this.viewer.find({kind: "triangle", index: this.viewer.model.worstTriangle()}),
      Escape: () => state.set({picked: null, hovered: null, report: false}),
    };
    // On a button, Enter and space press it.
    if (!event.target.closest?.("button")) keys.Enter = () => this.viewer.pickMiddle();
    let does = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (arrows[event.key] && event.target.closest?.("aside")) return; // Reports and panels scroll.
    if (arrows[event.key]) {
      const [right, down] = arrows[event.key];
      does = () => (camera.turns && !event.shiftKey ? camera.rotate(0.1 * right, 0.1 * down) : camera.move(far * right, far * down));
    }
    const shows = showsOf(this.viewer.model), number = Number(event.key) - 1;
    if (shows[number]) does = () => state.set({show: shows[number][0]});
    if (!does) return;
    event.preventDefault();
    does();
  }
}
