// Sizes of the model, in the unit chosen by the user.

// [key, name, length in metres]
const UNITS = [
  ["", "no unit", 1],
  ["mm", "mm", 0.001],
  ["cm", "cm", 0.01],
  ["m", "m", 1],
  ["inch", "inches", 0.0254],
];

/** Return the text of a length, or an area (power 2), in the unit to be shown. */
function sizeText(value, power, [ofFile, shown]) {
  const metres = (unit) => UNITS.find(([key]) => key === unit)[2];
  const scaled = value * (shown ? metres(ofFile) / metres(shown) : 1) ** power;
  const unit = {inch: "in"}[shown || ofFile] ?? (shown || ofFile);
  const number = scaled !== 0 && (scaled < 1e-3 || scaled >= 1e7) ? scaled.toExponential(3) : Number(scaled.toPrecision(5)).toLocaleString("en-US", {maximumFractionDigits: 8});
  return unit ? `${number} ${unit}${power === 2 ? "²" : ""}` : number;
}

function showSizes(studio) {
  const {viewer, choices} = studio, part = (id) => document.getElementById(id), units = choices.units ?? ["", ""];
  studio.panel.value("unit", units[0]);
  studio.panel.value("shown-in", units[1] === units[0] ? "" : units[1]);
  part("shown-in").closest("label").hidden = !units[0];
  const head = viewer?.model.head;
  if (!head) return;
  const rows = [["Area", "area", 2], ["Seams", "seams", 1], ["Boundary", "boundary", 1]];
  part("size-list").replaceChildren(
    ...rows.flatMap(([name, key, power]) => [
      Object.assign(document.createElement("dt"), {textContent: name}),
      Object.assign(document.createElement("dd"), {textContent: sizeText(head.sizes[key] * head.radius ** power, power, units)}),
    ]),
  );
}

const NARROW = 2, LONG = 40; // Width in triangles, and squared outline over area, of slivers; a square has 16.

/** Return the number of charts that are slivers: long, and less than two triangles wide. */
function sliverCount(model) {
  const {faces, uv, chart, outline} = model.arrays, charts = new Map();
  const sizes = (face) => charts.get(chart[face]) ?? charts.set(chart[face], {area: 0, length: 0, sides: 0, count: 0}).get(chart[face]);
  const length = (p, q) => Math.hypot(uv[2 * q] - uv[2 * p], uv[2 * q + 1] - uv[2 * p + 1]);
  for (let i = 0; i < chart.length; i++) {
    const [p, q, r] = [faces[3 * i], faces[3 * i + 1], faces[3 * i + 2]], own = sizes(i);
    own.area += Math.abs((uv[2 * q] - uv[2 * p]) * (uv[2 * r + 1] - uv[2 * p + 1]) - (uv[2 * q + 1] - uv[2 * p + 1]) * (uv[2 * r] - uv[2 * p])) / 2;
    own.sides += length(p, q) + length(q, r) + length(r, p);
    own.count += 3;
  }
  for (let i = 0; i < outline.length; i++) sizes(Math.floor(outline[i] / 3)).length += length(...model.outlineCorners(i).map((corner) => faces[corner]));
  return [...charts.values()].filter((one) => (2 * one.area) / one.length < (NARROW * one.sides) / one.count && one.length ** 2 > LONG * one.area).length;
}
