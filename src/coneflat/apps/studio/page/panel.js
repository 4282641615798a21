// The panel beside the panes: shows what is chosen, and changes it.

const LEAST_STEP = 5; // degrees that the keys change an angle by where it snaps to nothing

class Panel {
  constructor(studio) {
    this.studio = studio;
    this.part = (id) => document.getElementById(id);
    this.snap = 0;
    this.fill();
    this.connect();
  }

  fill() {
    this.part("tools").append(
      ...TOOLS.map(([key, name, letter]) => button(name, `${name} (${letter})`, () => this.studio.setTool(key), {className: "toggle", id: `tool-${key}`})),
    );
    this.part("exports").append(
      ...["obj", "ply", "glb", "npz", "svg"].map((ending) => button(ending.toUpperCase(), `Save as .${ending}`, () => this.studio.save(ending), {id: `save-${ending}`})),
    );
  }

  connect() {
    const {studio} = this, act = (action) => studio.act(action);
    const set = (name, value) => act({do: "set", name, value});
    for (const name of ["undo", "redo", "again"]) this.part(name).addEventListener("click", () => act({do: name}));
    this.part("repair").addEventListener("click", () => set("repair", true));
    this.part("open").addEventListener("change", (event) => {
      if (event.target.files.length) studio.open(event.target.files[0]);
      event.target.value = "";
    });
    this.part("cones-by").addEventListener("change", (event) => this.placeBy(event.target.value));
    this.part("cone-count").addEventListener("change", (event) => set("cone_count", Math.round(Number(event.target.value))));
    this.slider("distortion", (value) => ({do: "set", name: "distortion", value: Number((10 ** value).toPrecision(3))}));
    this.slider("stretch", (value) => ({do: "set", name: "stretch", value}));
    this.slider("hide", (value) => ({do: "set", name: "hide_seams", value}));
    for (const name of ["boundary", "charts"]) this.part(name).addEventListener("change", (event) => set(name, event.target.value));
    this.part("sharp").addEventListener("change", (event) => {
      set("sharp_angle", event.target.value ? (Number(event.target.value) * Math.PI) / 180 : null);
    });
    this.part("snap").addEventListener("change", (event) => (this.snap = Number(event.target.value)));
  }

  /** Let a slider act while it moves, as often as there is time, and when it rests; one move is one step. */
  slider(id, action) {
    let stroke = null, sent = null;
    const send = (event, rests) => {
      const value = Number(event.target.value);
      stroke ??= `${id} ${performance.now()}`;
      if (value !== sent && (rests || !this.studio.isBusy())) {
        sent = value;
        this.studio.act({...action(value), stroke});
      }
      if (rests) stroke = sent = null;
    };
    this.part(id).addEventListener("input", (event) => send(event, false));
    this.part(id).addEventListener("change", (event) => send(event, true));
  }

  placeBy(kind) {
    const {studio} = this;
    if (kind === "distortion") studio.act({do: "set", name: "distortion", value: studio.choices.options.distortion ?? DISTORTION});
    if (kind === "cone_count") studio.act({do: "set", name: "cone_count", value: studio.coneRows().length});
    if (kind === "hand") studio.act({do: "hand"});
  }

  /** Return an angle in degrees that snaps. */
  snapped(degrees) {
    return this.snap ? Math.max(this.snap, Math.round(degrees / this.snap) * this.snap) : degrees;
  }

  step() {
    return this.snap || LEAST_STEP;
  }

  // What is shown.

  show() {
    const {news, choices, tools} = this.studio, {options} = choices;
    this.part("undo").disabled = !news?.undo;
    this.part("redo").disabled = !news?.redo;
    for (const [key, , , hint] of TOOLS) {
      this.part(`tool-${key}`).setAttribute("aria-pressed", String(tools.mode === key));
      if (tools.mode === key) this.part("hint").textContent = hint;
    }
    const by = choices.by_hand ? "hand" : "cone_count" in options ? "cone_count" : "distortion";
    this.part("cones-by").value = by;
    this.part("distortion").closest("label").hidden = by !== "distortion";
    this.part("cone-count").closest("label").hidden = by !== "cone_count";
    this.value("distortion", Math.log10(options.distortion ?? DISTORTION));
    this.part("distortion-value").textContent = (options.distortion ?? DISTORTION).toPrecision(2);
    this.value("cone-count", options.cone_count ?? 0);
    this.value("sharp", options.sharp_angle == null ? "" : Number(((options.sharp_angle * 180) / Math.PI).toFixed(2)));
    this.value("hide", options.hide_seams ?? 0);
    this.part("hide-value").textContent = options.hide_seams ?? 0;
    this.value("boundary", options.boundary ?? "free");
    this.part("boundary").closest("label").hidden = !this.studio.hasBoundary();
    this.value("stretch", options.stretch ?? 0);
    this.value("charts", options.charts ?? "atlas");
    for (const saving of this.part("exports").children) saving.disabled = !this.studio.viewer;
    this.part("command").textContent = news?.command ?? "";
    this.part("python").textContent = news?.python ?? "";
    this.part("kept-in").textContent = news?.project ? `Kept in ${news.project}.` : "";
    this.showWork();
    this.showRefusal();
    this.showCones();
    this.showPaths();
  }

  /** Show a value, unless the user is just changing it. */
  value(id, value) {
    const field = this.part(id);
    if (document.activeElement !== field || field.tagName === "SELECT" || !this.studio.isBusy()) field.value = value;
  }

  showWork() {
    const {news, took} = this.studio, busy = news?.busy;
    this.part("work").classList.toggle("idle", !busy);
    this.part("busy").value = busy?.fraction ?? 0;
    this.part("stage-name").textContent = busy ? busy.stage || "…" : took ? `shown ${(took / 1000).toFixed(2)} s after the change` : "";
  }

  showRefusal() {
    const trouble = this.studio.refused ?? this.studio.news?.trouble;
    this.part("refusal").hidden = !trouble;
    if (!trouble) return;
    this.part("refusal-text").textContent = trouble.text[0].toUpperCase() + trouble.text.slice(1) + ".";
    this.part("repair").hidden = !trouble.repair;
    this.part("again").hidden = Boolean(trouble.repair) || Boolean(this.studio.refused);
  }

  showCones() {
    const rows = this.studio.coneRows(), picked = this.studio.selectedNumber();
    const key = JSON.stringify([rows, picked]);
    if (key === this.conesShown) return;
    this.conesShown = key;
    const typing = document.activeElement?.closest?.("#cone-list .cone")?.dataset.vertex;
    this.part("cone-list").replaceChildren(...rows.map((row) => this.coneRow(row, row.vertex === picked)));
    if (typing !== undefined) this.angleField(typing)?.focus();
  }

  coneRow({vertex, degrees, chosen, locked}, isPicked) {
    const {studio} = this, row = document.createElement("div");
    row.className = degrees > 360 ? "cone saddle" : "cone";
    row.dataset.vertex = vertex;
    if (isPicked) row.setAttribute("aria-current", "true");
    const angle = Object.assign(document.createElement("input"), {
      type: "number", step: this.step(), min: 1, value: degrees === null ? "" : Number(degrees.toFixed(1)), className: chosen ? "" : "computed",
      title: "Cone angle in degrees; empty: the best one",
    });
    angle.setAttribute("aria-label", `Angle of cone ${vertex}, degrees`);
    angle.addEventListener("change", () => studio.setAngle(vertex, angle.value === "" ? null : this.snapped(Number(angle.value))));
    row.append(
      button(grouped(vertex), "Find it", () => studio.find(vertex), {className: "find"}),
      angle,
      button("Lock", "Searches keep it here (l)", () => studio.act({do: "lock", vertex, locked: !locked}), {className: "toggle", ariaPressed: String(locked)}),
      button("×", "Take it away (Delete)", () => studio.act({do: "remove", vertex})),
    );
    return row;
  }

  angleField(vertex) {
    return document.querySelector(`#cone-list .cone[data-vertex="${vertex}"] input`);
  }

  showPaths() {
    const {cuts, kept} = this.studio.choices;
    const key = JSON.stringify([cuts, kept]);
    if (key === this.pathsShown) return;
    this.pathsShown = key;
    const row = (path, name) => {
      const line = document.createElement("div");
      line.className = "drawn";
      line.append(
        `${name} ${grouped(path[0])} to ${grouped(path[path.length - 1])}`,
        button("×", "Erase it", () => this.studio.act({do: "erase", edge: path.slice(0, 2)})),
      );
      return line;
    };
    this.part("path-list").replaceChildren(...cuts.map((path) => row(path, "Cut")), ...kept.map((path) => row(path, "Whole")));
  }
}

function button(text, title, does, more = {}) {
  const made = Object.assign(document.createElement("button"), {type: "button", textContent: text, title, ...more});
  if (text.length < 2) made.setAttribute("aria-label", title);
  made.addEventListener("click", does);
  return made;
}
