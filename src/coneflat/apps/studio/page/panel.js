// The panel next to the panes, which shows and changes the choices.

const WIDEST = 720; // degrees, as in `choices.py`
const ISOMETRIC = 4; // The energy of a map without stretch.
const DEFAULT_STEP = 5; // Step in degrees by which keys change an angle without snapping.

class Panel {
  constructor(studio) {
    this.studio = studio;
    this.part = (id) => document.getElementById(id);
    this.snap = 0;
    this.isPressed = this.isDue = false; // A button is pressed in the panel, which is to be shown again afterwards.
    this.curve = new ConeCurve(studio);
    this.quads = new Quads(studio);
    this.charts = new Charts(studio);
    this.work = new Work(studio);
    this.fill();
    this.connect();
  }

  fill() {
    this.part("tools").append(
      ...TOOLS.map(([key, name, letter]) => button(name, `${name} (${letter})`, () => this.studio.setTool(key), {className: `toggle ${useOf(key)}`, id: `tool-${key}`})),
    );
    this.part("brushes").append(
      ...BRUSHES.map(([key, name, letter]) => button(name, `${name} (${letter})`, () => this.studio.setTool(key), {className: `toggle brush ${key} ${useOf(key)}`, id: `tool-${key}`})),
    );
    this.part("exports").append(
      ...RESULT_FILES.map(({ending, label, title}) => button(label, title, () => this.studio.save(ending), {id: `save-${ending}`})),
    );
    this.part("more").append(...FURTHER_OPTIONS.map((control) => this.further(control)));
    for (const id of ["unit", "shown-in"]) this.part(id).replaceChildren(...UNITS.map(([key, name]) => new Option(key || id === "unit" ? name : "unit of the file", key)));
  }

  connect() {
    const {studio} = this, act = (action) => studio.act(action);
    const set = (name, value) => act({do: "set", name, value});
    for (const name of ["undo", "redo", "again"]) this.part(name).addEventListener("click", () => act({do: name}));
    this.part("repair").addEventListener("click", () => set("repair", true));
    this.part("undo-last").addEventListener("click", () => act({do: "undo"}));
    this.part("search").addEventListener("click", () => this.placeBy("distortion"));
    for (const id of ["open", "open-first"]) {
      this.part(id).addEventListener("change", (event) => {
        if (event.target.files.length) studio.open(event.target.files[0]);
        event.target.value = "";
      });
    }
    this.part("cones-by").addEventListener("change", (event) => this.placeBy(event.target.value));
    this.part("cone-count").addEventListener("change", (event) => set("cone_count", Math.round(Number(event.target.value))));
    this.slider("distortion", (value) => ({do: "set", name: "distortion", value: Number((10 ** value).toPrecision(3))}));
    this.slider("stretch", (value) => ({do: "set", name: "stretch", value}));
    this.slider("hide", (value) => ({do: "set", name: "hide_seams", value}));
    this.part("boundary").addEventListener("change", (event) => set("boundary", event.target.value));
    this.part("charts").addEventListener("change", (event) => set("charts", event.target.value === "number" ? 2 : event.target.value));
    this.part("chart-number").addEventListener("change", (event) => set("charts", Math.round(Number(event.target.value))));
    this.part("boundary").addEventListener("change", (event) => event.target.value === "rectangle" && studio.setTool("corner"));
    this.part("purpose").addEventListener("change", (event) => act({do: "texture", value: event.target.value === "texture"}));
    this.slider("energy", (value) => ({do: "set", name: "max_energy", value: energyAt(value)}));
    this.part("energy").addEventListener("input", (event) => (this.part("max-energy").value = energyAt(Number(event.target.value))));
    this.part("max-energy").addEventListener("change", (event) => set("max_energy", Number(event.target.value)));
    this.part("texel-density").addEventListener("change", (event) => set("texel_density", event.target.value === "" ? null : Number(event.target.value)));
    for (const name of ["resolution", "padding"]) this.part(name).addEventListener("change", (event) => set(name, Number(event.target.value)));
    for (const [id, word] of [["own-seams", "input"], ["no-more", "none"]]) this.part(id).addEventListener("change", (event) => set("seams", event.target.checked ? word : null));
    this.part("follow").addEventListener("change", (event) => studio.setFollowing(event.target.checked));
    this.part("brush-size").addEventListener("input", (event) => studio.growBrush(Number(event.target.value) / studio.brush.radius));
    this.part("brush-weight").addEventListener("change", (event) => (studio.brush.weight = Number(event.target.value)));
    for (const id of ["unit", "shown-in"]) this.part(id).addEventListener("change", () => this.measureIn(id));
    this.part("sharp").addEventListener("change", (event) => {
      set("sharp_angle", event.target.value ? (Number(event.target.value) * Math.PI) / 180 : null);
    });
    this.part("up").addEventListener("change", (event) => studio.viewer && studio.setUp(event.target.value));
    this.part("sample").addEventListener("click", () => studio.openSample());
    for (const id of ["tools", "brushes", "exports", "quad-files"]) rove(this.part(id), "button", true);
    this.part("cone-list").addEventListener("keydown", (event) => this.changeRow(event));
    this.part("snap").addEventListener("change", (event) => (this.snap = Number(event.target.value)));
    this.holdWhilePressed();
  }

  /** Change nothing in the panel between the press and the release of a button, which would lose the click. */
  holdWhilePressed() {
    const release = () => {
      this.isPressed = false;
      setTimeout(() => this.isDue && this.show()); // After the click.
    };
    this.part("studio").addEventListener("pointerdown", ({target}) => (this.isPressed = isButton(target)), {capture: true});
    for (const name of ["pointerup", "pointercancel"]) window.addEventListener(name, release, {capture: true});
    // The release may be outside the window.
    window.addEventListener("pointermove", ({buttons}) => this.isPressed && !buttons && release(), {capture: true});
  }

  /** Return the control of an option that is made from its declaration. */
  further({name, kind, words, least, most, doc, label, use}) {
    const id = `more-${name}`, line = Object.assign(document.createElement("label"), {className: `line ${use}`, htmlFor: id, title: doc});
    const field = Object.assign(document.createElement(kind === "choice" ? "select" : "input"), {id});
    if (kind === "choice") field.append(...words.map((word) => new Option(word)));
    else Object.assign(field, {type: "number", min: least, step: kind === "integer" ? 1 : "any", placeholder: DEFAULTS[name] == null ? "none" : ""});
    field.addEventListener("change", () => this.studio.act({do: "set", name, value: furtherValue(name, kind, field.value)}));
    line.append(`${label} `, field);
    return line;
  }

  /** Apply the value of a slider while it moves, as often as possible, and at the end; one motion is one step. */
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

  measureIn(changed) {
    const of_file = this.part("unit").value, shown = of_file ? this.part("shown-in").value : "";
    this.studio.act({do: "units", of_file, shown});
  }

  placeBy(kind) {
    const {studio} = this;
    if (kind === "distortion") studio.act({do: "set", name: "distortion", value: studio.choices.options.distortion ?? DEFAULTS.distortion});
    if (kind === "cone_count") studio.act({do: "set", name: "cone_count", value: studio.coneRows().length});
    if (kind === "hand") studio.act({do: "hand"});
  }

  /** Return an angle in degrees after snapping. */
  snapped(degrees) {
    return this.snap ? Math.max(this.snap, Math.round(degrees / this.snap) * this.snap) : degrees;
  }

  step() {
    return this.snap || DEFAULT_STEP;
  }

  // Display.

  showUp() {
    this.part("up").value = this.studio.viewer.state.get("up");
  }

  show() {
    this.isDue = this.isPressed;
    if (this.isPressed) return;
    const {news, choices, tools} = this.studio, options = {...DEFAULTS, ...choices.options};
    this.part("undo").disabled = !news?.undo;
    this.part("redo").disabled = !news?.redo;
    const {forTexture} = this.studio;
    this.value("purpose", forTexture ? "texture" : "angles");
    this.value("max-energy", options.area == null ? options.max_energy : "");
    this.value("energy", Math.log10((options.area == null ? options.max_energy : energyOfArea(options.area)) - ISOMETRIC));
    for (const part of document.querySelectorAll(".for-angles, .for-texture")) part.hidden = forTexture !== part.classList.contains("for-texture");
    for (const [key, , , hint] of [...TOOLS, ...BRUSHES]) {
      this.part(`tool-${key}`).setAttribute("aria-pressed", String(tools.mode === key));
      if (tools.mode === key) this.part("hint").textContent = forTexture && key === "look" ? "Drag to rotate the model." : hint;
    }
    const by = choices.by_hand ? "hand" : "cone_count" in choices.options ? "cone_count" : "distortion";
    this.value("cones-by", by);
    this.part("distortion").closest("label").hidden = by !== "distortion";
    this.part("cone-count").closest("label").hidden = by !== "cone_count";
    this.value("distortion", Math.log10(options.distortion));
    this.part("distortion-value").textContent = options.distortion.toPrecision(2);
    this.value("cone-count", options.cone_count ?? 0);
    this.value("sharp", options.sharp_angle == null ? "" : Number(((options.sharp_angle * 180) / Math.PI).toFixed(2)));
    this.value("hide", options.hide_seams);
    this.part("hide-value").textContent = options.hide_seams;
    this.check("own-seams", options.seams === "input");
    this.check("no-more", options.seams === "none");
    for (const {name, kind} of FURTHER_OPTIONS) this.value(`more-${name}`, furtherText(kind, options[name]));
    this.value("boundary", options.boundary);
    this.part("boundary").closest("label").hidden = this.part("tool-corner").hidden = forTexture || !this.studio.hasBoundary();
    this.value("resolution", options.resolution);
    this.value("texel-density", options.texel_density ?? "");
    this.value("padding", options.padding);
    this.value("stretch", options.stretch);
    const isNumber = forTexture && typeof options.charts === "number";
    this.value("charts", isNumber ? "number" : typeof options.charts === "number" ? "atlas" : options.charts);
    this.value("chart-number", isNumber ? options.charts : "");
    this.part("chart-number").closest("label").hidden = !isNumber;
    this.showNotesOnControls({cone_count: by === "cone_count", charts: isNumber});
    for (const saving of this.part("exports").children) saving.disabled = !this.studio.hasLayout();
    this.curve.show();
    this.quads.show();
    this.charts.show();
    this.part("command").textContent = news?.command ?? "";
    this.part("python").textContent = news?.python ?? "";
    this.part("kept-in").textContent = news?.project ? `Saved in ${news.project}.` : "";
    this.work.show();
    this.showRefusal();
    this.showWarnings();
    this.showTool();
    this.showCorners();
    this.showCones();
    this.showPaths();
    showSizes(this.studio);
  }

  /** Show a value, unless the user is changing it. */
  value(id, value) {
    if (this.studio.isBehind()) return;
    const field = this.part(id);
    if (document.activeElement !== field || field.tagName === "SELECT" || !this.studio.isBusy()) field.value = value;
  }

  /** Check a box or not, unless the user has just clicked it. */
  check(id, isChecked) {
    if (!this.studio.isBehind()) this.part(id).checked = isChecked;
  }

  /** Show the notes on values that are not met beside their controls. */
  showNotesOnControls(isShown) {
    for (const [name, visible] of Object.entries(isShown)) {
      const note = this.studio.news?.on_controls?.[name] ?? "";
      this.part(`on-${name}`).hidden = !note || !visible;
      this.part(`on-${name}`).textContent = note;
    }
  }

  showRefusal() {
    const {news, refused, choices} = this.studio, trouble = news?.trouble, isFailed = Boolean(news?.stale || news?.bare);
    this.part("refusal").hidden = !refused && !trouble;
    for (const [id, told] of [["refusal-text", refused], ["trouble-text", trouble]]) {
      this.part(id).hidden = !told;
      this.part(id).textContent = told ? told.text[0].toUpperCase() + told.text.slice(1) + "." : "";
    }
    this.part("repair").hidden = !trouble?.repair;
    this.part("undo-last").hidden = !trouble || !isFailed || !news.undo;
    this.part("search").hidden = !trouble || !isFailed || !choices.by_hand;
    this.part("again").hidden = !trouble?.again;
  }

  /** Show the warnings on the choices. */
  showWarnings() {
    const warnings = [...(this.studio.news?.warnings ?? []), ...this.studio.sliverWarning()], key = JSON.stringify(warnings);
    if (key === this.warningsShown) return;
    this.warningsShown = key;
    this.part("warnings").hidden = !warnings.length;
    this.part("warnings").replaceChildren(...warnings.map((text) => Object.assign(document.createElement("li"), {textContent: text})));
  }

  /** Show the settings of the tool. */
  showTool() {
    const {tools, brush, paint} = this.studio;
    this.part("brush-size").closest("label").hidden = !tools.paints;
    this.part("brush-weight").closest("label").hidden = tools.mode !== "importance";
    this.part("follow").closest("label").hidden = !tools.draws;
    this.part("follow").checked = this.studio.follows;
    this.part("brush-size").value = brush.radius;
    this.part("brush-weight").value = brush.weight;
    this.part("brush-size-value").textContent = brush.radius;
    for (const [layer, name, letter] of BRUSHES.slice(0, -1)) {
      const count = paint.count(layer);
      this.part(`tool-${layer}`).title = `${name} (${letter})${count ? `: ${grouped(count)} vertices are painted` : ""}`;
      this.part(`tool-${layer}`).dataset.painted = String(count > 0);
    }
  }

  showCorners() {
    const {choices} = this.studio, {boundary} = choices.options, left = 4 - (choices.corners ?? []).length;
    this.part("corners-left").hidden = this.studio.forTexture || boundary !== "rectangle" || !left;
    this.part("corners-left").textContent = `Click ${left === 4 ? "its four corners" : left === 1 ? "one more corner" : `${left} more corners`} with the tool Corner.`;
  }

  showCones() {
    this.isDue ||= this.isPressed;
    if (this.isPressed) return; // The rows are replaced.
    const rows = this.studio.coneRows(), picked = this.studio.selectedNumber();
    const key = JSON.stringify([rows, picked]);
    if (key === this.conesShown) return;
    this.conesShown = key;
    this.part("cone-names").hidden = !rows.length;
    this.part("angle-sum").textContent = this.sumText(rows);
    this.part("angle-sum").hidden = !this.part("angle-sum").textContent;
    const list = this.part("cone-list"), focused = document.activeElement, held = focused?.closest?.("#cone-list .cone");
    const [line, column] = held ? [[...list.children].indexOf(held), [...held.children].indexOf(focused)] : [-1, -1];
    list.replaceChildren(...rows.map((row) => this.coneRow(row, row.vertex === picked)));
    if (!held) return;
    // The focus stays on the same control; of a removed cone, on that of the next one.
    const row = this.coneElement(held.dataset.vertex) ?? list.children[Math.min(line, rows.length - 1)];
    row?.children[column]?.focus();
  }

  /** Move the focus to the next or the previous row. */
  changeRow(event) {
    const step = {ArrowUp: "previousElementSibling", ArrowDown: "nextElementSibling"}[event.key];
    if (!step || event.target.tagName === "INPUT") return;
    const row = event.target.closest(".cone");
    event.preventDefault();
    event.stopPropagation();
    row[step]?.children[[...row.children].indexOf(event.target)].focus();
  }

  /** Return a text if all angles are typed and their sum is wrong; "" if a computed cone or the boundary takes the rest. */
  sumText(rows) {
    const {viewer, choices, news} = this.studio;
    const isWhole = viewer?.model.arrays.cones.length === news?.found.length; // A simplified model may show only some of them.
    if (!isWhole || this.studio.hasBoundary() || !choices.by_hand || !rows.length || rows.some((row) => !row.chosen)) return "";
    // On a closed surface the curvatures of all cones have a fixed sum.
    const lacking = viewer.model.head.cone_curvatures.reduce((sum, curvature) => sum + (curvature * 180) / Math.PI, 0);
    const off = rows.reduce((sum, row) => sum + row.degrees, 0) - (360 * rows.length - lacking);
    if (Math.abs(off) < 0.05) return "";
    const much = Number(Math.abs(off).toFixed(1)).toLocaleString("en-US");
    return `All angles are typed, and their sum is ${much}° too ${off > 0 ? "large" : "small"} for this surface. Clear one, so that it is computed.`;
  }

  coneRow({vertex, degrees, chosen, locked}, isPicked) {
    const {studio} = this, row = document.createElement("div");
    row.className = degrees > 360 ? "cone saddle" : "cone";
    row.dataset.vertex = vertex;
    if (isPicked) row.setAttribute("aria-current", "true");
    const angle = Object.assign(document.createElement("input"), {
      type: "number", step: this.step(), min: 1, max: WIDEST, value: degrees === null ? "" : Number(degrees.toFixed(1)), className: chosen ? "" : "computed",
      title: degrees === null ? "Cone angle in degrees; empty: computed" : `Cone angle in degrees: ${(degrees / 180).toFixed(3)} π; empty: computed`,
    });
    angle.setAttribute("aria-label", `Angle of cone ${vertex}, degrees`);
    angle.addEventListener("change", () => studio.setAngle(vertex, angle.value === "" ? null : this.snapped(Number(angle.value))));
    row.append(
      button(grouped(vertex), "Show the cone", () => studio.find(vertex), {className: "find"}),
      angle,
      button("Lock", "Searches keep this cone (l)", () => studio.act({do: "lock", vertex, locked: !locked}), {className: "toggle", ariaPressed: String(locked), ariaLabel: `Lock cone ${vertex}`}),
      button("×", "Remove (Delete)", () => studio.act({do: "remove", vertex}), {ariaLabel: `Remove cone ${vertex}`}),
    );
    rove(row, "button, input");
    return row;
  }

  coneElement(vertex) {
    return document.querySelector(`#cone-list .cone[data-vertex="${vertex}"]`);
  }

  angleField(vertex) {
    return this.coneElement(vertex)?.querySelector("input");
  }

  showPaths() {
    const {cuts, kept} = this.studio.choices;
    const key = JSON.stringify([cuts, kept]);
    if (key === this.pathsShown) return;
    this.pathsShown = key;
    const row = (path, name) => {
      const line = document.createElement("div"), text = `${name} ${grouped(path[0])} to ${grouped(path[path.length - 1])}`;
      line.className = "drawn";
      line.append(
        text,
        button("×", "Erase", () => this.studio.act({do: "erase", edge: path.slice(0, 2)}), {ariaLabel: `Erase ${text}`}),
      );
      return line;
    };
    this.part("path-list").replaceChildren(...cuts.map((path) => row(path, "Cut")), ...kept.map((path) => row(path, "Whole")));
  }
}

function button(text, title, does, more = {}) {
  const made = Object.assign(document.createElement("button"), {type: "button", textContent: text, title, ...more});
  if (text.length < 2 && !more.ariaLabel) made.setAttribute("aria-label", title);
  made.addEventListener("click", does);
  return made;
}

/** Return whether an element is a button, a checkbox, or in one; other fields may be shown again while they are used. */
function isButton(element) {
  return Boolean(element.closest("button, summary, label, [type=checkbox]")) && !element.closest("select, input:not([type=checkbox])");
}

/** Return the bound of the energy at a position of its slider. */
function energyAt(position) {
  return ISOMETRIC + Number((10 ** position).toPrecision(2));
}

/** Return the bound of the energy that belongs to one of the area distortion, as in `textures/options.py`. */
function energyOfArea(area) {
  return ISOMETRIC + 20 * area ** 2;
}

/** Return the value of an option for the text of its control; angles are in degrees there, and axes directions. */
function furtherValue(name, kind, text) {
  if (kind === "choice" && DEFAULTS[name] !== null) return text;
  if (kind === "choice") return text === "none" ? null : AXES.map((axis) => (text.at(-1) !== axis ? 0 : text[0] === "-" ? -1 : 1));
  if (text === "") return DEFAULTS[name];
  return kind === "angle" ? (Number(text) * Math.PI) / 180 : Number(text);
}

/** Return the text of the control of an option. */
function furtherText(kind, value) {
  if (kind === "choice") return Array.isArray(value) ? axisOf(value) : value ?? "none";
  return value == null ? "" : kind === "angle" ? Number(((value * 180) / Math.PI).toFixed(2)) : value;
}

/** Return the name of the axis of a direction; "" if there is none. */
function axisOf(direction) {
  const others = direction.filter((part) => part !== 0), at = direction.findIndex((part) => part !== 0);
  return others.length === 1 ? `${others[0] < 0 ? "-" : ""}${AXES[at]}` : "";
}

/** Make controls one tab stop, among which the arrow keys to the sides move; vertical: the other arrow keys, too. */
function rove(bar, selector, vertical = false) {
  const all = () => [...bar.querySelectorAll(selector)];
  const stopAt = (chosen) => all().forEach((one) => (one.tabIndex = one === chosen ? 0 : -1));
  stopAt(all()[0]);
  bar.addEventListener("focusin", (event) => stopAt(event.target.closest(selector)));
  bar.addEventListener("keydown", (event) => {
    const step = {ArrowLeft: -1, ArrowRight: 1, ...(vertical ? {ArrowUp: -1, ArrowDown: 1} : {})}[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const usable = all().filter((one) => !one.hidden && !one.disabled);
    usable[(usable.indexOf(event.target) + step + usable.length) % usable.length]?.focus();
  });
}

/** Return the class of the button of a tool: some tools have no effect on maps for textures. */
function useOf(tool) {
  return CONE_TOOLS.includes(tool) ? "for-angles" : CHART_TOOLS.includes(tool) ? "for-texture" : "";
}
