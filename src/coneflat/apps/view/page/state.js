// The state of the page, independent of drawing and of the source of the data.

// Display modes: [key, name].
const SHOWS = [
  ["checker", "Checkerboard"],
  ["picture", "Picture"],
  ["charts", "Charts"],
  ["qc", "QC distortion"],
  ["area", "Area scale"],
  ["strain", "Strain"],
  ["faults", "UV faults"],
  ["curvature", "Curvature before"],
  ["flat", "Curvature after"],
  ["own", "Own values"],
  ["plain", "Plain"],
];

/** Return the display modes of a model; values given by the user have their own name. */
function showsOf(model) {
  const {scales, parts} = model.head;
  const names = {own: scales.own?.title, charts: parts ? "Pieces" : "Charts"};
  return SHOWS.filter(([key]) => key !== "own" || scales.own).map(([key, name]) => [key, names[key] ?? name]);
}

/** Named values; listeners are called with the names that have changed. */
class State {
  constructor(values) {
    this.values = {...values};
    this.listeners = [];
  }

  get(name) {
    return this.values[name];
  }

  set(changes) {
    const changed = Object.keys(changes).filter((name) => !Object.is(this.values[name], changes[name]));
    if (!changed.length) return;
    Object.assign(this.values, changes);
    const names = new Set(changed);
    for (const listener of this.listeners) listener(names);
  }

  toggle(name) {
    this.set({[name]: !this.values[name]});
  }

  listen(listener) {
    this.listeners.push(listener);
  }
}

/** Return whether two things, {kind, index} or null, are the same. */
function sameThing(one, other) {
  return one === other || (one && other && one.kind === other.kind && one.index === other.index);
}
